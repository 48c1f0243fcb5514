//! Colours of any number type as 8 bits, by one rule for all formats.
//!
//! # How it works
//!
//! Wide types often hold 8-bit values, and floats 0 to 1 or 0 to 255, so the values tell the scale. Nearly all of them
//! have to agree: a few may exceed full brightness, as light that was measured or corrected does, and are clipped.
//! Zeros tell nothing, because points without a colour are black.

use rayon::prelude::*;

/// Full brightness of each scale: of floats, of 8 bits, and of 16 bits.
const FULL: [f64; 3] = [1.0, 255.0, 65535.0];

/// From here on a value is clipped in each scale. Mixed colours may exceed full brightness a little.
const CLIPPED: [f64; 3] = [1.01, 256.0, 65536.0];

/// One in so many values may exceed 8 bits and be clipped; of 16-bit values nearly all do.
const CLIPPED_ONE_IN: usize = 20;

/// How many colour values lie where.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Levels {
    positive: usize,
    /// Values between 0 and 1, which 8-bit values hardly ever are.
    fractions: usize,
    /// Values that each scale clips.
    above: [usize; 3],
}

impl Levels {
    pub(crate) fn of(count: usize, color: impl Fn(usize) -> [f64; 3] + Sync + Send) -> Self {
        let levels = (0..count).into_par_iter().fold(Self::default, |levels, i| levels.with(color(i)));
        levels.reduce(Self::default, Self::and)
    }

    fn with(mut self, color: [f64; 3]) -> Self {
        for value in color {
            self.positive += usize::from(value > 0.0);
            self.fractions += usize::from(value > 0.0 && value < 1.0);
            for (above, limit) in self.above.iter_mut().zip(CLIPPED) {
                *above += usize::from(value >= limit);
            }
        }
        self
    }

    /// Levels of whole values, of which `positive` are above zero and `above_byte` above 255.
    pub(crate) fn whole(positive: usize, above_byte: usize) -> Self {
        Self { positive, fractions: 0, above: [positive, above_byte, 0] }
    }

    #[must_use]
    pub(crate) fn and(self, other: Self) -> Self {
        Self {
            positive: self.positive + other.positive,
            fractions: self.fractions + other.fractions,
            above: [0, 1, 2].map(|scale| self.above[scale] + other.above[scale]),
        }
    }

    /// Largest number of values that may exceed 8 bits and be clipped, of so many above zero.
    pub(crate) fn most_clipped(positive: usize) -> usize {
        positive / CLIPPED_ONE_IN
    }

    /// Whether any value is above zero.
    pub(crate) fn any(&self) -> bool {
        self.positive > 0
    }

    /// Whether the values have 16 bits: more exceed 8 bits than are clipped.
    pub(crate) fn are_wide(&self) -> bool {
        self.above[1] > Self::most_clipped(self.positive)
    }
}

/// What all colours of a file tell together. Those of its parts can be joined.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ColorLook {
    levels: Levels,
    /// Whether 8 bits lose some value in each scale.
    lost: [bool; 3],
}

impl ColorLook {
    /// What `count` colours tell. Whether 8 bits lose some is found out only if `exact`.
    pub(crate) fn of(count: usize, exact: bool, color: impl Fn(usize) -> [f64; 3] + Sync + Send) -> Self {
        let add = |mut look: Self, i: usize| {
            let color = color(i);
            look.levels = look.levels.with(color);
            if exact {
                for (scale, lost) in look.lost.iter_mut().enumerate() {
                    *lost = *lost || !color.iter().all(|&value| keeps(scale, value));
                }
            }
            look
        };
        (0..count).into_par_iter().fold(Self::default, add).reduce(Self::default, Self::and)
    }

    /// What colours of whole numbers of 0 to 255 tell.
    pub(crate) fn of_bytes(colors: &[[u8; 3]]) -> Self {
        let number = |least: u8| {
            let of = |color: &[u8; 3]| color.iter().map(|&value| usize::from(value >= least)).sum::<usize>();
            colors.iter().map(of).sum::<usize>()
        };
        let (positive, above_one) = (number(1), number(2));
        let levels = Levels { positive, fractions: 0, above: [above_one, 0, 0] };
        Self { levels, lost: [above_one > 0, false, positive > 0] }
    }

    #[must_use]
    pub(crate) fn and(self, other: Self) -> Self {
        Self {
            levels: self.levels.and(other.levels),
            lost: [0, 1, 2].map(|scale| self.lost[scale] || other.lost[scale]),
        }
    }

    /// The scale. Only floats can be in 0 to 1.
    pub(crate) fn scale(&self, float: bool) -> ColorScale {
        ColorScale::of_levels(self.levels, float)
    }

    /// Whether 8 bits lose some value in this scale.
    pub(crate) fn loses(&self, scale: ColorScale) -> bool {
        self.lost[scale.index]
    }
}

/// A value in a scale as 8 bits.
fn byte(scale: usize, value: f64) -> u8 {
    // 16-bit values are cut, not rounded: that restores the byte both of v * 256 and of v * 257.
    (match scale {
        0 => value * 255.0 + 0.5,
        1 => value + 0.5,
        _ => value / 256.0,
    }) as u8
}

