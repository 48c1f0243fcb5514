//! Pictures averaged down.

use autosplats::Image;
use rayon::prelude::*;

/// Each pixel the mean of `factor`² pixels, in linear light. The sides of `image` are multiples of `factor`.
pub(crate) fn shrink(image: &Image, factor: u32) -> Image {
    let linear: [f32; 256] = std::array::from_fn(|step| to_linear(step as f32 / 255.0));
    let [width, height] = [image.width / factor, image.height / factor];
    let samples = |x: u32, y: u32| {
        let at = move |dx, dy| (y * factor + dy) as usize * image.width as usize + (x * factor + dx) as usize;
        (0..factor).flat_map(move |dy| (0..factor).map(move |dx| image.pixels[at(dx, dy)]))
    };
    let mean = |x, y| {
        // What is not covered has no say in the colour.
        let alpha: f32 = samples(x, y).map(|pixel| f32::from(pixel[3])).sum();
        let sum =
            |i: usize| samples(x, y).map(|pixel| linear[usize::from(pixel[i])] * f32::from(pixel[3])).sum::<f32>();
        let channel = |i: usize| if alpha > 0.0 { (to_srgb(sum(i) / alpha) * 255.0).round() as u8 } else { 0 };
        [channel(0), channel(1), channel(2), (alpha / (factor * factor) as f32).round() as u8]
    };
    let row = |y: u32| (0..width).map(move |x| mean(x, y));
    let pixels = (0..height).into_par_iter().flat_map_iter(row).collect();
    Image { width, height, pixels, linear: Vec::new() }
}

/// Linear value, 0 to 1, of an sRGB value 0 to 1.
fn to_linear(srgb: f32) -> f32 {
    if srgb <= 0.04045 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

/// sRGB value, 0 to 1, of a linear value 0 to 1.
fn to_srgb(linear: f32) -> f32 {
    if linear <= 0.0031308 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_of_light() {
        let (white, black, nothing) = ([255, 255, 255, 255], [0, 0, 0, 255], [0; 4]);
        let pixels = vec![white, black, [90, 90, 90, 255], nothing, black, white, nothing, nothing];
        let image = Image { width: 4, height: 2, pixels, linear: Vec::new() };
        let small = shrink(&image, 2);
        assert_eq!([small.width, small.height], [2, 1], "size");
        // Half the light is 188 of 255 in sRGB; nothing takes part in the alpha alone.
        assert_eq!(small.pixels, [[188, 188, 188, 255], [90, 90, 90, 64]], "means");
        assert_eq!(shrink(&image, 1).pixels, image.pixels, "nothing to average");
    }
}
