//! Points strewn over a body's surface, evenly by area.
//!
//! # How it works
//! Every cell the surface may pass through is pierced by random lines along one of the three axes. Such lines meet a
//! piece of surface with normal `n` in proportion to `|n.x| + |n.y| + |n.z|`, so keeping a crossing with one over that
//! makes the density exactly even: no shell, no projection, no correction for curvature. Cells are drawn by the area of
//! their faces. Points come in blocks that each have their own random stream, so threads change nothing.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use super::octree::{Leaf, Octree};
use super::random::Random;

/// Points per random stream.
const BLOCK: usize = 4096;

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
    leaves: Vec<Leaf>,
    /// Sums of face areas up to and including each cell.
    sums: Vec<f64>,
}

impl Zone {
    fn new(tree: &Octree, zone: usize) -> Self {
        let leaves = tree.leaves().into_iter().filter(|leaf| tree.body().touches(tree.list(leaf), zone)).collect::<Vec<_>>();
        let mut sum = 0.0;
        let sums = leaves
            .iter()
            .map(|leaf| {
                sum += leaf.size * leaf.size;
                sum
            })
            .collect();
        Self { leaves, sums }
    }

    fn draw(&self, random: &mut Random) -> Option<&Leaf> {
        let at = random.unit() * self.sums.last()?;
        self.leaves.get(self.sums.partition_point(|&sum| sum <= at))
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
    let count = positions.len();
    // The zone of point i, spread evenly over the cloud so that any part of it shows the whole scene.
    let zone_of = |i: usize| {
        let (mut sum, at) = (0.0, (i as f64 * 0.618_033_988_749_894_9).fract());
        shares.iter().position(|share| {
            sum += share;
            at < sum
        })
    };
    let last = zones.len() - 1;
    by_blocks(positions, colors, progress, |first, points, colors| {
        let mut random = Random::new(first as u64);
        // Several crossings of one line are all used, or folds would be thinner than flat parts; what a zone has too
        // many of waits here.
        let mut waiting = vec![Vec::new(); zones.len()];
        let end = (first + points.len()).min(count);
        for (i, (point, color)) in (first..end).zip(points.iter_mut().zip(colors)) {
            let zone = zone_of(i).unwrap_or(last);
            let mut tries = 0;
            while waiting[zone].is_empty() {
                tries += 1;
                let Some(leaf) = zones[zone].draw(&mut random).filter(|_| tries < 1_000_000) else { return false };
                pierce(tree, leaf, zone, &mut random, &mut waiting[zone]);
            }
            if let Some((p, rgb)) = waiting[zone].pop() {
                *point = p;
                *color = rgb;
            }
        }
        true
    })
}

type Painted = ([f32; 3], [u8; 3]);

/// Sends one random line through `leaf` and keeps its crossings in `zone`.
fn pierce(tree: &Octree, leaf: &Leaf, zone: usize, random: &mut Random, out: &mut Vec<Painted>) {
    let axis = random.below(3);
    let mut origin = leaf.min;
    origin[(axis + 1) % 3] += leaf.size * random.unit();
    origin[(axis + 2) % 3] += leaf.size * random.unit();
    let direction = DVec3::AXES[axis];
    let list = tree.list(leaf);
    tree.crossings_in(leaf, origin, direction, leaf.size, &mut |t| {
        let p = origin + direction * t;
        let normal = tree.gradient(p, list).abs();
        if random.unit() * normal.element_sum() < 1.0 {
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
