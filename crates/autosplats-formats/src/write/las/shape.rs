//! The shape of records: which point format suits some points, and where each value goes.

use std::path::Path;

use autosplats_cloud::{Axes, Crs, Error, FieldValues, PointCloud, Progress, each_type, one_line, printable};
use glam::DVec3;
use rayon::prelude::*;

use super::super::colors::{self, WideColors};
use crate::las::{self, ANGLE_STEP, EXTRA_DESCRIPTOR, Place};

/// 2⁵³: up to it, `f64` holds all integers.
const MAX_EXACT_INTEGER: f64 = 9_007_199_254_740_992.0;

/// Most bytes of a record, and of a name.
const MAX_RECORD: usize = 65_535;
const MAX_NAME: usize = 32;

/// Distance of coordinates from multiples of their steps, in steps, that is due to rounding.
const MAX_MISS: f64 = 0.01;

/// What points hold, which may come in several clouds.
#[derive(Clone, Debug)]
pub(in crate::write) struct Survey {
    /// Number of points with finite coordinates, and of others.
    pub(in crate::write) points: usize,
    dropped: usize,
    /// Corners of the box around the points.
    pub(in crate::write) bounds: [DVec3; 2],
    /// Steps of which all coordinates are multiples, if the clouds state them.
    pub(in crate::write) steps: Option<DVec3>,
    pub(super) fields: Vec<Surveyed>,
    /// Whether there are colours of 8 bits, and what is known of those of 16.
    colored: bool,
    wide: Option<WideColors>,
    sensors: bool,
    axes: Option<Axes>,
    /// The step that the clouds state.
    pub(super) resolution: Option<DVec3>,
    pub(in crate::write) crs: Crs,
    standard_time: bool,
}

/// What is known of a field.
#[derive(Clone, Debug)]
pub(super) struct Surveyed {
    name: String,
    /// Type number among those of extra bytes.
    kind: u8,
    range: ValueRange,
    /// Whether some values are no multiples of the step of scan angles.
    rounds: bool,
}

impl Survey {
    pub(in crate::write) fn of(cloud: &PointCloud) -> Self {
        let none = (0, [DVec3::INFINITY, DVec3::NEG_INFINITY]);
        let one = |i: usize| match cloud.world_position(i) {
            place if place.is_finite() => (1, [place; 2]),
            _ => none,
        };
        let join = |(n, [a, b]): (usize, [DVec3; 2]), (m, [c, d]): (usize, [DVec3; 2])| (n + m, [a.min(c), b.max(d)]);
        let (points, bounds) = (0..cloud.len()).into_par_iter().map(one).reduce(|| none, join);
        let positive = |steps: &DVec3| steps.is_finite() && steps.cmpgt(DVec3::ZERO).all();
        let is_multiple = |steps: &DVec3| {
            let miss = |place: DVec3| (place / *steps - (place / *steps).round()).abs().max_element();
            (0..cloud.len()).into_par_iter().map(|i| cloud.world_position(i)).all(|place| !(miss(place) > MAX_MISS))
        };
        let resolution = cloud.resolution().filter(positive);
        let steps = resolution.filter(is_multiple);
        let fields = cloud.fields().iter().map(|field| Surveyed {
            name: field.name.clone(),
            kind: data_type(&field.values),
            range: ValueRange::of(&field.values),
            rounds: angles_are_rounded(&field.values),
        });
        let fields: Vec<Surveyed> = fields.collect();
        let time = fields.iter().find(|field| field.name.eq_ignore_ascii_case("GpsTime"));
        Self {
            points,
            dropped: cloud.len() - points,
            bounds,
            steps,
            colored: cloud.colors().is_some(),
            wide: WideColors::of(cloud).filter(WideColors::are_short),
            sensors: !cloud.scans().is_empty(),
            axes: cloud.axes(),
            resolution,
            crs: cloud.crs().clone(),
            standard_time: time.is_some_and(|time| time.range.high.max(-time.range.low) > WEEK),
            fields,
        }
    }

    /// Adds what other points hold. Both must have fields of the same names and types.
    pub(in crate::write) fn add(&mut self, other: Self) -> Result<(), String> {
        let same = |(a, b): (&Surveyed, &Surveyed)| (&a.name, a.kind) == (&b.name, b.kind);
        let fields = self.fields.len() == other.fields.len() && self.fields.iter().zip(&other.fields).all(same);
        if !fields || self.colored != other.colored {
            return Err("its points do not all have the same values; it cannot be read in parts".into());
        }
        self.points += other.points;
        self.dropped += other.dropped;
        self.steps = self.steps.filter(|_| self.steps == other.steps);
        self.resolution = self.resolution.filter(|_| self.resolution == other.resolution);
        self.wide = self.wide.zip(other.wide).map(|(wide, other)| wide.and(other));
        self.bounds = [self.bounds[0].min(other.bounds[0]), self.bounds[1].max(other.bounds[1])];
        for (own, other) in self.fields.iter_mut().zip(other.fields) {
            own.range = own.range.and(other.range);
            own.rounds |= other.rounds;
        }
        self.sensors |= other.sensors;
        self.standard_time |= other.standard_time;
        Ok(())
    }

