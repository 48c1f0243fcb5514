//! Parsers of option values: the accepted forms, and what is wrong with others.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use autosplats::{MAX_SIDE, Reconstruction};
use autosplats_cloud::glam::DVec3;
use autosplats_formats::DepthCamera;
use autosplats_scenes::parse_count;
use serde::{Serialize, Serializer};

/// `-k`: number of neighbours that a splat is made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Neighbors {
    /// As many as the noise requires.
    Auto,
    Count(u32),
}

impl Neighbors {
    /// The smallest number of neighbours, and whether noise may raise it.
    pub(crate) fn settings(self) -> (u32, bool) {
        match self {
            Self::Auto => (Reconstruction::default().k, true),
            Self::Count(k) => (k, false),
        }
    }
}

impl FromStr for Neighbors {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            _ if text == "auto" => Ok(Self::Auto),
            Ok(k) => Ok(Self::Count(k)),
            _ => Err("must be a whole number, or 'auto'".into()),
        }
    }
}

impl Serialize for Neighbors {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str("auto"),
            Self::Count(k) => serializer.serialize_u32(*k),
        }
    }
}

impl fmt::Display for Neighbors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Count(k) => write!(f, "{k}"),
        }
    }
}

/// `--first-radius`: a radius such as `0.05`, or `best`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum FirstRadius {
    /// The fastest radius of sufficient accuracy, found by trials.
    Best,
    /// A radius in the input's units.
    Radius(f32),
}

impl FromStr for FirstRadius {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            _ if text == "best" => Ok(Self::Best),
            Ok(radius) if radius > 0.0 && f32::is_finite(radius) => Ok(Self::Radius(radius)),
            _ => Err("must be a number above 0, or 'best'".into()),
        }
    }
}

impl FirstRadius {
    /// The radius, or a valid placeholder while the best one is unknown.
    pub(crate) fn unless_best(self) -> f32 {
        match self {
            Self::Best => 1.0,
            Self::Radius(radius) => radius,
        }
    }
}

/// Parses the number of neighbours of a normal.
pub(crate) fn normal_neighbors(text: &str) -> Result<u32, String> {
    text.parse().ok().filter(|k| (3..=1024).contains(k)).ok_or("must be a whole number within 3 to 1024".into())
}

/// Parses a gap factor.
pub(crate) fn gap_factor(text: &str) -> Result<f32, String> {
    number(text).filter(|factor: &f32| *factor > 1.0).ok_or("must be a number above 1 and below 3e38".into())
}

/// A range of frames, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrameRange {
    pub(crate) first: usize,
    /// `None`: to the last frame.
    pub(crate) last: Option<usize>,
}

/// Parses `A..B`, `A..`, `..B` or `A`.
pub(crate) fn frame_range(text: &str) -> Result<FrameRange, String> {
    let number = |text: &str| text.parse().map_err(|_| "must be A..B, A.., ..B or a number, counted from 0".to_owned());
    let (first, last) = match text.split_once("..") {
        None => (number(text)?, Some(number(text)?)),
        Some((first, last)) => (
            if first.is_empty() { 0 } else { number(first)? },
            if last.is_empty() { None } else { Some(number(last)?) },
        ),
    };
    if last.is_some_and(|last| last < first) {
        return Err("the last frame must not be before the first".into());
    }
    Ok(FrameRange { first, last })
}

/// Parses a rate in frames per second.
pub(crate) fn rate(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|rate| *rate > 0.0 && *rate <= 1e5).ok_or("must be above 0 and at most 100000".into())
}

/// Parses a time in seconds, or with the unit `s`, `ms` or `min`.
pub(crate) fn duration(text: &str) -> Result<Duration, String> {
    let units = [("ms", 1e-3), ("min", 60.0), ("s", 1.0), ("", 1.0)];
    let seconds = units.into_iter().find_map(|(unit, seconds)| {
        let number: f64 = text.strip_suffix(unit)?.trim_end().parse().ok()?;
        Some(number * seconds)
    });
    let seconds = seconds.filter(|seconds| *seconds >= 0.0 && *seconds <= 1e9);
    seconds.map(Duration::from_secs_f64).ok_or("must be a time such as 2s, 500ms or 1min".into())
}

