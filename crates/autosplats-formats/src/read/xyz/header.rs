//! A line of column names before the points.

use autosplats_cloud::Unit;

use super::super::{MAX_HEADER_LINE, columns, columns::MAX_COLUMNS};

/// Names of columns, and the units they state.
pub(super) struct Header {
    pub(super) names: Vec<String>,
    pub(super) units: Vec<Option<Unit>>,
}

impl Header {
    /// Parses a header line, which may be a comment. Names may contain blanks if another separator is used.
    pub(super) fn parse(line: &[u8]) -> Option<Self> {
        if line.len() > MAX_HEADER_LINE {
            return None;
        }
        let line = String::from_utf8_lossy(line);
        let line = line.trim_start_matches(['#', '/', ' ', '\u{feff}']);
        let separator = [';', '\t', ','].into_iter().find(|&separator| line.contains(separator));
        let clean = |name: &str| name.trim().trim_matches(['"', '\'']).trim().to_owned();
        let mut names: Vec<String> = Vec::new();
        match separator {
            Some(separator) => names.extend(line.split(separator).map(clean)),
            None => {
                // `x [m] y [m]`: a unit belongs to the name before it.
                for word in line.split_ascii_whitespace() {
                    match names.last_mut() {
                        Some(last) if word.starts_with(['[', '(']) => *last += word,
                        _ => names.push(clean(word)),
                    }
                }
            }
        }
        if names.len() < 3 || names.len() > MAX_COLUMNS + 1 {
            return None;
        }
        let mut units = Vec::with_capacity(names.len());
        for name in &mut names {
            let at = name.find(['[', '(']).filter(|&at| at > 0);
            units.push(at.and_then(|at| unit_of(name[at..].trim_matches(['[', ']', '(', ')', ' ']))));
            if let Some(at) = at {
                name.truncate(name[..at].trim_end().len());
            }
        }
        Some(Self { names, units })
    }

    /// Number of names; a separator after the last name is not counted.
    pub(super) fn len(&self) -> usize {
        self.names.iter().rposition(|name| !name.is_empty()).map_or(0, |last| last + 1)
    }

    pub(super) fn has_axes(&self) -> bool {
        columns::find_axes(&self.names).is_some()
    }

    /// The names, if a row has as many values. A separator may follow the last name.
    pub(super) fn fitting(&self, width: usize) -> Option<&[String]> {
        let more = self.names.get(width..)?;
        (more.is_empty() || more.len() == 1 && more[0].is_empty()).then(|| &self.names[..width])
    }
}

fn unit_of(name: &str) -> Option<Unit> {
    Some(match &*name.to_lowercase() {
        "m" | "metre" | "meter" | "metres" | "meters" => Unit::Metre,
        "mm" => Unit::Millimetre,
        "ft" | "feet" | "foot" => Unit::Foot,
        "usft" | "us ft" | "ftus" => Unit::UsSurveyFoot,
        "deg" | "degree" | "degrees" | "°" => Unit::Degree,
        _ => return None,
    })
}
