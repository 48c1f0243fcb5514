//! Meaning of the name of an output.

use std::path::{Path, PathBuf};

use autosplats::cloud::is_there;

use crate::{Error, PictureFormat};

/// Most digits of a number in a name.
const MAX_DIGITS: usize = 12;
/// Least digits of a number without a pattern in the name.
const DIGITS: usize = 5;

/// Target of successive pictures.
///
/// # Examples
///
/// ```
/// use std::path::PathBuf;
///
/// use autosplats_output::{Error, Target};
///
/// let Target::Frames(frames) = Target::new("turn_%03d.png".as_ref())? else { panic!("a film") };
/// assert_eq!(frames.file(7), PathBuf::from("turn_007.png"));
/// assert_eq!(Target::new("turn.mp4".as_ref())?, Target::Film("turn.mp4".into()));
/// assert!(matches!(Target::new("turn.gif".as_ref()), Err(Error::Name { .. })));
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// A file per picture.
    Frames(Frames),
    /// One film, with its path.
    Film(PathBuf),
}

/// Names of numbered files.
///
/// # Examples
///
/// ```
/// use autosplats_output::Target;
///
/// let target = Target::new("frames/turn_%03d.png".as_ref())?;
/// let Target::Frames(frames) = target else { panic!("a film") };
/// assert!(frames.file(12).ends_with("turn_012.png"));
/// assert!(frames.pattern().ends_with("turn_….png"));
/// # Ok::<(), autosplats_output::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frames {
    folder: PathBuf,
    before: String,
    /// Least digits of the number between `before` and `after`; `None` for a single picture without a number.
    digits: Option<usize>,
    after: String,
    format: PictureFormat,
}

impl Target {
    /// Parses a path. The extensions `.mp4`, `.mkv`, `.webm` and `.mov` mean a film, those of a [`PictureFormat`]
    /// numbered pictures. The number replaces `%d`, `%05d` or the like, or else is appended to the name with at least
    /// five digits.
    ///
    /// # Errors
    /// [`Error::Name`] if the extension is another one or the name has several numbers.
    pub fn new(path: &Path) -> Result<Self, Error> {
        let refuse = |why: &str| Error::Name { path: path.into(), why: why.into() };
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match (extension.as_deref(), PictureFormat::of(path)) {
            (Some("mp4" | "mkv" | "webm" | "mov"), _) => Ok(Self::Film(path.into())),
            (Some(extension), Some(format)) => {
                let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
                    return Err(refuse("the names of numbered pictures have to be UTF-8"));
                };
                let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
                let (before, digits, after) = match number(name) {
                    Some((place, digits)) => (name[..place.start].into(), digits, name[place.end..].to_owned()),
                    None => {
                        let stem = &name[..name.len() - extension.len() - 1];
                        (format!("{stem}_"), DIGITS, format!(".{extension}"))
                    }
                };
                if number(&after).is_some() {
                    return Err(refuse("the name has more than one number"));
                }
                Ok(Self::Frames(Frames { folder, before, digits: Some(digits), after, format }))
            }
            _ => Err(refuse("the name has to end in .png, .jpg, .mp4, .mkv, .webm or .mov")),
        }
    }

    /// Parses a path for a single picture: a name without a place for a number is used as it is.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    ///
    /// # Examples
    ///
    /// ```
    /// use std::path::PathBuf;
    ///
    /// use autosplats_output::Target;
    ///
    /// let Target::Frames(one) = Target::one("scan.png".as_ref())? else { panic!("a film") };
    /// assert_eq!(one.file(0), PathBuf::from("scan.png"));
    /// let Target::Frames(many) = Target::new("scan.png".as_ref())? else { panic!("a film") };
    /// assert_eq!(many.file(0), PathBuf::from("scan_00000.png"));
    /// # Ok::<(), autosplats_output::Error>(())
    /// ```
    pub fn one(path: &Path) -> Result<Self, Error> {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        Ok(match Self::new(path)? {
            Self::Frames(frames) if !has_number(&name) => {
                Self::Frames(Frames { before: name, digits: None, after: String::new(), ..frames })
            }
            other => other,
        })
    }

    /// The first existing file that this many pictures, numbered from 0, would replace.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats_output::Target;
    ///
    /// # let folder = tempfile::tempdir()?;
    /// # let folder = folder.path();
    /// let target = Target::new(&folder.join("turn_%02d.png"))?;
    /// assert_eq!(target.existing(100), None);
    /// std::fs::write(folder.join("turn_03.png"), "")?;
    /// assert_eq!(target.existing(100), Some(folder.join("turn_03.png")));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn existing(&self, pictures: usize) -> Option<PathBuf> {
        match self {
            Self::Film(path) => Some(path.clone()).filter(|path| is_there(path)),
            Self::Frames(frames) => (0..pictures).map(|number| frames.file(number)).find(|path| is_there(path)),
        }
    }
}

