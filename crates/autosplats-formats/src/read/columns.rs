//! Names of columns: coordinates, colours and attributes as files name them, and names that the caller gives.

use autosplats_cloud::{Error, excerpt};

use super::{Attribute, Job, names};

/// Largest number of values of a point; a header with more is broken.
pub const MAX_COLUMNS: usize = 1024;

/// The names that the caller gives to the columns.
pub(super) struct Given {
    /// `None` for a column to leave out.
    pub(super) names: Vec<Option<String>>,
    /// Whether more columns may follow, which are left out.
    pub(super) open: bool,
}

/// The names that the caller gives to the columns, if any. `...` at the end leaves out whatever follows.
pub(super) fn given(job: &Job<'_>) -> Result<Option<Given>, Error> {
    let Some(names) = &job.options.columns else { return Ok(None) };
    check_columns(names).map_err(|what| job.unsupported(what))?;
    let (names, open) = closed(names);
    let name = |name: &String| (name != "-" && name != "_").then(|| name.clone());
    Ok(Some(Given { names: names.iter().map(name).collect(), open }))
}

/// The names without `...` at the end, and whether it was there.
fn closed(names: &[String]) -> (&[String], bool) {
    match names.split_last() {
        Some((last, names)) if last == "..." || last == "…" => (names, true),
        _ => (names, false),
    }
}

/// Checks names for [columns](super::ReadOptions::columns), which no file makes right.
///
/// # Errors
/// What is wrong, in one line: too many names, or not each of x, y and z once.
///
/// # Examples
///
/// ```
/// use autosplats_formats::check_columns;
///
/// assert!(check_columns(&["x", "y", "z", "-"].map(String::from)).is_ok());
/// assert!(check_columns(&["x", "y", "Intensity"].map(String::from)).is_err());
/// ```
pub fn check_columns(names: &[String]) -> Result<(), String> {
    let (names, _) = closed(names);
    if names.len() > MAX_COLUMNS {
        return Err(format!("--columns names {} columns; at most {MAX_COLUMNS}", names.len()));
    }
    for axis in ["x", "y", "z"] {
        let count = names.iter().filter(|name| name.eq_ignore_ascii_case(axis)).count();
        if count != 1 {
            let names = excerpt(names.join(" ").as_bytes());
            return Err(format!("--columns {names}: {axis} is named {count} times; name each of x, y and z once"));
        }
    }
    Ok(())
}

/// Largest number of columns that a note lists.
const MAX_NOTED_COLUMNS: usize = 24;

/// Note that tells which names the columns got.
pub(super) fn taken_for(names: &[Option<String>]) -> String {
    let shown = names.iter().map(|name| name.as_deref().map_or("-".into(), |name| excerpt(name.as_bytes())));
    let more = if names.len() > MAX_NOTED_COLUMNS {
        format!(" and {} more", names.len() - MAX_NOTED_COLUMNS)
    } else {
        String::new()
    };
    format!(
        "columns taken for {}{more}; --columns overrides",
        shown.take(MAX_NOTED_COLUMNS).collect::<Vec<_>>().join(" ")
    )
}

/// Columns that names state as x, y and z. The place of each axis is `None` if no name stands for it.
pub(super) fn axes(names: &[String]) -> [Option<usize>; 3] {
    let known: Vec<Option<(usize, usize)>> = names.iter().map(|name| names::axis(&names::plain(name))).collect();
    let exact = |axis: usize| {
        let of_axis =
            known.iter().enumerate().filter_map(|(index, known)| Some((known.filter(|k| k.0 == axis)?.1, index)));
        of_axis.min_by_key(|&(place, index)| (place, index)).map(|(_, index)| index)
    };
    let found = [0, 1, 2].map(exact);
    if found.iter().all(Option::is_some) {
        return found;
    }
    let compounds: Vec<Option<(usize, String)>> = names.iter().map(|name| compound(name)).collect();
    // The axes of one position share the words around them.
    let beside = |axis: usize, qualifier: &str| {
        compounds.iter().position(|found| found.as_ref().is_some_and(|(a, q)| *a == axis && q == qualifier))
    };
    let third = |axis: usize, qualifier: &str| {
        let mut others = compounds.iter().enumerate().filter(|(_, found)| found.as_ref().is_some_and(|f| f.0 == axis));
        let only = others.next().filter(|_| others.next().is_none()).map(|(index, _)| index);
        found[axis].or_else(|| beside(axis, qualifier)).or(only)
    };
    match found {
        [Some(x), Some(y), None] => {
            let up = (names::plain(&names[x]) == "e").then(|| names.iter().position(|name| names::plain(name) == "u"));
            [Some(x), Some(y), up.flatten().or_else(|| third(2, ""))]
        }
        [None, Some(_), Some(_)] | [Some(_), None, Some(_)] => found,
        _ => {
            let pairs = compounds.iter().flatten().filter_map(|(_, q)| Some((beside(0, q)?, beside(1, q)?, q)));
            let mut pairs = pairs.map(|(x, y, q)| [Some(x), Some(y), third(2, q)]);
            pairs.clone().find(|pair| pair[2].is_some()).or_else(|| pairs.next()).unwrap_or(found)
        }
    }
}

