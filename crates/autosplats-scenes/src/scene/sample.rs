//! Samples points on a body's surface, evenly by area.
//!
//! # How it works
//! Every cell that the surface may cross is pierced by random lines along one of the three axes. Such lines meet a
//! piece of surface with normal `n` in proportion to `|n.x| + |n.y| + |n.z|`. Keeping a crossing with the inverse of
//! that makes the density exactly even, without a shell, projection or correction for curvature. Cells are drawn by the
//! area of their faces. Each block of points has its own random stream, so threads change nothing. A block visits cells
//! in order, which is faster than at random. It gets a few more crossings than it needs and drops random ones.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use autosplats_cloud::{Progress, Random};
use glam::DVec3;
use rayon::prelude::*;

use super::octree::{Leaf, Octree};

/// Points per random stream.
pub(super) const BLOCK: usize = 16384;

/// Fills `positions` and `colors` block by block, in parallel: those of the points from `start` on, which begins a
/// block. `block` gets the index of its first point and returns false if it cannot fill the block. Returns whether all
/// blocks are filled.
pub(super) fn by_blocks(
    start: usize,
    positions: &mut [[f32; 3]],
    colors: &mut [[u8; 3]],
    progress: &dyn Progress,
    block: impl Fn(usize, &mut [[f32; 3]], &mut [[u8; 3]]) -> bool + Sync,
) -> bool {
    let total = positions.len().max(1) as f32;
    let (done, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    positions.par_chunks_mut(BLOCK).zip(colors.par_chunks_mut(BLOCK)).enumerate().for_each(|(i, (points, colors))| {
        if stop.load(Ordering::Relaxed) {
            return;
        }
        let filled = block(start + i * BLOCK, points, colors);
        let done = done.fetch_add(points.len(), Ordering::Relaxed) + points.len();
        if !filled || progress.tick(done as f32 / total).is_err() {
            stop.store(true, Ordering::Relaxed);
        }
    });
    !stop.into_inner()
}

/// The cells of one zone, with their probabilities.
struct Zone {
    /// Each cell with a bit for each of its octants that the surface may cross.
    leaves: Vec<(Leaf, u8)>,
    /// Running sums of the cells' face areas.
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

    /// Calls `visit` for about `lines` cells, drawn in proportion to face area and evenly spread.
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

    /// Samples `need` points of this zone, or fewer if the zone has no surface.
    fn fill(&self, tree: &Octree, zone: usize, need: usize, random: &mut Random) -> Vec<PaintedPoint> {
        let mut points = Vec::new();
        // Lines per point: a guess, corrected by the crossings found so far.
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

/// The random numbers of item `number`. The seeding is fixed: other numbers would be other points.
pub(super) fn random_of(number: u64) -> Random {
    let seed = Random::from_state(number ^ 0x5EED_A570_5B1A_7500).bits();
    Random::from_state(seed)
}

/// The cells of a body's zones, and the shares of the points that each zone gets.
pub(super) struct Zones<'a> {
    tree: &'a Octree,
    shares: &'a [f64],
    zones: Vec<Zone>,
}

impl<'a> Zones<'a> {
    pub(super) fn new(tree: &'a Octree, shares: &'a [f64]) -> Self {
        Self { tree, shares, zones: (0..tree.body().zones()).map(|zone| Zone::new(tree, zone)).collect() }
    }

    /// Number of points among the first `count` that lie in zones up to and including `zone`.
    fn upto(&self, count: usize, zone: usize) -> usize {
        let share = if zone + 1 == self.zones.len() { 1.0 } else { self.shares[..=zone].iter().sum::<f64>() };
        (count as f64 * share).round() as usize
    }

    /// Samples the points from `start` on. Returns false if cancelled or if a zone has no surface.
    pub(super) fn sample(
        &self,
        start: usize,
        positions: &mut [[f32; 3]],
        colors: &mut [[u8; 3]],
        progress: &dyn Progress,
    ) -> bool {
        by_blocks(start, positions, colors, progress, |first, points, colors| {
            let mut random = random_of(first as u64);
            let end = first + points.len();
            let mut slots = points.iter_mut().zip(colors);
            let mut before = 0;
            for (zone, cells) in self.zones.iter().enumerate() {
                let all = self.upto(end, zone) - self.upto(first, zone);
                let need = all - before;
                before = all;
                let filled = cells.fill(self.tree, zone, need, &mut random);
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
}

type PaintedPoint = ([f32; 3], [u8; 3]);

/// Sends one random line through `leaf` and keeps its crossings in `zone`.
fn pierce(tree: &Octree, (leaf, octants): &(Leaf, u8), zone: usize, random: &mut Random, out: &mut Vec<PaintedPoint>) {
    let axis = random.below(3);
    let (mut origin, mut octant) = (leaf.min, 0);
    for other in [(axis + 1) % 3, (axis + 2) % 3] {
        let at = random.unit();
        origin[other] += leaf.size * at;
        octant |= u8::from(at >= 0.5) << other;
    }
    // The line crosses two octants. Often the surface crosses neither.
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

/// Converts to sRGB bytes, with a little sensor noise.
pub(super) fn quantize(rgb: [f32; 3], random: &mut Random) -> [u8; 3] {
    let gain = 255.0 * (1.0 + 0.03 * (random.unit() as f32 - 0.5));
    rgb.map(|c| (c * gain + 0.5).clamp(0.0, 255.0) as u8)
}
