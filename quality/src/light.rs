//! Lighting of pictures for comparisons: the renderer's own, for given depths and normals.

use autosplats::cloud::glam::DVec3;
use autosplats::{Background, ColorMode, GBuffer, Image, Shading, shade_layers};
use rayon::prelude::*;

use crate::picture::Picture;
use crate::rays::Rays;

/// Colour of the background, sRGB.
pub const BACKGROUND: [u8; 3] = [36, 41, 48];

/// A lit picture, in rows of pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Lit {
    /// Number of pixels in a row.
    pub width: usize,
    /// Colours of covered pixels, sRGB, 0 to 1.
    pub pixels: Vec<Option<[f64; 3]>>,
    /// Colours of all pixels, sRGB, 0 to 1: at edges the background is mixed with the surface beside it.
    around: Vec<[f64; 3]>,
}

impl Lit {
    /// Lights `picture` in one clay tone. Pixels without a normal are lit as if they faced the eye; occlusion shows the
    /// shape, as in viewers that draw dots.
    pub fn new(picture: &Picture, rays: &Rays) -> Self {
        let [width, height] = [picture.width, picture.height()];
        let mut layers = GBuffer::new(width as u32, height as u32);
        for (pixel, shown) in picture.shown.iter().enumerate() {
            let Some(shown) = shown else { continue };
            let index = layers.index(pixel % width, pixel / width);
            let normal = if shown.normal == DVec3::ZERO { DVec3::NEG_Z } else { rays.turned(shown.normal) };
            layers.weight[index] = 1.0;
            layers.depth[index] = shown.depth as f32;
            layers.normal[index] = normal.as_vec3().to_array();
        }
        let background = Background::Color(BACKGROUND);
        let shading = Shading { color: ColorMode::Plain, background, ..Shading::default() };
        let image = shade_layers(&layers, &rays.camera, &shading).expect("layers have the picture's size");
        Self::of(&image, picture)
    }

    /// The image that the renderer lit itself, over [`BACKGROUND`]. `picture` says which pixels are covered.
    pub fn of(image: &Image, picture: &Picture) -> Self {
        let width = picture.width;
        let around: Vec<[f64; 3]> =
            image.pixels.iter().map(|&[r, g, b, _]| [r, g, b].map(|channel| f64::from(channel) / 255.0)).collect();
        let pixels = picture.shown.iter().zip(&around).map(|(shown, &color)| shown.map(|_| color)).collect();
        Self { width, pixels, around }
    }

    /// Colour of a pixel over the background, sRGB, 0 to 1.
    pub fn over_background(&self, pixel: usize) -> [f64; 3] {
        self.pixels[pixel].unwrap_or(self.around[pixel])
    }

    /// Colours of all pixels over the background, sRGB, 0 to 1.
    pub fn flat(&self) -> Vec<[f64; 3]> {
        (0..self.pixels.len()).map(|pixel| self.over_background(pixel)).collect()
    }

    /// The picture with each block of `factor`² pixels averaged in linear light. A block is covered if any of its
    /// pixels is.
    #[must_use]
    pub fn averaged(&self, factor: usize) -> Self {
        let [width, height] = [self.width / factor, self.pixels.len() / self.width / factor];
        let parts = |pixel: usize| {
            let [x, y] = [pixel % width, pixel / width].map(|at| at * factor);
            (0..factor).flat_map(move |dy| (0..factor).map(move |dx| (y + dy) * self.width + x + dx))
        };
        let mean = |pixel: usize| {
            let colors = parts(pixel).map(|part| self.over_background(part).map(to_linear));
            let sum = colors.fold([0.0; 3], |sum, color| [0, 1, 2].map(|i| sum[i] + color[i]));
            sum.map(|channel| to_srgb(channel / (factor * factor) as f64))
        };
        let around: Vec<_> = (0..width * height).into_par_iter().map(mean).collect();
        let is_covered = |pixel: usize| parts(pixel).any(|part| self.pixels[part].is_some());
        let pixels = around.iter().enumerate().map(|(pixel, &color)| is_covered(pixel).then_some(color)).collect();
        Self { width, pixels, around }
    }

    /// The picture with the colour of each covered pixel replaced by the result of `change`.
    #[must_use]
    pub fn changed(&self, change: impl Fn(usize, [f64; 3]) -> [f64; 3]) -> Self {
        let change = |(pixel, color): (usize, &Option<[f64; 3]>)| color.map(|color| change(pixel, color));
        let pixels = self.pixels.iter().enumerate().map(change).collect();
        Self { width: self.width, pixels, around: self.around.clone() }
    }
}

/// Converts a linear value to sRGB, both 0 to 1.
pub fn to_srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Converts an sRGB value to linear, both 0 to 1.
pub fn to_linear(srgb: f64) -> f64 {
    if srgb <= 0.040_45 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

/// Peak signal-to-noise ratio over some pixels, decibels.
pub fn psnr(lit: &Lit, truth: &Lit, pixels: impl Iterator<Item = usize>) -> f64 {
    let mut sum = 0.0;
    let mut count = 0;
    for pixel in pixels {
        let (ours, theirs) = (lit.over_background(pixel), truth.over_background(pixel));
        sum += (0..3).map(|i| (ours[i] - theirs[i]).powi(2)).sum::<f64>();
        count += 3;
    }
    -10.0 * (sum / f64::from(count)).log10()
}

/// Indices of the pixels that either picture covers.
pub fn either<'a>(lit: &'a Lit, truth: &'a Lit) -> impl Iterator<Item = usize> + 'a {
    (0..lit.pixels.len()).filter(|&pixel| lit.pixels[pixel].is_some() || truth.pixels[pixel].is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_of_light_and_cover_what_any_part_covers() {
        let [black, white] = [[0.0; 3], [1.0; 3]];
        let around = vec![black, white, black, black, white, black, black, black];
        let pixels = around.iter().enumerate().map(|(pixel, &color)| (pixel % 4 < 2).then_some(color)).collect();
        let small = Lit { width: 4, pixels, around }.averaged(2);
        // Half the light is 188 of 255 in sRGB.
        let [mean, rest] = [small.pixels[0].expect("covered"), small.around[1]].map(|color| (color[0] * 255.0).round());
        assert_eq!([small.width, small.pixels.len()], [2, 2], "size");
        assert_eq!(([mean, rest], small.pixels[1]), ([188.0, 0.0], None), "the mean colour, and an empty pixel");
    }
}
