//! Files as frames: all files of a folder, or those that match a pattern.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use autosplats_cloud::{Contents, Error, PointCloud, Progress};
use autosplats_formats::{Description, ReadOptions, describe, read_mesh, read_with};
use autosplats_scenes::Surface;
use rayon::prelude::*;

use super::frames::Frames;
use crate::{
    Timeline,
    listing::{candidates, is_named_as_cloud},
    stream::or_empty,
};

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
            let why = "which are not clouds, are depth images beside clouds, or have no number";
            let what = format!("left out {left_out} of {all} files, {why}");
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
        let cloud = or_empty(read_with(&self.files[frame], &self.options, progress))?;
        Ok(vec![Arc::new(cloud)])
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
            Ok(Description { format, .. }) => {
                sound = true;
                kept.push((file, format));
            }
            Err(Error::UnknownFormat { .. } | Error::Unsupported { .. }) => {}
            Err(error) => {
                reason = reason.or(Some(error));
                kept.push((file, String::new()));
            }
        }
    }
    if !sound {
        return Err(no_frames(match reason {
            Some(error) => format!("none of its files can be read; {error}"),
            None => "none of its files is a cloud".into(),
        }));
    }
    // Pose and camera files beside numbered frames may look like text files of points.
    let numbered = |(file, _): &(PathBuf, String)| {
        file.file_stem()
            .is_some_and(|stem| stem.to_string_lossy().contains(|character: char| character.is_ascii_digit()))
    };
    if kept.iter().any(numbered) {
        kept.retain(numbered);
    }
    // Pictures beside clouds often have a layer of depths. Text beside depth images holds poses.
    let is_image = |(_, format): &(PathBuf, String)| format.starts_with("depth image");
    if kept.iter().any(|file| !file.1.is_empty() && file.1 != "text" && !is_image(file)) {
        kept.retain(|file| !is_image(file));
    }
    Ok(kept.into_iter().map(|(file, _)| file).collect())
}
