//! LAS 1.0 to 1.4, all point formats; the records of LAZ and COPC come from [`laz`](super::laz).
//!
//! The header is read by the `las` crate in its raw form. Its checked form also reads all variable length records,
//! allocating what they claim, and refuses files for faults that do not touch the points, so it is not used.

use glam::DVec3;
use las::raw;
use rayon::prelude::*;

use super::{
    Contents, Description, Format, Job, guard, laz,
    table::{Part, collect, middle, reserve},
};
use crate::{Axes, Error, FieldValues, PointCloud};

/// Bytes of a record, by point format.
const RECORD_LEN: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// Points decoded between two looks at the caller's wish to stop.
const BLOCK: usize = 1 << 18;

/// What reading the points needs to know of the header.
pub(super) struct Header {
    pub(super) format: usize,
    pub(super) record_len: usize,
    pub(super) points: u64,
    pub(super) point_data: usize,
    pub(super) compressed: bool,
    /// First byte after the header, where the variable length records begin, and how many there should be.
    pub(super) records: (usize, u32),
    scale: DVec3,
    offset: DVec3,
}

pub(super) const FORMAT: Format = Format {
    name: "LAS",
    extensions: &["las", "laz", "copc"],
    recognised: |bytes| bytes.starts_with(b"LASF"),
    sensor_frame: false,
    describe,
    read,
};

fn describe(job: &Job<'_>) -> Result<Description, Error> {
    let header = header(job)?;
    Ok(Description { format: "LAS".into(), points: Some(header.points), ..Description::default() })
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    let header = header(job)?;
    let mut columns = Columns::new(header.format);
    if header.compressed {
        laz::decode(job, &header, |records| columns.append(records, header.record_len))?;
    } else {
        uncompressed(job, &header, &mut columns)?;
    }
    Ok(columns.into_cloud(job, &header)?.into())
}

fn header(job: &Job<'_>) -> Result<Header, Error> {
    let fail = |at: usize, what: String| job.malformed(format!("byte {at}"), what);
    if !job.bytes.starts_with(b"LASF") {
        return Err(fail(0, "a LAS file begins with 'LASF', this one does not".into()));
    }
    let raw = guard(|| raw::Header::read_from(job.bytes).map_err(|error| error.to_string()))
        .map_err(|what| fail(job.bytes.len(), format!("the header cannot be read ({what}); copy the file again")))?;

    let format = usize::from(raw.point_data_record_format & 0x3f);
    let compressed = raw.point_data_record_format & 0xc0 != 0;
    let record_len = usize::from(raw.point_data_record_length);
    let Some(&needed) = RECORD_LEN.get(format) else {
        return Err(fail(104, format!("point format {format} does not exist; formats 0 to 10 do")));
    };
    if record_len < needed {
        return Err(fail(105, format!("records of {record_len} bytes are too short for format {format}")));
    }
    let scale = DVec3::new(raw.x_scale_factor, raw.y_scale_factor, raw.z_scale_factor);
    let offset = DVec3::new(raw.x_offset, raw.y_offset, raw.z_offset);
    if !scale.is_finite() || !offset.is_finite() || scale.min_element() == 0.0 {
        return Err(fail(131, format!("coordinates cannot be made with scale {scale} and offset {offset}")));
    }
    let legacy = u64::from(raw.number_of_point_records);
    let points = raw.large_file.map_or(0, |large| large.number_of_point_records);
    let point_data = raw.offset_to_point_data as usize;
    if point_data > job.bytes.len() {
        return Err(fail(
            job.bytes.len(),
            format!("the points should begin at byte {point_data}; copy the file again"),
        ));
    }
    Ok(Header {
        format,
        record_len,
        points: if points == 0 { legacy } else { points },
        point_data,
        compressed,
        records: (raw.header_size.into(), raw.number_of_variable_length_records),
        scale,
        offset,
    })
}

fn uncompressed(job: &Job<'_>, header: &Header, columns: &mut Columns) -> Result<(), Error> {
    let data = &job.bytes[header.point_data..];
    let complete = data.len() / header.record_len;
    let points = usize::try_from(header.points).unwrap_or(usize::MAX);
    if points > complete {
        return Err(job.malformed(
            format!("byte {}", job.bytes.len()),
            format!("the file ends after {complete} of {points} points; it is cut off, copy it again"),
        ));
    }
    let records = &data[..points * header.record_len];
    for (index, block) in records.chunks(BLOCK * header.record_len).enumerate() {
        job.tick(0.9 * (index * BLOCK) as f32 / points as f32)?;
        columns.append(block, header.record_len)?;
    }
    Ok(())
}

/// Where the values lie in a record.
struct Layout {
    /// Formats 6 and up, with wider bit fields.
    wide: bool,
    gps_time: Option<usize>,
    colors: Option<usize>,
    infrared: Option<usize>,
}

/// The values of the points so far, coordinates as the file's integers.
struct Columns {
    layout: Layout,
    positions: Vec<[i32; 3]>,
    intensity: Vec<u16>,
    return_number: Vec<u8>,
    number_of_returns: Vec<u8>,
    classification: Vec<u8>,
    source: Vec<u16>,
    gps_time: Vec<f64>,
    colors: Vec<[u16; 3]>,
    infrared: Vec<u16>,
}

