//! The legend: a colour bar with its range, drawn into the picture.

use font8x8::UnicodeFonts as _;

use super::color_map::Scale;
use super::encode::background;
use super::{Background, Image, Shading};

/// Labels along the bar, both ends included.
const LABELS: usize = 5;
/// Side of a character in font pixels.
const GLYPH: usize = 8;

/// Colours of text and panel.
#[derive(Clone, Copy)]
struct Inks {
    text: [u8; 4],
    panel: [u8; 4],
}

const ON_DARK: Inks = Inks { text: [240, 240, 240, 255], panel: [24, 26, 30, 255] };
const ON_LIGHT: Inks = Inks { text: [20, 22, 26, 255], panel: [244, 244, 244, 255] };

impl Inks {
    /// Those that suit the background half-way down the picture.
    fn on(behind: Background) -> Self {
        let [red, green, blue, alpha] = background(behind, 0.5).map(u32::from);
        if alpha > 0 && 3 * red + 6 * green + blue > 10 * 128 { ON_LIGHT } else { ON_DARK }
    }
}

/// Draws the legend where it hides the least of the surface, at best in the middle of the right edge. A picture too
/// small gets none. `world` turns values of the scale into those of the world.
pub(super) fn draw(
    image: &mut Image,
    shading: &Shading,
    scale: &Scale,
    world: impl Fn([f32; 2]) -> [f64; 2],
    encode: impl Fn(f32) -> u8,
) {
    let title = &shading.color.title();
    let [width, height] = [image.width as usize, image.height as usize];
    // Picture pixels per font pixel.
    let unit = (height / 400).max(1);
    let line = (GLYPH + 4) * unit;
    let [low, high] = scale.range();
    let value = |i: usize| high + (low - high) * i as f32 / (LABELS - 1) as f32;
    let [world_low, world_high] = world([low, high]);
    // A single value stands at the middle of the bar.
    let places = if high > low { 0..LABELS } else { LABELS / 2..LABELS / 2 + 1 };
    let label = |i: usize| (i, number(world([value(i); 2])[0], world_high - world_low));
    let labels: Vec<(usize, String)> = places.map(label).collect();
    let text_width =
        labels.iter().map(|(_, label)| label.len()).chain([title.chars().count()]).max().unwrap_or(0) * GLYPH * unit;
    let bar_width = 14 * unit;
    let panel_width = bar_width + text_width + 5 * line / 2;
    let bar_height = height / 2;
    let panel_height = bar_height + 3 * line;
    if panel_width + line > width || panel_height + line > height || bar_height < LABELS * line {
        return;
    }
    let [right, bottom] = [width - panel_width - line, height - panel_height - line / 2];
    let places =
        [right, line].into_iter().flat_map(|x| [(height - panel_height) / 2, line / 2, bottom].map(|y| [x, y]));
    let hidden = |&place: &[usize; 2]| hidden(image, shading.background, place, [panel_width, panel_height]);
    let [x0, y0] = places.min_by_key(hidden).unwrap_or_default();
    let inks = Inks::on(shading.background);
    for y in y0..y0 + panel_height {
        for pixel in &mut image.pixels[y * width + x0..][..panel_width] {
            let [red, green, blue, _] = inks.panel;
            *pixel = if pixel[3] == 0 { [red, green, blue, 190] } else { blend(*pixel, inks.panel) };
        }
    }
    let x = x0 + line / 2;
    let top = y0 + 2 * line;
    text(image, title, [x, y0 + line / 2], unit, inks.text);
    for y in 0..bar_height {
        let t = 1.0 - (y as f32 + 0.5) / bar_height as f32;
        let [r, g, b] = scale.color(low + (high - low) * t).map(&encode);
        image.pixels[(top + y) * width + x..][..bar_width].fill([r, g, b, 255]);
    }
    for (i, label) in &labels {
        let y = top + (bar_height - 1) * i / (LABELS - 1);
        image.pixels[y * width + x + bar_width..][..3 * unit].fill(inks.text);
        text(image, label, [x + bar_width + 5 * unit, y - GLYPH * unit / 2], unit, inks.text);
    }
}

/// Number of surface pixels in a part of the picture.
fn hidden(image: &Image, behind: Background, [x0, y0]: [usize; 2], [width, height]: [usize; 2]) -> usize {
    let count = |y: usize| {
        let nothing = background(behind, (y as f32 + 0.5) / image.height as f32);
        image.pixels[y * image.width as usize + x0..][..width].iter().filter(|pixel| **pixel != nothing).count()
    };
    (y0..y0 + height).map(count).sum()
}

/// A value with the digits that tell hundredths of a range of this width apart.
fn number(value: f64, range: f64) -> String {
    let largest = value.abs().max(range);
    let part = if range > 0.0 { range / largest } else { 1.0 };
    // Large values that differ in their last digits only are read more easily without an exponent.
    let long = 1e7 <= largest && part < 1e-3 || range == 0.0;
    if largest != 0.0 && !(1e-4..if long { 1e15 } else { 1e7 }).contains(&largest) {
        let digits = (2.0 - part.log10()).round().clamp(2.0, 15.0) as usize;
        return format!("{value:.digits$e}");
    }
    let digits = if range > 0.0 { (2.0 - range.log10()).ceil().clamp(0.0, 12.0) as usize } else { 3 };
    format!("{value:.digits$}")
}

fn blend(below: [u8; 4], above: [u8; 4]) -> [u8; 4] {
    // The panel covers three quarters, so text is readable on any picture.
    let mix = |i: usize| ((u16::from(below[i]) + 3 * u16::from(above[i])) / 4) as u8;
    [mix(0), mix(1), mix(2), 255]
}

fn text(image: &mut Image, text: &str, [x0, y0]: [usize; 2], unit: usize, ink: [u8; 4]) {
    let width = image.width as usize;
    for (column, character) in text.chars().enumerate() {
        let glyph = font8x8::BASIC_FONTS.get(character).or_else(|| font8x8::BASIC_FONTS.get('?')).unwrap_or_default();
        for (row, bits) in glyph.into_iter().enumerate() {
            for bit in (0..GLYPH).filter(|bit| bits >> bit & 1 == 1) {
                for y in 0..unit {
                    let start = (y0 + row * unit + y) * width + x0 + (column * GLYPH + bit) * unit;
                    image.pixels[start..start + unit].fill(ink);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn numbers_have_the_digits_that_matter() {
        assert_eq!(number(406_123.25, 80.0), "406123.2", "large values of a small range");
        assert_eq!(number(0.0312, 0.05), "0.0312", "small values");
        assert_eq!(number(3e-9, 5e-9), "3.00e-9", "tiny values");
        assert_eq!(number(7.0, 0.0), "7.000", "no range");
        assert_eq!(number(3.0e8, 2.0e8), "3.00e8", "large values of a large range");
        assert_eq!(number(1_700_000_123.25, 60.0), "1700000123.2", "seconds of an era");
        assert_eq!(number(300_000_000.123_456, 2e-3), "300000000.12346", "parts of seconds");
        assert_eq!(number(0.1, 1e-7), "0.100000000", "nearly one value");
        assert_eq!(number(3e-9, 1e-12), "3.00000e-9", "tiny values of a small range");
        assert_eq!(number(0.0, 0.0), "0.000", "nothing");
    }
}