/// The axis in a name of several words, and the other words: 0 and `centroid` of `LONGITUDE_CENTROID`. A direction
/// counts more than a letter: `Northing_X` is y. Words such as `normal` make it something other than a position.
fn compound(name: &str) -> Option<(usize, String)> {
    let words = names::words(name);
    let is_axis = |least: usize| {
        let axis = |word: &String| names::axis(word).filter(|_| word.chars().count() >= least || !word.is_ascii());
        words.iter().position(|word| axis(word).is_some())
    };
    let letter = || words.iter().position(|word| ["x", "y", "z"].contains(&&**word));
    let at = is_axis(3).or_else(letter)?;
    let (axis, _) = names::axis(&words[at])?;
    let mut others: Vec<&str> = words.iter().enumerate().filter(|(i, _)| *i != at).map(|(_, word)| &**word).collect();
    if others.iter().any(|word| names::contains(names::NO_POSITION, word)) {
        return None;
    }
    others.retain(|word| !["x", "y", "z"].contains(word));
    Some((axis, others.join(" ")))
}

/// Indices of x, y and z among the names, if all are there.
pub(super) fn find_axes(names: &[String]) -> Option<[usize; 3]> {
    let [x, y, z] = axes(names);
    Some([x?, y?, z?])
}

/// Whether a name is one of longitude.
pub(super) fn is_longitude(name: &str) -> bool {
    is_degrees(names::LONGITUDES, name)
}

/// Whether a name is one of latitude.
pub(super) fn is_latitude(name: &str) -> bool {
    is_degrees(names::LATITUDES, name)
}

/// Whether a name, or a word of it, is in a list of longitudes or latitudes.
fn is_degrees(list: &str, name: &str) -> bool {
    names::contains(list, &names::plain(name))
        || names::words(name).iter().any(|word| word.len() > 2 && names::contains(list, word))
}

/// Whether a name is one of a colour or of a known attribute, which is no coordinate.
pub(super) fn is_known(name: &str) -> bool {
    let plain = names::plain(name);
    names::field(&plain).is_some() || names::COLORS.iter().any(|channels| names::contains(channels, &plain))
}

/// Suffix of a name that comes again though it has a meaning, as `x`.
pub(super) const AGAIN: &str = "_2";

/// Attributes whose names differ: a suffix is added to each that comes again, as to the fields of a cloud.
pub(super) fn unrepeated(attributes: impl Iterator<Item = Attribute>) -> Vec<Attribute> {
    let mut all: Vec<Attribute> = Vec::new();
    for mut attribute in attributes.take(MAX_COLUMNS) {
        while all.iter().any(|other| other.name.eq_ignore_ascii_case(&attribute.name)) {
            attribute.name.push_str(AGAIN);
        }
        all.push(attribute);
    }
    all
}

/// Indices of red, green and blue among the names, if all are there.
pub(super) fn find_color(names: &[String]) -> Option<[usize; 3]> {
    let plain: Vec<String> = names.iter().map(|name| names::plain(name)).collect();
    let find = |name: &str| plain.iter().position(|found| found == name);
    names::COLORS.iter().find_map(|channels| {
        let mut channels = channels.split_ascii_whitespace();
        Some([find(channels.next()?)?, find(channels.next()?)?, find(channels.next()?)?])
    })
}

/// PDAL's name of a field, if the field is known to PDAL; otherwise `name`.
pub(super) fn field_name(name: &str) -> String {
    let plain = names::plain(name);
    // CloudCompare prefixes the fields of a PLY with `scalar`.
    names::field(plain.strip_prefix("scalar").unwrap_or(&plain)).unwrap_or(name).into()
}

/// Largest number of values per point for which each becomes a field of its own. Descriptors have more.
pub(super) const MAX_COUNT: usize = 16;

/// Names of a field's columns, one per value. Padding (`_`) and fields of more than 16 values get none.
pub fn numbered(name: &str, count: usize) -> Vec<String> {
    match count {
        _ if name == "_" => Vec::new(),
        1 => vec![name.to_owned()],
        2..=MAX_COUNT => (0..count).map(|index| format!("{name}_{index}")).collect(),
        _ => Vec::new(),
    }
}