    /// Whether the colours come from fields of 16 bits.
    fn is_wide(&self) -> bool {
        self.wide.is_some_and(|wide| wide.are_colors())
    }

    pub(in crate::write) fn is_colored(&self) -> bool {
        self.colored || self.is_wide()
    }

    /// The fields that are no colours.
    fn values(&self) -> impl Iterator<Item = &Surveyed> {
        let is_wide = self.is_wide();
        self.fields.iter().filter(move |field| !(is_wide && colors::CHANNELS.contains(&&*field.name)))
    }

    /// Notes what LAS cannot hold, whatever its format.
    pub(in crate::write) fn note_losses(&self, progress: &dyn Progress) {
        if self.dropped > 0 {
            let dropped = self.dropped;
            progress.note(&format!("{dropped} points without finite coordinates are left out; LAS cannot hold them"));
        }
        if self.sensors {
            progress.note("LAS cannot hold sensor positions; they are left out");
        }
        if let Some(axes) = self.axes.filter(|&axes| axes != Axes::ZUp) {
            let up = if axes == Axes::Camera { Axes::YDown } else { axes }.name();
            progress.note(&format!("LAS does not store which axis is up; readers assume z-up, but here it is {up}"));
        }
    }

    /// The point format of those of COPC that suits best.
    pub(in crate::write) fn tree_format(&self) -> usize {
        let infrared = |field: &Surveyed| {
            let place = Place::U16(36);
            field.name.eq_ignore_ascii_case("Infrared") && !field.range.is_zero() && field.range.fits(place)
        };
        match (self.is_colored(), self.fields.iter().any(infrared)) {
            (_, true) => 8,
            (true, false) => 7,
            (false, false) => 6,
        }
    }

    /// Whether some time exceeds those within a GPS week; `None` without times.
    pub(in crate::write) fn standard_time(&self) -> Option<bool> {
        self.fields.iter().any(|field| field.name.eq_ignore_ascii_case("GpsTime")).then_some(self.standard_time)
    }
}

/// Seconds of a GPS week.
pub(super) const WEEK: f64 = 604_800.0;

/// Where the values of points go.
#[derive(Clone, Debug)]
pub(in crate::write) struct Shape {
    pub(in crate::write) format: usize,
    pub(in crate::write) record_len: usize,
    /// Whether colours come from fields of 16 bits.
    pub(super) wide: bool,
    pub(super) columns: Vec<Column>,
    /// Descriptions of the extra bytes.
    pub(in crate::write) descriptors: Vec<[u8; EXTRA_DESCRIPTOR]>,
}

/// Where the values of a field go.
#[derive(Clone, Debug)]
pub(super) struct Column {
    pub(super) name: String,
    /// Place in the point format, and how values are scaled for it.
    pub(super) place: Option<(Place, Option<IntensityScale>)>,
    /// Byte offset among the extra bytes of a record.
    pub(super) extra: Option<usize>,
}

impl Shape {
    /// The shape of records of this format. Notes the losses.
    pub(in crate::write) fn of(
        survey: &Survey,
        format: usize,
        path: &Path,
        progress: &dyn Progress,
    ) -> Result<Self, Error> {
        let note = |note: String| progress.note(&one_line(&note));
        let places = las::places(format);
        let mut columns = Vec::new();
        let mut descriptors: Vec<[u8; EXTRA_DESCRIPTOR]> = Vec::new();
        let mut record_len = las::RECORD_LEN[format];
        for Surveyed { name, kind, range, rounds } in survey.values() {
            let place = places.iter().find(|(known, _)| name.eq_ignore_ascii_case(known)).map(|&(_, place)| place);
            let mut column = Column { name: name.clone(), place: None, extra: None };
            match place {
                Some(place) if range.fits(place) => {
                    if matches!(place, Place::Angle(_)) && *rounds {
                        note(format!("scan angles are rounded to steps of {ANGLE_STEP} degrees"));
                    }
                    column.place = Some((place, None));
                }
                // A value that is zero at every point counts as not recorded.
                None if range.is_zero() && is_known(name) => {}
                place => {
                    let scale = IntensityScale::of(name, *range).zip(place);
                    if let Some((scale, place)) = scale {
                        column.place = Some((place, Some(scale)));
                        let [low, high] = [scale.low, scale.high].map(|end| end as f32);
                        note(format!(
                            "intensities of {low} to {high} are scaled to 0 to 65535; {EXACT_INTENSITY} keeps the original values"
                        ));
                    } else if place.is_some() || is_known(name) {
                        note(format!("the values of {name} do not fit their place in LAS; they become extra bytes"));
                    }
                    let wished = if scale.is_some() { EXACT_INTENSITY } else { name };
                    let own = extra_name(wished, &descriptors);
                    if own != wished {
                        note(format!("the field '{}' is called '{own}' in the file", shown(name)));
                    }
                    let mut raw = [0; EXTRA_DESCRIPTOR];
                    raw[2] = *kind;
                    raw[4..4 + own.len()].copy_from_slice(own.as_bytes());
                    descriptors.push(raw);
                    column.extra = Some(record_len);
                    record_len += las::extra_size(*kind).unwrap_or_default();
                }
            }
            columns.push(column);
        }
        if record_len > MAX_RECORD {
            let what = format!("a point would take {record_len} bytes; LAS allows {MAX_RECORD}; write PLY instead");
            return Err(Error::Unsupported { path: path.into(), what });
        }
        Ok(Self { format, record_len, wide: survey.is_wide(), columns, descriptors })
    }
}

