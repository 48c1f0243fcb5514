//! Averaging pictures down.

use rayon::prelude::*;

use super::encode::{encode_bounds, encode_table, nearest};
use super::{Image, linear_steps};

impl Image {
    /// A smaller picture, each pixel the mean of `factor`² pixels in linear light. Uncovered pixels have no weight in
    /// the colour. [`linear`](Self::linear) is empty. Pixels beyond a multiple of `factor` are dropped.
    ///
    /// # Panics
    /// If `factor` is 0.
    #[must_use]
    pub fn averaged(&self, factor: u32) -> Self {
        let (steps, table, bounds) = (linear_steps(), encode_table(), encode_bounds());
        let [width, height] = [self.width / factor, self.height / factor];
        let per_mean = (factor * factor) as f32;
        let (factor, all_columns) = (factor as usize, self.width as usize);
        let mean = |rows: &[[u8; 4]], x: usize| {
            let (mut sum, mut alpha) = ([0f32; 3], 0f32);
            for &[r, g, b, a] in rows.chunks(all_columns).flat_map(|row| &row[x * factor..][..factor]) {
                let weight = f32::from(a);
                alpha += weight;
                sum[0] += steps[usize::from(r)] * weight;
                sum[1] += steps[usize::from(g)] * weight;
                sum[2] += steps[usize::from(b)] * weight;
            }
            let [r, g, b] = sum.map(|sum| if alpha > 0.0 { nearest(table, bounds, sum / alpha) } else { 0 });
            [r, g, b, (alpha / per_mean + 0.5) as u8]
        };
        let mut pixels = bytemuck::zeroed_vec(width as usize * height as usize);
        let rows = pixels.par_chunks_mut(width.max(1) as usize).zip(self.pixels.par_chunks(factor * all_columns));
        rows.for_each(|(out, rows)| out.iter_mut().enumerate().for_each(|(x, out)| *out = mean(rows, x)));
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
