//! The fit to each point, kept for the next frame.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::Vec3;
use rayon::prelude::*;

use super::surfaces::{MIN_SURFACE_COSINE, draw_to, draw_towards, seen_before};
use crate::camera::{PlacedView, Reprojection, View};
use crate::cancel::Cancel;
use crate::fit::{Surfel, Surfels};
use crate::project::{ScreenPoints, half_at};
use crate::splat::GBuffer;

/// Frames of the same points that are averaged. See docs/decisions/0014-frame-to-frame.md.
pub(crate) const STEADY_FRAMES: u32 = 8;
/// Surfels, or halves of pixels, per task.
const TASK: usize = 4096;

/// The fit to a point, in the view space of its frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Fitted {
    /// From the point to the surfel's centre.
    pub(crate) offset: [f32; 3],
    /// Index of the point in the cloud.
    pub(crate) source: u32,
    /// Unit normal.
    pub(crate) normal: [f32; 3],
    /// Number of frames averaged.
    pub(crate) frames: f32,
}

/// State that the last frame, made with settings `M`, leaves for the next one. Keeps its buffers.
#[derive(Debug)]
pub(crate) struct OverTime<M> {
    /// View and origin of the last frame, identity of its points, and its settings; `None` if there is no last frame.
    seen: Option<(PlacedView, u64, M)>,
    /// Index plus 1 in `fitted` for the point of each half of a pixel; 0 if there is none.
    halves: Vec<AtomicU32>,
    fitted: Vec<Fitted>,
    /// View into the last frame; `None` if this frame does not continue it.
    past: Option<LookBack>,
    /// Number of frames averaged in each surfel of this frame.
    frames: Vec<f32>,
}

/// Look back from a frame into the last one.
#[derive(Clone, Copy, Debug)]
pub(super) struct LookBack {
    reprojection: Reprojection,
    same_points: bool,
    /// Number of frames to average.
    frames: f32,
}

impl<M> Default for OverTime<M> {
    fn default() -> Self {
        Self { seen: None, halves: Vec::new(), fitted: Vec::new(), past: None, frames: Vec::new() }
    }
}

impl<M: PartialEq> OverTime<M> {
    /// Begins a frame of the cloud with this identity. The frame continues the last one if both were `made` with the
    /// same settings. Then `of_same` frames are averaged for the same points, `of_others` for others. The state of a
    /// frame that was given up is dropped.
    pub(crate) fn begin(&mut self, now: PlacedView, identity: u64, made: &M, [of_same, of_others]: [u32; 2]) {
        self.frames.clear();
        let last = self.seen.take().filter(|(.., before)| before == made);
        self.past = last.and_then(|(then, points, _)| {
            let same_points = points == identity;
            let frames = if same_points { of_same } else { of_others } as f32;
            let reprojection = Reprojection::new(&now, &then)?;
            Some(LookBack { reprojection, same_points, frames })
        });
    }

    /// Forgets all earlier frames.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Averages `surfels`, which follow those of earlier calls in this frame, with the last frame. `last` is the
    /// surface that the last frame showed.
    pub(crate) fn smooth(
        &mut self,
        surfels: &mut [Surfel],
        screen: &ScreenPoints,
        last: &GBuffer,
        view: &View,
        cancel: &Cancel<'_>,
    ) {
        let first = self.frames.len();
        self.frames.resize(first + surfels.len(), 1.0);
        let Some(past) = self.past.filter(|past| past.frames > 1.0) else { return };
        let Self { halves, fitted, frames, .. } = self;
        let known = LastFrame { past: &past, halves, fitted, last, screen };
        let tasks = surfels.par_chunks_mut(TASK).zip(frames[first..].par_chunks_mut(TASK));
        tasks.filter(|_| !cancel.is_given_up()).for_each(|(surfels, frames)| {
            for (surfel, frames) in surfels.iter_mut().zip(frames) {
                *frames = known.smooth(surfel, view);
            }
        });
    }

