//! Cameras as bare numbers.

use super::{PinholeCamera, scale_of};

/// A 3 × 3 matrix, a 4 × 4 matrix with it in the upper left, or fx fy cx cy. A scale may follow, except after 4 × 4.
pub(super) fn parse(text: &str) -> Option<PinholeCamera> {
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default());
    let words =
        lines.flat_map(|line| line.split([' ', '\t', ',', ';', '[', ']'])).filter(|word| !word.trim().is_empty());
    let k = words.map(|word| word.trim().parse().ok()).collect::<Option<Vec<f64>>>()?;
    let scaled = |camera, index: usize| PinholeCamera { scale: k.get(index).copied().map(scale_of), ..camera };
    match k.len() {
        4 | 5 => Some(scaled(PinholeCamera::new([k[0], k[1], k[2], k[3]]), 4)),
        9 | 10 => Some(scaled(PinholeCamera::from_rows(&k[..9])?, 9)),
        16 if k[10] == 1.0 && k[15] == 1.0 => Some(PinholeCamera::new([k[0], k[5], k[2], k[6]])),
        _ => None,
    }
}
