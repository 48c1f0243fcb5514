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