    /// Keeps the fits of this frame; `surfels` are all of its surfels.
    pub(crate) fn keep(&mut self, surfels: &Surfels, screen: &ScreenPoints, view: &View, cancel: &Cancel<'_>) {
        let Self { halves, fitted, frames, .. } = self;
        halves.resize_with(2 * view.width as usize * view.height as usize, AtomicU32::default);
        halves.par_chunks_mut(TASK).for_each(|halves| halves.iter_mut().for_each(|half| *half.get_mut() = 0));
        fitted.resize(surfels.len(), Fitted::default());
        let halves = &*halves;
        let tasks = fitted.par_chunks_mut(TASK).zip(surfels.par_chunks(TASK)).zip(frames.par_chunks(TASK));
        tasks.enumerate().filter(|_| !cancel.is_given_up()).for_each(|(task, ((fitted, surfels), frames))| {
            for (index, ((fitted, surfel), &frames)) in fitted.iter_mut().zip(surfels).zip(frames).enumerate() {
                let point = point_of(surfel, screen);
                let offset = (Vec3::from(surfel.center) - point).to_array();
                *fitted = Fitted { offset, source: surfel.source, normal: surfel.normal, frames };
                if !surfel.is_dropped()
                    && !surfel.is_near()
                    && let Some(half) = half_at(view.to_pixel(point), view)
                {
                    // Rounding may put two points into one half. The maximum always keeps the same one.
                    halves[half].fetch_max((task * TASK + index + 1) as u32, Ordering::Relaxed);
                }
            }
        });
    }

    /// Completes the frame that began. It is the last one for the next frame.
    pub(crate) fn end(&mut self, now: PlacedView, identity: u64, made: M) {
        self.seen = Some((now, identity, made));
    }
}

/// The last frame, and the screen points of this one.
struct LastFrame<'a> {
    past: &'a LookBack,
    halves: &'a [AtomicU32],
    fitted: &'a [Fitted],
    last: &'a GBuffer,
    /// Screen points of this frame.
    screen: &'a ScreenPoints,
}

impl LastFrame<'_> {
    /// Averages a surfel. Returns the number of frames in its mean.
    fn smooth(&self, surfel: &mut Surfel, view: &View) -> f32 {
        let LookBack { reprojection, same_points, frames: most } = self.past;
        if surfel.is_dropped() {
            return 1.0;
        }
        let mut noisy = true;
        if *same_points {
            let point = point_of(surfel, self.screen);
            if let Some(then) = self.then(surfel, point) {
                let back = reprojection.rotation.transpose();
                let normal = back * Vec3::from(then.normal);
                let facing = normal.dot(surfel.normal.into());
                if facing.abs() >= MIN_SURFACE_COSINE {
                    let frames = (then.frames + 1.0).min(*most);
                    let share = 1.0 - 1.0 / frames;
                    let center = Vec3::from(surfel.center);
                    let moved = center + share * (point + back * Vec3::from(then.offset) - center);
                    draw_to(surfel, moved, normal * facing.signum(), share, view);
                    return frames;
                }
            }
            noisy = point.to_array() != surfel.center;
        }
        if noisy && let Some(surface) = seen_before(surfel, self.last, reprojection) {
            draw_towards(surfel, &surface, 1.0 - 1.0 / most, view);
            return *most;
        }
        1.0
    }

    /// The fit to a surfel's point in the last frame.
    fn then(&self, surfel: &Surfel, point: Vec3) -> Option<&Fitted> {
        let reprojection = &self.past.reprojection;
        let half = half_at(reprojection.place(point)?, &reprojection.view)?;
        let place = self.halves[half].load(Ordering::Relaxed);
        let then = self.fitted.get((place as usize).checked_sub(1)?)?;
        (then.source == surfel.source).then_some(then)
    }
}

/// The measured point of a surfel, view space.
fn point_of(surfel: &Surfel, screen: &ScreenPoints) -> Vec3 {
    screen.points[surfel.screen() as usize].position_view.into()
}
