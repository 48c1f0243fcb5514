//! The header and the variable length records before the points.

use std::time::{SystemTime, UNIX_EPOCH};

use autosplats_cloud::{Crs, CrsDefinition, GeoKeys};
use glam::DVec3;
use laz::LazVlr;

use super::plan::Plan;
use crate::las::{self, EXTRA_DESCRIPTOR, VLR_HEADER};

/// Bytes of the headers of LAS 1.2 and of LAS 1.4.
const LEGACY_HEADER_LEN: usize = 227;
const HEADER_LEN_LAS14: usize = 375;

/// Most bytes of data in a variable length record.
const MAX_VLR: usize = 65_535;

/// Facts that are known only after all points are encoded.
#[derive(Clone, Debug)]
pub(super) struct Totals {
    low: [i32; 3],
    high: [i32; 3],
    points: u64,
    /// Number of points by return number; points without one are not counted.
    returns: [u64; 15],
}

impl Totals {
    pub(super) fn new() -> Self {
        Self { low: [i32::MAX; 3], high: [i32::MIN; 3], points: 0, returns: [0; 15] }
    }

    /// The totals of some records.
    pub(super) fn of(records: &[u8], plan: &Plan<'_>) -> Self {
        let mut totals = Self::new();
        let mask = if plan.is_wide() { 15 } else { 7 };
        for record in records.chunks_exact(plan.record_len) {
            for axis in 0..3 {
                let at = 4 * axis;
                let value = i32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]);
                totals.low[axis] = totals.low[axis].min(value);
                totals.high[axis] = totals.high[axis].max(value);
            }
            if let Some(number) = usize::from(record[14] & mask).checked_sub(1) {
                totals.returns[number] += 1;
            }
            totals.points += 1;
        }
        totals
    }

    pub(super) fn add(&mut self, other: &Self) {
        for axis in 0..3 {
            self.low[axis] = self.low[axis].min(other.low[axis]);
            self.high[axis] = self.high[axis].max(other.high[axis]);
        }
        for (own, other) in self.returns.iter_mut().zip(other.returns) {
            *own += other;
        }
        self.points += other.points;
    }
}

/// Header and records as stored in the file, and the byte at which the points begin.
pub(super) fn bytes(plan: &Plan<'_>, totals: &Totals, compression: Option<&LazVlr>) -> (Vec<u8>, usize) {
    let (records, count, wkt) = records(plan, compression);
    let header_len = if plan.is_wide() { HEADER_LEN_LAS14 } else { LEGACY_HEADER_LEN };
    let start = header_len + records.len();
    let mut bytes = Vec::with_capacity(start);
    bytes.extend(b"LASF");
    put(&mut bytes, [0_u16.to_le_bytes()]);
    let standard_time = u16::from(plan.has_standard_time());
    put(&mut bytes, [(standard_time | if plan.is_wide() && wkt { 16 } else { 0 }).to_le_bytes()]);
    bytes.extend([0; 16]);
    bytes.extend([1, if plan.is_wide() { 4 } else { 2 }]);
    bytes.extend(padded::<32>("OTHER"));
    bytes.extend(padded::<32>(concat!("autosplats ", env!("CARGO_PKG_VERSION"))));
    let (day, year) = today();
    put(&mut bytes, [day, year, header_len as u16].map(u16::to_le_bytes));
    put(&mut bytes, [start as u32, count].map(u32::to_le_bytes));
    bytes.push(plan.format as u8 | if compression.is_some() { 0x80 } else { 0 });
    put(&mut bytes, [(plan.record_len as u16).to_le_bytes()]);
    // These legacy counts are zero for the point formats of LAS 1.4, which stores the counts further down.
    let short = |count: u64| if plan.is_wide() { 0 } else { count as u32 };
    put(&mut bytes, [short(totals.points).to_le_bytes()]);
    put(&mut bytes, [0, 1, 2, 3, 4].map(|i| short(totals.returns[i]).to_le_bytes()));
    put(&mut bytes, [plan.scale, plan.offset].map(|vector| vector_bytes(vector.to_array())));
    let corner = |steps: [i32; 3]| DVec3::from_array(steps.map(f64::from)) * plan.scale + plan.offset;
    let (a, b) = if totals.points == 0 { ([0; 3], [0; 3]) } else { (totals.low, totals.high) };
    let (low, high) = if totals.points == 0 { (DVec3::ZERO, DVec3::ZERO) } else { (corner(a), corner(b)) };
    for axis in 0..3 {
        put(&mut bytes, [high[axis], low[axis]].map(f64::to_le_bytes));
    }
    if plan.is_wide() {
        put(&mut bytes, [0, 0].map(u64::to_le_bytes));
        put(&mut bytes, [0_u32.to_le_bytes()]);
        put(&mut bytes, [totals.points.to_le_bytes()]);
        put(&mut bytes, totals.returns.map(u64::to_le_bytes));
    }
    debug_assert_eq!(bytes.len(), header_len, "the header is as long as it says");
    bytes.extend(records);
    (bytes, start)
}

