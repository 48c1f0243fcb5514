//! Inputs with timelines: the points at each frame.

use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use autosplats::{Camera, ColorMode, Renderer};
use autosplats_cloud::glam::DMat4;
use autosplats_cloud::{Axes, LocalMetres, PointCloud, Progress};
use autosplats_sources::Timeline;

use super::job::Job;
use crate::exit::{Exit, Failure};
use crate::input::{Playing, read_failure};
use crate::progress::Bar;

/// Most frames that the camera is placed by.
const MAX_CAMERA_FRAMES: usize = 5;

/// Inputs with timelines, played together.
pub(super) struct Moving {
    playing: Vec<Playing>,
    /// Times at which something changes, in nanoseconds since the common start.
    pub(super) times: Vec<i64>,
    place: SharedPlacement,
    /// Names of the inputs, for messages.
    names: String,
}

impl Moving {
    pub(super) fn new(playing: Vec<Playing>, names: String) -> Self {
        let times_of = |input: &Playing| {
            let stamps = input.player.stream().timeline().map_or(&[][..], Timeline::stamps);
            let first = stamps.first().copied().unwrap_or_default();
            let begins = i64::try_from(input.begins.unwrap_or_default().as_nanos()).unwrap_or(i64::MAX);
            stamps.iter().map(|stamp| stamp.saturating_sub(first).saturating_add(begins)).collect::<Vec<_>>()
        };
        let times = match playing.as_slice() {
            [only] => times_of(only),
            several => {
                let mut times: Vec<i64> = several.iter().flat_map(times_of).collect();
                times.sort_unstable();
                times.dedup();
                times
            }
        };
        Self { playing, times, place: SharedPlacement::default(), names }
    }

    /// The points at a frame.
    pub(super) fn points(&mut self, frame: usize, progress: &dyn Progress) -> Result<Arc<PointCloud>, Failure> {
        let time = Duration::from_nanos(u64::try_from(self.times[frame]).unwrap_or_default());
        let single = self.playing.len() == 1;
        let mut parts: Vec<(Arc<PointCloud>, DMat4)> = Vec::new();
        for Playing { player, begins, world_from_input, .. } in &mut self.playing {
            let at = |timeline: &Timeline| timeline.frame_at(time.saturating_sub(begins.unwrap_or_default()));
            // Frames of a single input may share a time, so its frames are taken by number.
            let own = if single { frame } else { player.stream().timeline().map_or(0, at) };
            parts.push((player.frame(own, progress).map_err(read_failure)?, *world_from_input));
        }
        Ok(self.place.merge(parts))
    }

    /// Places the camera so that it sees all frames, and fixes the settings that depend on the points.
    pub(super) fn settle(
        &mut self,
        job: &mut Job,
        renderer: &mut Renderer,
        frames: &Range<usize>,
    ) -> Result<Camera, Failure> {
        let bar = Bar::on_input("placing the camera", &self.names, job.quiet);
        let last = frames.len() - 1;
        let count = frames.len().min(MAX_CAMERA_FRAMES);
        let mut looks: Vec<usize> = (0..count).map(|look| frames.start + last * look / (count - 1).max(1)).collect();
        looks.dedup();
        let mut clouds = Vec::new();
        for (number, frame) in looks.iter().enumerate() {
            clouds.push(self.points(*frame, &bar)?);
            bar.report((number + 1) as f32 / looks.len() as f32);
        }
        drop(bar);
        let parts: Vec<_> = clouds.iter().map(|cloud| (&**cloud, DMat4::IDENTITY)).collect();
        let all = PointCloud::merged(&parts);
        if all.len() < 2 {
            return Err(Failure::new(Exit::Input, format!("{}: there are no points in these frames", self.names)));
        }
        let first = clouds.into_iter().find(|cloud| cloud.len() > 1).unwrap_or_else(|| Arc::new(all.clone()));
        self.place.settle(job, renderer, &all, first)
    }

    /// The points at a frame, ready for rendering.
    pub(super) fn frame(&mut self, frame: usize, progress: &dyn Progress) -> Result<Arc<PointCloud>, Failure> {
        let cloud = self.points(frame, progress)?;
        Ok(self.place.upright(cloud))
    }
}

/// Conversion to metres and up axis, fixed by the first points so that all pictures share them.
#[derive(Default)]
pub(super) struct SharedPlacement {
    /// Conversion of degrees to metres.
    metres: Option<LocalMetres>,
    axes: Option<Axes>,
}

impl SharedPlacement {
    /// Merges inputs with their poses.
    pub(super) fn merge(&mut self, mut parts: Vec<(Arc<PointCloud>, DMat4)>) -> Arc<PointCloud> {
        let mut cloud = match parts.pop() {
            Some((only, pose)) if parts.is_empty() && pose == DMat4::IDENTITY => only,
            Some(last) => {
                parts.push(last);
                let parts: Vec<_> = parts.iter().map(|(cloud, pose)| (&**cloud, *pose)).collect();
                Arc::new(PointCloud::merged(&parts))
            }
            None => Arc::default(),
        };
        if self.metres.is_none() && !cloud.is_empty() {
            self.metres = cloud.local_metres(None);
        }
        if let Some(metres) = &self.metres {
            Arc::make_mut(&mut cloud).to_metres_on(metres);
        }
        cloud
    }

    /// Places the camera for `all` points. Fixes by the `first` points what all pictures must share: exposure, range of
    /// the colour map and first radius of the kd-tree.
    pub(super) fn settle(
        &mut self,
        job: &mut Job,
        renderer: &mut Renderer,
        all: &PointCloud,
        first: Arc<PointCloud>,
    ) -> Result<Camera, Failure> {
        job.check_color(all)?;
        job.settle_exposure(&first);
        let (camera, axes) = job.camera.place(all, job.inputs.only_scene(), job.size)?;
        self.axes = Some(axes);
        let first = self.upright(first);
        job.settle_first_radius(renderer, &first, &camera)?;
        let plain = matches!(job.settings.shading.color, ColorMode::Plain | ColorMode::Rgb | ColorMode::Normal);
        if job.settings.shading.range.is_none() && !plain {
            // No later frame may be averaged with this trial.
            let averaged = std::mem::replace(&mut job.settings.reconstruction.frames_averaged, 1);
            let range = job.render(renderer, &first, &camera)?.counts.value_range;
            job.settings.reconstruction.frames_averaged = averaged;
            let ends = range.map(|ends| ends.map(|end| end as f32));
            job.settings.shading.range = ends.filter(|[low, high]| low < high);
        }
        Ok(camera)
    }

    /// The points with the shared up axis.
    pub(super) fn upright(&self, mut cloud: Arc<PointCloud>) -> Arc<PointCloud> {
        if let Some(axes) = self.axes
            && cloud.axes() != Some(axes)
        {
            // Other owners of the cloud keep theirs; this is a copy.
            cloud = Arc::new(Arc::unwrap_or_clone(cloud).with_axes(axes));
        }
        cloud
    }
}
