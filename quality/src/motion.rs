//! How steady pictures are while the camera moves.
//!
//! A surface point seen in two pictures after one another should look the same in both, but for what the light, which goes
//! with the camera, truly changes. The true surface says which pixels show the same point.

use crate::exact::Exact;
use crate::light::{Lit, to_linear};
use crate::measure::Mean;
use crate::picture::Picture;

/// Steps in a movement.
pub const STEPS: usize = 6;
/// Pictures of the same movement before them, so that what is averaged over pictures has enough of them: what is measured is the
/// flicker that stays.
pub const LEAD_IN: usize = 8;
/// Degrees around the subject for each step.
pub const STEP_DEGREES: f64 = 0.7;
/// Pixels in depth within which two pictures show the same place.
const SAME_PX: f64 = 3.0;

/// Mean changes of one surface point from a picture to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Of the normal, degrees.
    pub degrees: f64,
    /// Of the lightness shown, in 255ths.
    pub lightness: f64,
}

/// Sums up changes over the steps of a movement.
#[derive(Clone, Copy, Debug, Default)]
pub struct Changes {
    degrees: Mean,
    lightness: Mean,
}

/// The pixels of two pictures that show the same surface point.
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
        let is_same = (to.seen[other]?.depth - depth).abs() < SAME_PX * to.rays.pixel_size(depth);
        is_same.then_some((pixel, other))
    };
    (0..from.seen.len()).filter_map(pair).collect()
}

impl Changes {
    /// Takes the step from one picture to the next; `same` are the pixels that show the same.
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

    /// The means; degrees are no number for a method that knows no normals.
    pub fn mean(&self) -> Change {
        Change { degrees: self.degrees.value(), lightness: self.lightness.value() }
    }
}

/// Grey value of an sRGB colour, 0 to 255.
fn lightness(srgb: [f64; 3]) -> f64 {
    let [r, g, b] = srgb.map(to_linear);
    255.0 * crate::light::to_srgb((0.2126 * r + 0.7152 * g + 0.0722 * b).clamp(0.0, 1.0))
}
