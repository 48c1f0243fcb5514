//! The numbers of one picture.

use crate::exact::{Exact, Seen};
use crate::flip::Flip;
use crate::light::{Lit, either, psnr};
use crate::picture::{Picture, Shown};
use crate::subject::Subject;
use crate::verdict::{Cover, Verdicts};

/// Angles in degrees between the normals shown and the true ones, 0 to 180, where both pictures show a surface and something
/// is asked about it.
#[derive(Clone, Copy, Debug)]
pub struct Angles {
    /// Mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// Share below 5°.
    pub below_5: f64,
    /// Share below 10°.
    pub below_10: f64,
    /// Share above 90°.
    pub above_90: f64,
    /// Share above 90° to all that is truly seen at the pixel and the eight around it: lit from the wrong side. At an edge either
    /// side may be seen.
    pub flipped: f64,
    /// Mean near silhouettes.
    pub band: f64,
}

/// How much of what a spinning lidar sees is there, where it should be and nowhere else. What it does not see, in shadow or
/// out of its beams' reach, may be there or not.
#[derive(Clone, Copy, Debug)]
pub struct Swept {
    /// Share of the true surface that the sensor sees.
    pub seen: f64,
    /// Of that, what is covered.
    pub closed: f64,
    /// Of that, what is covered by a surface not farther from the true one than rings are apart.
    pub right: f64,
    /// Pixels covered where nothing is, or well before what the sensor does not see, over those that it sees.
    pub over: f64,
}

/// The numbers of one picture.
#[derive(Clone, Copy, Debug)]
pub struct Measures {
    /// How much is where it should be.
    pub cover: Cover,
    /// The same between the rings of a sweep; nothing for points that are not swept.
    pub swept: Option<Swept>,
    /// Errors of normals; nothing for a method that knows none.
    pub angles: Option<Angles>,
    /// Mean error in depth, in pixels at that depth, over the same.
    pub depth_px: f64,
    /// Of the lit picture with the lit truth, decibels, over the pixels that either covers and about which something is
    /// asked.
    pub psnr: f64,
    /// Mean FLIP error of the same over the same.
    pub flip: f64,
}

/// The truth of a case, ready to be compared with.
#[derive(Debug)]
pub struct Truth {
    /// What is there.
    pub exact: Exact,
    /// That, lit.
    pub lit: Lit,
    band: Vec<bool>,
    flip: Flip,
}

impl Truth {
    /// Lights what is there.
    pub fn new(exact: Exact) -> Self {
        let lit = Lit::new(&Picture::truth(&exact), &exact.rays);
        Self { band: exact.band(), flip: Flip::new(&lit.flat(), lit.width), lit, exact }
    }

    /// Measures `picture`, and `lit`, what it looks like.
    pub fn measure(&self, picture: &Picture, lit: &Lit, subject: &Subject) -> Measures {
        Measures {
            cover: Verdicts::new(&self.exact, picture, subject).cover(),
            swept: swept(&self.exact, picture),
            angles: angles(&self.exact, &self.band, picture),
            depth_px: depth_px(&self.exact, picture),
            psnr: self.psnr_against(lit, &self.lit),
            flip: self.flip(lit),
        }
    }

    /// PSNR of `lit` with another lit truth of the same view, over the same pixels as [`Measures::psnr`].
    pub fn psnr_against(&self, lit: &Lit, truth: &Lit) -> f64 {
        psnr(lit, truth, self.compared(lit))
    }

    /// The pixels that either picture covers, but for those that nothing is asked about.
    fn compared<'a>(&'a self, lit: &'a Lit) -> impl Iterator<Item = usize> + 'a {
        either(lit, &self.lit).filter(|&pixel| self.exact.is_asked(pixel))
    }

    /// Mean FLIP error over those.
    fn flip(&self, lit: &Lit) -> f64 {
        let errors = self.flip.errors(&lit.flat());
        let mut mean = Mean::default();
        self.compared(lit).for_each(|pixel| mean.add(errors[pixel]));
        mean.value()
    }
}

/// Degrees between the normal shown at a pixel and the true one, if there are both.
pub fn angle(exact: &Exact, picture: &Picture, pixel: usize) -> Option<f64> {
    between(&exact.seen[pixel]?, &picture.shown[pixel]?)
}

fn between(seen: &Seen, shown: &Shown) -> Option<f64> {
    // The angle's sine is exact where its cosine is not.
    let sine = shown.normal.cross(seen.normal).length();
    (shown.normal.length_squared() > 0.0).then(|| sine.atan2(shown.normal.dot(seen.normal)).to_degrees())
}

/// Whether the normal shown at a pixel is turned away from all true ones there and around.
fn is_flipped(exact: &Exact, picture: &Picture, pixel: usize) -> bool {
    let turned_away = |seen: &Seen| picture.shown[pixel].is_some_and(|shown| between(seen, &shown) > Some(90.0));
    exact.around(pixel, 1).flatten().all(turned_away)
}

