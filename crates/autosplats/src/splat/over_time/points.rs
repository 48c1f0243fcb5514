//! What was fitted to each point, kept for the next frame.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::Vec3;
use rayon::prelude::*;

use super::surfaces::{draw_to, draw_towards, seen_before};
use crate::camera::{Reprojection, Seen, View};
use crate::fit::{Surfel, Surfels};
use crate::project::{ScreenPoints, half_at};
use crate::splat::GBuffer;

/// Frames of the same points that are averaged. Over four normals were nearly as steady: with 0.3 % of noise the bunny's changed
/// by 1.11° a picture, over eight by 1.07°, and by 2.21° alone.
pub(crate) const STEADY_FRAMES: u32 = 8;
/// Cosine of the angle by which a surface may have faced another way in the last frame.
pub(super) const ALIKE: f32 = 0.7;
/// Surfels, or halves of pixels, per task.
const TASK: usize = 4096;

/// What was fitted to a point, in the view space of its frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Fitted {
    /// From the point to the surfel's centre.
    pub(crate) offset: [f32; 3],
    /// Index in the cloud.
    pub(crate) source: u32,
    /// Unit normal.
    pub(crate) normal: [f32; 3],
    /// Over how many frames it is the mean.
    pub(crate) frames: f32,
}

/// What the last frame, made by settings `M`, leaves for the next one; keeps its buffers.
#[derive(Debug)]
pub(crate) struct OverTime<M> {
    /// How the last frame was seen and made, and the identity of its points; `None` if it left nothing.
    seen: Option<(Seen, u64, M)>,
    /// Of each half of a pixel, the place of its point's surfel in `fitted`, from 1 on; 0 if it has none.
    halves: Vec<AtomicU32>,
    fitted: Vec<Fitted>,
    /// Into the last frame.
    past: Option<Past>,
    /// Over how many frames each surfel of this frame is averaged.
    frames: Vec<f32>,
}

/// How a frame looks back into the last one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Past {
    reprojection: Reprojection,
    same_points: bool,
    /// Over how many frames to average.
    frames: f32,
}

impl<M> Default for OverTime<M> {
    fn default() -> Self {
        Self { seen: None, halves: Vec::new(), fitted: Vec::new(), past: None, frames: Vec::new() }
    }
}

impl<M: PartialEq> OverTime<M> {
    /// A frame of the cloud with this identity begins, to be averaged with so many of the same points, or of others, if they were
    /// `made` by the same settings. What one that was given up left is forgotten.
    pub(crate) fn begin(&mut self, now: Seen, identity: u64, made: &M, [of_same, of_others]: [u32; 2]) {
        self.frames.clear();
        let last = self.seen.take().filter(|(.., before)| before == made);
        self.past = last.and_then(|(then, points, _)| {
            let same_points = points == identity;
            let frames = if same_points { of_same } else { of_others } as f32;
            let reprojection = Reprojection::new(&now, &then)?;
            Some(Past { reprojection, same_points, frames })
        });
    }

    /// Nothing is known of frames before the next.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Averages `surfels`, which follow those of the calls before in this frame, with what the last one found; `last` is the
    /// surface that it showed.
    pub(crate) fn smooth(&mut self, surfels: &mut [Surfel], screen: &ScreenPoints, last: &GBuffer, view: &View) {
        let first = self.frames.len();
        self.frames.resize(first + surfels.len(), 1.0);
        let Some(past) = self.past.filter(|past| past.frames > 1.0) else { return };
        let Self { halves, fitted, frames, .. } = self;
        let known = Known { past: &past, halves, fitted, last, screen };
        let tasks = surfels.par_chunks_mut(TASK).zip(frames[first..].par_chunks_mut(TASK));
        tasks.for_each(|(surfels, frames)| {
            for (surfel, frames) in surfels.iter_mut().zip(frames) {
                *frames = known.smooth(surfel, view);
            }
        });
    }

    /// Keeps what was fitted in this frame, all of whose surfels these are.
    pub(crate) fn end(&mut self, now: Seen, identity: u64, made: M, surfels: &Surfels, screen: &ScreenPoints) {
        let Self { halves, fitted, frames, .. } = self;
        let view = &now.view;
        halves.resize_with(2 * view.width as usize * view.height as usize, AtomicU32::default);
        halves.par_chunks_mut(TASK).for_each(|halves| halves.iter_mut().for_each(|half| *half.get_mut() = 0));
        fitted.resize(surfels.len(), Fitted::default());
        let halves = &*halves;
        let tasks = fitted.par_chunks_mut(TASK).zip(surfels.par_chunks(TASK)).zip(frames.par_chunks(TASK));
        tasks.enumerate().for_each(|(task, ((fitted, surfels), frames))| {
            for (index, ((fitted, surfel), &frames)) in fitted.iter_mut().zip(surfels).zip(frames).enumerate() {
                let point = point_of(surfel, screen);
                let offset = (Vec3::from(surfel.center) - point).to_array();
                *fitted = Fitted { offset, source: surfel.source, normal: surfel.normal, frames };
                if surfel.radius > 0.0
                    && let Some(half) = half_at(view.to_pixel(point), view)
                {
                    // Rounding may put two into one half: always the same one stays.
                    halves[half].fetch_max((task * TASK + index + 1) as u32, Ordering::Relaxed);
                }
            }
        });
        self.seen = Some((now, identity, made));
    }
}

/// What is known of the last frame.
struct Known<'a> {
    past: &'a Past,
    halves: &'a [AtomicU32],
    fitted: &'a [Fitted],
    last: &'a GBuffer,
    /// Of this frame.
    screen: &'a ScreenPoints,
}

impl Known<'_> {
    /// Averages a surfel; returns over how many frames it is the mean then.
    fn smooth(&self, surfel: &mut Surfel, view: &View) -> f32 {
        let Past { reprojection, same_points, frames: most } = self.past;
        if surfel.radius == 0.0 {
            return 1.0;
        }
        let mut noisy = true;
        if *same_points {
            let point = point_of(surfel, self.screen);
            if let Some(then) = self.then(surfel, point) {
                let back = reprojection.rotation.transpose();
                let normal = back * Vec3::from(then.normal);
                let facing = normal.dot(surfel.normal.into());
                if facing.abs() >= ALIKE {
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

    /// What was fitted to a surfel's point then.
    fn then(&self, surfel: &Surfel, point: Vec3) -> Option<&Fitted> {
        let reprojection = &self.past.reprojection;
        let half = half_at(reprojection.place(point)?, &reprojection.view)?;
        let place = self.halves[half].load(Ordering::Relaxed);
        let then = self.fitted.get((place as usize).checked_sub(1)?)?;
        (then.source == surfel.source).then_some(then)
    }
}

/// The point that a surfel stands for, where it was measured, view space.
fn point_of(surfel: &Surfel, screen: &ScreenPoints) -> Vec3 {
    screen.points[(surfel.screen & !Surfel::BACK) as usize].position_view.into()
}
