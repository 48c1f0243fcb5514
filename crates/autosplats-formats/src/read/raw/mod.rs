//! Sweeps stored as headerless 32-bit floats: KITTI's `.bin` (x y z intensity), nuScenes' `.pcd.bin` (and ring).
//!
//! No header states how many numbers a point has; the numbers tell ([`Width`]), or --columns does.

mod width;

use autosplats_cloud::{Axes, Contents, Error, Scan};
use glam::DMat4;

use self::width::Width;
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
            let guess = match Width::of(job.bytes) {
                Width::Known(width) => names_of(job.bytes, width),
                Width::Unfinished(_) | Width::Unknown(_) => None,
            };
            let note = guess.filter(|guess| guess.len() > names.len()).map(|guess| {
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
        let no_points = || {
            let what = "these are no plausible points of 3 to 8 floats (x y z, intensity ...); name the columns with \
                        --columns";
            job.malformed("byte 0", what)
        };
        let width = match Width::of(job.bytes) {
            Width::Known(width) => width,
            Width::Unfinished(width) => {
                names_of(job.bytes, width).ok_or_else(no_points)?;
                let what = format!(
                    "these look like points of {width} floats, but the file ends inside a point; it is cut off, copy it \
                     again"
                );
                return Err(job.malformed(format!("byte {len}"), what));
            }
            Width::Unknown(widths) => {
                let widths: Vec<String> = widths
                    .into_iter()
                    .filter(|&width| names_of(job.bytes, width).is_some())
                    .map(|w| w.to_string())
                    .collect();
                if widths.is_empty() {
                    return Err(no_points());
                }
                let what = format!(
                    "a point may have {} floats, which the values do not tell; name the columns with --columns, such as \
                     x,y,z,intensity",
                    widths.join(" or ")
                );
                return Err(job.malformed("byte 0", what));
            }
        };
        let names: Vec<Option<String>> =
            names_of(job.bytes, width).ok_or_else(no_points)?.into_iter().map(Some).collect();
        let note = Some(columns::taken_for(&names));
        Ok(Self { names, note })
    }

    fn stride(&self) -> usize {
        SIZE * self.names.len()
    }

    fn columns(&self, bytes: &[u8]) -> Vec<Column> {
        let stride = self.stride();
        let column = |(index, name): (usize, &Option<String>)| {
            let integer = index >= 3 && Values::of(bytes, self.names.len(), index).integers;
            let scalar = if integer { Scalar::U32 } else { Scalar::F32 };
            Some(Column { name: name.clone()?, scalar, offset: index * SIZE, stride })
        };
        self.names.iter().enumerate().filter_map(column).collect()
    }
}

/// The numbers of one column at sampled points.
fn column(bytes: &[u8], width: usize, index: usize) -> impl ExactSizeIterator<Item = f32> + '_ {
    let stride = SIZE * width;
    let count = bytes.len() / stride;
    (0..count).step_by(count.div_ceil(SAMPLED_RECORDS).max(1)).map(move |point| {
        let at = point * stride + index * SIZE;
        f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
    })
}

/// Integers read as floats are tiny.
fn tiny(value: f32) -> bool {
    value != 0.0 && value.abs() < 1e-20
}

/// What the values of a column can be.
struct Values {
    /// Integers of 32 bits.
    integers: bool,
    /// Small whole numbers, as numbers of lasers are.
    ring: bool,
    /// No value is below zero, and all are in the range of 16 bits.
    intensity: bool,
}

impl Values {
    fn of(bytes: &[u8], width: usize, index: usize) -> Self {
        let mut values = Self { integers: false, ring: true, intensity: true };
        let mut floats = false;
        for value in column(bytes, width, index).filter(|value| !value.is_nan()) {
            values.integers |= tiny(value);
            floats |= value != 0.0 && !tiny(value);
            values.ring &=
                tiny(value) && value.to_bits() < 128 || (0.0..128.0).contains(&value) && value.fract() == 0.0;
            values.intensity &= (0.0..=65535.0).contains(&value);
        }
        values.integers &= !floats;
        values
    }
}

/// Names of the numbers of a point; `None` if the first three cannot be coordinates.
fn names_of(bytes: &[u8], width: usize) -> Option<Vec<String>> {
    let (mut odd, mut total) = (0, 0);
    for axis in 0..3 {
        let mut wide = axis == 2;
        for value in column(bytes, width, axis) {
            if value.is_finite() && value.abs() >= MAX_COORDINATE_M {
                return None;
            }
            // Sensors write NaN for missing returns.
            odd += usize::from(!value.is_finite() || tiny(value));
            wide |= value.abs() > 1e-3;
            total += 1;
        }
        if !wide {
            return None;
        }
    }
    let mut names = ["x", "y", "z"].map(str::to_owned).to_vec();
    for index in 3..width {
        let values = Values::of(bytes, width, index);
        names.push(match index {
            3 if values.intensity => "intensity".into(),
            4 if values.ring => "ring".into(),
            _ => format!("value_{}", index + 1),
        });
    }
    (odd * 2 <= total).then_some(names)
}

fn describe(job: &Job<'_>) -> Result<Description, Error> {
    let layout = Layout::of(job)?;
    let points = job.bytes.len() / layout.stride();
    Ok(Description {
        format: "bare 32-bit floats".into(),
        points: Some(points as u64),
        attributes: layout.columns(job.bytes).iter().map(Column::attribute).collect(),
        scans: vec![at_the_origin(points)],
        notes: layout.note.into_iter().collect(),
        ..Description::default()
    })
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    let layout = Layout::of(job)?;
    layout.note.iter().for_each(|note| job.note(note));
    let count = job.bytes.len() / layout.stride();
    let table = Table {
        bytes: job.bytes,
        count,
        big_endian: false,
        columns: layout.columns(job.bytes),
        packed_rgb: false,
        done: 0.0,
    };
    table.preview(job, "columns")?;
    let cloud = table.into_cloud(job, "columns")?;
    Ok(cloud.with_axes(Axes::ZUp).with_scans(vec![at_the_origin(count)]).into())
}

/// Sweeps are in the sensor's own frame.
fn at_the_origin(points: usize) -> Scan {
    Scan { name: None, world_from_sensor: DMat4::IDENTITY, points: 0..points }
}
