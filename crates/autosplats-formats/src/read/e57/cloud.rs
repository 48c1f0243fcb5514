//! Joins the values of all scans to one cloud.

use std::collections::HashMap;

use autosplats_cloud::{Axes, Error, PointCloud, Scan, excerpt};
use glam::{DMat3, DMat4, DVec3};

use super::super::{
    Job,
    columns::MAX_COLUMNS,
    placed::{fill, place},
    table::ProgressRange,
};
use super::{
    colors::{Colors, color_fields},
    element::{Kind, Stored},
    source::Source,
    xml::ScanHeader,
};

/// Points of a preview chunk.
const CHUNK: usize = 1 << 20;

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
