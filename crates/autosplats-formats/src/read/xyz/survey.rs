//! What rows sampled all over a text tell, before it is read.

use autosplats_cloud::{Crs, Unit, degree_origin, storage_origin};
use glam::DVec3;

use super::super::{
    Job,
    units::{LOOKS_LIKE_DEGREES, look_like_degrees},
};
use super::layout::{Layout, Target};

/// Longest line, in bytes, that the survey reads.
const MAX_LINE: usize = 1 << 16;

/// Places in the text sampled to find the middle of the points.
const PLACES: usize = 1024;

/// What rows sampled all over the text tell.
pub(super) struct Survey {
    /// An origin for the points.
    pub(super) origin: DVec3,
    pub(super) crs: Crs,
    /// Mean length of a row in bytes.
    pub(super) row_len: usize,
}

/// Samples the rows from byte `start` on.
pub(super) fn survey(job: &Job<'_>, layout: &Layout, start: usize) -> Survey {
    let text = job.bytes;
    let mut points = Vec::new();
    let (mut last, mut bytes) = (None, 0);
    for place in 0..PLACES {
        let offset = start + ((text.len() - start) as u128 * place as u128 / PLACES as u128) as usize;
        // The search for a line end is bounded, because a line may be as long as the file.
        let line_end = |at: usize| {
            let window = &text[at..text.len().min(at + MAX_LINE)];
            let end = window.iter().position(|&byte| byte == b'\n').map(|len| at + len);
            end.or((window.len() < MAX_LINE).then_some(text.len()))
        };
        let at = if place == 0 { Some(start) } else { line_end(offset).map(|end| (end + 1).min(text.len())) };
        let Some((at, end)) = at.and_then(|at| Some((at, line_end(at)?))) else { continue };
        if last == Some(at) {
            continue;
        }
        last = Some(at);
        let mut point = [f64::NAN; 3];
        for (cell, target) in layout.dialect.cells(&text[at..end]).zip(&layout.targets) {
            if let Target::Axis(axis) = *target {
                point[axis] = layout.dialect.number(cell).unwrap_or(f64::NAN);
            }
        }
        if point.iter().all(|value| value.is_finite()) {
            bytes += end + 1 - at;
            points.push(DVec3::from(point));
        }
    }
    let mut crs = layout.crs.clone();
    if crs == Crs::default() && job.options.columns.is_none() && look_like_degrees(points.len(), |i| points[i]) {
        crs.unit = Some(Unit::Degree);
        job.note(LOOKS_LIKE_DEGREES);
    }
    let origin = if crs.unit == Some(Unit::Degree) {
        degree_origin(points.len(), |i| points[i])
    } else {
        storage_origin(points.len(), |i| points[i])
    };
    // The shortest row has three digits, each followed by a byte.
    Survey { origin, crs, row_len: bytes.checked_div(points.len()).unwrap_or(0).max(6) }
}