pub(crate) fn frames(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(frames) if (1..=100_000).contains(&frames) => Ok(frames),
        _ => Err("must be within 1 to 100000".into()),
    }
}

/// Parses a size in pixels, such as `1760x900`.
pub(crate) fn size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.trim().parse().ok()?, h.trim().parse().ok()?]));
    match sides {
        Some(size) if size.iter().all(|side| (1..=MAX_SIDE).contains(side)) => Ok(size),
        Some(_) => Err(format!("width and height must be within 1 to {MAX_SIDE} pixels")),
        None => Err("must be WIDTHxHEIGHT in pixels, such as 1760x900".into()),
    }
}

/// Parses a distance in pixels, 0 or more.
pub(crate) fn detail(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|detail| (0.0..=1000.0).contains(detail)).ok_or("must be within 0 to 1000 pixels".into())
}

/// Parses a number of bytes, such as `500M` or `2G`.
pub(crate) fn bytes(text: &str) -> Result<u64, String> {
    let text = text.trim().to_ascii_uppercase();
    let units = [("K", 10), ("M", 20), ("G", 30), ("T", 40), ("", 0)];
    let bytes = units.into_iter().find_map(|(unit, shift)| {
        let number = text.trim_end_matches(['I', 'B']).strip_suffix(unit)?.trim().parse::<f64>().ok()?;
        Some(number * (1u64 << shift) as f64)
    });
    let bytes = bytes.filter(|bytes| (1.0..1e18).contains(bytes));
    bytes.map(|bytes| bytes as u64).ok_or("must be a number of bytes, such as 500M or 2G".into())
}

/// Parses a vector, such as `1.5,-2,0`.
pub(crate) fn vector(text: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(number).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        _ => Err("must be three numbers, such as 1.5,-2,0".into()),
    }
}

/// Parses a box, such as `0,0,0,1.5,1.5,2`: the lower corner, then the upper one.
pub(crate) fn bounds(text: &str) -> Result<[DVec3; 2], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(number).collect();
    match numbers.as_deref() {
        Some(&[x0, y0, z0, x1, y1, z1]) => {
            let [min, max] = [DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1)];
            if min.cmple(max).all() { Ok([min, max]) } else { Err("the first corner must be the lower one".into()) }
        }
        _ => Err("must be six numbers, such as 0,0,0,10,10,2.5".into()),
    }
}

/// Parses the intrinsics of a depth camera, such as `525,525,319.5,239.5`, optionally with pixel values per metre:
/// `525,525,319.5,239.5,5000`.
pub(crate) fn depth_camera(text: &str) -> Result<DepthCamera, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(number).collect();
    let (fx, fy, cx, cy, scale) = match numbers.as_deref() {
        Some(&[fx, fy, cx, cy]) => (fx, fy, cx, cy, None),
        Some(&[fx, fy, cx, cy, scale]) => (fx, fy, cx, cy, Some(scale)),
        _ => return Err("must be four or five numbers, such as 525,525,319.5,239.5,1000".into()),
    };
    if fx > 0.0 && fy > 0.0 && scale.is_none_or(|scale| scale > 0.0) {
        Ok(DepthCamera { fx, fy, cx, cy, scale })
    } else {
        Err("focal lengths and values per metre must be above 0".into())
    }
}

/// Parses a number of points, such as `250000`, `250K` or `2.5M`.
pub(crate) fn count(text: &str) -> Result<usize, String> {
    parse_count(text).ok_or_else(|| "must be a number of points, such as 250000, 250K or 1.5M".into())
}

/// Parses a whole number above 0.
pub(crate) fn step(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|step| *step > 0).ok_or_else(|| "must be a whole number above 0".into())
}

/// Most threads. More take seconds to start and are no faster.
pub(crate) const MAX_THREADS: u16 = 1024;

/// Parses a number of threads.
pub(crate) fn threads(text: &str) -> Result<u16, String> {
    let count = text.parse().ok().filter(|count| (1..=MAX_THREADS).contains(count));
    count.ok_or_else(|| format!("must be a number from 1 to {MAX_THREADS}; without --threads there is one per core"))
}

