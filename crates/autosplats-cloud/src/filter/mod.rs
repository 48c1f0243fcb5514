//! Which points to keep, by class, flag and return.

mod words;

use std::fmt;

use rayon::prelude::*;

use crate::{FieldValues, PointCloud, each_type};

/// Names of fields with classes, without separators and in lower case. The first that a cloud has is taken.
const CLASS_FIELDS: [&str; 4] = ["classification", "class", "label", "labels"];

/// The reason of points that no word without a hyphen matches.
const OTHERS: &str = "others";

/// Points checked at a time.
const BLOCK: usize = 1 << 16;

/// Which points to keep, by class, flag and return. A filter is parsed from words that are separated by commas:
///
/// | word | points |
/// |---|---|
/// | `all` | all |
/// | `usual` | all but withheld ones and those of the classes for noise, a `Classification` of 7 or 18 |
/// | `6`, `2..5` | of this class, of these classes |
/// | `ground`, `building`, `water` … | of the ASPRS class of this name |
/// | `noise`, `vegetation`, `wire` | of classes 7 and 18; 3, 4 and 5; 13 and 14 |
/// | `withheld`, `synthetic`, `key-point`, `edge-of-flight-line` | with this flag |
/// | `overlap` | with this flag, or of class 12, which older LAS files have instead |
/// | `first`, `last`, `single`, `return:2`, `return:2..3` | of these returns of a pulse |
///
/// A hyphen before a word leaves its points out. Of the words without a hyphen, a kept point matches one for classes,
/// one for flags and one for returns, as far as there are such words. `all` and `usual` stand alone.
///
/// Classes are in a field called `Classification`, `class` or `label`; `usual` takes the first name only. Flags and
/// returns are in fields with the names of PDAL: `Withheld`, `ReturnNumber` … Letter case and separators do not matter.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{FieldValues, PointCloud, PointFilter, glam::DVec3};
///
/// let mut cloud = PointCloud::new(DVec3::ZERO, vec![[0.0; 3]; 5])
///     .with_field("Classification", FieldValues::U8(vec![2, 2, 6, 7, 18]))?
///     .with_field("Withheld", FieldValues::U8(vec![0, 1, 0, 0, 0]))?;
/// assert_eq!(PointFilter::usual().left_out(&cloud).count(), 3);
///
/// let filter: PointFilter = "ground,6,-withheld".parse()?;
/// assert_eq!(filter.missing_field(&cloud), None);
/// let left_out = cloud.keep(&filter);
/// assert_eq!(cloud.len(), 2);
/// assert_eq!(left_out.to_string(), "3 of 5 points: 1 withheld, 2 others");
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PointFilter {
    /// The words, in lower case and without blanks.
    text: String,
    terms: Vec<Term>,
}

/// What one word says.
#[derive(Clone, Debug, PartialEq)]
struct Term {
    kind: Kind,
    /// Whether the word has a hyphen before it.
    excludes: bool,
    /// Name of the points for people.
    label: String,
    /// A point matches if it passes one of these tests.
    tests: Vec<Test>,
}

/// What a word is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Class,
    Flag,
    Return,
}

/// A test of a point's values.
#[derive(Clone, Debug, PartialEq)]
enum Test {
    /// The value of a field is within a range, both ends included.
    Within(Column, [f64; 2]),
    /// The number of the return is at least the number of returns.
    Last,
}

/// A field, if a cloud has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Column {
    Class,
    /// PDAL's name.
    Named(&'static str),
}

impl PointFilter {
    /// Keeps all points.
    #[must_use]
    pub fn all() -> Self {
        Self { text: words::ALL.into(), terms: Vec::new() }
    }

    /// Leaves out points of the classes for noise (7 and 18) and withheld points, which most programs do not show.
    #[must_use]
    pub fn usual() -> Self {
        Self { text: words::USUAL.into(), terms: words::usual() }
    }

    /// Whether the filter keeps all points of every cloud.
    #[must_use]
    pub fn is_all(&self) -> bool {
        self.terms.is_empty()
    }

    /// Whether this is [`usual`](Self::usual).
    #[must_use]
    pub fn is_usual(&self) -> bool {
        self.text == words::USUAL
    }

