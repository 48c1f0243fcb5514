//! The light that pictures are compared in: the renderer's own, over any depths and normals.
//!
//! The formula stands here once more, so that the truth can be lit without the renderer; a test holds it against the
//! renderer's pictures.

use autosplats::cloud::glam::DVec3;
use rayon::prelude::*;

use crate::picture::Picture;
use crate::view::Rays;

/// One clay tone, linear.
const CLAY: [f64; 3] = [0.53, 0.50, 0.46];
/// Key light: direction (right, down, forward), strength, and how far it reaches around.
const KEY: (DVec3, f64, f64) = (DVec3::new(-0.47, -0.62, -0.63), 0.74, 0.15);
/// Fill light.
const FILL: (DVec3, f64) = (DVec3::new(0.80, 0.05, -0.60), 0.13);
/// Light of the sky on surfaces that face down and up.
const SKY: [f64; 2] = [0.05, 0.18];
/// Neighbours looked at by eye-dome lighting, in pixels.
const EYE_DOME: [[isize; 2]; 8] = [[-2, 0], [2, 0], [0, -2], [0, 2], [-1, -1], [1, -1], [-1, 1], [1, 1]];
/// What is seen where no surface is, sRGB.
pub const BACKGROUND: [f64; 3] = [0.14, 0.16, 0.19];

/// A lit picture, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Lit {
    /// Pixels in a row.
    pub width: usize,
    /// sRGB, 0 to 1; nothing where no surface is.
    pub pixels: Vec<Option<[f64; 3]>>,
}

impl Lit {
    /// Lights `picture`. Pixels without a normal are lit as if they faced the eye, with eye-dome lighting to show the
    /// shape, as viewers of dots do.
    pub fn new(picture: &Picture, rays: &Rays) -> Self {
        let pixel = |index: usize| {
            linear(picture, rays, index).map(|color| color.map(|channel| to_srgb(channel.clamp(0.0, 1.0))))
        };
        Self { width: picture.width, pixels: (0..picture.shown.len()).into_par_iter().map(pixel).collect() }
    }

    /// sRGB of a pixel, 0 to 1, over the background.
    pub fn over_background(&self, pixel: usize) -> [f64; 3] {
        self.pixels[pixel].unwrap_or(BACKGROUND)
    }

    /// All pixels over the background.
    pub fn flat(&self) -> Vec<[f64; 3]> {
        (0..self.pixels.len()).map(|pixel| self.over_background(pixel)).collect()
    }

    /// The picture with each pixel's colour changed.
    #[must_use]
    pub fn changed(&self, change: impl Fn(usize, [f64; 3]) -> [f64; 3]) -> Self {
        let change = |(pixel, color): (usize, &Option<[f64; 3]>)| color.map(|color| change(pixel, color));
        Self { width: self.width, pixels: self.pixels.iter().enumerate().map(change).collect() }
    }
}

/// The linear colour of a pixel, if a surface covers it.
pub fn linear(picture: &Picture, rays: &Rays, index: usize) -> Option<[f64; 3]> {
    let shown = picture.shown[index]?;
    let normal = if shown.normal == DVec3::ZERO { DVec3::NEG_Z } else { rays.turned(shown.normal) };
    let light = light(normal) * eye_dome(picture, rays, index, shown.depth);
    Some(CLAY.map(|channel| channel * light))
}

fn light(normal: DVec3) -> f64 {
    let (key, key_light, wrap) = KEY;
    let key = ((normal.dot(key) + wrap) / (1.0 + wrap)).max(0.0);
    let (fill, fill_light) = FILL;
    let fill = normal.dot(fill).max(0.0);
    let sky = SKY[0] + (SKY[1] - SKY[0]) * (0.5 - 0.5 * normal.y);
    key_light * key + fill_light * fill + sky
}

/// How much light is left beside nearer surfaces.
fn eye_dome(picture: &Picture, rays: &Rays, index: usize, depth: f64) -> f64 {
    let [x, y] = [index % picture.width, index / picture.width];
    let unit = rays.pixel_size(depth);
    let mut shadow = 0.0;
    for [dx, dy] in EYE_DOME {
        let (Some(nx), Some(ny)) = (x.checked_add_signed(dx), y.checked_add_signed(dy)) else { continue };
        if nx >= picture.width || ny >= picture.height() {
            continue;
        }
        let Some(near) = picture.shown[ny * picture.width + nx] else { continue };
        let slope = (depth - near.depth) / (unit * ((dx * dx + dy * dy) as f64).sqrt());
        shadow += if slope > 1.0 { (slope - 1.0) / (slope + 3.0) } else { 0.0 };
    }
    let shadow = shadow / EYE_DOME.len() as f64;
    1.0 / (1.0 + shadow + 0.5 * shadow * shadow)
}

/// sRGB value, 0 to 1, of a linear value 0 to 1.
pub fn to_srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Linear value, 0 to 1, of an sRGB value 0 to 1.
pub fn to_linear(srgb: f64) -> f64 {
    if srgb <= 0.040_45 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

/// Peak signal-to-noise ratio in decibels, over the pixels that either picture covers.
pub fn psnr(lit: &Lit, truth: &Lit) -> f64 {
    let mut sum = 0.0;
    let mut count = 0;
    for pixel in either(lit, truth) {
        let (ours, theirs) = (lit.over_background(pixel), truth.over_background(pixel));
        sum += (0..3).map(|i| (ours[i] - theirs[i]).powi(2)).sum::<f64>();
        count += 3;
    }
    -10.0 * (sum / f64::from(count)).log10()
}

/// The pixels that either picture covers.
pub fn either<'a>(lit: &'a Lit, truth: &'a Lit) -> impl Iterator<Item = usize> + 'a {
    (0..lit.pixels.len()).filter(|&pixel| lit.pixels[pixel].is_some() || truth.pixels[pixel].is_some())
}
