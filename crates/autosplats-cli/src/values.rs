//! The small values that options take: how they are typed and what is wrong with those that do not fit.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use autosplats::{Background, ColorMode, MAX_SIDE, Reconstruction};
use autosplats_cloud::glam::DVec3;
use autosplats_cloud::{DepthCamera, parse_count};
use serde::{Serialize, Serializer};

/// The colour modes by name; any other name is a field's.
pub(crate) const COLOR_MODES: [&str; 11] = [
    "auto",
    "rgb",
    "plain",
    "height",
    "intensity",
    "classification",
    "normal",
    "curvature",
    "radius",
    "k-radius",
    "depth",
];

/// `-k`: how many neighbours a splat is made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Neighbors {
    /// As many as the noise calls for.
    Auto,
    Count(u32),
}

impl Neighbors {
    /// The least number of neighbours, and whether there may be more.
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
            _ => Err("a number of neighbours is a whole number, or 'auto'".into()),
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

/// Frames from one to another, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrameRange {
    pub(crate) first: usize,
    /// To the end, if it is not said.
    pub(crate) last: Option<usize>,
}

/// `A..B`, `A..`, `..B` or `A`.
pub(crate) fn frame_range(text: &str) -> Result<FrameRange, String> {
    let number = |text: &str| text.parse().map_err(|_| "frames are A..B, A.., ..B or a number, from 0".to_owned());
    let (first, last) = match text.split_once("..") {
        None => (number(text)?, Some(number(text)?)),
        Some((first, last)) => (
            if first.is_empty() { 0 } else { number(first)? },
            if last.is_empty() { None } else { Some(number(last)?) },
        ),
    };
    if last.is_some_and(|last| last < first) {
        return Err("the last frame comes before the first".into());
    }
    Ok(FrameRange { first, last })
}

/// Frames a second.
pub(crate) fn rate(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|rate| *rate > 0.0 && *rate <= 1e5).ok_or("a rate is above 0 and at most 100000".into())
}

/// A time in seconds, or with `s`, `ms` or `min` behind it.
pub(crate) fn duration(text: &str) -> Result<Duration, String> {
    let units = [("ms", 1e-3), ("min", 60.0), ("s", 1.0), ("", 1.0)];
    let seconds = units.into_iter().find_map(|(unit, seconds)| {
        let number: f64 = text.strip_suffix(unit)?.trim_end().parse().ok()?;
        Some(number * seconds)
    });
    let seconds = seconds.filter(|seconds| *seconds >= 0.0 && *seconds <= 1e9);
    seconds.map(Duration::from_secs_f64).ok_or("a time is a number with s, ms or min behind it, such as 2s".into())
}

/// A number of frames.
pub(crate) fn frames(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(frames) if (1..=100_000).contains(&frames) => Ok(frames),
        _ => Err("a number of frames is within 1 to 100000".into()),
    }
}

/// `1760x900`
pub(crate) fn size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.trim().parse().ok()?, h.trim().parse().ok()?]));
    match sides {
        Some(size) if size.iter().all(|side| (1..=MAX_SIDE).contains(side)) => Ok(size),
        Some(_) => Err(format!("width and height are within 1 to {MAX_SIDE} pixels")),
        None => Err("a size is WIDTHxHEIGHT, such as 1760x900".into()),
    }
}

/// `1.5,-2,0`
pub(crate) fn vector(text: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(number).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        _ => Err("three numbers are expected, such as 1.5,-2,0".into()),
    }
}

/// `0,0,0,1.5,1.5,2`: the lower corner, then the upper one.
pub(crate) fn bounds(text: &str) -> Result<[DVec3; 2], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(number).collect();
    match numbers.as_deref() {
        Some(&[x0, y0, z0, x1, y1, z1]) => {
            let [min, max] = [DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1)];
            if min.cmple(max).all() { Ok([min, max]) } else { Err("the first corner has to be the lower one".into()) }
        }
        _ => Err("six numbers are expected, such as 0,0,0,10,10,2.5".into()),
    }
}

/// `525,525,319.5,239.5` or with values per metre as `525,525,319.5,239.5,5000`
pub(crate) fn depth_camera(text: &str) -> Result<DepthCamera, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(number).collect();
    let (fx, fy, cx, cy, scale) = match numbers.as_deref() {
        Some(&[fx, fy, cx, cy]) => (fx, fy, cx, cy, 1000.0),
        Some(&[fx, fy, cx, cy, scale]) => (fx, fy, cx, cy, scale),
        _ => return Err("four or five numbers are expected, such as 525,525,319.5,239.5,1000".into()),
    };
    if fx > 0.0 && fy > 0.0 && scale > 0.0 {
        Ok(DepthCamera { fx, fy, cx, cy, scale })
    } else {
        Err("focal lengths and values per metre are above 0".into())
    }
}

