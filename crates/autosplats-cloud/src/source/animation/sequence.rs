//! Files as frames: all files of a folder, or those that match a pattern.

use std::{
    cmp::Ordering,
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use rayon::prelude::*;

use super::{Frames, Surface};
use crate::{Contents, Error, PointCloud, Progress, ReadOptions, Timeline, describe, formats, read_mesh, read_with};

/// Files, one per frame.
pub(super) struct Sequence {
    files: Vec<PathBuf>,
    timeline: Timeline,
    options: ReadOptions,
    /// The mesh of the first file.
    first: OnceLock<Arc<Contents>>,
}

impl Sequence {
    pub(super) fn find(name: &str, fps: f64, options: &ReadOptions, progress: &dyn Progress) -> Result<Self, Error> {
        let found = candidates(name)?;
        let all = found.len();
        let files = clouds(name, found, options)?;
        if files.len() < all {
            let (left_out, frames) = (all - files.len(), files.len());
            let what = format!("left out {left_out} of {all} files, which are not clouds or have no number");
            progress.note(&format!("{what}; {frames} are the frames"));
        }
        let timeline = Timeline::even(files.len(), fps)?;
        Ok(Self { files, timeline, options: options.clone(), first: OnceLock::new() })
    }

    fn mesh(&self, frame: usize, progress: &dyn Progress) -> Result<Contents, Error> {
        // Keeps points without a return: the number of vertices must match the faces.
        let options = ReadOptions { keep_no_returns: true, ..self.options.clone() };
        read_mesh(&self.files[frame], &options, progress)
    }
}

impl Frames for Sequence {
    fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    fn read(&self, frame: usize, progress: &dyn Progress) -> Result<Vec<Arc<PointCloud>>, Error> {
        Ok(vec![Arc::new(read_with(&self.files[frame], &self.options, progress)?)])
    }

    fn surface(&self, frame: usize, progress: &dyn Progress) -> Result<Surface, Error> {
        let first = match self.first.get() {
            Some(first) => first,
            None => {
                let first = Arc::new(self.mesh(0, progress)?);
                self.first.get_or_init(|| first)
            }
        };
        if frame == 0 {
            return Ok(Surface::Mesh(Arc::clone(first)));
        }
        let mut mesh = self.mesh(frame, progress)?;
        if mesh.triangles.is_empty() {
            if mesh.cloud.len() != first.cloud.len() {
                let (own, firsts) = (mesh.cloud.len(), first.cloud.len());
                let what = format!("it has no faces, and {own} vertices where the first frame has {firsts}");
                let path = self.files[frame].clone();
                return Err(Error::Malformed { path, place: format!("frame {frame}"), what });
            }
            mesh.triangles.clone_from(&first.triangles);
        }
        Ok(Surface::Mesh(Arc::new(mesh)))
    }
}

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

/// Keeps the files that are clouds, damaged ones included.
fn clouds(name: &str, files: Vec<PathBuf>, options: &ReadOptions) -> Result<Vec<PathBuf>, Error> {
    let no_frames = |why: String| Error::NoFrames { name: name.into(), why };
    if files.is_empty() {
        let folder = Path::new(name).is_dir();
        let why = if folder { "the folder has no files" } else { "no file matches" };
        return Err(no_frames(why.into()));
    }
    let looked =
        files.into_par_iter().filter(|file| is_named_as_cloud(file)).map(|file| (describe(&file, options), file));
    let looked: Vec<_> = looked.collect();
    let (mut kept, mut sound, mut reason) = (Vec::new(), false, None);
    for (described, file) in looked {
        match described {
            Ok(_) => sound = true,
            Err(Error::UnknownFormat { .. } | Error::Unsupported { .. }) => continue,
            Err(error) => reason = reason.or(Some(error)),
        }
        kept.push(file);
    }
    if !sound {
        return Err(no_frames(match reason {
            Some(error) => format!("none of its files can be read; {error}"),
            None => "none of its files is a cloud".into(),
        }));
    }
    // Pose and camera files beside numbered frames may look like text files of points.
    let numbered =
        |file: &PathBuf| file.file_stem().is_some_and(|s| s.to_string_lossy().contains(|c: char| c.is_ascii_digit()));
    if kept.iter().any(numbered) {
        kept.retain(numbered);
    }
    Ok(kept)
}

/// Whether a file is not hidden and has the extension of a readable format.
pub(crate) fn is_named_as_cloud(file: &Path) -> bool {
    let name = file.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let ends = |extension: &&str| name.strip_suffix(extension).is_some_and(|stem| stem.ends_with('.'));
    !name.starts_with('.') && formats().any(|(_, extensions)| extensions.iter().any(ends))
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
