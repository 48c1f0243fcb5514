//! Joins the values of all scans to one cloud.

use std::collections::HashMap;

use autosplats_cloud::{Axes, Error, PointCloud, Scan, excerpt};
use glam::{DMat3, DMat4, DVec3};
use rayon::prelude::*;

use super::super::{
    Job,
    columns::MAX_COLUMNS,
    placed::{fill, place},
    table::ProgressRange,
};
use super::{
    colors::{Colors, color_fields},
    element::{Kind, Stored},
    packets::Values,
    xml::ScanHeader,
};

/// Points of a preview chunk.
const CHUNK: usize = 1 << 20;

/// A scan's header and values.
pub(super) struct Source<'a> {
    pub(super) header: &'a ScanHeader,
    pub(super) values: Values,
    coordinates: Coordinates,
    pose: DMat4,
    /// Index of the element that states which points have coordinates.
    state: Option<usize>,
    /// Indices of the points kept; `None` keeps all.
    keep: Option<Vec<u32>>,
    keep_invalid: bool,
}

/// Indices of the elements that make a position.
#[derive(Clone, Copy)]
enum Coordinates {
    Cartesian([usize; 3]),
    /// Range, azimuth and elevation.
    Spherical([usize; 3]),
}

impl<'a> Source<'a> {
    /// Finds the points of a scan that have a position, and counts the others in `dropped`.
    pub(super) fn new(
        job: &Job<'_>,
        header: &'a ScanHeader,
        values: Values,
        dropped: &mut Dropped,
    ) -> Result<Self, Error> {
        let cartesian = header.elements(["cartesianX", "cartesianY", "cartesianZ"]);
        let spherical = header.elements(["sphericalRange", "sphericalAzimuth", "sphericalElevation"]);
        let (coordinates, state) = match (cartesian, spherical) {
            (Some(elements), _) => (Coordinates::Cartesian(elements), "cartesianInvalidState"),
            (None, Some(elements)) => (Coordinates::Spherical(elements), "sphericalInvalidState"),
            (None, None) => {
                let what = "its points have neither x, y and z nor range, azimuth and elevation; write the file again";
                return Err(job.malformed("XML section", what));
            }
        };
        let mut source = Self {
            header,
            coordinates,
            pose: header.pose.unwrap_or(DMat4::IDENTITY),
            state: header.element(state),
            keep: None,
            keep_invalid: job.options.keep_no_returns,
            values,
        };
        if u32::try_from(source.values.count).is_err() {
            return Err(job.unsupported("more than 4 billion points in a scan; split it"));
        }
        if !job.options.keep_no_returns {
            source.keep = source.measured(dropped);
        }
        Ok(source)
    }

    /// Indices of the points with a position; `None` if all have one.
    fn measured(&self, dropped: &mut Dropped) -> Option<Vec<u32>> {
        let count = self.values.count as u32;
        let direction_only = |i: &u32| self.state(*i as usize) == 1;
        let invalid = |i: u32| self.state(i as usize) != 0;
        let at_scanner = |i: u32| !invalid(i) && self.is_scanner(i as usize);
        let [directions, without] = match self.state {
            None => [0; 2],
            Some(_) => [
                (0..count).into_par_iter().filter(direction_only).count(),
                (0..count).into_par_iter().filter(|&i| invalid(i)).count(),
            ],
        };
        let zeros = (0..count).into_par_iter().filter(|&i| at_scanner(i)).count();
        // A single point at the scanner may be real. If all points are there, the file means something else by it.
        let drop_zeros = zeros > 1 && zeros < count as usize - without;
        dropped.directions += directions;
        dropped.nothing += without - directions;
        dropped.at_scanner += if drop_zeros { zeros } else { 0 };
        dropped.kept_at_scanner += if drop_zeros || zeros < 2 { 0 } else { zeros };
        let keep = |i: &u32| !(invalid(*i) || drop_zeros && at_scanner(*i));
        (without > 0 || drop_zeros).then(|| (0..count).into_par_iter().filter(keep).collect())
    }

    /// Invalid state of a point: 0 for a position, 1 for a direction only, 2 for neither.
    fn state(&self, value: usize) -> i64 {
        self.state.map_or(0, |state| self.values.streams[state].integer(value))
    }

    /// Number of points kept.
    pub(super) fn len(&self) -> usize {
        self.keep.as_ref().map_or(self.values.count, Vec::len)
    }

    /// Index of a kept point among the scan's values.
    #[inline]
    pub(super) fn value_of(&self, point: usize) -> usize {
        self.keep.as_ref().map_or(point, |keep| keep[point] as usize)
    }

    /// Whether a position is the scanner's own.
    fn is_scanner(&self, value: usize) -> bool {
        let zero = |element: usize| self.values.streams[element].value(value) == 0.0;
        match self.coordinates {
            Coordinates::Cartesian(elements) => elements.into_iter().all(zero),
            Coordinates::Spherical([range, ..]) => zero(range),
        }
    }

    fn local(&self, value: usize) -> DVec3 {
        match self.coordinates {
            Coordinates::Cartesian(elements) => {
                DVec3::from(elements.map(|element| self.values.streams[element].value(value)))
            }
            Coordinates::Spherical(elements) => {
                let [range, azimuth, elevation] = elements.map(|element| self.values.streams[element].value(value));
                let (sin, cos) = elevation.sin_cos();
                range * DVec3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin)
            }
        }
    }

    fn world(&self, point: usize) -> DVec3 {
        let value = self.value_of(point);
        if self.keep_invalid && self.state(value) != 0 {
            return DVec3::NAN;
        }
        let local = self.local(value);
        if self.pose == DMat4::IDENTITY { local } else { self.pose.transform_point3(local) }
    }
}

