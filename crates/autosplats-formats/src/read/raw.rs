//! Sweeps stored as headerless 32-bit floats: KITTI's `.bin` (x y z intensity), nuScenes' `.pcd.bin` (and ring).
//!
//! No header states how many numbers a point has, so a sample of records is inspected. At a wrong width, coordinates
//! appear as intensities or rings; coordinates can be negative, intensities and rings cannot.

use autosplats_cloud::{Axes, Contents, Error, Scan};
use glam::DMat4;

use super::{
    Description, Format, Job, columns,
    table::{Column, Scalar, Table},
};

pub(super) const FORMAT: Format = Format {
    name: "bare floats",
    extensions: &["pcd.bin", "bin"],
    recognised: |_| false,
    sensor_frame: true,
    describe,
    read,
};

/// Bytes of a number.
const SIZE: usize = 4;

/// Records sampled.
const SAMPLED_RECORDS: usize = 4096;

/// Bound of plausible coordinates, in metres; no sensor sees further.
const MAX_COORDINATE_M: f32 = 1e4;

/// Meaning of the numbers of a point.
struct Layout {
    names: Vec<Option<String>>,
    /// Note for the user.
    note: Option<String>,
}

impl Layout {
    fn of(job: &Job<'_>) -> Result<Self, Error> {
        let len = job.bytes.len();
        if len == 0 {
            return Err(job.malformed("byte 0", "the file is empty; copy it again"));
        }
        // Three columns come last, because data of more columns pass for three as well.
        let with_ring: &[&str] = &["x", "y", "z", "intensity", "ring"];
        let guess =
            || [&with_ring[..4], with_ring, &with_ring[..3]].into_iter().find(|names| plausible(job.bytes, names));
        if let Some(columns::Given { names, open }) = columns::given(job)? {
            if open {
                let what = "--columns ends in '...', but the length of these records has to be known; name all columns";
                return Err(job.unsupported(what));
            }
            let stride = SIZE * names.len();
            if !len.is_multiple_of(stride) {
                let what = format!(
                    "the file ends inside a point: --columns names {} floats per point; name all there are",
                    names.len()
                );
                return Err(job.malformed(format!("byte {len}"), what));
            }
            let note = guess().filter(|guess| guess.len() > names.len()).map(|guess| {
                format!(
                    "these look like points of {} floats ({}) and are read as {}; --columns has to name all of them, '-' \
                     leaves one out",
                    guess.len(),
                    guess.join(" "),
                    names.len()
                )
            });
            return Ok(Self { names, note });
        }
        let Some(names) = guess() else {
            return Err(job.malformed(
                "byte 0",
                "these are no plausible points of 4, 5 or 3 floats (x y z intensity ring); name the columns with \
                 --columns",
            ));
        };
        let names: Vec<Option<String>> = names.iter().map(|&name| Some(name.into())).collect();
        let note = Some(columns::taken_for(&names));
        Ok(Self { names, note })
    }

    fn stride(&self) -> usize {
        SIZE * self.names.len()
    }

    fn columns(&self) -> Vec<Column> {
        let column = |(index, name): (usize, &Option<String>)| {
            let name = name.clone()?;
            Some(Column { name, scalar: Scalar::F32, offset: index * SIZE, stride: self.stride() })
        };
        self.names.iter().enumerate().filter_map(column).collect()
    }
}

/// Whether the bytes can be records of these values.
fn plausible(bytes: &[u8], names: &[&str]) -> bool {
    let stride = SIZE * names.len();
    if !bytes.len().is_multiple_of(stride) {
        return false;
    }
    let count = bytes.len() / stride;
    let step = count.div_ceil(SAMPLED_RECORDS);
    let (mut odd, mut wide) = (0, [false; 2]);
    let records = (0..count).step_by(step).map(|index| &bytes[index * stride..][..stride]);
    let total = records.len();
    for record in records {
        let value = |column: usize| f32::from_le_bytes(std::array::from_fn(|byte| record[column * SIZE + byte]));
        let xyz = [0, 1, 2].map(value);
        if xyz.iter().any(|value| value.is_finite() && value.abs() >= MAX_COORDINATE_M) {
            return false;
        }
        // Integers read as floats are tiny. Sensors write NaN for missing returns.
        let tiny = |value: f32| value != 0.0 && value.abs() < 1e-20;
        if xyz.iter().any(|&value| !value.is_finite() || tiny(value)) {
            odd += 1;
        }
        wide[0] |= xyz[0].abs() > 1e-3;
        wide[1] |= xyz[1].abs() > 1e-3;
        let in_order = |(column, &name): (usize, &&str)| match name {
            "intensity" => (0.0..=65535.0).contains(&value(column)) && !tiny(value(column)),
            "ring" => (0.0..128.0).contains(&value(column)) && value(column).fract() == 0.0,
            _ => true,
        };
        if !names.iter().enumerate().all(in_order) {
            return false;
        }
    }
    wide == [true; 2] && odd * 2 <= total
}

fn describe(job: &Job<'_>) -> Result<Description, Error> {
    let layout = Layout::of(job)?;
    let points = job.bytes.len() / layout.stride();
    Ok(Description {
        format: "bare 32-bit floats".into(),
        points: Some(points as u64),
        attributes: layout.columns().iter().map(Column::attribute).collect(),
        scans: vec![at_the_origin(points)],
        notes: layout.note.into_iter().collect(),
        ..Description::default()
    })
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    let layout = Layout::of(job)?;
    layout.note.iter().for_each(|note| job.note(note));
    let count = job.bytes.len() / layout.stride();
    let table =
        Table { bytes: job.bytes, count, big_endian: false, columns: layout.columns(), packed_rgb: false, done: 0.0 };
    table.preview(job, "columns")?;
    let cloud = table.into_cloud(job, "columns")?;
    Ok(cloud.with_axes(Axes::ZUp).with_scans(vec![at_the_origin(count)]).into())
}

/// Sweeps are in the sensor's own frame.
fn at_the_origin(points: usize) -> Scan {
    Scan { name: None, world_from_sensor: DMat4::IDENTITY, points: 0..points }
}