    /// Tells that `left` of `all` points were left out, where it is not known why each was.
    #[must_use]
    pub fn left_out_note(&self, left: u64, all: u64) -> String {
        if self.is_usual() {
            format!("left out {left} of {all} points: noise or withheld; --keep all keeps them")
        } else {
            format!("--keep {self} left out {left} of {all} points")
        }
    }

    /// Whether the filter looks at a field of this name.
    #[must_use]
    pub fn needs(&self, field: &str) -> bool {
        let plain = plain_field(field);
        let names = |column: &Column| match column {
            Column::Class => CLASS_FIELDS.contains(&&*plain),
            Column::Named(name) => words::plain(name) == plain,
        };
        self.terms.iter().flat_map(|term| &term.tests).any(|test| test.columns().iter().any(names))
    }

    /// Name of a field that the filter needs and the cloud lacks. `None` if it has all of them, or if the filter is
    /// [`usual`](Self::usual), which needs none.
    #[must_use]
    pub fn missing_field(&self, cloud: &PointCloud) -> Option<&'static str> {
        let lacks = |test: &Test| test.columns().iter().find(|column| column.values(cloud).is_none()).copied();
        let missing = |term: &Term| {
            let lacking: Vec<Column> = term.tests.iter().filter_map(lacks).collect();
            (lacking.len() == term.tests.len()).then(|| lacking[0].name())
        };
        if self.is_usual() { None } else { self.terms.iter().find_map(missing) }
    }

    /// The points that the filter does not keep. A field that the cloud lacks counts as 0 at every point, because
    /// readers of LAS leave out fields that are 0 at every point.
    #[must_use]
    pub fn left_out(&self, cloud: &PointCloud) -> LeftOut {
        let mut left = LeftOut { total: cloud.len(), marks: Vec::new(), reasons: Vec::new() };
        for term in self.terms.iter().filter(|term| term.excludes) {
            if term.tests.iter().any(|test| test.passes_any(cloud)) {
                left.add(&term.label, &term.matching(cloud));
            }
        }
        for kind in [Kind::Class, Kind::Flag, Kind::Return] {
            let wanted: Vec<_> = self.terms.iter().filter(|term| !term.excludes && term.kind == kind).collect();
            if !wanted.is_empty() {
                let mut others = vec![false; cloud.len()];
                wanted.iter().flat_map(|term| &term.tests).for_each(|test| test.mark(cloud, &mut others));
                others.par_iter_mut().for_each(|other| *other = !*other);
                left.add(OTHERS, &others);
            }
        }
        left
    }
}

impl Default for PointFilter {
    fn default() -> Self {
        Self::all()
    }
}

impl fmt::Display for PointFilter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Term {
    /// For each point, whether it matches.
    fn matching(&self, cloud: &PointCloud) -> Vec<bool> {
        let mut marks = vec![false; cloud.len()];
        self.tests.iter().for_each(|test| test.mark(cloud, &mut marks));
        marks
    }
}

impl Test {
    fn columns(&self) -> &[Column] {
        match self {
            Self::Within(column, _) => std::slice::from_ref(column),
            Self::Last => &[Column::Named("ReturnNumber"), Column::Named("NumberOfReturns")],
        }
    }

    /// Whether some point passes.
    fn passes_any(&self, cloud: &PointCloud) -> bool {
        let Self::Within(column, [low, high]) = self else { return true };
        match column.values(cloud) {
            None => (*low..=*high).contains(&0.0),
            // Whole files are checked each time they are shown, so bytes are compared as bytes.
            Some(FieldValues::U8(values)) => {
                let bytes = low.ceil().max(0.0) as u8..=high.min(255.0) as u8;
                let found = |block: &[u8]| block.iter().fold(false, |found, byte| found | bytes.contains(byte));
                *low <= 255.0 && values.par_chunks(BLOCK).any(found)
            }
            Some(_) => true,
        }
    }

    /// Marks the points that pass.
    fn mark(&self, cloud: &PointCloud, marks: &mut [bool]) {
        match self {
            Self::Within(column, [low, high]) => {
                let within = |value: f64| *low <= value && value <= *high;
                let Some(values) = column.values(cloud) else {
                    if within(0.0) {
                        marks.fill(true);
                    }
                    return;
                };
                #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one of the types is f64 itself")]
                {
                    each_type!(values, v => {
                        marks.par_iter_mut().zip(v).for_each(|(mark, &value)| *mark |= within(value as f64));
                    });
                }
            }
            Self::Last => {
                let [number, returns] = [self.columns()[0], self.columns()[1]].map(|column| column.values(cloud));
                let value = |values: Option<&FieldValues>, i| values.map_or(0.0, |values| values.get(i));
                let last = |i| value(number, i) >= value(returns, i);
                marks.par_iter_mut().enumerate().for_each(|(i, mark)| *mark |= last(i));
            }
        }
    }
}

