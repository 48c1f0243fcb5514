//! The frames to render, and their target: numbered files or a film.

use std::path::PathBuf;

use autosplats_output::{Target, has_ffmpeg, has_number};

use crate::exit::Failure;
use crate::values::FrameRange;

/// Frames to render, and their target.
#[derive(Debug)]
pub(super) struct FilmJob {
    pub(super) target: Target,
    pub(super) frames: FrameRange,
    pub(super) resume: bool,
    pub(super) fps: Option<f64>,
    /// Whether files are read again when they change.
    pub(super) watch: bool,
}

impl FilmJob {
    /// The job of the flags; `None` if they ask for no frames.
    pub(super) fn new(
        outputs: &[PathBuf],
        frames: Option<FrameRange>,
        resume: bool,
        fps: Option<f64>,
        watch: bool,
    ) -> Result<Option<Self>, Failure> {
        let many = |path: &PathBuf| {
            let name = path.to_string_lossy();
            let film = Target::new(path).is_ok_and(|target| matches!(target, Target::Film(_)));
            // Of a name that is no text, the target tells what is wrong.
            film || has_number(&name) && (Target::new(path).is_ok() || path.to_str().is_none())
        };
        if frames.is_none() && !resume && !watch && !outputs.iter().any(many) {
            return Ok(None);
        }
        let [output] = outputs else {
            return Err(Failure::usage(
                "--out: frames need one film, or one file name with a number such as f_%05d.png",
            ));
        };
        let all = FrameRange { first: 0, last: None };
        let frames = frames.unwrap_or(all);
        let is_one = frames.last == Some(frames.first) && !watch;
        let target = if is_one { Target::one(output) } else { Target::new(output) }?;
        if matches!(target, Target::Film(_)) {
            if resume {
                return Err(Failure::usage("--resume: a film cannot be resumed; write pictures as f_%05d.png"));
            }
            if !has_ffmpeg() {
                let error = "films need ffmpeg, which is not installed; install it, or write pictures as f_%05d.png";
                return Err(Failure::usage(format!("{}: {error}", output.display())));
            }
        }
        Ok(Some(Self { target, frames, resume, fps, watch }))
    }

    /// The first file that is written.
    pub(super) fn first_file(&self) -> PathBuf {
        self.file(self.frames.first).unwrap_or_else(|| match &self.target {
            Target::Film(path) => path.clone(),
            Target::Frames(names) => names.file(0),
        })
    }

    /// The file of a frame's picture; `None` for a film.
    pub(super) fn file(&self, frame: usize) -> Option<PathBuf> {
        match &self.target {
            Target::Film(_) => None,
            Target::Frames(names) => Some(names.file(frame)),
        }
    }
}
