//! A simulated laser scan from positions inside a scene.

use std::f64::consts::{FRAC_PI_2, TAU};

use autosplats_cloud::Progress;
use glam::DVec3;

use super::octree::Octree;
use super::sample::{by_blocks, quantize, random_of};

/// Lowest elevation of a ray, in radians; the tripod hides everything below.
const MIN_ELEVATION_RAD: f64 = -60.0 / 180.0 * std::f64::consts::PI;

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
    by_blocks(start, positions, colors, progress, |first, points, colors| {
        for (i, (point, color)) in (first..).zip(points.iter_mut().zip(colors)) {
            let mut random = random_of(i as u64);
            let (station, ray) = (i / per_station, i % per_station);
            let hit = (0..100).find_map(|_| {
                let azimuth = TAU * ((ray / profile) as f64 + random.unit()) / per_station.div_ceil(profile) as f64;
                let height = ((ray % profile) as f64 + random.unit()) / profile as f64;
                let elevation = MIN_ELEVATION_RAD + (FRAC_PI_2 - MIN_ELEVATION_RAD) * height;
                let (sin, cos) = azimuth.sin_cos();
                let direction = DVec3::new(cos * elevation.cos(), sin * elevation.cos(), elevation.sin());
                tree.trace(stations[station], direction, 0.0..f64::INFINITY)
            });
            let Some(hit) = hit else { return false };
            *point = hit.world.as_vec3().to_array();
            *color = quantize(tree.rgb(&hit), &mut random);
        }
        true
    })
}
