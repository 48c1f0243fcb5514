//! Schedule of a film: the frame that each picture shows.

use crate::exit::Failure;

/// Pictures per second of a film whose frames have no rate of their own.
pub(super) const DEFAULT_FPS: f64 = 30.0;
/// Largest difference of equal times, in nanoseconds; stamps are rounded.
const STAMP_ROUNDING_NS: i64 = 1000;
/// Most pictures of a film. Longer films have broken time stamps.
const MAX_FILM_PICTURES: f64 = 1e6;

/// Frames per second of evenly spaced frames; otherwise the default rate.
pub(super) fn rate(times: &[i64]) -> f64 {
    match step(times) {
        Some(step) if is_even(times, step) => 1e9 / step,
        _ => DEFAULT_FPS,
    }
}

/// Mean time between frames in nanoseconds; `None` if all are at one time.
fn step(times: &[i64]) -> Option<f64> {
    let (first, last) = (times.first()?, times.last()?);
    (last > first).then(|| last.abs_diff(*first) as f64 / (times.len() - 1) as f64)
}

fn is_even(times: &[i64], step: f64) -> bool {
    let expected = |index: usize| times[0].saturating_add((index as f64 * step).round() as i64);
    times.iter().enumerate().all(|(index, time)| time.abs_diff(expected(index)) <= STAMP_ROUNDING_NS.unsigned_abs())
}

/// Frames that a film of `rate` pictures per second shows, each with its number of successive pictures. Each picture
/// shows the newest frame of its time, so everything plays at its own speed.
///
/// `times` are those of the frames in nanoseconds, never decreasing. The last frame is shown for the mean duration of
/// the others.
pub(super) fn resample(times: &[i64], rate: f64, name: &str) -> Result<Vec<(usize, usize)>, Failure> {
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else { return Ok(Vec::new()) };
    let end = last.abs_diff(first) as f64 + step(times).unwrap_or(1e9 / rate);
    if end * rate * 1e-9 > MAX_FILM_PICTURES {
        let seconds = end * 1e-9;
        let why =
            format!("a film of {seconds:.0} s has more than {MAX_FILM_PICTURES} pictures at {rate:.0} per second");
        return Err(Failure::usage(format!("{name}: {why}; if its time stamps jump, choose a part with --frames")));
    }
    let mut shown: Vec<(usize, usize)> = Vec::new();
    for picture in 0_u32.. {
        let time = (f64::from(picture) * 1e9 / rate).round() as i64;
        if picture > 0 && time.saturating_add(STAMP_ROUNDING_NS) as f64 >= end {
            break;
        }
        let by_then = |&stamp: &i64| stamp.saturating_sub(first) <= time + STAMP_ROUNDING_NS;
        let frame = times.partition_point(by_then).saturating_sub(1);
        match shown.last_mut() {
            Some((last, pictures)) if *last == frame => *pictures += 1,
            _ => shown.push((frame, 1)),
        }
    }
    Ok(shown)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(milliseconds: &[i64]) -> Vec<i64> {
        milliseconds.iter().map(|time| time * 1_000_000).collect()
    }

    #[test]
    fn even_frames_have_a_picture_each() {
        for fps in [0.5, 10.0, 23.976, 29.97, 30.0, 60.0, 1000.0] {
            let times: Vec<i64> = (7..507).map(|frame| (f64::from(frame) * 1e9 / fps).round() as i64).collect();
            assert!((rate(&times) - fps).abs() < 1e-4 * fps, "{} is not {fps}", rate(&times));
            let expected: Vec<_> = (0..500).map(|frame| (frame, 1)).collect();
            assert_eq!(resample(&times, fps, "").ok(), Some(expected.clone()), "{fps} a second");
            assert_eq!(resample(&times, rate(&times), "").ok(), Some(expected), "at the rate that was found");
        }
        assert_eq!(resample(&[5], 30.0, "").ok(), Some(vec![(0, 1)]), "a single one");
        assert_eq!(resample(&[], 30.0, "").ok(), Some(vec![]), "none");
    }

    #[test]
    fn uneven_frames_play_at_their_own_speed() {
        let times = at(&[0, 100, 150, 1005, 1010, 1200]);
        assert_eq!(rate(&times), DEFAULT_FPS, "no rate is theirs");
        let shown = resample(&times, 10.0, "").expect("a film");
        // Pictures are at 0, 100, 200 ms and so on, to 1200 ms and 240 ms beyond. The frame at 1005 ms is never the
        // newest.
        assert_eq!(shown, [(0, 1), (1, 1), (2, 9), (4, 1), (5, 3)]);
        let often = resample(&times, 200.0, "").expect("a film");
        assert_eq!(often.iter().map(|(_, pictures)| pictures).sum::<usize>(), 288, "1.44 s");
        assert_eq!(often[2..4], [(2, 171), (3, 1)], "0.855 s and 0.005 s");
        let equal = resample(&at(&[0, 0, 0, 50]), 20.0, "").expect("a film");
        assert_eq!(equal, [(2, 1), (3, 1)], "of frames at one time the newest");
    }

    #[test]
    fn clocks_that_jump_make_no_endless_film() {
        let far = [0, i64::MAX];
        let failure = resample(&far, 30.0, "drive.mcap").expect_err("it is too long");
        assert!(failure.message.contains("drive.mcap") && failure.message.contains("--frames"), "{}", failure.message);
    }
}
