//! Colours of any number type as 8 bits.

/// Factor that converts colours of any number type to 8 bits.
#[derive(Clone, Copy)]
pub(crate) struct ColorScale(f64);

impl ColorScale {
    /// Decides by the largest value, because wide types often hold 8-bit values, and floats 0 to 1 or 0 to 255.
    pub(crate) fn of(largest: f64, float: bool) -> Self {
        // Mixed colours may exceed full brightness a little.
        Self(if largest >= 256.0 {
            1.0 / 256.0
        } else if float && largest <= 1.01 {
            255.0
        } else {
            1.0
        })
    }

    pub(crate) fn byte(self, value: f64) -> u8 {
        // 16-bit values are cut, not rounded: that restores the byte both of v * 256 and of v * 257.
        let round = if self.0 < 1.0 { 0.0 } else { 0.5 };
        (value * self.0 + round) as u8
    }

    /// Whether 8 bits keep the value exactly.
    pub(crate) fn keeps(self, value: f64) -> bool {
        let back = if self.0 < 1.0 { 257.0 } else { 1.0 / self.0 };
        (value - f64::from(self.byte(value)) * back).abs() < 1e-6
    }
}
