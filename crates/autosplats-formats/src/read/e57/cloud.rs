//! Joins the values of all scans to one cloud.

use std::collections::HashMap;

use autosplats_cloud::{Axes, Error, FieldValues, PointCloud, Scan, excerpt, residual, sample_step, storage_origin};
use glam::{DMat3, DMat4, DVec3};
use rayon::prelude::*;

use super::super::{
    Job,
    columns::MAX_COLUMNS,
    placed::{fill, place},
    table::ProgressRange,
};
use super::{
    colors::{GREY, Tint},
    element::{Kind, Stored},
    source::Source,
    xml::ScanHeader,
};
use crate::color_scale::Levels;

/// Points of a preview chunk.
const CHUNK: usize = 1 << 20;

/// Passes the points of a scan to the caller as preview chunks.
pub(super) fn preview(job: &Job<'_>, source: &Source<'_>) -> Result<(), Error> {
    let quiet = Job { progress: &(), ..*job };
    let part = ProgressRange { start: 0.0, len: 0.0 };
    let mut tint = Tint::of(source.header);
    if let Some(tint) = &mut tint {
        tint.settle(tint.levels(source), &quiet);
    }
    for start in (0..source.len()).step_by(CHUNK) {
        let lens = [CHUNK.min(source.len() - start)];
        job.preview(|| {
            let cloud = place(&quiet, &lens, part, |_| move |i| source.world(start + i))?;
            let Some(tint) = &tint else { return Ok(cloud) };
            cloud.with_colors(fill(&quiet, "colours", &lens, part, |_| move |i| tint.bytes(source, start + i))?)
        })?;
    }
    Ok(())
}

/// A scan, and how many of its points are kept.
#[derive(Clone, Copy)]
pub(super) struct Kept<'a> {
    pub(super) header: &'a ScanHeader,
    pub(super) points: usize,
}

/// Points of one scan: all that are kept, or consecutive ones.
pub(super) struct Run<'a> {
    /// Index of the scan.
    pub(super) scan: usize,
    pub(super) source: &'a Source<'a>,
    /// Number of the scan's kept points before these.
    pub(super) first: usize,
}

/// Passes all points to a function, run by run in order.
pub(super) type Each<'a> = dyn FnMut(&mut dyn FnMut(&Run<'_>) -> Result<(), Error>) -> Result<(), Error> + 'a;

/// Gets points, and the origin that they are stored about.
type See<'a> = dyn FnMut(&Run<'_>, DVec3) -> Result<(), Error> + 'a;

/// All that the points are made by, which is decided by all of them.
pub(super) struct Settled {
    fields: Vec<MergedField>,
    origin: DVec3,
    residuals: bool,
    /// Of each scan; none at all if no scan has colours.
    tints: Vec<Option<Tint>>,
    /// Whether colours are kept as 16-bit fields too, because 8 bits lose some.
    wide_colors: bool,
    /// Whether each scan's points come from a scanner.
    pub(super) scanners: Vec<bool>,
}