/// The variable length records, their number, and whether one holds the coordinate system as text.
fn records(plan: &Plan<'_>, compression: Option<&LazVlr>) -> (Vec<u8>, u32, bool) {
    let mut bytes = Vec::new();
    let mut count = 0;
    let mut record = |user: &str, id: u16, description: &str, data: &[u8]| {
        bytes.extend([0; 2]);
        bytes.extend(padded::<16>(user));
        put(&mut bytes, [id, data.len() as u16].map(u16::to_le_bytes));
        bytes.extend(padded::<32>(description));
        bytes.extend(data);
        count += 1;
    };
    let crs = plan.cloud.crs();
    let mut text = crs.wkt.clone().unwrap_or_default().into_bytes();
    text.push(0);
    let wkt = text.len() > 1 && text.len() <= MAX_VLR;
    if wkt {
        record(las::PROJECTION, las::WKT, "OGC coordinate system WKT", &text);
    }
    if let Some(keys) = keys(plan, crs, wkt) {
        let directory: Vec<u8> = keys.directory.iter().flat_map(|value| value.to_le_bytes()).collect();
        let doubles: Vec<u8> = keys.doubles.iter().flat_map(|value| value.to_le_bytes()).collect();
        record(las::PROJECTION, las::GEO_KEYS, "GeoTIFF GeoKeyDirectoryTag", &directory);
        if !doubles.is_empty() {
            record(las::PROJECTION, las::GEO_DOUBLES, "GeoTIFF GeoDoubleParamsTag", &doubles);
        }
        if !keys.ascii.is_empty() {
            record(
                las::PROJECTION,
                las::GEO_ASCII,
                "GeoTIFF GeoAsciiParamsTag",
                &[keys.ascii.as_bytes(), &[0]].concat(),
            );
        }
    }
    for descriptors in plan.descriptors().chunks(MAX_VLR / EXTRA_DESCRIPTOR) {
        record(las::SPEC, las::EXTRA_BYTES, "extra bytes", descriptors.as_flattened());
    }
    if let Some(vlr) = compression {
        let mut data = Vec::new();
        // Writing to a vector cannot fail.
        let written = vlr.write_to(&mut data);
        debug_assert!(written.is_ok(), "memory is written to");
        record(LazVlr::USER_ID, LazVlr::RECORD_ID, "laz", &data);
    }
    debug_assert!(bytes.len() >= VLR_HEADER * count as usize, "each has a header");
    (bytes, count, wkt)
}

/// The cloud's own GeoTIFF keys; without them new ones, if LAS 1.2 or missing text require keys.
fn keys(plan: &Plan<'_>, crs: &Crs, wkt: bool) -> Option<GeoKeys> {
    let fit = |keys: &GeoKeys| {
        keys.directory.len() * 2 <= MAX_VLR && keys.doubles.len() * 8 <= MAX_VLR && keys.ascii.len() < MAX_VLR
    };
    let own = crs.geotiff.clone().filter(fit);
    let known = crs.epsg.is_some() || crs.unit.is_some() || crs.name.is_some();
    // Keys for geocentric systems are not written.
    let geocentric = || crs.wkt.as_deref().is_some_and(|text| CrsDefinition::from_wkt(text).geocentric);
    own.or_else(|| (known && !(wkt && plan.is_wide()) && !geocentric()).then(|| GeoKeys::describe(crs)))
}

fn put<const LEN: usize, const COUNT: usize>(bytes: &mut Vec<u8>, values: [[u8; LEN]; COUNT]) {
    bytes.extend(values.as_flattened());
}

fn vector_bytes(vector: [f64; 3]) -> [u8; 24] {
    bytemuck::cast(vector.map(f64::to_le_bytes))
}

fn padded<const LEN: usize>(text: &str) -> [u8; LEN] {
    let mut bytes = [0; LEN];
    bytes[..text.len()].copy_from_slice(text.as_bytes());
    bytes
}

/// Day of the year, counted from 1, and year.
fn today() -> (u16, u16) {
    let mut days = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs() / 86_400);
    let mut year: u16 = 1970;
    loop {
        let leap = year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
        let length = if leap { 366 } else { 365 };
        if days < length {
            return (days as u16 + 1, year);
        }
        days -= length;
        year += 1;
    }
}
