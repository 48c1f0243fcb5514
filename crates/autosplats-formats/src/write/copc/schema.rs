//! What the records of the file hold, so that those of all inputs fit in.

use std::path::{Path, PathBuf};

use autosplats_cloud::{Crs, Error, Progress, Unit, shown_number};
use glam::DVec3;

use super::{extras::Extras, frame::Lattice};
use crate::{
    las::{self, EXTRA_DESCRIPTOR},
    write::las::{today, well_known_text},
};

/// Most steps from the offset, slightly less than 32 bits hold.
pub(super) const MAX_STEPS: f64 = 2_147_483_600.0;

/// Distance of two lattices from each other, in steps, up to which they are the same.
pub(super) const SAME_STEP: f64 = 1e-3;

/// Most inputs that a message names.
const MAX_NAMED: usize = 3;

/// The records of the file.
#[derive(Clone, Debug)]
pub(super) struct Schema {
    pub(super) format: usize,
    pub(super) record_len: usize,
    pub(super) lattice: Lattice,
    pub(super) extras: Vec<[u8; EXTRA_DESCRIPTOR]>,
    /// The layout of the extra bytes.
    pub(super) layout: Extras,
    pub(super) crs: Crs,
    pub(super) standard_time: bool,
    pub(super) created: (u16, u16),
}

/// What an input holds.
#[derive(Clone, Debug)]
pub(super) struct Holds {
    pub(super) name: PathBuf,
    pub(super) points: u64,
    pub(super) colors: bool,
    pub(super) infrared: bool,
    /// Steps of the coordinates, if they are integers in the input.
    pub(super) lattice: Option<Lattice>,
    pub(super) bounds: [DVec3; 2],
    pub(super) extras: Extras,
    pub(super) crs: Crs,
    /// Whether times count from 1980; `None` without times.
    pub(super) standard_time: Option<bool>,
    pub(super) created: Option<(u16, u16)>,
}

impl Schema {
    /// The records that hold what all inputs hold. What is lost is noted, what cannot be joined is refused.
    pub(super) fn of(inputs: &[Holds], progress: &dyn Progress) -> Result<Self, Error> {
        let any = |has: fn(&Holds) -> bool| inputs.iter().any(has);
        let format = match (any(|input| input.colors), any(|input| input.infrared)) {
            (_, true) => 8,
            (true, false) => 7,
            (false, false) => 6,
        };
        if format > 6 && !inputs.iter().all(|input| input.colors) {
            progress.note(&format!("{} without colours become black", named(inputs, |input| !input.colors)));
        }
        let layout = Extras::join(inputs.iter().map(|input| (&*input.name, &input.extras)), progress)?;
        let record_len = las::RECORD_LEN[format] + layout.len();
        if record_len > usize::from(u16::MAX) {
            let what = format!("a point would take {record_len} bytes; LAS allows {}", u16::MAX);
            return Err(Error::unsupported(&inputs[0].name, what));
        }
        let times = |standard| inputs.iter().find(|input| input.standard_time == Some(standard));
        if let (Some(week), Some(standard)) = (times(false), times(true)) {
            let what = format!(
                "its GPS times count from the start of a week, those of {} from 1980; no conversion is known",
                standard.name.display()
            );
            return Err(Error::unsupported(&week.name, what));
        }
        let newest = inputs.iter().filter_map(|input| input.created).max_by_key(|&(day, year)| (year, day));
        Ok(Self {
            format,
            record_len,
            lattice: lattice(inputs, progress)?,
            extras: layout.descriptors(),
            layout,
            crs: crs(inputs, progress)?,
            standard_time: times(true).is_some(),
            created: newest.unwrap_or_else(today),
        })
    }
}

/// Names of some inputs for a message.
fn named(inputs: &[Holds], which: impl Fn(&Holds) -> bool) -> String {
    let names: Vec<String> =
        inputs.iter().filter(|input| which(input)).map(|input| input.name.display().to_string()).collect();
    let more = names.len().saturating_sub(MAX_NAMED);
    names[..names.len().min(MAX_NAMED)].join(", ") + &if more > 0 { format!(" and {more} more") } else { String::new() }
}

/// The coordinate system of all inputs.
fn crs(inputs: &[Holds], progress: &dyn Progress) -> Result<Crs, Error> {
    let plain = |crs: &Crs| *crs == Crs::default();
    let mut known: Vec<&Holds> = inputs.iter().filter(|input| !plain(&input.crs)).collect();
    // The order of the inputs does not matter.
    known.sort_by_key(|input| (input.crs.wkt.is_none(), format!("{:?}", input.crs)));
    let Some(first) = known.first() else { return Ok(Crs::default()) };
    let same = |a: &Crs, b: &Crs| {
        a == b
            || a.unit == b.unit
                && a.vertical_unit == b.vertical_unit
                && (a.epsg.is_some() && a.epsg == b.epsg || a.wkt.is_some() && a.wkt == b.wkt)
    };
    if let Some(other) = known.iter().find(|other| !same(&first.crs, &other.crs)) {
        let shown = |crs: &Crs| match (&crs.name, crs.epsg) {
            (_, Some(code)) => format!("EPSG:{code}"),
            (Some(name), None) => format!("'{name}'"),
            (None, None) => crs.unit.map_or("an unknown system".into(), |unit| format!("a system in {}", unit.name())),
        };
        let what = format!(
            "its coordinate system is {}, that of {} is {}; convert one of them first",
            shown(&other.crs),
            first.name.display(),
            shown(&first.crs)
        );
        return Err(Error::unsupported(&other.name, what));
    }
    if known.len() < inputs.len() {
        let unknown = named(inputs, |input| plain(&input.crs));
        progress.note(&format!("{unknown} without a coordinate system are taken to be in that of the others"));
    }
    if first.crs.geotiff.is_some() && well_known_text(&first.crs).is_none() {
        progress.note("the coordinate system is kept as GeoTIFF keys, as in the input, where few programs look for it");
    }
    Ok(first.crs.clone())
}

