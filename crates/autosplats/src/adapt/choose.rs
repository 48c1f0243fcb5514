//! The scale of a quadric: the balls around a place, from small to large, until the error is small enough.

use glam::Vec3;
use pulp::Simd;

use super::cells::Cells;
use super::quadric::{Gathered, LEAST_CLUSTERS, Quadric};
use super::rules::{AGREE_ERRORS, Goal, LEAST_TRACE, MAX_MOVE_NOISES, MAX_NOISE_BALL_RADII, MAX_RELIABLE_ERROR_RAD};
use super::{SCALES, STEP};
use crate::camera::View;

/// The upright quadric around `center`, from balls that grow until the error is small enough. Ball radii are powers of
/// [`STEP`] times `radius`. Where `first` is given, a normal and its standard error, the smallest ball has to agree
/// with that normal. Returns `None` if no quadric is better than the first neighbours.
///
/// Each ball counts by how far it agrees with the result of the smaller ones. A ball that disagrees, or scatters too
/// much, ends the search (stagewise aggregation, Belomestny and Spokoiny 2007). An all-or-nothing choice would depend
/// on chance and flicker from picture to picture. See docs/decisions/0006-scale-by-agreement.md.
#[inline(always)]
pub(super) fn choose<S: Simd>(
    simd: S,
    center: [f32; 3],
    mut radius: f32,
    first: Option<(Vec3, f32)>,
    &Goal { noise, enough, scatter }: &Goal,
    (cells, view): (&Cells, &View),
    gathered: &mut Gathered,
) -> Option<Quadric> {
    // A normal to agree with, and its standard error.
    let mut reliable = first;
    let mut best: Option<Quadric> = None;
    // The quadric of least error, for when none is reliable.
    let mut fallback: Option<Quadric> = None;
    // The first ball's heights run along its plane's normal, those of larger balls along the normal found so far.
    let mut axis = None;
    for scale in 0..SCALES {
        radius *= STEP;
        // Points of a ball that the noise fills are no surface; the largest ball is taken if there is no better one.
        let thin = noise < MAX_NOISE_BALL_RADII * radius;
        if !thin & (scale + 1 < SCALES) {
            continue;
        }
        if gathered.read(simd, cells, center, radius, view) < LEAST_CLUSTERS {
            continue;
        }
        if axis.is_none() && scale + 1 < SCALES {
            let least = noise * (1.0 / (MAX_RELIABLE_ERROR_RAD * radius));
            if gathered.weight() < LEAST_TRACE * least * least {
                continue;
            }
        }
        let (along, curvature) = axis.unwrap_or_else(|| {
            let plane = gathered.plane(simd);
            (plane.axis, plane.curvature())
        });
        let quadric = gathered.quadric(simd, radius, along, curvature);
        let error = quadric.error * noise;
        if !(thin & (error < MAX_RELIABLE_ERROR_RAD)) {
            if fallback.is_none_or(|other| quadric.error < other.error) {
                fallback = Some(quadric);
            }
            continue;
        }
        let mut share = 1.0;
        if let Some((normal, other)) = reliable {
            let across = quadric.normal.cross(normal).length_squared();
            share = 1.0 - across / (AGREE_ERRORS * AGREE_ERRORS * (error * error + other * other));
            if !((share > 0.0) & (quadric.scatter <= scatter)) {
                break;
            }
        }
        let found = best.map_or(quadric, |smaller| smaller.towards(&quadric, share)).upright();
        let error = found.error * noise;
        reliable = Some((found.normal, error));
        axis = Some((found.normal, curvature));
        best = Some(found);
        if error < enough {
            break;
        }
    }
    let quadric = if reliable.is_none() { fallback.map(|quadric| quadric.upright()) } else { best };
    quadric.filter(|quadric| quadric.height.abs() <= MAX_MOVE_NOISES * noise)
}
