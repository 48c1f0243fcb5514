//! PLY, binary little endian: positions, colours and fields of any type, with all their digits.

use std::{
    fs::File,
    io::{BufWriter, Write as _},
    ops::Range,
};

use autosplats_cloud::{Error, Field, FieldValues, PointCloud, each_type};

use super::{
    Format, Job,
    colors::{CHANNELS, channels},
    facts::{Facts, note_left_out},
    records::Records,
};

pub(super) const FORMAT: Format = Format { name: "PLY", extensions: &["ply"], write };

/// Writes positions as 32-bit floats if the points have neither an origin nor residuals, otherwise world coordinates as
/// 64-bit floats. Blanks in field names become underscores.
fn write(job: &Job<'_>, file: &mut BufWriter<&mut File>) -> Result<(), Error> {
    let facts = Facts::of(job)?;
    note_left_out(job, &facts, "PLY", &[]);
    facts.beyond.iter().for_each(|name| job.note(format!("{name}: integers beyond 53 bits are rounded")));
    let mut records = Records::new(facts.points);
    let mut begun = false;
    job.each(&mut |cloud| {
        let layout = Layout::of(cloud, &facts);
        if !std::mem::replace(&mut begun, true) {
            file.write_all(layout.header(&facts).as_bytes()).map_err(|source| job.io(source))?;
        }
        records.write(job, file, cloud, layout.stride, |first, records| layout.encode(cloud, first, records))
    })
}

/// Layout of a record: positions, colours, fields.
struct Layout<'a> {
    doubles: bool,
    colors: Option<Colors<'a>>,
    fields: Vec<&'a Field>,
    names: Vec<String>,
    stride: usize,
}

/// Colours, with all their digits if the cloud has them.
enum Colors<'a> {
    Bytes(&'a [[u8; 3]]),
    Wide([&'a FieldValues; 3]),
}

impl<'a> Layout<'a> {
    fn of(cloud: &'a PointCloud, facts: &Facts) -> Self {
        let doubles = facts.origin || facts.residuals;
        let wide = channels(cloud).filter(|_| facts.are_wide());
        let is_color = |field: &&Field| wide.is_some() && CHANNELS.contains(&&*field.name);
        let fields: Vec<&Field> = cloud.fields().iter().filter(|field| !is_color(field)).collect();
        let colors = wide.map(Colors::Wide).or_else(|| cloud.colors().map(Colors::Bytes));
        let color = colors.as_ref().map_or(0, |colors| 3 * colors.scalar().1);
        let others: usize = fields.iter().map(|field| scalar(&field.values).1).sum();
        let stride = if doubles { 24 } else { 12 } + color + others;
        Self { doubles, colors, names: property_names(&fields), fields, stride }
    }

    fn header(&self, facts: &Facts) -> String {
        let mut header = String::from("ply\nformat binary_little_endian 1.0\n");
        header += &facts.like.axes().map_or_else(String::new, |axes| format!("comment axes {}\n", axes.name()));
        header += &format!("element vertex {}\n", facts.points);
        for axis in ["x", "y", "z"] {
            header += &format!("property {} {axis}\n", if self.doubles { "double" } else { "float" });
        }
        if let Some(colors) = &self.colors {
            for channel in ["red", "green", "blue"] {
                header += &format!("property {} {channel}\n", colors.scalar().0);
            }
        }
        for (field, name) in self.fields.iter().zip(&self.names) {
            header += &format!("property {} {name}\n", scalar(&field.values).0);
        }
        header + "end_header\n"
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
        match &self.colors {
            Some(Colors::Bytes(colors)) => self.place(records, &mut at, colors[range.clone()].iter().copied()),
            Some(Colors::Wide(wide)) => wide.iter().for_each(|values| self.values(records, &mut at, values, &range)),
            None => {}
        }
        for field in &self.fields {
            self.values(records, &mut at, &field.values, &range);
        }
    }

    fn values(&self, records: &mut [u8], at: &mut usize, values: &FieldValues, range: &Range<usize>) {
        match values {
            FieldValues::U64(_) | FieldValues::I64(_) => {
                self.place(records, at, range.clone().map(|i| values.get(i).to_le_bytes()));
            }
            values => each_type!(values, v => {
                self.place(records, at, v[range.clone()].iter().map(|value| value.to_le_bytes()));
            }),
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

impl Colors<'_> {
    fn scalar(&self) -> (&'static str, usize) {
        match self {
            Self::Bytes(_) => ("uchar", 1),
            Self::Wide([first, ..]) => scalar(first),
        }
    }
}

/// PLY's name and size of the values' type.
fn scalar(values: &FieldValues) -> (&'static str, usize) {
    match values {
        FieldValues::I8(_) => ("char", 1),
        FieldValues::U8(_) => ("uchar", 1),
        FieldValues::I16(_) => ("short", 2),
        FieldValues::U16(_) => ("ushort", 2),
        FieldValues::I32(_) => ("int", 4),
        FieldValues::U32(_) => ("uint", 4),
        FieldValues::F32(_) => ("float", 4),
        // PLY has no 64-bit integers; 53 bits survive.
        FieldValues::U64(_) | FieldValues::I64(_) | FieldValues::F64(_) => ("double", 8),
    }
}

/// Unique names without blanks, different from those of coordinates and colours.
fn property_names(fields: &[&Field]) -> Vec<String> {
    let mut taken: Vec<String> = ["x", "y", "z", "red", "green", "blue"].map(String::from).into();
    for field in fields {
        let blank = |c: char| c.is_whitespace() || c.is_control();
        let mut name = match field.name.as_str() {
            // The names that other programs expect.
            "NormalX" => "nx".into(),
            "NormalY" => "ny".into(),
            "NormalZ" => "nz".into(),
            name => name.replace(blank, "_"),
        };
        while name.is_empty() || taken.iter().any(|other| other.eq_ignore_ascii_case(&name)) {
            name.push('_');
        }
        taken.push(name);
    }
    taken.split_off(6)
}