impl Settled {
    /// Settles it from two looks at all points, which `each` gives; for `trusted` see [`is_of_scanner`]. `see` gets the
    /// points at the second look, and their origin.
    pub(super) fn of(
        job: &Job<'_>,
        scans: &[Kept<'_>],
        trusted: bool,
        each: &mut Each<'_>,
        mut see: Option<&mut See<'_>>,
    ) -> Result<Self, Error> {
        let fields = fields(job, scans);
        let total: usize = scans.iter().map(|scan| scan.points).sum();
        let before: Vec<usize> = scans
            .iter()
            .scan(0, |sum, scan| {
                *sum += scan.points;
                Some(*sum - scan.points)
            })
            .collect();
        let mut tints: Vec<Option<Tint>> = scans.iter().map(|scan| Tint::of(scan.header)).collect();
        let mut levels = vec![Levels::default(); scans.len()];
        let (mut sample, step) = (Vec::new(), sample_step(total));
        each(&mut |run| {
            let start = before[run.scan] + run.first;
            let sampled = (start.next_multiple_of(step)..start + run.source.len()).step_by(step);
            sample.extend(sampled.map(|i| run.source.world(i - start)));
            if let Some(tint) = &tints[run.scan] {
                levels[run.scan] = levels[run.scan].and(tint.levels(run.source));
            }
            Ok(())
        })?;
        let origin = storage_origin(sample.len(), |i| sample[i]);
        if tints.iter().all(Option::is_none) {
            tints.clear();
        }
        for (tint, levels) in tints.iter_mut().zip(levels) {
            tint.iter_mut().for_each(|tint| tint.settle(levels, job));
        }
        let grey: usize =
            scans.iter().zip(&tints).filter(|(_, tint)| tint.is_none()).map(|(scan, _)| scan.points).sum();
        if grey > 0 {
            job.note(format!("{grey} points belong to scans without colours; they become grey"));
        }
        let (mut residuals, mut wide_colors) = (false, false);
        let exact = job.options.exact;
        if exact || see.is_some() {
            each(&mut |run| {
                let (source, points) = (run.source, (0..run.source.len()).into_par_iter());
                let loses = |i| residual(source.world(i) - origin) != [0.0; 3];
                residuals = residuals || exact && points.clone().any(loses);
                if let Some(Some(tint)) = tints.get(run.scan) {
                    wide_colors = wide_colors || exact && points.into_par_iter().any(|i| tint.loses(source, i));
                }
                see.as_mut().map_or(Ok(()), |see| see(run, origin))
            })?;
        }
        let scanners = scans.iter().map(|scan| is_of_scanner(scan.header, trusted)).collect();
        Ok(Self { fields, origin, residuals, tints, wide_colors, scanners })
    }

    /// Most bytes of a point in memory.
    pub(super) fn point_bytes(&self, exact: bool) -> usize {
        let fields: usize = self.fields.iter().map(|field| field.kind.size()).sum();
        12 + 3 + fields + if exact { 12 + 6 } else { 0 }
    }

    /// Makes the points of some runs. `done` is the finished fraction of the work.
    pub(super) fn build(&self, job: &Job<'_>, runs: &[Run<'_>], done: f32) -> Result<PointCloud, Error> {
        let Self { fields, origin, tints, .. } = self;
        let lens: Vec<usize> = runs.iter().map(|run| run.source.len()).collect();
        let steps = 2.0 + fields.len() as f32;
        let part = |step: f32| ProgressRange { start: done + (1.0 - done) * step / steps, len: (1.0 - done) / steps };
        let none = |step: f32| ProgressRange { len: 0.0, ..part(step) };
        let world = |run: usize| {
            let source = runs[run].source;
            move |i| source.world(i) - *origin
        };
        let positions = fill(job, "positions", &lens, part(0.0), |run| {
            let world = world(run);
            move |i| world(i).as_vec3().to_array()
        })?;
        let mut cloud = PointCloud::new(*origin, positions);
        if self.residuals {
            let residuals = fill(job, "residuals", &lens, none(1.0), |run| {
                let world = world(run);
                move |i| residual(world(i))
            })?;
            cloud = cloud.with_residuals(residuals)?;
        }
        if !tints.is_empty() {
            let tint = |run: usize| tints[runs[run].scan].map(|tint| (tint, runs[run].source));
            let bytes = fill(job, "colours", &lens, part(1.0), |run| {
                let tint = tint(run);
                move |i| tint.map_or(GREY, |(tint, source)| tint.bytes(source, i))
            })?;
            cloud = cloud.with_colors(bytes)?;
            let channels = ["Red", "Green", "Blue"].into_iter().enumerate();
            for (channel, name) in channels.filter(|_| self.wide_colors) {
                let wide = fill(job, name, &lens, none(2.0), |run| {
                    let tint = tint(run);
                    let grey = u16::from(GREY[channel]) * 257;
                    move |i| tint.map_or(grey, |(tint, source)| tint.wide(source, channel, i))
                })?;
                cloud = cloud.with_field(name, FieldValues::U16(wide))?;
            }
        }
        for (step, field) in fields.iter().enumerate() {
            let mut values = field.kind.values();
            macro_rules! filled {
                ($v:ident, $read:ident, $absent:expr) => {
                    *$v = fill(job, &field.name, &lens, part(2.0 + step as f32), |run| {
                        let taken = field.of(runs[run].scan).map(|taken| (taken, runs[run].source));
                        move |i| taken.map_or($absent, |(taken, source)| taken.$read(source, source.value_of(i)) as _)
                    })?
                };
            }
            use autosplats_cloud::FieldValues::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
            match &mut values {
                U8(v) => filled!(v, integer, 0),
                I8(v) => filled!(v, integer, 0),
                U16(v) => filled!(v, integer, 0),
                I16(v) => filled!(v, integer, 0),
                U32(v) => filled!(v, integer, 0),
                I32(v) => filled!(v, integer, 0),
                U64(v) => filled!(v, integer, 0),
                I64(v) => filled!(v, integer, 0),
                F32(v) => filled!(v, value, f32::NAN),
                F64(v) => filled!(v, value, f64::NAN),
            }
            cloud = cloud.with_field(&field.name, values)?;
        }
        let mut start = 0;
        let scans = runs.iter().filter_map(|Run { scan, source, .. }| {
            let points = start..start + source.len();
            start = points.end;
            let of = || Scan { name: source.header.name.clone(), world_from_sensor: source.pose, points };
            self.scanners[*scan].then(of)
        });
        Ok(cloud.with_scans(scans.collect()))
    }