impl Frames {
    /// File of the picture with this number.
    pub fn file(&self, number: usize) -> PathBuf {
        let Self { folder, before, digits, after, .. } = self;
        folder.join(match *digits {
            Some(digits) => format!("{before}{number:0digits$}{after}"),
            None => format!("{before}{after}"),
        })
    }

    /// The format of the files.
    pub fn format(&self) -> PictureFormat {
        self.format
    }

    /// Path of all pictures, for messages: "…" stands for the number.
    pub fn pattern(&self) -> PathBuf {
        let number = if self.digits.is_some() { "…" } else { "" };
        self.folder.join(format!("{}{number}{}", self.before, self.after))
    }
}

/// Whether a file name has a place for a number, as in `f_%05d.png`.
///
/// # Examples
///
/// ```
/// use autosplats_output::has_number;
///
/// assert!(has_number("turn_%05d.png"));
/// assert!(!has_number("50%.png"));
/// ```
pub fn has_number(name: &str) -> bool {
    number(name).is_some()
}

/// Range of the number's place in a name, and the least digits.
fn number(name: &str) -> Option<(std::ops::Range<usize>, usize)> {
    name.match_indices('%').find_map(|(start, _)| {
        let rest = &name[start + 1..];
        let end = rest.find('d')?;
        let width = &rest[..end];
        let digits = match width.strip_prefix('0') {
            None if width.is_empty() => 1,
            Some(digits) => digits.parse().ok().filter(|digits| (1..=MAX_DIGITS).contains(digits))?,
            None => return None,
        };
        Some((start..start + 1 + end + 1, digits))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(pattern: &str, picture: usize) -> String {
        match Target::new(Path::new(pattern)) {
            Ok(Target::Frames(frames)) => frames.file(picture).display().to_string(),
            other => panic!("{pattern} is {other:?}"),
        }
    }

    #[test]
    fn names_tell_what_is_written() {
        let film = Target::new(Path::new("a/film.MP4")).expect("a film");
        assert_eq!(film, Target::Film("a/film.MP4".into()));
        assert_eq!(file("a/f.png", 7), "a/f_00007.png", "numbered");
        assert_eq!(file("f.JPEG", 7), "f_00007.jpeg", "of any format");
        assert_eq!(file("f%03d_x.png", 7), "f007_x.png", "where it is told");
        assert_eq!(file("%d.png", 12), "12.png", "as wide as it is");
        assert_eq!(file("100%_done.png", 1), "100%_done_00001.png", "a percent sign alone is one");
        assert_eq!(file("f%02d.png", 12345), "f12345.png", "no digit is lost");
        let one = |name: &str| match Target::one(Path::new(name)) {
            Ok(Target::Frames(frames)) => [frames.file(7), frames.pattern()].map(|path| path.display().to_string()),
            other => panic!("{name} is {other:?}"),
        };
        assert_eq!(one("a/f.png"), ["a/f.png", "a/f.png"], "as it is");
        assert_eq!(one("f%02d.png"), ["f07.png", "f….png"], "where it is told");
        assert!(has_number("f%02d.png") && !has_number("50%.png"), "a percent sign alone is none");
        for name in ["film", "film.gif", "a%d_%d.png"] {
            assert!(matches!(Target::new(Path::new(name)), Err(Error::Name { .. })), "{name} is none");
        }
    }

    #[test]
    fn what_would_be_replaced_is_found() {
        let folder = tempfile::tempdir().expect("a folder");
        let target = Target::new(&folder.path().join("f%02d.png")).expect("pictures");
        assert_eq!(target.existing(10), None, "nothing is there");
        std::fs::write(folder.path().join("f03.png"), "").expect("a file");
        assert_eq!(target.existing(10), Some(folder.path().join("f03.png")));
        assert_eq!(target.existing(3), None, "that is beyond");
    }
}