/// Counts of the points without a position, over all scans.
#[derive(Default)]
pub(super) struct Dropped {
    directions: usize,
    nothing: usize,
    at_scanner: usize,
    /// Points at the scanner that are kept, because their scan has no others.
    kept_at_scanner: usize,
}

impl Dropped {
    pub(super) fn note(&self, job: &Job<'_>) {
        let counts = [
            (self.nothing, "points without a return are dropped"),
            (self.directions, "points of which only the direction is known are dropped"),
            (self.at_scanner, "points at the scanner's own place, where nothing was measured, are dropped"),
            (self.kept_at_scanner, "points lie at the scanner's own place, and their scan has no others"),
        ];
        for (count, what) in counts.iter().filter(|(count, _)| *count > 0) {
            job.note(format!("{count} {what}"));
        }
    }
}

/// Passes the points of a scan to the caller as preview chunks.
pub(super) fn preview(job: &Job<'_>, source: &Source<'_>) -> Result<(), Error> {
    let quiet = Job { progress: &(), ..*job };
    let part = ProgressRange { start: 0.0, len: 0.0 };
    let colors = Colors::new(&quiet, source);
    for start in (0..source.len()).step_by(CHUNK) {
        let lens = [CHUNK.min(source.len() - start)];
        job.preview(|| {
            let cloud = place(&quiet, &lens, part, |_| move |i| source.world(start + i))?;
            let Some(colors) = &colors else { return Ok(cloud) };
            cloud.with_colors(fill(&quiet, "colours", &lens, part, |_| move |i| colors.bytes(start + i))?)
        })?;
    }
    Ok(())
}

/// Makes the cloud of all scans. `done` is the finished fraction of the work; for `trusted` see [`is_of_scanner`].
pub(super) fn cloud(job: &Job<'_>, sources: &[Source<'_>], trusted: bool, done: f32) -> Result<PointCloud, Error> {
    let lens: Vec<usize> = sources.iter().map(Source::len).collect();
    let total: usize = lens.iter().sum();
    let fields = fields(job, sources);
    let bytes: usize = fields.iter().map(|field| field.kind.size()).sum();
    job.check_memory(total, 12 + 3 + bytes + if job.options.exact { 12 + 6 } else { 0 })?;
    let steps = 2.0 + fields.len() as f32;
    let part = |step: f32| ProgressRange { start: done + (1.0 - done) * step / steps, len: (1.0 - done) / steps };

    let mut cloud = place(job, &lens, part(0.0), |index| move |i| sources[index].world(i))?;
    cloud = color_fields(job, sources, &lens, cloud, part(1.0))?;
    for (step, field) in fields.iter().enumerate() {
        let mut values = field.kind.values();
        macro_rules! filled {
            ($v:ident, $read:ident, $absent:expr) => {
                *$v = fill(job, &field.name, &lens, part(2.0 + step as f32), |index| {
                    let taken = field.of(index).map(|taken| (taken, &sources[index]));
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
    let scans = sources.iter().filter_map(|source| {
        let points = start..start + source.len();
        start = points.end;
        let scan = || Scan { name: source.header.name.clone(), world_from_sensor: source.pose, points };
        is_of_scanner(source.header, trusted).then(scan)
    });
    let scans: Vec<Scan> = scans.collect();
    // The standard does not state which axis points up, but scanners stand upright, and programs that write E57 use Z
    // up. A small cloud that no scanner saw is an object turned by hand.
    if !scans.is_empty() || !cloud.is_small() {
        cloud = cloud.with_axes(Axes::ZUp);
    }
    Ok(cloud.with_scans(scans))
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
fn fields(job: &Job<'_>, sources: &[Source<'_>]) -> Vec<MergedField> {
    let mut fields: Vec<MergedField> = Vec::new();
    let mut by_name: HashMap<String, usize> = HashMap::new();
    let mut left_out = 0;
    for (index, source) in sources.iter().enumerate() {
        for (name, kind, taken) in of_scan(job, source) {
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
    limit_fill(job, sources, &mut fields);
    fields
}

/// Drops fields that some scans lack if filling them up would take more memory than the file's size justifies.
fn limit_fill(job: &Job<'_>, sources: &[Source<'_>], fields: &mut Vec<MergedField>) {
    let total: usize = sources.iter().map(Source::len).sum();
    let mut budget = job.bytes.len().saturating_mul(8).saturating_add(1 << 20);
    let (mut filled, mut dropped) = (Vec::new(), Vec::new());
    fields.retain_mut(|field| {
        let stored = |&(index, taken): &(usize, FieldSource)| {
            let element = match taken {
                FieldSource::Plain { element, .. } | FieldSource::Time { element, .. } => element,
                FieldSource::Normal { elements, .. } => elements[0],
            };
            let source = &sources[index];
            (source.len(), source.header.elements[element].stored.bits() == 0)
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
fn of_scan(job: &Job<'_>, source: &Source<'_>) -> Vec<(String, Kind, FieldSource)> {
    let header = source.header;
    let rows = DMat3::from_mat4(source.pose).transpose();
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
            let turned = if source.pose == DMat4::IDENTITY { DMat3::IDENTITY } else { rows };
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