/// Steps that hold the coordinates of all inputs.
fn lattice(inputs: &[Holds], progress: &dyn Progress) -> Result<Lattice, Error> {
    let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let [low, high] = inputs.iter().map(|input| input.bounds).fold(none, |[a, b], [c, d]| [a.min(c), b.max(d)]);
    let points: u64 = inputs.iter().map(|input| input.points).sum();
    let (mut scale, mut offset) = (DVec3::INFINITY, DVec3::INFINITY);
    for known in inputs.iter().filter_map(|input| input.lattice) {
        scale = scale.min(known.scale.abs());
        offset = offset.min(known.offset);
    }
    if inputs.iter().any(|input| input.lattice.is_none()) {
        let degrees = inputs.iter().any(|input| input.crs.unit == Some(Unit::Degree));
        scale = scale.min(scale_of_floats(high - low, points, degrees));
    }
    for axis in 0..3 {
        let size = high[axis] - low[axis];
        let wished = scale[axis];
        while size > 2.0 * MAX_STEPS * scale[axis] {
            scale[axis] *= 10.0;
        }
        let loses = |input: &&Holds| input.lattice.is_some_and(|own| own.scale[axis].abs() < 0.999 * scale[axis]);
        if let Some(input) = inputs.iter().find(loses) {
            let what = format!(
                "32 bits do not reach from it to the other inputs in its steps of {}; convert them one by one",
                shown_number(wished)
            );
            return Err(Error::unsupported(&input.name, what));
        }
        let reaches = |offset: f64| [low, high].iter().all(|end| (end[axis] - offset).abs() <= MAX_STEPS * scale[axis]);
        if !(offset[axis].is_finite() && reaches(offset[axis])) {
            let middle = f64::midpoint(low[axis], high[axis]);
            let from = if offset[axis].is_finite() { offset[axis] } else { 0.0 };
            offset[axis] = if offset[axis].is_infinite() && reaches(0.0) {
                0.0
            } else {
                from + ((middle - from) / scale[axis]).round() * scale[axis]
            };
        }
    }
    let lattice = Lattice { scale, offset };
    if let Some(rounded) = inputs.iter().find(|input| input.lattice.is_some_and(|own| !own.fits(&lattice))) {
        let steps = scale.to_array().map(shown_number).join(", ");
        let name = rounded.name.display();
        progress
            .note(&format!("coordinates such as those of {name} are rounded to steps of {steps} that suit all inputs"));
    }
    Ok(lattice)
}

/// The coarsest power of ten that is a thousandth of the usual distance between points on the sides of their box.
fn scale_of_floats(size: DVec3, points: u64, degrees: bool) -> DVec3 {
    let of = |size: DVec3| {
        let area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
        // Points on a line have no area.
        let spacing = (area / points.max(1) as f64).sqrt().max(size.max_element() / points.max(1) as f64);
        let spacing = if spacing > 0.0 { spacing } else { 1.0 };
        // A quotient is rounded to the digits that a person would write.
        let digits = -(spacing / 1000.0).log10().floor().clamp(-12.0, -3.0);
        1.0 / 10_f64.powi(digits as i32)
    };
    if !degrees {
        return DVec3::splat(of(size));
    }
    // Degrees and heights are different units.
    let flat = of(DVec3::new(size.x, size.y, 0.0)).min(1e-8);
    DVec3::new(flat, flat, 1e-3)
}

impl Lattice {
    /// Whether all places of this lattice are places of the other.
    fn fits(&self, other: &Self) -> bool {
        (0..3).all(|axis| !matches!(Axis::between(self, other, axis), Axis::Rounded { .. }))
    }
}

/// How integers of one lattice become those of another, along one axis.
#[derive(Clone, Copy, Debug)]
pub(super) enum Axis {
    Same,
    Whole { factor: i64, shift: i64 },
    Rounded { factor: f64, shift: f64 },
}

impl Axis {
    pub(super) fn between(from: &Lattice, to: &Lattice, axis: usize) -> Self {
        let factor = from.scale[axis] / to.scale[axis];
        let shift = (from.offset[axis] - to.offset[axis]) / to.scale[axis];
        let whole = |value: f64, slack: f64| value.abs() < 1e15 && (value - value.round()).abs() <= slack;
        if factor == 1.0 && shift == 0.0 {
            Self::Same
        } else if whole(factor, 1e-9 * factor.abs()) && whole(shift, SAME_STEP) {
            Self::Whole { factor: factor.round() as i64, shift: shift.round() as i64 }
        } else {
            Self::Rounded { factor, shift }
        }
    }

    #[inline]
    pub(super) fn apply(self, value: i32) -> Option<i32> {
        match self {
            Self::Same => Some(value),
            Self::Whole { factor, shift } => {
                i32::try_from(i64::from(value).checked_mul(factor)?.checked_add(shift)?).ok()
            }
            Self::Rounded { factor, shift } => {
                let value = (f64::from(value) * factor + shift).round();
                (value.abs() <= MAX_STEPS).then_some(value as i32)
            }
        }
    }
}

/// The error of a point that 32 bits do not reach.
pub(super) fn too_far(path: &Path) -> Error {
    Error::malformed(
        path,
        "a point",
        "it is so far beyond the bounds in the header that the steps of the file do not reach it",
    )
}
