//! Which files a name stands for, and in which order.

use std::{
    cmp::Ordering,
    path::{Path, PathBuf},
};

use autosplats_cloud::Error;
use autosplats_formats::is_named_as_points;

/// The files that a name stands for, in natural order.
pub(crate) fn candidates(name: &str) -> Result<Vec<PathBuf>, Error> {
    let path = Path::new(name);
    let mut files = if path.is_dir() {
        let io = |source| Error::Io { path: path.into(), source };
        let entries = std::fs::read_dir(path).map_err(io)?;
        entries.map(|entry| Ok(entry.map_err(io)?.path())).collect::<Result<Vec<_>, Error>>()?
    } else if path.is_file() {
        vec![path.into()]
    } else {
        let pattern = glob::glob(name)
            .map_err(|error| Error::NoFrames { name: name.into(), why: format!("bad pattern: {error}") })?;
        // Folders that cannot be read are skipped.
        pattern.filter_map(Result::ok).collect()
    };
    files.retain(|file| file.is_file());
    files.sort_by(|a, b| natural(&a.to_string_lossy(), &b.to_string_lossy()));
    Ok(files)
}

/// Whether a file is not hidden and has the extension of a readable format.
pub(crate) fn is_named_as_cloud(file: &Path) -> bool {
    let hidden = file.file_name().is_none_or(|name| name.to_string_lossy().starts_with('.'));
    !hidden && is_named_as_points(file)
}

/// Natural order of names: `frame_2` before `frame_10`.
pub(crate) fn natural(a: &str, b: &str) -> Ordering {
    let (mut a, mut b) = (a, b);
    loop {
        let (Some(x), Some(y)) = (a.chars().next(), b.chars().next()) else { return a.len().cmp(&b.len()) };
        if x.is_ascii_digit() && y.is_ascii_digit() {
            let number = |text: &'_ str| text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
            let ((left, rest), (right, other)) = (a.split_at(number(a)), b.split_at(number(b)));
            let value = |digits: &str| digits.trim_start_matches('0').to_owned();
            let (l, r) = (value(left), value(right));
            // Of equal numbers the one with fewer leading zeros comes first.
            let order = l.len().cmp(&r.len()).then_with(|| l.cmp(&r)).then_with(|| left.len().cmp(&right.len()));
            if order != Ordering::Equal {
                return order;
            }
            (a, b) = (rest, other);
        } else {
            if x != y {
                return x.cmp(&y);
            }
            (a, b) = (&a[x.len_utf8()..], &b[y.len_utf8()..]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count() {
        let mut names = vec!["f10.ply", "f2.ply", "f002.ply", "a", "f1_10", "f1_9", "f", "f99999999999999999999999"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(
            names,
            ["a", "f", "f1_9", "f1_10", "f2.ply", "f002.ply", "f10.ply", "f99999999999999999999999"],
            "sorted"
        );
    }
}