impl Column {
    fn name(self) -> &'static str {
        match self {
            Self::Class => "Classification",
            Self::Named(name) => name,
        }
    }

    fn values(self, cloud: &PointCloud) -> Option<&FieldValues> {
        let find = |name: &str| cloud.fields().iter().find(|field| plain_field(&field.name) == name);
        let field = match self {
            Self::Class => CLASS_FIELDS.iter().find_map(|name| find(name)),
            Self::Named(name) => find(&words::plain(name)),
        };
        field.map(|field| &field.values)
    }
}

/// A field's name in lower case, without separators and without the `scalar` that CloudCompare writes before names.
fn plain_field(name: &str) -> String {
    let plain = words::plain(name);
    plain.strip_prefix("scalar").map_or(plain.clone(), str::to_owned)
}

/// The points that a [`PointFilter`] does not keep, and why. Its text gives their number and the reasons:
/// `3 of 5 points: 1 withheld, 2 others`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LeftOut {
    total: usize,
    /// For each point, whether it is left out; empty if none is.
    marks: Vec<bool>,
    /// Reasons, each with the number of points that no earlier reason leaves out.
    reasons: Vec<(String, usize)>,
}

impl LeftOut {
    /// Number of points that are left out.
    #[must_use]
    pub fn count(&self) -> usize {
        self.reasons.iter().map(|(_, count)| count).sum()
    }

    /// Whether point `index` is left out.
    #[must_use]
    pub fn has(&self, index: usize) -> bool {
        self.marks.get(index).copied().unwrap_or(false)
    }

    /// Joins what one filter leaves out of consecutive parts of a cloud. Keeps the numbers and the reasons, and forgets
    /// which points were left out.
    #[must_use]
    pub fn counts(parts: &[Self], filter: &PointFilter) -> Self {
        let mut all = Self { total: parts.iter().map(|part| part.total).sum(), ..Self::default() };
        for label in filter.terms.iter().map(|term| &*term.label).chain([OTHERS]) {
            let reasons = parts.iter().flat_map(|part| &part.reasons).filter(|(known, _)| known == label);
            let count: usize = reasons.map(|(_, count)| count).sum();
            if count > 0 && !all.reasons.iter().any(|(known, _)| known == label) {
                all.reasons.push((label.into(), count));
            }
        }
        all
    }

    /// Adds the marked points.
    fn add(&mut self, reason: &str, marks: &[bool]) {
        self.marks.resize(self.total, false);
        let add = |(own, more): (&mut bool, &bool)| {
            let new = *more && !*own;
            *own |= *more;
            usize::from(new)
        };
        let count = self.marks.par_iter_mut().zip(marks).map(add).sum();
        match self.reasons.iter_mut().find(|(known, _)| known == reason) {
            Some((_, known)) => *known += count,
            None if count > 0 => self.reasons.push((reason.into(), count)),
            None => {}
        }
    }
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = if self.total == 1 { "" } else { "s" };
        write!(f, "{} of {} point{plural}", self.count(), self.total)?;
        for (place, (reason, count)) in self.reasons.iter().enumerate() {
            write!(f, "{} {count} {reason}", if place == 0 { ":" } else { "," })?;
        }
        Ok(())
    }
}

impl PointCloud {
    /// Classes of the points: the field `Classification`, else `class` or `label`. `None` if there is no such field.
    pub fn class_values(&self) -> Option<&FieldValues> {
        Column::Class.values(self)
    }

    /// Keeps the points that a filter keeps. Order and attributes stay. Returns what was left out.
    ///
    /// A field that the cloud lacks counts as 0; [`PointFilter::missing_field`] tells whether one is missing.
    pub fn keep(&mut self, filter: &PointFilter) -> LeftOut {
        let left = filter.left_out(self);
        if left.count() > 0 {
            self.retain(|index| !left.has(index));
        }
        left
    }
}

#[cfg(test)]
mod tests;
