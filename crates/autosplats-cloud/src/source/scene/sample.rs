//! Points strewn over a body's surface, evenly by area.
//!
//! # How it works
//! Every cell the surface may pass through is pierced by random lines along one of the three axes. Such lines meet a
//! piece of surface with normal `n` in proportion to `|n.x| + |n.y| + |n.z|`, so keeping a crossing with one over that
//! makes the density exactly even: no shell, no projection, no correction for curvature. Cells are drawn by the area of
//! their faces. Points come in blocks that each have their own random stream, so threads change nothing. A block sends
//! its lines cell after cell, which is four times faster than at random, and gets a few more crossings than it needs, of
//! which it drops random ones.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use super::octree::{Leaf, Octree};
use crate::random::Random;

/// Points per random stream.
const BLOCK: usize = 16384;

/// Reports progress, 0 to 1, and says whether to go on.
pub(super) type Progress<'a> = &'a (dyn Fn(f32) -> bool + Sync);

/// Fills `positions` and `colors` by blocks, in parallel. `block` gets the index of its first point and returns false
/// when it cannot fill them. Returns whether all was filled.
pub(super) fn by_blocks(
    positions: &mut [[f32; 3]],
    colors: &mut [[u8; 3]],
    progress: Progress<'_>,
    block: impl Fn(usize, &mut [[f32; 3]], &mut [[u8; 3]]) -> bool + Sync,
) -> bool {
    let total = positions.len().max(1) as f32;
    let (done, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    positions.par_chunks_mut(BLOCK).zip(colors.par_chunks_mut(BLOCK)).enumerate().for_each(|(i, (points, colors))| {
        if stop.load(Ordering::Relaxed) {
            return;
        }
        let filled = block(i * BLOCK, points, colors);
        let done = done.fetch_add(points.len(), Ordering::Relaxed) + points.len();
        if !filled || !progress(done as f32 / total) {
            stop.store(true, Ordering::Relaxed);
        }
    });
    !stop.into_inner()
}

/// The cells of one zone, and how likely each is drawn.
struct Zone {
    /// Each with a bit for every one of its eight octants that the surface may pass through.
    leaves: Vec<(Leaf, u8)>,
    /// Sums of face areas up to and including each cell.
    sums: Vec<f64>,
}

impl Zone {
    fn new(tree: &Octree, zone: usize) -> Self {
        let mut leaves = tree.leaves();
        leaves.retain(|leaf| tree.body().touches(tree.list(leaf), zone));
        let leaves: Vec<_> = leaves.into_par_iter().map(|leaf| (leaf, tree.octants(&leaf))).collect();
        let mut sum = 0.0;
        let sums = leaves
            .iter()
            .map(|(leaf, _)| {
                sum += leaf.size * leaf.size;
                sum
            })
            .collect();
        Self { leaves, sums }
    }

    /// Calls `visit` with about `lines` cells, drawn by the area of their faces and evenly spread over them.
    fn draw<'a>(&'a self, lines: usize, random: &mut Random, visit: &mut dyn FnMut(&'a (Leaf, u8), &mut Random)) {
        let Some(total) = self.sums.last() else { return };
        let mut at = 0;
        for line in 0..lines {
            let drawn = (line as f64 + random.unit()) * total / lines as f64;
            while at + 1 < self.sums.len() && self.sums[at] <= drawn {
                at += 1;
            }
            visit(&self.leaves[at], random);
        }
    }

    /// `need` points of this zone, or fewer if it has no surface.
    fn fill(&self, tree: &Octree, zone: usize, need: usize, random: &mut Random) -> Vec<Painted> {
        let mut points = Vec::new();
        // Lines per point: a guess that is corrected by what the lines before have met.
        let (mut lines, mut met) = (0, 0);
        while points.len() < need && lines < 1000 * need {
            let missing = need - points.len();
            let rate = if met > 0 { 1.03 * lines as f64 / met as f64 } else { 4.0 };
            let more = ((missing as f64 + 2.0 * (missing as f64).sqrt()) * rate) as usize + 8;
            let mut fresh = Vec::new();
            self.draw(more, random, &mut |leaf, random| pierce(tree, leaf, zone, random, &mut fresh));
            lines += more;
            met += fresh.len();
            for last in (missing.min(fresh.len())..fresh.len()).rev() {
                fresh.swap_remove(random.below(last + 1));
            }
            points.append(&mut fresh);
        }
        points
    }
}

/// Strews points over the surface, `shares[zone]` of them over each zone. Returns false when cancelled.
pub(super) fn strew(
    tree: &Octree,
    shares: &[f64],
    positions: &mut [[f32; 3]],
    colors: &mut [[u8; 3]],
    progress: Progress<'_>,
) -> bool {
    let zones: Vec<_> = (0..tree.body().zones()).map(|zone| Zone::new(tree, zone)).collect();
    // How many of the first `count` points lie in zones up to and including `zone`.
    let upto = |count: usize, zone: usize| {
        let share = if zone + 1 == zones.len() { 1.0 } else { shares[..=zone].iter().sum::<f64>() };
        (count as f64 * share).round() as usize
    };
    by_blocks(positions, colors, progress, |first, points, colors| {
        let mut random = Random::of_scene(first as u64);
        let end = first + points.len();
        let mut slots = points.iter_mut().zip(colors);
        let mut before = 0;
        for (zone, cells) in zones.iter().enumerate() {
            let all = upto(end, zone) - upto(first, zone);
            let need = all - before;
            before = all;
            let filled = cells.fill(tree, zone, need, &mut random);
            if filled.len() < need {
                return false;
            }
            for ((p, rgb), (point, color)) in filled.into_iter().zip(&mut slots) {
                (*point, *color) = (p, rgb);
            }
        }
        true
    })
}

type Painted = ([f32; 3], [u8; 3]);

/// Sends one random line through `leaf` and keeps its crossings in `zone`.
fn pierce(tree: &Octree, (leaf, octants): &(Leaf, u8), zone: usize, random: &mut Random, out: &mut Vec<Painted>) {
    let axis = random.below(3);
    let (mut origin, mut octant) = (leaf.min, 0);
    for other in [(axis + 1) % 3, (axis + 2) % 3] {
        let at = random.unit();
        origin[other] += leaf.size * at;
        octant |= u8::from(at >= 0.5) << other;
    }
    // The line passes two octants, often through neither of which the surface goes.
    let near = octants >> octant & 1 > 0;
    let far = octants >> (octant | 1 << axis) & 1 > 0;
    let length = match (near, far) {
        (false, false) => return,
        (true, true) => leaf.size,
        _ => 0.5 * leaf.size,
    };
    if !near {
        origin[axis] += length;
    }
    let direction = DVec3::AXES[axis];
    let list = tree.list(leaf);
    tree.crossings_in(leaf, origin, direction, length, &mut |t| {
        let p = origin + direction * t;
        if random.unit() * tree.slant(p, list) < 1.0 {
            let (rgb, in_zone) = tree.body().paint(p, p, list);
            if in_zone == zone {
                out.push((p.as_vec3().to_array(), quantize(rgb, random)));
            }
        }
    });
}

/// sRGB bytes, with a little of the variation that any sensor has.
pub(super) fn quantize(rgb: [f32; 3], random: &mut Random) -> [u8; 3] {
    let gain = 255.0 * (1.0 + 0.03 * (random.unit() as f32 - 0.5));
    rgb.map(|c| (c * gain + 0.5).clamp(0.0, 255.0) as u8)
}
