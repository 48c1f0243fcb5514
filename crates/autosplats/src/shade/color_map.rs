//! Colour maps: from a value in a range to a colour.

use super::{ColorMap, linear};

/// Steps of a colour table: finer than 8 bits a channel can show.
pub(super) const STEPS: usize = 1024;
/// Four evenly spaced colours of [`ColorMap::Reds`], sRGB, 0 to 255.
const REDS: [[f32; 3]; 4] = [[205.0, 208.0, 212.0], [240.0, 190.0, 130.0], [225.0, 80.0, 50.0], [140.0, 0.0, 20.0]];

/// A colour map over a range of values, tabulated in linear colours.
pub(super) struct Scale {
    colors: Vec<[f32; 3]>,
    range: [f32; 2],
}

impl Scale {
    pub(super) fn new(map: ColorMap, range: [f32; 2]) -> Self {
        Self { colors: table(map), range }
    }

    /// Values at the two ends.
    pub(super) fn range(&self) -> [f32; 2] {
        self.range
    }

    /// The linear colour of `value`. Values beyond the ends get the colours of the ends, and unknown values (NaN) that
    /// of the lower end. In a range without width every value gets the middle colour.
    pub(super) fn color(&self, value: f32) -> [f32; 3] {
        let [low, high] = self.range;
        let t = if high > low { (value - low) / (high - low) } else { 0.5 };
        self.colors[(t.clamp(0.0, 1.0) * (STEPS - 1) as f32 + 0.5) as usize]
    }
}

impl ColorMap {
    /// The colour at `t`, 0 at its lower end to 1 at the upper one; sRGB, 8 bits a channel.
    pub fn at(self, t: f32) -> [u8; 3] {
        color(self, f64::from(t.clamp(0.0, 1.0))).map(|channel| (channel * 255.0).round() as u8)
    }
}

/// Linear colours of a colour map from its lower end to its upper end, [`STEPS`] of them.
pub(super) fn table(map: ColorMap) -> Vec<[f32; 3]> {
    (0..STEPS).map(|step| color(map, step as f64 / (STEPS - 1) as f64).map(linear)).collect()
}

/// The sRGB colour, 0 to 1, at `t`, 0 to 1.
fn color(map: ColorMap, t: f64) -> [f32; 3] {
    let gradient = match map {
        ColorMap::Viridis => colorous::VIRIDIS,
        ColorMap::Inferno => colorous::INFERNO,
        ColorMap::Turbo => colorous::TURBO,
        ColorMap::Gray => return [t as f32; 3],
        ColorMap::Reds => {
            let at = t as f32 * (REDS.len() - 1) as f32;
            let segment = (at as usize).min(REDS.len() - 2);
            let part = at - segment as f32;
            return std::array::from_fn(|i| (REDS[segment][i] * (1.0 - part) + REDS[segment + 1][i] * part) / 255.0);
        }
    };
    let color = gradient.eval_continuous(t);
    [color.r, color.g, color.b].map(|channel| f32::from(channel) / 255.0)
}
