//! The points of a spinning lidar: dense along rings, far apart between rings.
//!
//! # How it works
//! The sensor turns about the vertical in constant steps. At each step it sends all its beams, at constant steps of
//! elevation. A ray that hits the surface makes a point there. The spacing of points at a place follows from these
//! steps. Neighbour searches would give a wrong spacing: the nearest neighbours of a point are often all on its own
//! ring.

use std::f64::consts::TAU;

use autosplats::cloud::glam::DVec3;
use rayon::prelude::*;

use crate::surface::Surface;

/// Least cosine of the angle of incidence at which the sensor sees a place: that of 87°.
const MIN_INCIDENCE_COSINE: f64 = 0.0523;
/// Greatest difference of two distances from the sensor to one place, as a share of the distance.
const MAX_DISTANCE_DIFFERENCE: f64 = 1e-3;

/// A spinning lidar and its place. Lengths are in metres, as in scenes, angles in degrees. The z axis points up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Position of the sensor.
    pub eye: [f64; 3],
    /// Elevations of the lowest and the highest beam, degrees.
    pub elevations: [f64; 2],
    /// Number of beams, at least 2.
    pub beams: usize,
    /// Number of steps in a turn.
    pub azimuths: usize,
    /// Standard deviation of noise along the ray, metres.
    pub noise: f64,
}

impl Sweep {
    /// A sensor without noise.
    pub const fn new(eye: [f64; 3], elevations: [f64; 2], beams: usize, azimuths: usize) -> Self {
        Self { eye, elevations, beams, azimuths, noise: 0.0 }
    }

    /// The same sensor with noise of this standard deviation in metres.
    pub const fn noise(self, noise: f64) -> Self {
        Self { noise, ..self }
    }

    /// Number of rays in a turn.
    pub const fn count(&self) -> usize {
        self.beams * self.azimuths
    }

    /// Position of the sensor.
    pub fn origin(&self) -> DVec3 {
        DVec3::from(self.eye)
    }

    /// Radians between beams, and between steps of the turn.
    fn steps(&self) -> [f64; 2] {
        let [low, high] = self.elevations;
        [(high - low).to_radians() / (self.beams - 1) as f64, TAU / self.azimuths as f64]
    }

    /// Unit direction of a ray. Rays are ordered by step of the turn, then by beam from the lowest up.
    fn direction(&self, ray: usize) -> DVec3 {
        let [up, around] = self.steps();
        let (beam, azimuth) = (ray % self.beams, ray / self.beams);
        let (sin, cos) = (self.elevations[0].to_radians() + up * beam as f64).sin_cos();
        // The half step keeps rays off the axes, along which walls run.
        let (y, x) = (around * (azimuth as f64 + 0.5)).sin_cos();
        DVec3::new(cos * x, cos * y, sin)
    }

    /// The intersections of the rays with the surface, in the order of the rays.
    pub fn points(&self, surface: &Surface) -> Vec<DVec3> {
        let origin = self.origin();
        let meet = |ray: usize| {
            let direction = self.direction(ray);
            surface.trace(origin, direction).map(|hit| origin + direction * hit.distance)
        };
        (0..self.count()).into_par_iter().filter_map(meet).collect()
    }

    /// Distance on the surface between neighbouring points at `place`: along the ring or across rings, whichever is
    /// longer. Infinite where the sensor does not see the surface.
    pub fn gap(&self, surface: &Surface, place: DVec3) -> f64 {
        let offset = place - self.origin();
        let (range, direction) = (offset.length(), offset.normalize());
        let elevation = direction.z.asin().to_degrees();
        if !(self.elevations[0]..=self.elevations[1]).contains(&elevation) {
            return f64::INFINITY;
        }
        let hit = surface.trace(self.origin(), direction);
        let Some(hit) = hit.filter(|hit| (hit.distance - range).abs() < MAX_DISTANCE_DIFFERENCE * range) else {
            return f64::INFINITY;
        };
        let cos = hit.normal.dot(direction);
        if !(cos.abs() >= MIN_INCIDENCE_COSINE) {
            return f64::INFINITY;
        }
        let [up, around] = self.steps();
        let aside = DVec3::Z.cross(direction);
        // A small turn shifts the ray's end by range times angle. From there the ray goes on to the tangent plane.
        let gap = |turned: DVec3| range * (turned - direction * (turned.dot(hit.normal) / cos)).length();
        gap(aside * around).max(gap(direction.cross(aside).normalize_or(DVec3::X) * up))
    }
}
