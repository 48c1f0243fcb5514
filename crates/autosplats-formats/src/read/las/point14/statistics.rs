//! Statistics for predicting values, and the models in which corrections are coded.

use laz::models::{ArithmeticModel, ArithmeticModelBuilder};

/// Context of a correction that follows one of `bits` bits, at most `most`; even, as odd ones are for single returns.
pub(super) fn size(bits: u32, most: u32) -> u32 {
    bits.min(most) & !1
}

/// Kind of a return, 0 to 5; steps within a kind are alike. Writers number returns from 1, some from 0, and some leave
/// out or swap one of the two numbers, so every combination has a kind.
pub(super) fn return_kind(count: u8, number: u8) -> u8 {
    const OF_NONE: [u8; 16] = [0, 1, 2, 3, 4, 5, 3, 4, 4, 5, 5, 5, 5, 5, 5, 5];
    let (low, high) = if count < number { (count, number) } else { (number, count) };
    match (low, high) {
        (0, _) => OF_NONE[high as usize & 15],
        (1, 1) => 0,
        (1, 2) => 1,
        (2, 2) => 2,
        (1, _) | (2, 11..) => 3,
        (11.., _) if high - low < 2 => 5,
        _ if high == low => 5,
        _ => 4,
    }
}

/// Models created on first use, because most are never used.
pub(super) struct Models<const N: usize> {
    models: [Option<ArithmeticModel>; N],
    symbols: u32,
}

impl<const N: usize> Models<N> {
    pub(super) fn new(symbols: u32) -> Self {
        Self { models: [const { None }; N], symbols }
    }

    pub(super) fn get(&mut self, index: usize) -> &mut ArithmeticModel {
        self.models[index % N].get_or_insert_with(|| ArithmeticModelBuilder::new(self.symbols).build())
    }
}

/// Approximate median of the last values. A new value replaces the least or the greatest one.
#[derive(Clone, Copy)]
pub(super) struct Median {
    sorted: [i32; 5],
    drop_greatest: bool,
}

impl Default for Median {
    fn default() -> Self {
        Self { sorted: [0; 5], drop_greatest: true }
    }
}

impl Median {
    pub(super) fn middle(&self) -> i32 {
        self.sorted[2]
    }

    pub(super) fn add(&mut self, value: i32) {
        let [a, b, middle, d, e] = self.sorted;
        let [p, q, r, s] = if self.drop_greatest { [a, b, middle, d] } else { [b, middle, d, e] };
        self.sorted = [p.min(value), q.min(value).max(p), r.min(value).max(q), s.min(value).max(r), s.max(value)];
        // One side keeps losing values until a new value arrives on that side.
        self.drop_greatest = if self.drop_greatest { value < middle } else { value <= middle };
    }
}