    /// The axes. The standard does not state which axis points up, but scanners stand upright, and programs that write
    /// E57 use Z up. A small cloud that no scanner saw is an object turned by hand.
    pub(super) fn axes(&self, is_small: impl FnOnce() -> bool) -> Option<Axes> {
        (self.scanners.contains(&true) || !is_small()).then_some(Axes::ZUp)
    }
}

/// Whether points come from a scanner, not from a model or a merged cloud saved like a scan. Programs without a scanner
/// leave out the pose or write an identity. `trusted` files, this project's, have poses for scanners only.
pub(super) fn is_of_scanner(header: &ScanHeader, trusted: bool) -> bool {
    if trusted {
        return header.pose.is_some();
    }
    header.pose.is_some_and(|pose| pose != DMat4::IDENTITY)
        || header.indices.is_some()
        || header.sensor.is_some()
        || header.element("rowIndex").is_some()
        || header.element("sphericalRange").is_some()
}

/// A field of the cloud, and the scans that have it.
struct MergedField {
    name: String,
    kind: Kind,
    /// Pairs of scan index, ascending, and source of the values.
    taken: Vec<(usize, FieldSource)>,
}

impl MergedField {
    fn of(&self, scan: usize) -> Option<FieldSource> {
        self.taken.binary_search_by_key(&scan, |(index, _)| *index).ok().map(|found| self.taken[found].1)
    }
}

/// Source of a field's value in a scan.
#[derive(Clone, Copy)]
enum FieldSource {
    /// The element's value plus a constant.
    Plain { element: usize, add: i64 },
    /// A time that counts from `start`, unless the element `invalid` marks it as invalid.
    Time { element: usize, start: f64, invalid: Option<usize> },
    /// A component of a vector, rotated by the scan's pose.
    Normal { elements: [usize; 3], row: DVec3 },
}

impl FieldSource {
    fn integer(self, source: &Source<'_>, value: usize) -> i64 {
        match self {
            Self::Plain { element, add } => source.values.streams[element].integer(value).wrapping_add(add),
            _ => self.value(source, value) as i64,
        }
    }

    fn value(self, source: &Source<'_>, value: usize) -> f64 {
        let streams = &source.values.streams;
        match self {
            Self::Plain { element, add } => streams[element].value(value) + add as f64,
            Self::Time { element, start, invalid } => {
                let known = invalid.is_none_or(|invalid| streams[invalid].integer(value) == 0);
                if known { streams[element].value(value) + start } else { f64::NAN }
            }
            Self::Normal { elements, row } => {
                let [x, y, z] = elements.map(|element| streams[element].value(value));
                // Without a rotation the component is returned unchanged, so that infinities stay infinite.
                match row {
                    DVec3::X => x,
                    DVec3::Y => y,
                    DVec3::Z => z,
                    _ => row.dot(DVec3::new(x, y, z)),
                }
            }
        }
    }
}

/// Elements that do not become fields: positions, colours and their validity.
const NO_FIELDS: [&str; 11] = [
    "cartesianX",
    "cartesianY",
    "cartesianZ",
    "cartesianInvalidState",
    "sphericalRange",
    "sphericalAzimuth",
    "sphericalElevation",
    "sphericalInvalidState",
    "colorRed",
    "colorGreen",
    "colorBlue",
];

/// The fields of all scans, in order of appearance.
fn fields(job: &Job<'_>, scans: &[Kept<'_>]) -> Vec<MergedField> {
    let mut fields: Vec<MergedField> = Vec::new();
    let mut by_name: HashMap<String, usize> = HashMap::new();
    let mut left_out = 0;
    for (index, scan) in scans.iter().enumerate() {
        for (name, kind, taken) in of_scan(job, scan.header) {
            let next = fields.len();
            let at = *by_name.entry(name.clone()).or_insert(next);
            match fields.get_mut(at) {
                None if at < MAX_COLUMNS => fields.push(MergedField { name, kind, taken: vec![(index, taken)] }),
                None => {
                    by_name.remove(&name);
                    left_out += 1;
                }
                Some(field) if field.taken.last().is_some_and(|(last, _)| *last == index) => left_out += 1,
                Some(field) => {
                    field.kind = field.kind.join(kind);
                    field.taken.push((index, taken));
                }
            }
        }
    }
    if left_out > 0 {
        job.note(format!("{left_out} values per point are left out: their names repeat, or there are too many"));
    }
    limit_fill(job, scans, &mut fields);
    fields
}

