//! The header and the variable length records before the points.

use std::time::{SystemTime, UNIX_EPOCH};

use autosplats_cloud::{Crs, CrsDefinition, GeoKeys};
use glam::DVec3;
use laz::LazVlr;

use super::{
    grid::Grid,
    shape::{Shape, Survey},
    wkt::well_known_text,
};
use crate::las::{self, EXTRA_DESCRIPTOR, VLR_HEADER};

/// Bytes of the headers of LAS 1.2 and of LAS 1.4.
const LEGACY_HEADER_LEN: usize = 227;
const HEADER_LEN_LAS14: usize = 375;

/// Most bytes of data in a variable length record.
const MAX_VLR: usize = 65_535;

/// Facts that are known only after all points are encoded.
#[derive(Clone, Debug)]
pub(in crate::write) struct Totals {
    pub(in crate::write) low: [i32; 3],
    pub(in crate::write) high: [i32; 3],
    pub(in crate::write) points: u64,
    /// Number of points by return number; points without one are not counted.
    returns: [u64; 15],
}

impl Totals {
    pub(in crate::write) fn new() -> Self {
        Self { low: [i32::MAX; 3], high: [i32::MIN; 3], points: 0, returns: [0; 15] }
    }

    /// The totals of some records of `len` bytes, of the formats of LAS 1.4 if they are `wide`.
    pub(in crate::write) fn of(records: &[u8], len: usize, wide: bool) -> Self {
        let mut totals = Self::new();
        let mask = if wide { 15 } else { 7 };
        for record in records.chunks_exact(len) {
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

    pub(in crate::write) fn add(&mut self, other: &Self) {
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

/// A variable length record.
pub(in crate::write) struct Record {
    pub(in crate::write) user: &'static str,
    pub(in crate::write) id: u16,
    pub(in crate::write) description: &'static str,
    pub(in crate::write) data: Vec<u8>,
}

/// What a header states.
pub(in crate::write) struct Head<'a> {
    pub(in crate::write) format: usize,
    pub(in crate::write) record_len: usize,
    pub(in crate::write) scale: DVec3,
    pub(in crate::write) offset: DVec3,
    pub(in crate::write) standard_time: bool,
    /// Day of the year, counted from 1, and year.
    pub(in crate::write) created: (u16, u16),
    pub(in crate::write) totals: &'a Totals,
    pub(in crate::write) records: &'a [Record],
    /// First byte and number of the extended records.
    pub(in crate::write) extended: (u64, u32),
}

impl Head<'_> {
    /// Header and records as stored in the file, and the byte at which the points begin.
    pub(in crate::write) fn bytes(&self) -> (Vec<u8>, usize) {
        let Self { format, record_len, totals, records, .. } = *self;
        let wide = las::is_wide(format);
        let compressed = records.iter().any(|record| record.user == LazVlr::USER_ID);
        let header_len = if wide { HEADER_LEN_LAS14 } else { LEGACY_HEADER_LEN };
        let start = header_len + records.iter().map(|record| VLR_HEADER + record.data.len()).sum::<usize>();
        let mut bytes = Vec::with_capacity(start);
        bytes.extend(b"LASF");
        put(&mut bytes, [0_u16.to_le_bytes()]);
        // The specification has bit 4 for all points of LAS 1.4; readers refuse files without it.
        put(&mut bytes, [(u16::from(self.standard_time) | if wide { 16 } else { 0 }).to_le_bytes()]);
        bytes.extend([0; 16]);
        bytes.extend([1, if wide { 4 } else { 2 }]);
        bytes.extend(padded::<32>("OTHER"));
        bytes.extend(padded::<32>(concat!("autosplats ", env!("CARGO_PKG_VERSION"))));
        put(&mut bytes, [self.created.0, self.created.1, header_len as u16].map(u16::to_le_bytes));
        put(&mut bytes, [start as u32, records.len() as u32].map(u32::to_le_bytes));
        bytes.push(format as u8 | if compressed { 0x80 } else { 0 });
        put(&mut bytes, [(record_len as u16).to_le_bytes()]);
        // These legacy counts are zero for the point formats of LAS 1.4, which stores the counts further down.
        let short = |count: u64| if wide { 0 } else { count as u32 };
        put(&mut bytes, [short(totals.points).to_le_bytes()]);
        put(&mut bytes, [0, 1, 2, 3, 4].map(|i| short(totals.returns[i]).to_le_bytes()));
        put(&mut bytes, [self.scale, self.offset].map(|vector| vector_bytes(vector.to_array())));
        let corner = |steps: [i32; 3]| DVec3::from_array(steps.map(f64::from)) * self.scale + self.offset;
        let [low, high] = if totals.points == 0 { [DVec3::ZERO; 2] } else { [corner(totals.low), corner(totals.high)] };
        for axis in 0..3 {
            put(&mut bytes, [high[axis], low[axis]].map(f64::to_le_bytes));
        }
        if wide {
            put(&mut bytes, [0, self.extended.0].map(u64::to_le_bytes));
            put(&mut bytes, [self.extended.1.to_le_bytes()]);
            put(&mut bytes, [totals.points.to_le_bytes()]);
            put(&mut bytes, totals.returns.map(u64::to_le_bytes));
        }
        debug_assert_eq!(bytes.len(), header_len, "the header is as long as it says");
        for Record { user, id, description, data } in records {
            bytes.extend([0; 2]);
            bytes.extend(padded::<16>(user));
            put(&mut bytes, [*id, data.len() as u16].map(u16::to_le_bytes));
            bytes.extend(padded::<32>(description));
            bytes.extend(data);
        }
        (bytes, start)
    }
}

/// Header and records of points as stored in the file, and the byte at which the points begin.
pub(super) fn bytes(
    survey: &Survey,
    shape: &Shape,
    grid: &Grid,
    totals: &Totals,
    compression: Option<&LazVlr>,
) -> (Vec<u8>, usize) {
    let Shape { format, record_len, .. } = *shape;
    let Grid { scale, offset } = *grid;
    let mut records = crs_records(&survey.crs, las::is_wide(format));
    records.extend(extra_records(&shape.descriptors));
    records.extend(compression.map(compression_record));
    let (standard_time, created) = (survey.standard_time().unwrap_or(false), today());
    let head =
        Head { format, record_len, scale, offset, standard_time, created, totals, records: &records, extended: (0, 0) };
    head.bytes()
}

/// The records of a coordinate system.
pub(in crate::write) fn crs_records(crs: &Crs, wide: bool) -> Vec<Record> {
    let mut records = Vec::new();
    let mut record = |id, description, data| records.push(Record { user: las::PROJECTION, id, description, data });
    let own = if wide { well_known_text(crs) } else { crs.wkt.clone() };
    let mut text = own.unwrap_or_default().into_bytes();
    text.push(0);
    let wkt = text.len() > 1 && text.len() <= MAX_VLR;
    if wkt {
        record(las::WKT, "OGC coordinate system WKT", text);
    }
    if let Some(keys) = keys(crs, wide, wkt) {
        let directory: Vec<u8> = keys.directory.iter().flat_map(|value| value.to_le_bytes()).collect();
        let doubles: Vec<u8> = keys.doubles.iter().flat_map(|value| value.to_le_bytes()).collect();
        record(las::GEO_KEYS, "GeoTIFF GeoKeyDirectoryTag", directory);
        if !doubles.is_empty() {
            record(las::GEO_DOUBLES, "GeoTIFF GeoDoubleParamsTag", doubles);
        }
        if !keys.ascii.is_empty() {
            record(las::GEO_ASCII, "GeoTIFF GeoAsciiParamsTag", [keys.ascii.as_bytes(), &[0]].concat());
        }
    }
    records
}

/// The records that describe extra bytes.
pub(in crate::write) fn extra_records(descriptors: &[[u8; EXTRA_DESCRIPTOR]]) -> impl Iterator<Item = Record> {
    descriptors.chunks(MAX_VLR / EXTRA_DESCRIPTOR).map(|descriptors| Record {
        user: las::SPEC,
        id: las::EXTRA_BYTES,
        description: "extra bytes",
        data: descriptors.as_flattened().to_vec(),
    })
}

/// The record that tells how points are compressed.
pub(in crate::write) fn compression_record(vlr: &LazVlr) -> Record {
    let mut data = Vec::new();
    // Writing to a vector cannot fail.
    let written = vlr.write_to(&mut data);
    debug_assert!(written.is_ok(), "memory is written to");
    Record { user: LazVlr::USER_ID, id: LazVlr::RECORD_ID, description: "laz", data }
}

/// The cloud's own GeoTIFF keys; without them new ones, if LAS 1.2 or missing text require keys.
fn keys(crs: &Crs, wide: bool, wkt: bool) -> Option<GeoKeys> {
    let fit = |keys: &GeoKeys| {
        keys.directory.len() * 2 <= MAX_VLR && keys.doubles.len() * 8 <= MAX_VLR && keys.ascii.len() < MAX_VLR
    };
    let own = crs.geotiff.clone().filter(fit);
    let known = crs.epsg.is_some() || crs.unit.is_some() || crs.name.is_some();
    // Keys for geocentric systems are not written.
    let geocentric = || crs.wkt.as_deref().is_some_and(|text| CrsDefinition::from_wkt(text).geocentric);
    own.or_else(|| (known && !(wkt && wide) && !geocentric()).then(|| GeoKeys::describe(crs)))
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

/// Day of the year, counted from 1, and year of the file's making. The environment variable `SOURCE_DATE_EPOCH`, in
/// seconds since 1970, stands for the clock, so that the same file can be made on any day.
pub(in crate::write) fn today() -> (u16, u16) {
    let told = std::env::var("SOURCE_DATE_EPOCH").ok().and_then(|seconds| seconds.trim().parse().ok());
    let clock = || SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    day_and_year(told.unwrap_or_else(clock))
}

/// Day of the year, counted from 1, and year, from seconds since 1970. At most the last year that LAS can hold.
fn day_and_year(seconds: u64) -> (u16, u16) {
    let mut days = seconds / 86_400;
    let mut year: u16 = 1970;
    loop {
        let leap = year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
        let length = if leap { 366 } else { 365 };
        if days < length || year == u16::MAX {
            return (days.min(length - 1) as u16 + 1, year);
        }
        days -= length;
        year += 1;
    }
}
