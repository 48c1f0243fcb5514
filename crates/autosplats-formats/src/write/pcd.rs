//! PCD, binary little endian.

use std::{
    fs::File,
    io::{BufWriter, Write as _},
};

use autosplats_cloud::{Error, Field, FieldValues, PointCloud, each_type};
use glam::{DMat4, DQuat};

use super::{Format, Job, facts::Facts, names::unique_names, records::Records};

pub(super) const FORMAT: Format = Format { name: "PCD", extensions: &["pcd"], write };

/// Writes positions as 32-bit floats if the cloud's origin is zero, otherwise world coordinates as 64-bit floats. Most
/// programs read 32-bit floats only. Colours are packed into a field `rgb`.
fn write(job: &Job<'_>, file: &mut BufWriter<&mut File>) -> Result<(), Error> {
    let facts = Facts::of(job)?;
    note_losses(job, &facts);
    let mut records = Records::new(facts.points);
    let mut begun = false;
    job.each(&mut |cloud| {
        let layout = Layout::of(cloud, &facts);
        if !std::mem::replace(&mut begun, true) {
            file.write_all(layout.header(cloud, &facts).as_bytes()).map_err(|source| job.io(source))?;
        }
        records.write(job, file, cloud, layout.stride, |first, records| layout.encode(cloud, first, records))
    })
}

fn note_losses(job: &Job<'_>, facts: &Facts) {
    if facts.origin {
        job.note("coordinates this large are written as 64-bit floats, which some programs do not read");
    } else if facts.residuals {
        job.note("coordinates are rounded to 32-bit floats, which is what programs read from PCD");
    }
    if facts.has_system() {
        job.note("PCD does not hold the coordinate system");
    }
    if facts.scans && facts.only_pose.is_none() {
        job.note("PCD holds one sensor pose for all points; several are left out");
    }
}

/// Layout of a record: positions, colours, fields.
struct Layout {
    doubles: bool,
    names: Vec<String>,
    stride: usize,
}

impl Layout {
    fn of(cloud: &PointCloud, facts: &Facts) -> Self {
        let doubles = facts.origin;
        let fields: usize = cloud.fields().iter().map(|field| scalar(&field.values).1).sum();
        let stride = if doubles { 24 } else { 12 } + if cloud.colors().is_some() { 4 } else { 0 } + fields;
        let all: Vec<&Field> = cloud.fields().iter().collect();
        // "_" means padding.
        Self { doubles, names: unique_names(&all, &["x", "y", "z", "rgb", "rgba", "_"]), stride }
    }

    fn header(&self, cloud: &PointCloud, facts: &Facts) -> String {
        let position = if self.doubles { ('F', 8) } else { ('F', 4) };
        let mut fields: Vec<(&str, char, usize)> = ["x", "y", "z"].map(|axis| (axis, position.0, position.1)).into();
        if cloud.colors().is_some() {
            fields.push(("rgb", 'U', 4));
        }
        for (field, name) in cloud.fields().iter().zip(&self.names) {
            let (kind, size) = scalar(&field.values);
            // What other programs look for.
            let name = match name.as_str() {
                "NormalX" => "normal_x",
                "NormalY" => "normal_y",
                "NormalZ" => "normal_z",
                "Curvature" => "curvature",
                "Intensity" => "intensity",
                name => name,
            };
            fields.push((name, kind, size));
        }
        let axes = facts.like.axes().map_or_else(String::new, |axes| format!("# axes {}\n", axes.name()));
        // The default viewpoint may mean a sensor at the origin or none.
        let sensor = if facts.only_pose.is_some() { "# sensor at VIEWPOINT\n" } else { "" };
        let words =
            |word: &dyn Fn(&(&str, char, usize)) -> String| fields.iter().map(word).collect::<Vec<_>>().join(" ");
        format!(
            "# .PCD v0.7 - Point Cloud Data file format\n{axes}{sensor}VERSION 0.7\nFIELDS {}\nSIZE {}\nTYPE {}\nCOUNT {}\n\
             WIDTH {len}\nHEIGHT 1\nVIEWPOINT {}\nPOINTS {len}\nDATA binary\n",
            words(&|field| field.0.into()),
            words(&|field| field.2.to_string()),
            words(&|field| field.1.into()),
            words(&|_| "1".into()),
            viewpoint(facts.only_pose.unwrap_or(DMat4::IDENTITY)),
            len = facts.points,
        )
    }

    /// Encodes points from `first` on, as many as `records` has room for.
    fn encode(&self, cloud: &PointCloud, first: usize, records: &mut [u8]) {
        let range = first..first + records.len() / self.stride;
        let mut at = 0;
        if self.doubles {
            let world = range.clone().map(|i| cloud.world_position(i).to_array().map(f64::to_le_bytes));
            self.place(records, &mut at, world.map(bytemuck::cast::<_, [u8; 24]>));
        } else {
            let positions = cloud.positions()[range.clone()].iter();
            let bytes = positions.map(|position| bytemuck::cast::<_, [u8; 12]>(position.map(f32::to_le_bytes)));
            self.place(records, &mut at, bytes);
        }
        if let Some(colors) = cloud.colors() {
            self.place(records, &mut at, colors[range.clone()].iter().map(|&[red, green, blue]| [blue, green, red, 0]));
        }
        for field in cloud.fields() {
            each_type!(&field.values, v => {
                self.place(records, &mut at, v[range.clone()].iter().map(|value| value.to_le_bytes()));
            });
        }
    }

    /// Stores one value in every record at byte `at`, and advances `at`.
    fn place<const LEN: usize>(&self, records: &mut [u8], at: &mut usize, values: impl Iterator<Item = [u8; LEN]>) {
        for (record, value) in records.chunks_exact_mut(self.stride).zip(values) {
            record[*at..*at + LEN].copy_from_slice(&value);
        }
        *at += LEN;
    }
}

/// A pose as tx ty tz qw qx qy qz.
fn viewpoint(pose: DMat4) -> String {
    let (_, DQuat { x, y, z, w }, place) = pose.to_scale_rotation_translation();
    format!("{} {} {} {w} {x} {y} {z}", place.x, place.y, place.z)
}

/// PCD's type letter and size of the values.
fn scalar(values: &FieldValues) -> (char, usize) {
    match values {
        FieldValues::I8(_) => ('I', 1),
        FieldValues::U8(_) => ('U', 1),
        FieldValues::I16(_) => ('I', 2),
        FieldValues::U16(_) => ('U', 2),
        FieldValues::I32(_) => ('I', 4),
        FieldValues::U32(_) => ('U', 4),
        FieldValues::I64(_) => ('I', 8),
        FieldValues::U64(_) => ('U', 8),
        FieldValues::F32(_) => ('F', 4),
        FieldValues::F64(_) => ('F', 8),
    }
}