/// Whether 8 bits keep a value in a scale exactly.
fn keeps(scale: usize, value: f64) -> bool {
    (value - f64::from(byte(scale, value)) * (FULL[scale] / 255.0)).abs() < 1e-6
}

/// The scale of colours.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ColorScale {
    /// Index in [`FULL`].
    index: usize,
    levels: Levels,
}

impl ColorScale {
    /// The scale of `count` colours. Only floats can be in 0 to 1.
    pub(crate) fn of(count: usize, float: bool, color: impl Fn(usize) -> [f64; 3] + Sync + Send) -> Self {
        Self::of_levels(Levels::of(count, color), float)
    }

    pub(crate) fn of_levels(levels: Levels, float: bool) -> Self {
        let index = if float && levels.above[0] <= levels.fractions {
            0
        } else if levels.are_wide() {
            2
        } else {
            1
        };
        Self { index, levels }
    }

    /// Every scale there is, by [`number`](Self::number).
    pub(crate) fn all() -> [Self; 3] {
        [0, 1, 2].map(|index| Self { index, levels: Levels::default() })
    }

    pub(crate) fn number(self) -> usize {
        self.index
    }

    /// The value of full brightness: 1, 255 or 65535.
    pub(crate) fn full(self) -> f64 {
        FULL[self.index]
    }

    pub(crate) fn byte(self, value: f64) -> u8 {
        byte(self.index, value)
    }

    /// Note on values that are clipped, if there are any.
    pub(crate) fn note(self) -> Option<String> {
        let clipped = self.levels.above[self.index];
        let exceed = if clipped == 1 { "exceeds" } else { "exceed" };
        (clipped > 0).then(|| {
            format!(
                "{clipped} of {} colour values {exceed} {}, full brightness of the others; clipped",
                self.levels.positive,
                self.full()
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(values: &[f64], float: bool) -> (f64, Option<String>) {
        let scale = ColorScale::of(values.len(), float, |i| [values[i], 0.0, 0.0]);
        (scale.full(), scale.note())
    }

    fn some(count: usize, value: impl Fn(usize) -> f64, others: &[f64]) -> Vec<f64> {
        (0..count).map(value).chain(others.iter().copied()).collect()
    }

    #[test]
    fn nearly_all_values_tell_the_scale() {
        let unit = |i: usize| 0.2 + 0.007 * (i % 100) as f64;
        let byte = |i: usize| (i % 200) as f64;
        let wide = |i: usize| (i % 200) as f64 * 257.0;
        for (values, float, full, clipped) in [
            (some(1000, unit, &[]), true, 1.0, 0),
            (some(1000, unit, &[1.6]), true, 1.0, 1),
            (some(1000, unit, &[1.4; 80]), true, 1.0, 80),
            (some(10, unit, &[1.001]), true, 1.0, 0),
            (some(1000, byte, &[]), true, 255.0, 0),
            (some(1000, byte, &[256.5]), true, 255.0, 1),
            (some(1000, byte, &[300.0, 70_000.0]), false, 255.0, 2),
            (some(1000, wide, &[]), false, 65535.0, 0),
            (some(1000, wide, &[70_000.0]), true, 65535.0, 1),
            (some(1000, |_| 0.0, &[0.5, 0.7]), true, 1.0, 0),
            (some(1000, |_| 0.0, &[40_000.0, 300.0]), false, 65535.0, 0),
            (some(1000, |_| 1.0, &[]), true, 1.0, 0),
            (some(1000, |_| 1.0, &[200.0]), true, 255.0, 0),
            (vec![f64::NAN, -3.0, 0.5, f64::NAN], true, 1.0, 0),
            (vec![65535.0], true, 65535.0, 0),
            (vec![], true, 1.0, 0),
        ] {
            let (found, note) = scale(&values, float);
            assert_eq!(found, full, "{:?} ...", &values[values.len().saturating_sub(3)..]);
            assert_eq!(note.is_some(), clipped > 0, "{note:?}");
            assert!(note.is_none_or(|note| note.starts_with(&format!("{clipped} of "))), "{clipped} are told");
        }
    }

    #[test]
    fn bytes_tell_what_their_values_tell() {
        for value in 0..=u8::MAX {
            let colors = [[value; 3], [0, 1, value], [0; 3]];
            for colors in [&colors[..], &colors[1..], &colors[2..]] {
                let expected = ColorLook::of(colors.len(), true, |i| colors[i].map(f64::from));
                assert_eq!(ColorLook::of_bytes(colors), expected, "{colors:?}");
            }
        }
    }

    #[test]
    fn too_bright_is_full() {
        let float = ColorScale::of(3, true, |i| [0.5, [0.25, 0.75, 1.6][i], 0.0]);
        assert_eq!([0.0, 0.5, 1.0, 1.6, f64::NAN].map(|value| float.byte(value)), [0, 128, 255, 255, 0]);
        let wide = ColorScale::of(3, false, |_| [65535.0, 256.0, 512.0]);
        assert_eq!([512.0, 514.0, 65535.0, 1e9, -5.0].map(|value| wide.byte(value)), [2, 2, 255, 255, 0]);
        assert!(keeps(2, 514.0) && !keeps(2, 513.0), "v * 257 is kept");
    }
}
