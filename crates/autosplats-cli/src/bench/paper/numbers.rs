//! Derived numbers of the page.

/// Speedup of one search over another as in the paper, per point and overall, from the milliseconds and points of each.
pub(super) fn speedups([slow_ms, fast_ms]: [f64; 2], [slow_points, fast_points]: [usize; 2]) -> [f64; 2] {
    let overall = slow_ms / fast_ms;
    [overall * fast_points as f64 / slow_points.max(1) as f64, overall]
}

/// A fraction in percent, with enough digits to differ from 0 and 100 %.
pub(super) fn percent(part: f64) -> String {
    let percent = 100.0 * part;
    let rest = percent.min(100.0 - percent);
    match rest {
        ..=0.0 | 1.0.. => format!("{percent:.1} %"),
        0.0005.. => format!("{percent:.3} %"),
        _ if percent > 50.0 => "> 99.999 %".into(),
        _ => "< 0.001 %".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speedups_are_the_papers() {
        // Table 1: milliseconds, thousands of points and pixels, and the speedups that the paper states.
        for (ms, points, [by_point, overall]) in [
            ([14.0, 9.0], [36, 34], [1.47, 1.56]),
            ([95.0, 37.0], [546, 291], [1.37, 2.57]),
            ([169.0, 117.0], [1000, 690], [1.00, 1.44]),
            ([169.0, 71.0], [1000, 690], [1.64, 2.38]),
        ] {
            let found = speedups(ms, points);
            assert!((found[0] - by_point).abs() < 0.006, "{ms:?}: {found:?} by point");
            assert!((found[1] - overall).abs() < 0.006, "{ms:?}: {found:?} overall");
        }
    }

    #[test]
    fn percentages_tell_nearly_all_from_all() {
        let parts = [0.0, 1e-7, 0.0004, 0.5, 0.99961, 0.999_999_9, 1.0];
        let shown = ["0.0 %", "< 0.001 %", "0.040 %", "50.0 %", "99.961 %", "> 99.999 %", "100.0 %"];
        assert_eq!(parts.map(percent), shown);
    }
}
