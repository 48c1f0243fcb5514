//! The changes of pictures while the camera moves.
//!
//! A surface point should look the same in successive pictures, apart from true changes: the light moves with the
//! camera. The true surface says which pixels show the same point.

use crate::exact::Exact;
use crate::light::{Lit, to_linear};
use crate::measure::Mean;
use crate::picture::Picture;

/// Number of measured steps of a movement.
pub const STEPS: usize = 6;
/// Number of pictures of the same movement before the measured ones. They fill the averages over pictures, so that only
/// lasting flicker is measured.
pub const LEAD_IN_STEPS: usize = 8;
/// Angle of each step around the subject, degrees.
pub const STEP_DEGREES: f64 = 0.7;
/// Greatest difference in depth at which two pictures show the same point, pixels.
const MAX_DEPTH_DIFFERENCE_PX: f64 = 3.0;

/// Mean changes of a surface point from one picture to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Change of the normal, degrees.
    pub degrees: f64,
    /// Change of the lightness, in 255ths.
    pub lightness: f64,
}

/// Running means of changes over the steps of a movement.
#[derive(Clone, Copy, Debug, Default)]
pub struct Changes {
    degrees: Mean,
    lightness: Mean,
}

/// Pairs of pixels in two pictures that show the same surface point.
pub fn same(from: &Exact, to: &Exact) -> Vec<(usize, usize)> {
    let [width, height] = [from.width, from.height()];
    let pair = |pixel: usize| {
        let seen = from.seen[pixel]?;
        let (origin, direction) = from.rays.through([pixel % width, pixel / width].map(|at| at as f64 + 0.5));
        let place = origin + direction * (seen.depth / direction.dot(from.rays.axes[2]));
        let ([x, y], depth) = to.rays.project(place)?;
        if !(x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64) {
            return None;
        }
        let other = y as usize * width + x as usize;
        let is_same = (to.seen[other]?.depth - depth).abs() < MAX_DEPTH_DIFFERENCE_PX * to.rays.pixel_size(depth);
        is_same.then_some((pixel, other))
    };
    (0..from.seen.len()).filter_map(pair).collect()
}

impl Changes {
    /// Adds the step from one picture to the next. `same` are the pairs of pixels that show the same point.
    pub fn add(&mut self, same: &[(usize, usize)], [before, after]: [(&Picture, &Lit); 2]) {
        for &(from, to) in same {
            if let (Some(one), Some(other)) = (before.0.shown[from], after.0.shown[to])
                && one.normal.length_squared() * other.normal.length_squared() > 0.0
            {
                let sine = one.normal.cross(other.normal).length();
                self.degrees.add(sine.atan2(one.normal.dot(other.normal)).to_degrees());
            }
            let [one, other] = [before.1.over_background(from), after.1.over_background(to)].map(lightness);
            self.lightness.add((one - other).abs());
        }
    }

    /// The mean changes. That of normals is NaN for methods without normals.
    pub fn mean(&self) -> Change {
        Change { degrees: self.degrees.value(), lightness: self.lightness.value() }
    }
}

/// Lightness of an sRGB colour, 0 to 255.
fn lightness(srgb: [f64; 3]) -> f64 {
    let [r, g, b] = srgb.map(to_linear);
    255.0 * crate::light::to_srgb((0.2126 * r + 0.7152 * g + 0.0722 * b).clamp(0.0, 1.0))
}
