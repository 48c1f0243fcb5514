//! The measures of one picture.

use crate::exact::{Exact, TrueSurface};
use crate::flip::Flip;
use crate::light::{Lit, either, psnr};
use crate::picture::{DrawnSurface, Picture};
use crate::subject::Subject;
use crate::verdict::{Cover, Verdicts};

/// Errors of normals: angles between drawn and true normals, 0° to 180°, over all measured pixels that both pictures
/// cover.
#[derive(Clone, Copy, Debug)]
pub struct Angles {
    /// Mean angle, degrees.
    pub mean: f64,
    /// Median angle, degrees.
    pub median: f64,
    /// Root mean square of the angles, degrees.
    pub rms: f64,
    /// Share of angles below 5°.
    pub below_5: f64,
    /// Share of angles below 10°.
    pub below_10: f64,
    /// Share of angles above 90°.
    pub above_90: f64,
    /// Share of pixels lit from the wrong side: the angles to all true normals at the pixel and the eight around it are
    /// above 90°. The eight count because at an edge either side may be drawn.
    pub flipped: f64,
    /// Mean angle within 4 pixels of a silhouette, degrees.
    pub band: f64,
}

/// How well a picture covers the surface that a spinning lidar sees: between its lowest and highest beam, with nothing
/// in the way, at an angle of incidence of at most 87°. The rest may be covered or not.
#[derive(Clone, Copy, Debug)]
pub struct Swept {
    /// Share of the true surface that the lidar sees.
    pub seen: f64,
    /// Share of the seen surface that is covered, at any depth. 1 is out of reach: no point says where a surface ends
    /// past its last ring.
    pub closed: f64,
    /// Share of the seen surface that is covered at the true depth, within a tolerance of the spacing of rings.
    pub right: f64,
    /// Number of pixels covered outside the surface or well in front of unseen parts, over that of seen pixels.
    /// Gaps between rings should be closed, but not what is truly open.
    pub over: f64,
}

/// The measures of one picture.
#[derive(Clone, Copy, Debug)]
pub struct Measures {
    /// Cover of the sampled surface.
    pub cover: Cover,
    /// Cover between the rings of a lidar. `None` for sampled points.
    pub swept: Option<Swept>,
    /// Errors of normals. `None` for methods without normals.
    pub angles: Option<Angles>,
    /// Mean error in depth over measured pixels that both pictures cover, in pixels at the true depth.
    pub depth_px: f64,
    /// Peak signal-to-noise ratio of the lit picture with the lit truth, decibels, over measured pixels that either
    /// covers.
    pub psnr: f64,
    /// Mean FLIP error of the lit picture, 0 to 1, over the same pixels as [`psnr`](Self::psnr).
    pub flip: f64,
}

/// The true picture of a case, prepared for comparisons.
#[derive(Debug)]
pub struct Truth {
    /// The true surface.
    pub exact: Exact,
    /// The lit true picture.
    pub lit: Lit,
    band: Vec<bool>,
    flip: Flip,
}

impl Truth {
    /// Lights the true surface.
    pub fn new(exact: Exact) -> Self {
        let lit = Lit::new(&Picture::truth(&exact), &exact.rays);
        Self { band: exact.band(), flip: Flip::new(&lit.flat(), lit.width), lit, exact }
    }

    /// Measures `picture`. `lit` is the same picture, lit.
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

    /// PSNR in decibels of `lit` with another lit truth of the view, over the same pixels as [`Measures::psnr`].
    pub fn psnr_against(&self, lit: &Lit, truth: &Lit) -> f64 {
        psnr(lit, truth, self.compared(lit))
    }

    /// The measured pixels that the picture or the truth covers.
    fn compared<'a>(&'a self, lit: &'a Lit) -> impl Iterator<Item = usize> + 'a {
        either(lit, &self.lit).filter(|&pixel| self.exact.is_measured(pixel))
    }

    /// Mean FLIP error over the compared pixels.
    fn flip(&self, lit: &Lit) -> f64 {
        let errors = self.flip.errors(&lit.flat());
        let mut mean = Mean::default();
        self.compared(lit).for_each(|pixel| mean.add(errors[pixel]));
        mean.value()
    }
}

/// Angle between the drawn and the true normal of a pixel, degrees. `None` if one is missing.
pub fn angle(exact: &Exact, picture: &Picture, pixel: usize) -> Option<f64> {
    between(&exact.seen[pixel]?, &picture.shown[pixel]?)
}

fn between(seen: &TrueSurface, shown: &DrawnSurface) -> Option<f64> {
    // The sine is precise at small angles, unlike the cosine.
    let sine = shown.normal.cross(seen.normal).length();
    (shown.normal.length_squared() > 0.0).then(|| sine.atan2(shown.normal.dot(seen.normal)).to_degrees())
}

/// Whether the drawn normal is more than 90° off all true normals at the pixel and the eight around it.
fn is_flipped(exact: &Exact, picture: &Picture, pixel: usize) -> bool {
    let turned_away = |seen: &TrueSurface| picture.shown[pixel].is_some_and(|shown| between(seen, &shown) > Some(90.0));
    exact.around(pixel, 1).flatten().all(turned_away)
}

fn angles(exact: &Exact, band: &[bool], picture: &Picture) -> Option<Angles> {
    let asked = (0..band.len()).filter(|&pixel| exact.is_measured(pixel));
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
    let is_right = |seen: &TrueSurface, shown: &DrawnSurface| (shown.depth - seen.depth).abs() <= seen.tolerance;
    let right = here().filter(|(seen, shown)| shown.is_some_and(|shown| is_right(seen, &shown))).count() as f64;
    // Unseen surfaces lie in shadow. Nothing should float in front of them, on the way to what casts the shadow.
    let is_over = |seen: &Option<TrueSurface>, shown: &DrawnSurface| match seen {
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
    for pixel in (0..exact.seen.len()).filter(|&pixel| exact.is_measured(pixel)) {
        if let (Some(seen), Some(shown)) = (&exact.seen[pixel], &picture.shown[pixel]) {
            mean.add((shown.depth - seen.depth).abs() / exact.rays.pixel_size(seen.depth));
        }
    }
    mean.value()
}

/// A running mean. Without values it is NaN.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    /// Adds a value.
    pub fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1.0;
    }

    /// The mean of all added values.
    pub fn value(&self) -> f64 {
        self.sum / self.count
    }
}

#[cfg(test)]
mod tests {
    use autosplats::cloud::glam::DVec3;
    use autosplats::{Camera, Projection};

    use super::*;
    use crate::rays::Rays;

    /// A true picture of one row of pixels with these normals.
    fn row(normals: [DVec3; 5]) -> Exact {
        let seen =
            |normal| TrueSurface { depth: 1.0, normal, spacing_px: 1.0, swept: None, sampled: true, tolerance: 0.1 };
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
            [40.0, 1.0, 6.0, 93.0, 4.0].map(|angle| Some(DrawnSurface { depth: 1.0, normal: turned(angle), point: 0 }));
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
            let mut shown = sides.map(|normal| Some(DrawnSurface { depth: 1.0, normal, point: 0 }));
            shown[wrong] = Some(DrawnSurface { depth: 1.0, normal: sides[4], point: 0 });
            let angles = angles(&exact, &[false; 5], &Picture { width: 5, shown: shown.to_vec() }).expect("normals");
            [angles.above_90, angles.flipped].map(|share| (5.0 * share).round() as usize)
        };
        assert_eq!(shares(2), [1, 0], "beside the edge, the normal is the one beyond the edge");
        assert_eq!(shares(0), [1, 1], "further from the edge, the normal is wrong");
    }
}
