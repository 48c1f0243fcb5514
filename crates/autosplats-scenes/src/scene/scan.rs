//! A simulated laser scan from positions inside a scene.

use std::f64::consts::{FRAC_PI_2, TAU};

use autosplats_cloud::{Progress, Random};
use glam::DVec3;

use super::octree::Octree;
use super::sample::{by_blocks, quantize, random_of};

/// Lowest elevation of a ray, in radians; the tripod hides everything below.
const MIN_ELEVATION_RAD: f64 = -60.0 / 180.0 * std::f64::consts::PI;

/// Rays of a point that may leave the scene before it is given up.
const MAX_TRIES: usize = 100;

/// Rays that are prepared at a time.
const RAYS: usize = 256;

/// Scans the inside of a closed scene, with an equal share of `count` points from each of `stations`: the points from
/// `start` on. Rays are jittered within equal steps of azimuth and elevation. Returns false if cancelled or if rays
/// leave the scene.
pub(super) fn scan(
    tree: &Octree,
    stations: &[DVec3],
    count: usize,
    start: usize,
    positions: &mut [[f32; 3]],
    colors: &mut [[u8; 3]],
    progress: &dyn Progress,
) -> bool {
    let per_station = count.div_ceil(stations.len()).max(1);
    // The scanner measures one vertical profile after another while its head turns.
    let profile = ((per_station as f64 * (FRAC_PI_2 - MIN_ELEVATION_RAD) / TAU).sqrt().ceil() as usize).max(1);
    let ray_of = |i: usize, random: &mut Random| {
        let (station, ray) = (i / per_station, i % per_station);
        let azimuth = TAU * ((ray / profile) as f64 + random.unit()) / per_station.div_ceil(profile) as f64;
        let height = ((ray % profile) as f64 + random.unit()) / profile as f64;
        let elevation = MIN_ELEVATION_RAD + (FRAC_PI_2 - MIN_ELEVATION_RAD) * height;
        let (sin, cos) = azimuth.sin_cos();
        let direction = DVec3::new(cos * elevation.cos(), sin * elevation.cos(), elevation.sin());
        (stations[station], direction)
    };
    by_blocks(start, positions, colors, progress, |first, points, colors| {
        let mut randoms = Vec::with_capacity(RAYS);
        let mut rays = Vec::with_capacity(RAYS);
        let mut hits = [None; RAYS];
        let groups = points.chunks_mut(RAYS).zip(colors.chunks_mut(RAYS));
        for (first, (points, colors)) in (first..).step_by(RAYS).zip(groups) {
            randoms.clear();
            randoms.extend((first..).take(points.len()).map(|i| random_of(i as u64)));
            rays.clear();
            rays.extend((first..).zip(&mut randoms).map(|(i, random)| ray_of(i, random)));
            tree.trace_each(&rays, &mut hits[..points.len()]);
            let slots = points.iter_mut().zip(colors).zip(&hits).zip(&mut randoms);
            for (i, (((point, color), &hit), random)) in (first..).zip(slots) {
                let again = |random: &mut Random| {
                    let (origin, direction) = ray_of(i, random);
                    tree.trace(origin, direction, 0.0..f64::INFINITY)
                };
                let hit = hit.or_else(|| (1..MAX_TRIES).find_map(|_| again(random)));
                let Some(hit) = hit else { return false };
                *point = hit.world.as_vec3().to_array();
                *color = quantize(tree.rgb(&hit), random);
            }
        }
        true
    })
}
