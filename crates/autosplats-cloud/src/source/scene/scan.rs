//! A simulated laser scan: what scanners standing in a scene would record.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::DVec3;

use super::octree::Octree;
use super::sample::{Progress, by_blocks, quantize};
use crate::random::Random;

/// Lowest elevation a scanner sees: below, its own tripod is in the way.
const LOWEST: f64 = -60.0 / 180.0 * std::f64::consts::PI;

/// Scans the inside of a closed scene from each of `stations`, an equal part of the points from each: rays a constant
/// angle apart in azimuth and elevation, jittered within that angle. Returns false when cancelled.
pub(super) fn scan(
    tree: &Octree,
    stations: &[DVec3],
    positions: &mut [[f32; 3]],
    colors: &mut [[u8; 3]],
    progress: Progress<'_>,
) -> bool {
    let per_station = positions.len().div_ceil(stations.len()).max(1);
    // One vertical profile after the other while the head turns, as such scanners do.
    let profile = ((per_station as f64 * (FRAC_PI_2 - LOWEST) / TAU).sqrt().ceil() as usize).max(1);
    by_blocks(positions, colors, progress, |first, points, colors| {
        for (i, (point, color)) in (first..).zip(points.iter_mut().zip(colors)) {
            let mut random = Random::of_scene(i as u64);
            let (station, ray) = (i / per_station, i % per_station);
            let hit = (0..100).find_map(|_| {
                let azimuth = TAU * ((ray / profile) as f64 + random.unit()) / per_station.div_ceil(profile) as f64;
                let height = ((ray % profile) as f64 + random.unit()) / profile as f64;
                let elevation = LOWEST + (FRAC_PI_2 - LOWEST) * height;
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