/// Drops fields that some scans lack if filling them up would take more memory than the file's size justifies.
fn limit_fill(job: &Job<'_>, scans: &[Kept<'_>], fields: &mut Vec<MergedField>) {
    let total: usize = scans.iter().map(|scan| scan.points).sum();
    let mut budget = job.bytes.len().saturating_mul(8).saturating_add(1 << 20);
    let (mut filled, mut dropped) = (Vec::new(), Vec::new());
    fields.retain_mut(|field| {
        let stored = |&(index, taken): &(usize, FieldSource)| {
            let element = match taken {
                FieldSource::Plain { element, .. } | FieldSource::Time { element, .. } => element,
                FieldSource::Normal { elements, .. } => elements[0],
            };
            let Kept { header, points } = scans[index];
            (points, header.elements[element].stored.bits() == 0)
        };
        let have: usize = field.taken.iter().map(stored).map(|(len, _)| len).sum();
        let constant: usize =
            field.taken.iter().map(stored).map(|(len, constant)| if constant { len } else { 0 }).sum();
        if let Kind::Integer { min, max } = field.kind
            && have < total
        {
            field.kind = Kind::Integer { min: min.min(0), max: max.max(0) };
        }
        let cost = (total - have + constant).saturating_mul(field.kind.size());
        if cost > budget {
            dropped.push(field.name.clone());
            return false;
        }
        budget -= cost;
        if have < total {
            filled.push(field.name.clone());
        }
        true
    });
    let listed = |names: &[String]| {
        let more = if names.len() > 8 { format!(" and {} more", names.len() - 8) } else { String::new() };
        let names: Vec<_> = names.iter().take(8).map(|name| excerpt(name.as_bytes())).collect();
        names.join(", ") + &more
    };
    if !filled.is_empty() {
        job.note(format!("only some scans have {}; NaN, or 0 for integers, in the others", listed(&filled)));
    }
    if !dropped.is_empty() {
        job.note(format!("{} would take far more memory than the file; left out", listed(&dropped)));
    }
}

/// The fields of one scan: names, value types and sources.
fn of_scan(job: &Job<'_>, header: &ScanHeader) -> Vec<(String, Kind, FieldSource)> {
    let pose = header.pose.unwrap_or(DMat4::IDENTITY);
    let rows = DMat3::from_mat4(pose).transpose();
    let normals = ["normalX", "normalY", "normalZ"]
        .map(|name| header.elements.iter().position(|element| element.prefix.is_some() && element.name == name));
    let normals = match normals {
        [Some(x), Some(y), Some(z)] => Some([x, y, z]),
        _ => None,
    };
    let mut fields: Vec<(String, Kind, FieldSource)> = Vec::new();
    for (index, element) in header.elements.iter().enumerate() {
        let kind = Kind::of(element.stored, job.options.exact);
        // A constant zero carries no information.
        let nothing = element.stored.bits() == 0
            && matches!(element.stored, Stored::Integer { min: 0, .. } | Stored::Scaled { min: 0, offset: 0.0, .. });
        if element.stored == Stored::Text || nothing || element.prefix.is_none() && NO_FIELDS.contains(&&*element.name)
        {
            continue;
        }
        if let Some(axis) = normals.and_then(|normals| normals.iter().position(|&normal| normal == index)) {
            let turned = if pose == DMat4::IDENTITY { DMat3::IDENTITY } else { rows };
            let taken = FieldSource::Normal { elements: normals.unwrap_or_default(), row: turned.col(axis) };
            let kind = if kind == Kind::Single { kind } else { Kind::Double };
            fields.push((format!("Normal{}", ["X", "Y", "Z"][axis]), kind, taken));
            continue;
        }
        let add_one = |kind| match kind {
            Kind::Integer { min, max } => Kind::Integer { min: min.saturating_add(1), max: max.saturating_add(1) },
            other => other,
        };
        let plain = FieldSource::Plain { element: index, add: 0 };
        let (name, kind, taken) = match (&element.prefix, &*element.name) {
            (None, "intensity") => ("Intensity".into(), kind, plain),
            // E57 counts returns from 0.
            (None, "returnIndex") => {
                ("ReturnNumber".into(), add_one(kind), FieldSource::Plain { element: index, add: 1 })
            }
            (None, "returnCount") => ("NumberOfReturns".into(), kind, plain),
            (None, "timeStamp") => {
                let (start, invalid) = (header.start.unwrap_or(0.0), header.element("isTimeStampInvalid"));
                ("GpsTime".into(), Kind::Double, FieldSource::Time { element: index, start, invalid })
            }
            (None, "isTimeStampInvalid") if header.element("timeStamp").is_some() => continue,
            _ if fields.iter().any(|(name, ..)| *name == element.name) => (element.full_name(), kind, plain),
            _ => (element.name.clone(), kind, plain),
        };
        fields.push((name, kind, taken));
    }
    fields
}
