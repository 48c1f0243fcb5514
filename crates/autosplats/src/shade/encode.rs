//! Colours as bytes: from linear light to 8-bit sRGB, and the background.

use std::sync::LazyLock;

use super::{Background, srgb};

/// Steps of the table from linear to 8-bit sRGB. At the dark end, where sRGB is steepest, a step of the table is less
/// than one of the 255.
pub(super) const ENCODE_STEPS: usize = 1 << 13;

/// The background at height `t` of the picture, 0 at the top to 1 at the bottom.
pub(super) fn background(background: Background, t: f32) -> [u8; 4] {
    match background {
        Background::Transparent => [0; 4],
        Background::Color([r, g, b]) => [r, g, b, 255],
        Background::Gradient(top, bottom) => {
            let [r, g, b] = [0, 1, 2].map(|i| {
                let [top, bottom] = [f32::from(top[i]), f32::from(bottom[i])];
                (top + (bottom - top) * t).round() as u8
            });
            [r, g, b, 255]
        }
    }
}

/// The sRGB channel of a linear one.
pub(super) fn encode(table: &[u8], channel: f32) -> u8 {
    table[(channel.clamp(0.0, 1.0) * ENCODE_STEPS as f32 + 0.5) as usize]
}

/// 8-bit sRGB channels of linear ones from 0 to 1.
pub(super) fn encode_table() -> &'static [u8] {
    static TABLE: LazyLock<Vec<u8>> = LazyLock::new(|| {
        (0..=ENCODE_STEPS).map(|step| (srgb(step as f32 / ENCODE_STEPS as f32) * 255.0).round() as u8).collect()
    });
    &TABLE
}

/// Least linear value of each 8-bit sRGB channel, then infinity.
pub(super) fn encode_bounds() -> &'static [f32; 257] {
    static BOUNDS: LazyLock<[f32; 257]> = LazyLock::new(|| {
        let mut bounds = std::array::from_fn(least_with);
        bounds[256] = f32::INFINITY;
        bounds
    });
    &BOUNDS
}

/// Least linear value from 0 to 1 whose nearest channel is not below this one.
fn least_with(channel: usize) -> f32 {
    // The bits of positive floats order like the floats.
    let [mut low, mut high] = [0.0f32, 1.0].map(f32::to_bits);
    while low < high {
        let middle = low + (high - low) / 2;
        if (srgb(f32::from_bits(middle)) * 255.0).round() < channel as f32 { low = middle + 1 } else { high = middle }
    }
    f32::from_bits(low)
}

/// The 8-bit sRGB channel nearest to a linear one from 0 to 1; [`encode`] may be off by one.
pub(super) fn nearest(table: &[u8], bounds: &[f32; 257], channel: f32) -> u8 {
    let near = encode(table, channel);
    let [own, next] = [0, 1].map(|more| bounds[usize::from(near) + more]);
    near + u8::from(channel >= next) - u8::from(channel < own)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_channel_is_that_of_the_formula() {
        let (table, bounds) = (encode_table(), encode_bounds());
        let [mut all, mut missed] = [0; 2];
        // A prime step, so that numbers of all kinds are met.
        for channel in (0..=1.0f32.to_bits()).step_by(10_007).map(f32::from_bits).chain([1.0, 1.0 + f32::EPSILON]) {
            let exact = (srgb(channel) * 255.0).round() as u8;
            assert_eq!(nearest(table, bounds, channel), exact, "{channel}");
            missed += usize::from(encode(table, channel) != exact);
            all += 1;
        }
        assert!(missed > 100 && all > 100_000, "the table alone misses {missed} of {all}");
    }
}