impl Columns {
    fn new(format: usize) -> Self {
        let layout = Layout {
            wide: format >= 6,
            gps_time: match format {
                0 | 2 => None,
                1..=5 => Some(20),
                _ => Some(22),
            },
            colors: match format {
                2 => Some(20),
                3 | 5 => Some(28),
                7 | 8 | 10 => Some(30),
                _ => None,
            },
            infrared: matches!(format, 8 | 10).then_some(36),
        };
        Self {
            layout,
            positions: Vec::new(),
            intensity: Vec::new(),
            return_number: Vec::new(),
            number_of_returns: Vec::new(),
            classification: Vec::new(),
            source: Vec::new(),
            gps_time: Vec::new(),
            colors: Vec::new(),
            infrared: Vec::new(),
        }
    }

    /// Takes the values out of whole records.
    fn append(&mut self, records: &[u8], len: usize) -> Result<(), Error> {
        let Layout { wide, gps_time, colors, infrared } = self.layout;
        extend(&mut self.positions, records, len, |r| [i32_at(r, 0), i32_at(r, 4), i32_at(r, 8)])?;
        extend(&mut self.intensity, records, len, |r| u16_at(r, 12))?;
        extend(&mut self.return_number, records, len, |r| r[14] & if wide { 15 } else { 7 })?;
        extend(&mut self.number_of_returns, records, len, |r| if wide { r[14] >> 4 } else { r[14] >> 3 & 7 })?;
        extend(&mut self.classification, records, len, |r| if wide { r[16] } else { r[15] & 31 })?;
        extend(&mut self.source, records, len, |r| u16_at(r, if wide { 20 } else { 18 }))?;
        if let Some(at) = gps_time {
            extend(&mut self.gps_time, records, len, |r| {
                let mut raw = [0; 8];
                raw.copy_from_slice(&r[at..at + 8]);
                f64::from_le_bytes(raw)
            })?;
        }
        if let Some(at) = colors {
            extend(&mut self.colors, records, len, |r| [u16_at(r, at), u16_at(r, at + 2), u16_at(r, at + 4)])?;
        }
        if let Some(at) = infrared {
            extend(&mut self.infrared, records, len, |r| u16_at(r, at))?;
        }
        Ok(())
    }

    /// Makes the cloud; what is zero for every point was not recorded and is left out.
    fn into_cloud(self, job: &Job<'_>, header: &Header) -> Result<PointCloud, Error> {
        let world = |[x, y, z]: [i32; 3]| DVec3::new(x.into(), y.into(), z.into()) * header.scale + header.offset;
        // An origin even for small coordinates: degrees need all the bits they can get.
        let origin = middle(self.positions.len(), |i| world(self.positions[i]));
        let part = Part { start: 0.9, len: 0.1 };
        let positions = collect("positions", self.positions.len(), job, part, |i| {
            (world(self.positions[i]) - origin).as_vec3().to_array()
        })?;
        let mut cloud = PointCloud::new(origin, positions).with_axes(Axes::ZUp);

        if self.colors.iter().any(|color| *color != [0; 3]) {
            // Many files hold 8-bit values in the 16 bits that the format has.
            let narrow = self.colors.par_iter().all(|color| color.iter().all(|&channel| channel <= 255));
            let shift = if narrow { 0 } else { 8 };
            let part = Part { start: 1.0, len: 0.0 };
            let colors = collect("colours", self.colors.len(), job, part, |i| {
                self.colors[i].map(|channel| (channel >> shift) as u8)
            })?;
            cloud = cloud.with_colors(colors)?;
        }
        let fields = [
            ("Intensity", FieldValues::U16(self.intensity)),
            ("ReturnNumber", FieldValues::U8(self.return_number)),
            ("NumberOfReturns", FieldValues::U8(self.number_of_returns)),
            ("Classification", FieldValues::U8(self.classification)),
            ("PointSourceId", FieldValues::U16(self.source)),
            ("GpsTime", FieldValues::F64(self.gps_time)),
            ("Infrared", FieldValues::U16(self.infrared)),
        ];
        for (name, values) in fields {
            let recorded = match &values {
                FieldValues::U8(values) => values.iter().any(|&value| value != 0),
                FieldValues::U16(values) => values.iter().any(|&value| value != 0),
                FieldValues::F64(values) => values.iter().any(|&value| value != 0.0),
                _ => true,
            };
            if recorded {
                cloud = cloud.with_field(name, values)?;
            }
        }
        Ok(cloud)
    }
}

fn extend<T: Send>(
    values: &mut Vec<T>,
    records: &[u8],
    len: usize,
    value: impl Fn(&[u8]) -> T + Sync + Send,
) -> Result<(), Error> {
    reserve(values, records.len() / len, "points")?;
    values.par_extend(records.par_chunks_exact(len).map(value));
    Ok(())
}

fn u16_at(record: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([record[at], record[at + 1]])
}

fn i32_at(record: &[u8], at: usize) -> i32 {
    i32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]])
}
