//! Numbers as short decimals.

use std::io::Write as _;

/// Powers of ten that `f64` holds exactly.
const TENS: [f64; 16] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// 2⁵³: beyond it, not every integer is an `f64`.
const MAX_EXACT_INTEGER: f64 = 9_007_199_254_740_992.0;

/// Appends `value` with as few decimals as `same` allows, which is called with the number that a reader would get.
pub(super) fn push(text: &mut Vec<u8>, value: f64, same: impl Fn(f64) -> bool) {
    if value.is_finite() {
        for (decimals, ten) in TENS.iter().enumerate() {
            let digits = (value * ten).round();
            if digits.abs() >= MAX_EXACT_INTEGER {
                break;
            }
            // A division is correctly rounded, so the result is what a reader gets.
            if same(digits / ten) {
                push_fixed(text, digits.abs() as u64, decimals, value.is_sign_negative());
                return;
            }
        }
    } else if value.is_nan() {
        text.extend(b"nan");
        return;
    }
    // Very small, very large, infinite, or a number that needs all its digits.
    let single = format!("{:e}", value as f32);
    if single.parse().is_ok_and(same) {
        text.extend(single.as_bytes());
    } else {
        let _ = write!(text, "{value:e}");
    }
}

/// Appends an integer.
pub(super) fn push_integer(text: &mut Vec<u8>, value: u64) {
    push_fixed(text, value, 0, false);
}

/// Appends an integer, with its last `decimals` digits after a point.
fn push_fixed(text: &mut Vec<u8>, mut digits: u64, decimals: usize, negative: bool) {
    // The longest text: a sign, 20 digits and a point.
    let mut buffer = [0; 24];
    let mut at = buffer.len();
    let mut written = 0;
    while digits > 0 || written <= decimals {
        if written == decimals && decimals > 0 {
            at -= 1;
            buffer[at] = b'.';
        }
        at -= 1;
        buffer[at] = b'0' + (digits % 10) as u8;
        digits /= 10;
        written += 1;
    }
    if negative {
        at -= 1;
        buffer[at] = b'-';
    }
    text.extend_from_slice(&buffer[at..]);
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

    use super::{push, push_integer};

    fn f32_text(value: f32) -> String {
        let mut text = Vec::new();
        push(&mut text, value.into(), |read| read as f32 == value);
        String::from_utf8(text).unwrap()
    }

    fn f64_text(value: f64) -> String {
        let mut text = Vec::new();
        push(&mut text, value, |read| read == value);
        String::from_utf8(text).unwrap()
    }

    #[test]
    fn short_decimals() {
        let cases = [
            (0.1, "0.1"),
            (-0.05, "-0.05"),
            (0.0, "0"),
            (-0.0, "-0"),
            (1.0, "1"),
            (-17.25, "-17.25"),
            (16_777_216.0, "16777216"),
            (1e30, "1e30"),
            (1.5e-30, "1.5e-30"),
            (f32::NAN, "nan"),
            (f32::INFINITY, "inf"),
            (f32::NEG_INFINITY, "-inf"),
        ];
        for (value, text) in cases {
            assert_eq!(f32_text(value), text, "{value:e}");
        }
        assert_eq!(f64_text(5_400_000.123), "5400000.123", "a survey coordinate");
        let mut text = Vec::new();
        push_integer(&mut text, u64::MAX);
        assert_eq!(text, b"18446744073709551615", "the longest integer");
    }

    #[test]
    fn every_value_comes_back() {
        let mut bits = 1_u64;
        for _ in 0..200_000 {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let single = f32::from_bits((bits >> 32) as u32);
            let back: f32 = f32_text(single).parse().unwrap();
            assert!(back == single || back.is_nan() && single.is_nan(), "{single:e} came back as {back:e}");
            // Odd numbers as well as coordinates.
            for double in [f64::from_bits(bits), (bits >> 20) as f64 / 1e7, (bits >> 40) as f64 / 1e3] {
                let back: f64 = f64_text(double).parse().unwrap();
                assert!(back == double || back.is_nan() && double.is_nan(), "{double:e} came back as {back:e}");
            }
        }
    }
}