/// `250000`, `250K` or `2.5M`
pub(crate) fn count(text: &str) -> Result<usize, String> {
    parse_count(text).ok_or_else(|| "a number of points is expected, such as 250000, 250K or 1.5M".into())
}

/// A whole number above zero.
pub(crate) fn step(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|step| *step > 0).ok_or_else(|| "a whole number above 0 is expected".into())
}

/// A number of threads.
pub(crate) fn threads(text: &str) -> Result<u16, String> {
    let count = text.parse().ok().filter(|count| (1..=1024).contains(count));
    count.ok_or_else(|| "a number from 1 to 1024 is expected; without --threads there is one per core".into())
}

/// A number above zero.
pub(crate) fn above_zero(text: &str) -> Result<f64, String> {
    number(text).filter(|value| *value > 0.0).ok_or_else(|| "a number above 0 is expected".into())
}

/// `-2..10` or `-2,10`
pub(crate) fn range(text: &str) -> Result<[f32; 2], String> {
    let ends = text.split_once("..").or_else(|| text.split_once(','));
    match ends.and_then(|(low, high)| Some([number::<f32>(low)?, number::<f32>(high)?])) {
        Some([low, high]) if low < high => Ok([low, high]),
        Some(_) => Err("the first number has to be the lower one".into()),
        None => Err("two numbers are expected, such as 0..2.5 or -1,1".into()),
    }
}

/// Vertical field of view in degrees.
pub(crate) fn fov(text: &str) -> Result<f64, String> {
    number(text)
        .filter(|fov| (0.01..=170.0).contains(fov))
        .ok_or("a field of view is within 0.01 to 170 degrees".into())
}

/// Height of an orthographic picture in world units; `None` for `fit`.
pub(crate) fn ortho(text: &str) -> Result<Ortho, String> {
    if text == "fit" {
        return Ok(Ortho(None));
    }
    let height = number(text).filter(|height| *height > 0.0).ok_or("a height above 0 in world units, or 'fit'")?;
    Ok(Ortho(Some(height)))
}

/// Height of an orthographic picture in world units, or as high as what there is to see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ortho(pub(crate) Option<f64>);

/// `#rrggbb`, `#top,#bottom` or `transparent`
pub(crate) fn background(text: &str) -> Result<Background, String> {
    let hint = || "a background is '#rrggbb', '#top,#bottom' or 'transparent'".to_owned();
    if text == "transparent" {
        return Ok(Background::Transparent);
    }
    match text.split_once(',') {
        Some((top, bottom)) => {
            Ok(Background::Gradient(hex_color(top).ok_or_else(hint)?, hex_color(bottom).ok_or_else(hint)?))
        }
        None => hex_color(text).map(Background::Color).ok_or_else(hint),
    }
}

fn hex_color(text: &str) -> Option<[u8; 3]> {
    let digits = text.trim().strip_prefix('#')?;
    if digits.len() != 6 || !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return None;
    }
    let [_, red, green, blue] = u32::from_str_radix(digits, 16).ok()?.to_be_bytes();
    Some([red, green, blue])
}

/// One of [`COLOR_MODES`], the name of a field, or `field:NAME` for a field that is called like a mode.
pub(crate) fn color(text: &str) -> Result<ColorMode, String> {
    Ok(match text {
        "auto" => ColorMode::Auto,
        "rgb" => ColorMode::Rgb,
        "plain" => ColorMode::Plain,
        "height" => ColorMode::Height,
        "classification" => ColorMode::Classification,
        "normal" => ColorMode::Normal,
        "curvature" => ColorMode::Curvature,
        "radius" => ColorMode::Radius,
        "k-radius" => ColorMode::KRadius,
        "depth" => ColorMode::Depth,
        "" => return Err("a colour mode or the name of a field is expected".into()),
        "intensity" => ColorMode::Field("Intensity".into()),
        name => ColorMode::Field(name.strip_prefix("field:").unwrap_or(name).into()),
    })
}

/// A finite number.
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

    #[test]
    fn backgrounds() {
        assert_eq!(background("#0a141E"), Ok(Background::Color([10, 20, 30])), "either letter case");
        assert_eq!(background("#000000,#ffffff"), Ok(Background::Gradient([0; 3], [255; 3])), "two colours");
        assert_eq!(background("transparent"), Ok(Background::Transparent), "no colour");
        for bad in ["red", "#fff", "#+12345", "#12345g", "000000", "#000000,", ""] {
            assert!(background(bad).is_err(), "{bad} is no background");
        }
    }

    #[test]
    fn colors() {
        for name in COLOR_MODES {
            let mode = color(name);
            let is_field = matches!(&mode, Ok(ColorMode::Field(field)) if field != "Intensity");
            assert!(mode.is_ok() && !is_field, "{name} is a mode");
        }
        assert_eq!(color("field:height"), Ok(ColorMode::Field("height".into())), "a field called like a mode");
    }
}