pub(super) fn angle_steps(degrees: f64) -> i16 {
    (degrees / f64::from(ANGLE_STEP)).round() as i16
}

fn angles_are_rounded(values: &FieldValues) -> bool {
    let off = |angle: f64| (f64::from(angle_steps(angle)) * f64::from(ANGLE_STEP) - angle).abs() > 1e-4;
    (0..values.len()).into_par_iter().any(|i| off(values.get(i)))
}

/// Least and greatest value of a field.
#[derive(Clone, Copy, Debug)]
pub(super) struct ValueRange {
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
        #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one of the types is f64 itself")]
        {
            each_type!(values, v => v.par_iter().map(|&value| one(value as f64)).reduce(|| none, Self::and))
        }
    }

    fn and(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            whole: self.whole && other.whole,
            finite: self.finite && other.finite,
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
#[derive(Clone, Copy, Debug)]
pub(super) struct IntensityScale {
    low: f64,
    high: f64,
}

impl IntensityScale {
    /// A scale for intensities that do not fit unchanged, such as the 0 to 1 of most formats.
    fn of(name: &str, range: ValueRange) -> Option<Self> {
        let ValueRange { low, high, .. } = range;
        let usable = low < high && low.is_finite() && high.is_finite();
        // If all values are NaN, the least one is above the greatest.
        let is_unit = low >= 0.0 && low <= high && high <= 1.0;
        let scale = if is_unit { Self { low: 0.0, high: 1.0 } } else { Self { low, high } };
        (name.eq_ignore_ascii_case("Intensity") && (usable || is_unit)).then_some(scale)
    }

    /// The scaled values; NaN becomes 0.
    pub(super) fn apply(self, values: &FieldValues) -> FieldValues {
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
pub(super) fn choose(survey: &Survey) -> usize {
    let (colored, count) = (survey.is_colored(), survey.points);
    let needs_wide = |field: &Surveyed| {
        let range = field.range;
        let find =
            |format: usize| las::places(format).into_iter().find(|(name, _)| field.name.eq_ignore_ascii_case(name));
        let fits = |format: usize| find(format).is_some_and(|(_, place)| range.fits(place));
        // LAS 1.2 counts five returns.
        let many =
            field.name.to_ascii_lowercase().contains("returns") || field.name.eq_ignore_ascii_case("ReturnNumber");
        let fits_narrow = fits(3) && !(many && range.high > 5.0);
        !range.is_zero() && !fits_narrow && fits(8)
    };
    let has = |name: &str| survey.values().any(|field| field.name.eq_ignore_ascii_case(name) && !field.range.is_zero());
    if count as u64 > u64::from(u32::MAX) || survey.values().any(needs_wide) {
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

/// A unique name of at most 32 bytes.
fn extra_name(name: &str, others: &[[u8; EXTRA_DESCRIPTOR]]) -> String {
    let cut = |name: &str, len: usize| {
        let end = (0..=len.min(name.len())).rev().find(|&end| name.is_char_boundary(end)).unwrap_or(0);
        name[..end].trim_end().to_owned()
    };
    let clean: String = name.chars().filter(|c| !c.is_control()).collect();
    let clean = if clean.trim().is_empty() { "Extra".to_owned() } else { clean.trim().to_owned() };
    let mut unique = cut(&clean, MAX_NAME);
    let mut number = 2;
    while others.iter().any(|other| name_of(other).eq_ignore_ascii_case(&unique)) {
        let ending = format!("_{number}");
        unique = cut(&clean, MAX_NAME - ending.len()) + &ending;
        number += 1;
    }
    unique
}

/// The name in a description.
fn name_of(raw: &[u8; EXTRA_DESCRIPTOR]) -> String {
    let name = raw[4..4 + MAX_NAME].split(|&byte| byte == 0).next().unwrap_or_default();
    String::from_utf8_lossy(name).into_owned()
}

/// A name for display in a message.
fn shown(name: &str) -> String {
    printable(&name.chars().take(60).collect::<String>())
}
