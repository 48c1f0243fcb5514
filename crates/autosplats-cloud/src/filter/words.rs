//! The words of a filter.

use std::str::FromStr;

use super::{Column, Kind, PointFilter, Term, Test};
use crate::{Error, classes::CLASSES, excerpt};

/// The word of [`PointFilter::all`].
pub(super) const ALL: &str = "all";
/// The word of [`PointFilter::usual`].
pub(super) const USUAL: &str = "usual";

/// Most words of a filter.
const MAX_WORDS: usize = 256;

/// The classes for noise.
const NOISE: [u32; 2] = [7, 18];

/// Words for several classes.
const GROUPS: [(&str, &[u32]); 3] = [("noise", &NOISE), ("vegetation", &[3, 4, 5]), ("wire", &[13, 14])];

/// Words for flags, and PDAL's names of their fields.
const FLAGS: [(&str, &str); 5] = [
    ("withheld", "Withheld"),
    ("synthetic", "Synthetic"),
    ("key-point", "KeyPoint"),
    ("overlap", "Overlap"),
    ("edge-of-flight-line", "EdgeOfFlightLine"),
];

/// Words for returns.
const RETURNS: [&str; 4] = ["first", "last", "single", "return:2"];

impl FromStr for PointFilter {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let words: Vec<String> = text.split(',').map(|word| word.trim().to_lowercase()).collect();
        match words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
            [ALL] => return Ok(Self::all()),
            [USUAL] => return Ok(Self::usual()),
            ref many if many.len() > MAX_WORDS => return Err(bad(text, format!("at most {MAX_WORDS} words"))),
            _ => {}
        }
        let mut terms = Vec::new();
        for word in &words {
            let (excludes, word) = word.strip_prefix('-').map_or((false, &**word), |rest| (true, rest));
            terms.extend(parse(word)?.into_iter().map(|term| Term { excludes, ..term }));
        }
        Ok(Self { text: words.join(","), terms })
    }
}

/// The terms of the usual filter.
pub(super) fn usual() -> Vec<Term> {
    // A label 7 may be anything, but not a `Classification` of 7.
    let noise = NOISE.iter().map(|&number| {
        let tests = vec![Test::Within(Column::Named("Classification"), [number.into(); 2])];
        Term { tests, ..class(number) }
    });
    noise.chain([flag("withheld", "Withheld")]).map(|term| Term { excludes: true, ..term }).collect()
}

/// The terms of one word without its hyphen.
fn parse(word: &str) -> Result<Vec<Term>, Error> {
    if let Some(numbers) = word.strip_prefix("return:") {
        let [low, high] = range(numbers).ok_or_else(|| bad(word, "must be return:N or return:N..M".into()))?;
        return Ok(vec![of_returns(format!("of return {numbers}"), "ReturnNumber", [low, high])]);
    }
    if word.starts_with(|first: char| first.is_ascii_digit()) {
        let [low, high] = range(word).ok_or_else(|| bad(word, "must be a class such as 6, or 2..5".into()))?;
        let tests = vec![Test::Within(Column::Class, [low.into(), high.into()])];
        let several = Term { kind: Kind::Class, excludes: false, label: format!("of classes {low} to {high}"), tests };
        return Ok(vec![if low == high { class(low) } else { several }]);
    }
    let plain = plain(word);
    let is = |known: &str| self::plain(known) == plain || self::plain(known) + "s" == plain;
    if let Some((_, classes)) = GROUPS.iter().find(|(known, _)| is(known)) {
        return Ok(classes.iter().map(|&number| class(number)).collect());
    }
    if let Some(&(known, field)) = FLAGS.iter().find(|(known, _)| is(known)) {
        return Ok(vec![flag(known, field)]);
    }
    if let Some(number) = CLASSES.iter().position(|(name, known)| is(name) || is(known)) {
        return Ok(vec![class(number as u32)]);
    }
    let term = match plain.trim_end_matches("returns").trim_end_matches("return") {
        "first" => of_returns("of first returns".into(), "ReturnNumber", [0, 1]),
        "single" => of_returns("of single returns".into(), "NumberOfReturns", [0, 1]),
        "last" => Term { tests: vec![Test::Last], ..of_returns("of last returns".into(), "", [0, 0]) },
        ALL | USUAL => return Err(bad(word, "stands alone, without other words and without a hyphen".into())),
        _ => return Err(bad(word, format!("is no class, flag or return; there are: {}", known()))),
    };
    Ok(vec![term])
}

/// All words, for a message.
fn known() -> String {
    let classes = CLASSES.iter().map(|&(_, word)| word).filter(|word| FLAGS.iter().all(|(flag, _)| flag != word));
    let groups = GROUPS.iter().map(|&(word, _)| word);
    let flags = FLAGS.iter().map(|&(word, _)| word);
    let words: Vec<_> = [ALL, USUAL].into_iter().chain(groups).chain(classes).chain(flags).chain(RETURNS).collect();
    format!("6, 2..5, {}", words.join(", "))
}

fn bad(word: &str, why: String) -> Error {
    Error::BadFilter { word: excerpt(word.as_bytes()), why }
}

fn class(number: u32) -> Term {
    let name = CLASSES.get(number as usize).map(|(_, word)| word.replace('-', " ") + " ").unwrap_or_default();
    let tests = vec![Test::Within(Column::Class, [number.into(); 2])];
    Term { kind: Kind::Class, excludes: false, label: format!("{name}(class {number})"), tests }
}

fn flag(word: &str, field: &'static str) -> Term {
    let mut tests = vec![Test::Within(Column::Named(field), [1.0, f64::INFINITY])];
    if field == "Overlap" {
        tests.push(Test::Within(Column::Class, [12.0; 2]));
    }
    Term { kind: Kind::Flag, excludes: false, label: word.into(), tests }
}

fn of_returns(label: String, field: &'static str, [low, high]: [u32; 2]) -> Term {
    let tests = vec![Test::Within(Column::Named(field), [low.into(), high.into()])];
    Term { kind: Kind::Return, excludes: false, label, tests }
}

/// Parses `A` or `A..B`, both ends included.
fn range(text: &str) -> Option<[u32; 2]> {
    let (low, high) = text.split_once("..").unwrap_or((text, text));
    let [low, high] = [low.trim().parse().ok()?, high.trim().parse().ok()?];
    (low <= high).then_some([low, high])
}

/// A name in lower case, letters and digits only.
pub(super) fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}
