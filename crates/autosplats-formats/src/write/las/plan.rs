//! Chooses the point format of a cloud, and the place of each value.

use std::borrow::Cow;

use autosplats_cloud::{Axes, Error, Field, FieldValues, PointCloud, each_type, printable};
use glam::DVec3;
use rayon::prelude::*;

use super::{
    super::{Job, colors},
    grid,
};
use crate::las::{self, ANGLE_STEP, EXTRA_DESCRIPTOR, Place};

/// 2⁵³: up to it, `f64` holds all integers.
const MAX_EXACT_INTEGER: f64 = 9_007_199_254_740_992.0;

/// Most bytes of a record, and of a name.
const MAX_RECORD: usize = 65_535;
const MAX_NAME: usize = 32;

/// How a cloud is written.
pub(super) struct Plan<'a> {
    pub(super) cloud: &'a PointCloud,
    pub(super) format: usize,
    pub(super) record_len: usize,
    pub(super) scale: DVec3,
    pub(super) offset: DVec3,
    /// Indices of the points that are written; `None` for all.
    kept: Option<Vec<usize>>,
    own: Vec<(Place, Cow<'a, FieldValues>)>,
    colors: Option<(usize, Colors<'a>)>,
    extras: Vec<Extra<'a>>,
}

/// Source of the colours.
enum Colors<'a> {
    Bytes(&'a [[u8; 3]]),
    Wide([&'a [u16]; 3]),
}

/// A field that becomes extra bytes.
struct Extra<'a> {
    name: String,
    values: &'a FieldValues,
    at: usize,
}

impl<'a> Plan<'a> {
    /// Makes the plan, and notes its losses.
    pub(super) fn of(job: &Job<'a>) -> Result<Self, Error> {
        let cloud = job.cloud;
        let finite = |i: usize| cloud.world_position(i).is_finite();
        let count = (0..cloud.len()).into_par_iter().filter(|&i| finite(i)).count();
        let kept: Option<Vec<usize>> =
            (count < cloud.len()).then(|| (0..cloud.len()).into_par_iter().filter(|&i| finite(i)).collect());
        if count < cloud.len() {
            let dropped = cloud.len() - count;
            job.note(format!("{dropped} points without finite coordinates are left out; LAS cannot hold them"));
        }
        if !cloud.scans().is_empty() {
            job.note("LAS cannot hold sensor positions; they are left out");
        }
        if let Some(axes) = cloud.axes().filter(|&axes| axes != Axes::ZUp) {
            let up = if axes == Axes::Camera { Axes::YDown } else { axes }.name();
            job.note(format!("LAS does not store which axis is up; readers assume z-up, but here it is {up}"));
        }
        let point = |i: usize| kept.as_ref().map_or(i, |kept| kept[i]);
        let grid = grid::Grid::of(job, count, |i| cloud.world_position(point(i)))?;

        let wide_colors = wide_colors(cloud);
        let colored = wide_colors.is_some() || cloud.colors().is_some();
        let is_color = |field: &Field| wide_colors.is_some() && colors::CHANNELS.contains(&&*field.name);
        let fields: Vec<(&Field, ValueRange)> = cloud
            .fields()
            .iter()
            .filter(|field| !is_color(field))
            .map(|field| (field, ValueRange::of(&field.values)))
            .collect();
        let format = choose(&fields, colored, count);

        let places = las::places(format);
        let mut own = Vec::new();
        let mut extras: Vec<Extra<'a>> = Vec::new();
        let mut record_len = las::RECORD_LEN[format];
        for (field, range) in fields {
            let place = places.iter().find(|(name, _)| field.name.eq_ignore_ascii_case(name)).map(|&(_, place)| place);
            match place {
                Some(place) if range.fits(place) => {
                    if matches!(place, Place::Angle(_)) && angles_are_rounded(&field.values) {
                        job.note(format!("scan angles are rounded to steps of {ANGLE_STEP} degrees"));
                    }
                    own.push((place, Cow::Borrowed(&field.values)));
                }
                // A value that is zero at every point counts as not recorded.
                None if range.is_zero() && is_known(&field.name) => {}
                place => {
                    let scale = IntensityScale::of(field, range).zip(place);
                    if let Some((scale, place)) = scale {
                        own.push((place, Cow::Owned(scale.apply(&field.values))));
                        let [low, high] = [scale.low, scale.high].map(|end| end as f32);
                        job.note(format!(
                            "intensities of {low} to {high} are scaled to 0 to 65535; {EXACT_INTENSITY} keeps the original values"
                        ));
                    } else if place.is_some() || is_known(&field.name) {
                        job.note(format!(
                            "the values of {} do not fit their place in LAS; they become extra bytes",
                            field.name
                        ));
                    }
                    let wished = if scale.is_some() { EXACT_INTENSITY } else { &field.name };
                    let name = extra_name(wished, &extras);
                    if name != wished {
                        job.note(format!("the field '{}' is called '{name}' in the file", shown(&field.name)));
                    }
                    let size = size(&field.values);
                    extras.push(Extra { name, values: &field.values, at: record_len });
                    record_len += size;
                }
            }
        }
        if record_len > MAX_RECORD {
            let what = format!("a point would take {record_len} bytes; LAS allows {MAX_RECORD}; write PLY instead");
            return Err(Error::Unsupported { path: job.path.into(), what });
        }
        let source = match (wide_colors, cloud.colors()) {
            (Some(wide), _) => Some(Colors::Wide(wide)),
            (None, bytes) => bytes.map(Colors::Bytes),
        };
        let colors = las::colors(format).zip(source);
        Ok(Self { cloud, format, record_len, scale: grid.scale, offset: grid.offset, kept, own, colors, extras })
    }

    /// Number of points that are written.
    pub(super) fn points(&self) -> usize {
        self.kept.as_ref().map_or(self.cloud.len(), Vec::len)
    }

    /// Index in the cloud of a point of the file.
    pub(super) fn point(&self, index: usize) -> usize {
        self.kept.as_ref().map_or(index, |kept| kept[index])
    }

    /// Bytes of a record beyond its point format.
    pub(super) fn extra_len(&self) -> usize {
        self.record_len - las::RECORD_LEN[self.format]
    }

    pub(super) fn is_wide(&self) -> bool {
        las::is_wide(self.format)
    }

    /// Whether some times exceed those within a GPS week.
    pub(super) fn has_standard_time(&self) -> bool {
        const WEEK: f64 = 604_800.0;
        let times = self.own.iter().find(|(place, _)| matches!(place, Place::F64(_)));
        times.is_some_and(|(_, values)| (0..values.len()).into_par_iter().any(|i| values.get(i).abs() > WEEK))
    }

    /// Fills `records` completely; `point` maps a record's index to its point in the cloud.
    pub(super) fn encode(&self, records: &mut [u8], point: impl Fn(usize) -> usize) {
        let len = self.record_len;
        let point = &point;
        records.fill(0);
        each(records, len, point, |record, i| {
            let steps = ((self.cloud.world_position(i) - self.offset) / self.scale).round().to_array();
            place_at::<12>(record, 0, bytemuck::cast(steps.map(|step| (step as i32).to_le_bytes())));
        });
        #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one of the types is f64 itself")]
        for (place, values) in &self.own {
            each_type!(&**values, v => match *place {
                Place::Bits { at, shift, mask } => {
                    each(records, len, point, |record, i| record[at] |= (v[i] as u8 & mask) << shift);
                }
                Place::I8(at) => each(records, len, point, |record, i| record[at] = v[i] as i8 as u8),
                Place::U16(at) => each(records, len, point, |record, i| place_at(record, at, (v[i] as u16).to_le_bytes())),
                Place::Angle(at) => {
                    each(records, len, point, |record, i| place_at(record, at, angle_steps(v[i] as f64).to_le_bytes()));
                }
                Place::F64(at) => each(records, len, point, |record, i| place_at(record, at, (v[i] as f64).to_le_bytes())),
            });
        }
        match &self.colors {
            Some((at, Colors::Bytes(colors))) => each(records, len, point, |record, i| {
                let channels = colors[i].map(|channel| (u16::from(channel) * 257).to_le_bytes());
                place_at::<6>(record, *at, bytemuck::cast(channels));
            }),
            Some((at, Colors::Wide(channels))) => each(records, len, point, |record, i| {
                let channels = channels.map(|channel| channel[i].to_le_bytes());
                place_at::<6>(record, *at, bytemuck::cast(channels));
            }),
            None => {}
        }
        for Extra { values, at, .. } in &self.extras {
            each_type!(values, v => each(records, len, point, |record, i| place_at(record, *at, v[i].to_le_bytes())));
        }
    }

    /// Descriptors of the extra bytes.
    pub(super) fn descriptors(&self) -> Vec<[u8; EXTRA_DESCRIPTOR]> {
        let describe = |extra: &Extra<'_>| {
            let mut raw = [0; EXTRA_DESCRIPTOR];
            raw[2] = data_type(extra.values);
            raw[4..4 + extra.name.len()].copy_from_slice(extra.name.as_bytes());
            raw
        };
        self.extras.iter().map(describe).collect()
    }
}

/// Calls `put` for every record with its point.
fn each(records: &mut [u8], len: usize, point: &impl Fn(usize) -> usize, put: impl Fn(&mut [u8], usize)) {
    records.chunks_exact_mut(len).enumerate().for_each(|(i, record)| put(record, point(i)));
}

fn place_at<const LEN: usize>(record: &mut [u8], at: usize, bytes: [u8; LEN]) {
    record[at..at + LEN].copy_from_slice(&bytes);
}

fn angle_steps(degrees: f64) -> i16 {
    (degrees / f64::from(ANGLE_STEP)).round() as i16
}

fn angles_are_rounded(values: &FieldValues) -> bool {
    let off = |angle: f64| (f64::from(angle_steps(angle)) * f64::from(ANGLE_STEP) - angle).abs() > 1e-4;
    (0..values.len()).into_par_iter().any(|i| off(values.get(i)))
}

/// The 16-bit colour fields.
fn wide_colors(cloud: &PointCloud) -> Option<[&[u16]; 3]> {
    match colors::wide_colors(cloud)? {
        [FieldValues::U16(red), FieldValues::U16(green), FieldValues::U16(blue)] => Some([red, green, blue]),
        _ => None,
    }
}

/// Least and greatest value of a field.
#[derive(Clone, Copy)]
struct ValueRange {
    low: f64,
    high: f64,
    /// Whether all values are whole numbers.
    whole: bool,
    finite: bool,
}

impl ValueRange {
    fn of(values: &FieldValues) -> Self {
        let none = Self { low: f64::INFINITY, high: f64::NEG_INFINITY, whole: true, finite: true };
        let one = |value: f64| Self { low: value, high: value, whole: value.fract() == 0.0, finite: value.is_finite() };
        let both = |a: Self, b: Self| Self {
            low: a.low.min(b.low),
            high: a.high.max(b.high),
            whole: a.whole && b.whole,
            finite: a.finite && b.finite,
        };
        #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one of the types is f64 itself")]
        {
            each_type!(values, v => v.par_iter().map(|&value| one(value as f64)).reduce(|| none, both))
        }
    }

    fn is_zero(&self) -> bool {
        self.whole && self.low >= 0.0 && self.high <= 0.0
    }

    fn within(&self, low: f64, high: f64) -> bool {
        // Without points everything fits.
        self.low > self.high || self.finite && self.low >= low && self.high <= high
    }

    fn fits(&self, place: Place) -> bool {
        match place {
            Place::Bits { mask, .. } => self.whole && self.within(0.0, mask.into()),
            Place::I8(_) => self.whole && self.within(-128.0, 127.0),
            Place::U16(_) => self.whole && self.within(0.0, 65_535.0),
            Place::Angle(_) => self.within(-180.0, 180.0),
            // Integers beyond 2⁵³ do not fit; NaN is allowed here.
            Place::F64(_) => !self.finite || !self.whole || self.within(-MAX_EXACT_INTEGER, MAX_EXACT_INTEGER),
        }
    }
}

/// Name of the field that keeps the original values of scaled intensities.
const EXACT_INTENSITY: &str = "ExactIntensity";

/// Intensities that are mapped to the 16 bits of LAS.
#[derive(Clone, Copy)]
struct IntensityScale {
    low: f64,
    high: f64,
}

impl IntensityScale {
    /// A scale for intensities that do not fit unchanged, such as the 0 to 1 of most formats.
    fn of(field: &Field, range: ValueRange) -> Option<Self> {
        let ValueRange { low, high, .. } = range;
        let usable = low < high && low.is_finite() && high.is_finite();
        // If all values are NaN, the least one is above the greatest.
        let is_unit = low >= 0.0 && low <= high && high <= 1.0;
        let scale = if is_unit { Self { low: 0.0, high: 1.0 } } else { Self { low, high } };
        (field.name.eq_ignore_ascii_case("Intensity") && (usable || is_unit)).then_some(scale)
    }

    /// The scaled values; NaN becomes 0.
    fn apply(self, values: &FieldValues) -> FieldValues {
        // Halving avoids overflow: a range of `f64` may exceed the largest `f64`.
        let part = |i| (values.get(i) / 2.0 - self.low / 2.0) / (self.high / 2.0 - self.low / 2.0);
        FieldValues::U16((0..values.len()).into_par_iter().map(|i| (65_535.0 * part(i)).round() as u16).collect())
    }
}

/// Whether any point format has a place for a field of this name.
fn is_known(name: &str) -> bool {
    [3, 8].into_iter().flat_map(las::places).any(|(known, _)| name.eq_ignore_ascii_case(known))
}

/// The point format: of LAS 1.2, unless some value needs LAS 1.4.
fn choose(fields: &[(&Field, ValueRange)], colored: bool, count: usize) -> usize {
    let needs_wide = |&(field, range): &(&Field, ValueRange)| {
        let find =
            |format: usize| las::places(format).into_iter().find(|(name, _)| field.name.eq_ignore_ascii_case(name));
        let fits = |format: usize| find(format).is_some_and(|(_, place)| range.fits(place));
        // LAS 1.2 counts five returns.
        let many =
            field.name.to_ascii_lowercase().contains("returns") || field.name.eq_ignore_ascii_case("ReturnNumber");
        let fits_narrow = fits(3) && !(many && range.high > 5.0);
        !range.is_zero() && !fits_narrow && fits(8)
    };
    let has =
        |name: &str| fields.iter().any(|(field, range)| field.name.eq_ignore_ascii_case(name) && !range.is_zero());
    if count as u64 > u64::from(u32::MAX) || fields.iter().any(needs_wide) {
        match (colored, has("Infrared")) {
            (_, true) => 8,
            (true, false) => 7,
            (false, false) => 6,
        }
    } else {
        match (has("GpsTime"), colored) {
            (false, false) => 0,
            (true, false) => 1,
            (false, true) => 2,
            (true, true) => 3,
        }
    }
}

/// Type number of the values among those of extra bytes.
fn data_type(values: &FieldValues) -> u8 {
    match values {
        FieldValues::U8(_) => 1,
        FieldValues::I8(_) => 2,
        FieldValues::U16(_) => 3,
        FieldValues::I16(_) => 4,
        FieldValues::U32(_) => 5,
        FieldValues::I32(_) => 6,
        FieldValues::U64(_) => 7,
        FieldValues::I64(_) => 8,
        FieldValues::F32(_) => 9,
        FieldValues::F64(_) => 10,
    }
}

fn size(values: &FieldValues) -> usize {
    match values {
        FieldValues::U8(_) | FieldValues::I8(_) => 1,
        FieldValues::U16(_) | FieldValues::I16(_) => 2,
        FieldValues::U32(_) | FieldValues::I32(_) | FieldValues::F32(_) => 4,
        FieldValues::U64(_) | FieldValues::I64(_) | FieldValues::F64(_) => 8,
    }
}

/// A unique name of at most 32 bytes.
fn extra_name(name: &str, others: &[Extra<'_>]) -> String {
    let cut = |name: &str, len: usize| {
        let end = (0..=len.min(name.len())).rev().find(|&end| name.is_char_boundary(end)).unwrap_or(0);
        name[..end].trim_end().to_owned()
    };
    let clean: String = name.chars().filter(|c| !c.is_control()).collect();
    let clean = if clean.trim().is_empty() { "Extra".to_owned() } else { clean.trim().to_owned() };
    let mut unique = cut(&clean, MAX_NAME);
    let mut number = 2;
    while others.iter().any(|other| other.name.eq_ignore_ascii_case(&unique)) {
        let ending = format!("_{number}");
        unique = cut(&clean, MAX_NAME - ending.len()) + &ending;
        number += 1;
    }
    unique
}

/// A name for display in a message.
fn shown(name: &str) -> String {
    printable(&name.chars().take(60).collect::<String>())
}