fn angles(exact: &Exact, band: &[bool], picture: &Picture) -> Option<Angles> {
    let asked = (0..band.len()).filter(|&pixel| exact.is_asked(pixel));
    let each = asked.filter_map(|pixel| Some((pixel, angle(exact, picture, pixel)?)));
    let mut flipped = 0;
    let mut near = Mean::default();
    let mut all: Vec<f64> = Vec::new();
    for (pixel, angle) in each {
        all.push(angle);
        if band[pixel] {
            near.add(angle);
        }
        flipped += usize::from(is_flipped(exact, picture, pixel));
    }
    all.sort_unstable_by(f64::total_cmp);
    let count = all.len() as f64;
    let below = |limit: f64| all.partition_point(|&angle| angle < limit) as f64 / count;
    Some(Angles {
        mean: all.iter().sum::<f64>() / count,
        median: *all.get(all.len() / 2)?,
        rms: (all.iter().map(|angle| angle * angle).sum::<f64>() / count).sqrt(),
        below_5: below(5.0),
        below_10: below(10.0),
        above_90: 1.0 - below(90.0),
        flipped: flipped as f64 / count,
        band: near.value(),
    })
}

fn swept(exact: &Exact, picture: &Picture) -> Option<Swept> {
    let both = || exact.seen.iter().zip(&picture.shown);
    let here =
        || both().filter_map(|(seen, shown)| seen.filter(|seen| seen.swept == Some(true)).map(|seen| (seen, shown)));
    let count = here().count() as f64;
    let closed = here().filter(|(_, shown)| shown.is_some()).count() as f64;
    let is_right = |seen: &Seen, shown: &Shown| (shown.depth - seen.depth).abs() <= seen.tolerance;
    let right = here().filter(|(seen, shown)| shown.is_some_and(|shown| is_right(seen, &shown))).count() as f64;
    // What is not seen lies in shadow; nothing hangs before it, between what casts the shadow and what it falls on.
    let is_over = |seen: &Option<Seen>, shown: &Shown| match seen {
        None => true,
        Some(seen) => seen.swept == Some(false) && shown.depth < seen.depth - seen.tolerance,
    };
    let over = both().filter(|(seen, shown)| shown.is_some_and(|shown| is_over(seen, &shown))).count() as f64;
    let surface = exact.seen.iter().flatten().count() as f64;
    (count > 0.0).then(|| Swept {
        seen: count / surface,
        closed: closed / count,
        right: right / count,
        over: over / count,
    })
}

fn depth_px(exact: &Exact, picture: &Picture) -> f64 {
    let mut mean = Mean::default();
    for pixel in (0..exact.seen.len()).filter(|&pixel| exact.is_asked(pixel)) {
        if let (Some(seen), Some(shown)) = (&exact.seen[pixel], &picture.shown[pixel]) {
            mean.add((shown.depth - seen.depth).abs() / exact.rays.pixel_size(seen.depth));
        }
    }
    mean.value()
}

/// A mean in the making; no number if there is nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    /// Takes another value.
    pub fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1.0;
    }

    /// The mean.
    pub fn value(&self) -> f64 {
        self.sum / self.count
    }
}

#[cfg(test)]
mod tests {
    use autosplats::cloud::glam::DVec3;
    use autosplats::{Camera, Projection};

    use super::*;
    use crate::view::Rays;

    /// A row of pixels with these normals.
    fn row(normals: [DVec3; 5]) -> Exact {
        let seen = |normal| Seen { depth: 1.0, normal, spacing_px: 1.0, swept: None, sampled: true, tolerance: 0.1 };
        let camera = Camera {
            eye: DVec3::ZERO,
            look_at: DVec3::Z,
            up: DVec3::NEG_Y,
            projection: Projection::OrthographicHeight(1.0),
        };
        let rays = Rays::new(&camera, [5, 1]).expect("a view");
        Exact { width: 5, rays, seen: normals.map(|normal| Some(seen(normal))).to_vec() }
    }

    #[test]
    fn angles_are_summed_up_as_their_names_say() {
        let exact = row([DVec3::NEG_Z; 5]);
        let turned = |degrees: f64| DVec3::new(degrees.to_radians().sin(), 0.0, -degrees.to_radians().cos());
        let shown =
            [40.0, 1.0, 6.0, 93.0, 4.0].map(|angle| Some(Shown { depth: 1.0, normal: turned(angle), point: 0 }));
        let band = [true, false, true, false, false];
        let found = angles(&exact, &band, &Picture { width: 5, shown: shown.to_vec() }).expect("normals");
        let Angles { mean, median, rms, below_5, below_10, above_90, flipped, band } = found;
        // √((40² + 1² + 6² + 93² + 4²) / 5)
        let expected = [28.8, 6.0, (10302.0_f64 / 5.0).sqrt(), 0.4, 0.6, 0.2, 0.2, 23.0];
        let found = [mean, median, rms, below_5, below_10, above_90, flipped, band];
        let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-9, "{found:?}, not {expected:?}");
    }

    #[test]
    fn the_other_side_of_an_edge_is_not_flipped() {
        let sides = [0.9, 0.9, 0.9, -0.9, -0.9].map(|x| DVec3::new(x, 0.0, -0.44).normalize());
        let exact = row(sides);
        let shares = |wrong: usize| {
            let mut shown = sides.map(|normal| Some(Shown { depth: 1.0, normal, point: 0 }));
            shown[wrong] = Some(Shown { depth: 1.0, normal: sides[4], point: 0 });
            let angles = angles(&exact, &[false; 5], &Picture { width: 5, shown: shown.to_vec() }).expect("normals");
            [angles.above_90, angles.flipped].map(|share| (5.0 * share).round() as usize)
        };
        assert_eq!(shares(2), [1, 0], "beside the edge it is what is seen beyond");
        assert_eq!(shares(0), [1, 1], "further away it is wrong");
    }
}
