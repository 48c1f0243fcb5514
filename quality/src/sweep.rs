//! Points as a spinning lidar sees them: dense along rings, far apart from ring to ring.
//!
//! # How it works
//! The sensor turns about the vertical and sends its beams at constant steps of elevation, all of them at each of the
//! constant steps of a turn. A ray that meets the surface leaves a point there. From the same steps follows, without
//! asking for neighbours, how far apart points are at a place: where rings lie far apart the nearest neighbours are all
//! on one of them, and would tell how close points are along it.

use std::f64::consts::TAU;

use autosplats::cloud::glam::DVec3;
use rayon::prelude::*;

use crate::surface::Surface;

/// Cosine of the flattest incidence, 87°, at which a place counts as seen.
const FLATTEST: f64 = 0.0523;
/// Share of the way to a place at which something else is in the way.
const BEFORE: f64 = 1e-3;

/// A spinning lidar and where it stands. Lengths are in metres, as scenes are, angles in degrees; z is up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Where the sensor is.
    pub eye: [f64; 3],
    /// Elevation of the lowest and of the highest beam.
    pub elevations: [f64; 2],
    /// Beams, at least two.
    pub beams: usize,
    /// Steps in a turn.
    pub azimuths: usize,
    /// Standard deviation of noise along the ray.
    pub noise: f64,
}

impl Sweep {
    /// A sensor without noise.
    pub const fn new(eye: [f64; 3], elevations: [f64; 2], beams: usize, azimuths: usize) -> Self {
        Self { eye, elevations, beams, azimuths, noise: 0.0 }
    }

    /// The same with noise.
    pub const fn noise(self, noise: f64) -> Self {
        Self { noise, ..self }
    }

    /// Rays in a turn.
    pub const fn count(&self) -> usize {
        self.beams * self.azimuths
    }

    /// Where the sensor is.
    pub fn origin(&self) -> DVec3 {
        DVec3::from(self.eye)
    }

    /// Radians from one beam to the next, and from one step of the turn to the next.
    fn steps(&self) -> [f64; 2] {
        let [low, high] = self.elevations;
        [(high - low).to_radians() / (self.beams - 1) as f64, TAU / self.azimuths as f64]
    }

    /// Unit direction of a ray: the beams of one step of the turn follow each other, the lowest first.
    fn direction(&self, ray: usize) -> DVec3 {
        let [up, around] = self.steps();
        let (beam, azimuth) = (ray % self.beams, ray / self.beams);
        let (sin, cos) = (self.elevations[0].to_radians() + up * beam as f64).sin_cos();
        // Half a step off the axes, which run along walls.
        let (y, x) = (around * (azimuth as f64 + 0.5)).sin_cos();
        DVec3::new(cos * x, cos * y, sin)
    }

    /// Where the rays meet the surface, in their order.
    pub fn points(&self, surface: &Surface) -> Vec<DVec3> {
        let origin = self.origin();
        let meet = |ray: usize| {
            let direction = self.direction(ray);
            surface.trace(origin, direction).map(|hit| origin + direction * hit.distance)
        };
        (0..self.count()).into_par_iter().filter_map(meet).collect()
    }

    /// Distance on the surface at `place` between points that are next to each other, along the ring or across, whichever
    /// is the longer; infinite where the sensor sees nothing of it.
    pub fn gap(&self, surface: &Surface, place: DVec3) -> f64 {
        let offset = place - self.origin();
        let (range, direction) = (offset.length(), offset.normalize());
        let elevation = direction.z.asin().to_degrees();
        if !(self.elevations[0]..=self.elevations[1]).contains(&elevation) {
            return f64::INFINITY;
        }
        let hit = surface.trace(self.origin(), direction);
        let Some(hit) = hit.filter(|hit| (hit.distance - range).abs() < BEFORE * range) else { return f64::INFINITY };
        let cos = hit.normal.dot(direction);
        if !(cos.abs() >= FLATTEST) {
            return f64::INFINITY;
        }
        let [up, around] = self.steps();
        let aside = DVec3::Z.cross(direction);
        // A ray turned by a small angle leaves the point it met by as much, and then goes on to the tangent plane.
        let gap = |turned: DVec3| range * (turned - direction * (turned.dot(hit.normal) / cos)).length();
        gap(aside * around).max(gap(direction.cross(aside).normalize_or(DVec3::X) * up))
    }
}
