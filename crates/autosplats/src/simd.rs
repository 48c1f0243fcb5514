//! Vectors of `f32` as wide as the processor has them, with operators.
//!
//! [`pulp`] chooses the width at run time. All widths give the same bits, as no operation mixes lanes and none is
//! fused.

use std::ops::{Add, AddAssign, Div, Mul, Sub};

use pulp::Simd;

/// A vector of `f32`.
#[derive(Clone, Copy)]
pub(crate) struct F32s<S: Simd> {
    simd: S,
    value: S::f32s,
}

/// The outcome of a comparison of two vectors.
#[derive(Clone, Copy)]
pub(crate) struct Mask<S: Simd> {
    simd: S,
    value: S::m32s,
}

impl<S: Simd> F32s<S> {
    #[inline(always)]
    pub(crate) fn splat(simd: S, value: f32) -> Self {
        Self { simd, value: simd.splat_f32s(value) }
    }

    /// The `index`-th vector of `values`, whose length is a multiple of the width.
    #[inline(always)]
    pub(crate) fn load(simd: S, values: &[f32], index: usize) -> Self {
        Self { simd, value: S::as_simd_f32s(values).0[index] }
    }

    /// Writes the vector where [`load`](Self::load) would read it.
    #[inline(always)]
    pub(crate) fn store(self, values: &mut [f32], index: usize) {
        S::as_mut_simd_f32s(values).0[index] = self.value;
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Self { value: self.simd.sqrt_f32s(self.value), ..self }
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        Self { value: self.simd.abs_f32s(self.value), ..self }
    }

    /// Minimum by lane. Neither may be NaN, for which processors differ.
    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        Self { value: self.simd.min_f32s(self.value, other.value), ..self }
    }

    /// Maximum by lane. Neither may be NaN, for which processors differ.
    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        Self { value: self.simd.max_f32s(self.value, other.value), ..self }
    }

    /// self < other, false where either is NaN.
    #[inline(always)]
    pub(crate) fn less(self, other: Self) -> Mask<S> {
        Mask { simd: self.simd, value: self.simd.less_than_f32s(self.value, other.value) }
    }

    /// self ≤ other, false where either is NaN.
    #[inline(always)]
    pub(crate) fn at_most(self, other: Self) -> Mask<S> {
        Mask { simd: self.simd, value: self.simd.less_than_or_equal_f32s(self.value, other.value) }
    }
}

impl<S: Simd> Mask<S> {
    #[inline(always)]
    pub(crate) fn select(self, yes: F32s<S>, no: F32s<S>) -> F32s<S> {
        F32s { simd: self.simd, value: self.simd.select_f32s(self.value, yes.value, no.value) }
    }

    /// `value` where true, 0 elsewhere.
    #[inline(always)]
    pub(crate) fn keep(self, value: F32s<S>) -> F32s<S> {
        self.select(value, F32s::splat(self.simd, 0.0))
    }

    #[inline(always)]
    pub(crate) fn and(self, other: Self) -> Self {
        Self { value: self.simd.and_m32s(self.value, other.value), ..self }
    }

    #[inline(always)]
    pub(crate) fn any(self) -> bool {
        self.simd.first_true_m32s(self.value) < S::F32_LANES
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $operation:ident) => {
        impl<S: Simd> $trait for F32s<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self { value: self.simd.$operation(self.value, other.value), ..self }
            }
        }
    };
}
operator!(Add, add, add_f32s);
operator!(Sub, sub, sub_f32s);
operator!(Mul, mul, mul_f32s);
operator!(Div, div, div_f32s);

impl<S: Simd> AddAssign for F32s<S> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}