/// Parses a number above 0.
pub(crate) fn above_zero(text: &str) -> Result<f64, String> {
    number(text).filter(|value| *value > 0.0).ok_or_else(|| "must be a number above 0".into())
}

/// Parses a range, such as `-2..10` or `-2,10`.
pub(crate) fn range(text: &str) -> Result<[f64; 2], String> {
    let ends = text.split_once("..").or_else(|| text.split_once(','));
    match ends.and_then(|(low, high)| Some([number::<f64>(low)?, number::<f64>(high)?])) {
        Some([low, high]) if low < high => Ok([low, high]),
        Some(_) => Err("the first number must be the lower one".into()),
        None => Err("must be two numbers, such as 0..2.5 or -1,1".into()),
    }
}

/// Parses a vertical field of view in degrees.
pub(crate) fn fov(text: &str) -> Result<f64, String> {
    number(text).filter(|fov| (0.01..=170.0).contains(fov)).ok_or("must be within 0.01 to 170 degrees".into())
}

/// Parses the height of an orthographic picture in world units, or `fit`.
pub(crate) fn ortho(text: &str) -> Result<Ortho, String> {
    if text == "fit" {
        return Ok(Ortho(None));
    }
    let height =
        number(text).filter(|height| *height > 0.0).ok_or("must be a height above 0 in world units, or 'fit'")?;
    Ok(Ortho(Some(height)))
}

/// Height of an orthographic picture in world units. `None` fits the cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ortho(pub(crate) Option<f64>);

fn number<T: FromStr + Into<f64> + Copy>(text: &str) -> Option<T> {
    text.trim().parse::<T>().ok().filter(|&value| value.into().is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_and_times() {
        let range = |first, last| Ok(FrameRange { first, last });
        assert_eq!(frame_range("3..7"), range(3, Some(7)));
        assert_eq!(frame_range("3.."), range(3, None));
        assert_eq!(frame_range("..7"), range(0, Some(7)));
        assert_eq!(frame_range(".."), range(0, None));
        assert_eq!(frame_range("5"), range(5, Some(5)));
        for bad in ["", "a", "7..3", "1...3", "-1"] {
            assert!(frame_range(bad).is_err(), "{bad} is no range");
        }
        assert_eq!(duration("2s"), Ok(Duration::from_secs(2)));
        assert_eq!(duration("500 ms"), Ok(Duration::from_millis(500)));
        assert_eq!(duration("1min"), Ok(Duration::from_secs(60)));
        assert_eq!(duration("0.5"), Ok(Duration::from_millis(500)));
        for bad in ["", "s", "-1s", "nan", "1e300", "2h"] {
            assert!(duration(bad).is_err(), "{bad} is no time");
        }
    }

    #[test]
    fn numbers_of_bytes() {
        for (text, number) in [("500M", 500 << 20), ("2G", 2 << 30), ("1.5 GiB", 3 << 29), ("64kb", 64 << 10), ("7", 7)]
        {
            assert_eq!(bytes(text), Ok(number), "{text}");
        }
        for bad in ["", "G", "-1M", "nan", "0", "1e30", "2X"] {
            assert!(bytes(bad).is_err(), "{bad} is no size");
        }
    }

    #[test]
    fn sizes() {
        assert_eq!(size("1760x900"), Ok([1760, 900]), "the usual form");
        for bad in ["0x0", "1x0", "100000x100000", "1760", "x", "-1x5", "1.5x2", ""] {
            assert!(size(bad).is_err(), "{bad} is no size");
        }
    }

    #[test]
    fn vectors_and_ranges() {
        assert_eq!(vector("1,-2.5, 3e2"), Ok(DVec3::new(1.0, -2.5, 300.0)), "signs, exponents and blanks");
        assert_eq!(range("-2..10"), Ok([-2.0, 10.0]), "dots");
        assert_eq!(range("-2,-1.5"), Ok([-2.0, -1.5]), "comma");
        for bad in ["1,2", "1,2,3,4", "a,b,c", "nan,0,0", "inf,0,0", ""] {
            assert!(vector(bad).is_err(), "{bad} is no vector");
        }
        for bad in ["2..1", "1..1", "1", "nan..2", "..", "0..inf"] {
            assert!(range(bad).is_err(), "{bad} is no range");
        }
    }
}
