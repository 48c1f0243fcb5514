//! Averaging pictures down.

use rayon::prelude::*;

use super::{Image, linear_steps, srgb};

impl Image {
    /// A smaller picture, each pixel the mean of `factor`² pixels in linear light. Uncovered pixels have no weight in
    /// the colour. [`linear`](Self::linear) is empty. Pixels beyond a multiple of `factor` are dropped.
    ///
    /// # Panics
    /// If `factor` is 0.
    #[must_use]
    pub fn averaged(&self, factor: u32) -> Self {
        let steps = linear_steps();
        let [width, height] = [self.width / factor, self.height / factor];
        let samples = |x: u32, y: u32| {
            let at = move |dx, dy| (y * factor + dy) as usize * self.width as usize + (x * factor + dx) as usize;
            (0..factor).flat_map(move |dy| (0..factor).map(move |dx| self.pixels[at(dx, dy)]))
        };
        let mean = |x, y| {
            let alpha: f32 = samples(x, y).map(|pixel| f32::from(pixel[3])).sum();
            let sum =
                |i: usize| samples(x, y).map(|pixel| steps[usize::from(pixel[i])] * f32::from(pixel[3])).sum::<f32>();
            let channel = |i: usize| if alpha > 0.0 { (srgb(sum(i) / alpha) * 255.0).round() as u8 } else { 0 };
            [channel(0), channel(1), channel(2), (alpha / (factor * factor) as f32).round() as u8]
        };
        let row = |y: u32| (0..width).map(move |x| mean(x, y));
        let pixels = (0..height).into_par_iter().flat_map_iter(row).collect();
        Self { width, height, pixels, linear: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_of_light() {
        let (white, black, nothing) = ([255, 255, 255, 255], [0, 0, 0, 255], [0; 4]);
        let pixels = vec![white, black, [90, 90, 90, 255], nothing, black, white, nothing, nothing];
        let image = Image { width: 4, height: 2, pixels, linear: Vec::new() };
        let small = image.averaged(2);
        assert_eq!([small.width, small.height], [2, 1], "size");
        // Half the light is 188 of 255 in sRGB. Uncovered pixels count for alpha alone.
        assert_eq!(small.pixels, [[188, 188, 188, 255], [90, 90, 90, 64]], "means");
        assert_eq!(image.averaged(1).pixels, image.pixels, "nothing to average");
    }
}
