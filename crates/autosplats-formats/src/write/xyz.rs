//! Text: XYZ and CSV with a line of names, and PTS as Leica's programs write it.
//!
//! Every number is written with the fewest digits that restore the cloud's number; colours are integers.

use std::{
    fs::File,
    io::{BufWriter, Write as _},
    path::Path,
};

use autosplats_cloud::{Error, Field, FieldValues, PointCloud, each_type};
use glam::DVec3;
use rayon::prelude::*;

use super::{
    Format, Job,
    colors::{CHANNELS, channels},
    decimal,
    facts::{Facts, note_left_out},
    names::unique_names,
};

pub(super) const FORMAT: Format = Format { name: "text", extensions: &["xyz", "txt", "csv", "asc", "pts"], write };

/// Points that one thread formats at a time.
const PIECE: usize = 1 << 12;

/// Pieces formatted before they are written.
const BATCH: usize = 64;

/// Layout of a row after the coordinates.
struct Layout<'a> {
    separator: u8,
    colors: Option<Channels<'a>>,
    fields: Vec<&'a Field>,
    /// Whether the fields precede the colours, as in PTS.
    fields_first: bool,
}

/// Colours, with all their digits if the cloud has them.
enum Channels<'a> {
    Bytes(&'a [[u8; 3]]),
    Wide([&'a FieldValues; 3]),
}

fn write(job: &Job<'_>, file: &mut BufWriter<&mut File>) -> Result<(), Error> {
    let facts = Facts::of(job)?;
    let extension = job.path.extension().map(|extension| extension.to_ascii_lowercase()).unwrap_or_default();
    let is_pts = extension == "pts";
    let io = |source| job.io(source);
    let (mut begun, mut done) = (false, 0);
    job.each(&mut |cloud| {
        let (layout, header) = if is_pts { pts(cloud, &facts) } else { table(cloud, &facts, Path::new(&extension)) };
        if !std::mem::replace(&mut begun, true) {
            if is_pts {
                note_lost_fields(job, cloud);
            }
            note_left_out(job, &facts, "text", &[(facts.like.axes().is_some(), "which axis is up")]);
            file.write_all(header.as_bytes()).map_err(io)?;
        }
        for start in (0..cloud.len()).step_by(PIECE * BATCH) {
            job.tick(done as f32 / facts.points as f32)?;
            let end = cloud.len().min(start + PIECE * BATCH);
            let starts = (start..end).into_par_iter().step_by(PIECE);
            let pieces: Vec<Vec<u8>> = starts.map(|from| layout.rows(cloud, from..end.min(from + PIECE))).collect();
            pieces.iter().try_for_each(|piece| file.write_all(piece)).map_err(io)?;
            done += (end - start) as u64;
        }
        Ok(())
    })
}

/// A line of names and all values.
fn table<'a>(cloud: &'a PointCloud, facts: &Facts, extension: &Path) -> (Layout<'a>, String) {
    let wide = channels(cloud).filter(|_| facts.are_wide());
    let is_color = |field: &&Field| wide.is_some() && CHANNELS.contains(&&*field.name);
    let fields: Vec<&Field> = cloud.fields().iter().filter(|field| !is_color(field)).collect();
    let colors = wide.map(Channels::Wide).or_else(|| cloud.colors().map(Channels::Bytes));
    let mut names: Vec<String> = ["x", "y", "z"].map(String::from).into();
    if colors.is_some() {
        names.extend(["red", "green", "blue"].map(String::from));
    }
    names.extend(unique_names(&fields, &["x", "y", "z", "red", "green", "blue"]));
    let separator = if extension == Path::new("csv") { "," } else { " " };
    let header = names.join(separator) + "\n";
    (Layout { separator: separator.as_bytes()[0], colors, fields, fields_first: false }, header)
}

/// The number of points, then x y z, intensity and red green blue, as far as the cloud has them.
fn pts<'a>(cloud: &'a PointCloud, facts: &Facts) -> (Layout<'a>, String) {
    let fields: Vec<&Field> = cloud.field("Intensity").into_iter().collect();
    let colors = cloud.colors().map(Channels::Bytes);
    (Layout { separator: b' ', colors, fields, fields_first: true }, format!("{}\n", facts.points))
}

fn note_lost_fields(job: &Job<'_>, cloud: &PointCloud) {
    let names = cloud.fields().iter().map(|field| field.name.as_str());
    let lost: Vec<&str> = names.filter(|name| *name != "Intensity").collect();
    if !lost.is_empty() {
        job.note(format!("PTS holds only intensities and colours; left out: {}", lost.join(", ")));
    }
}

impl Layout<'_> {
    fn rows(&self, cloud: &PointCloud, points: std::ops::Range<usize>) -> Vec<u8> {
        let mut text = Vec::with_capacity(points.len() * 40);
        for point in points {
            self.position(cloud, point, &mut text);
            if self.fields_first {
                self.fields(point, &mut text);
            }
            match &self.colors {
                Some(Channels::Bytes(colors)) => {
                    for channel in colors[point] {
                        text.push(self.separator);
                        decimal::push_integer(&mut text, channel.into());
                    }
                }
                Some(Channels::Wide(channels)) => {
                    for channel in channels {
                        text.push(self.separator);
                        value(channel, point, &mut text);
                    }
                }
                None => {}
            }
            if !self.fields_first {
                self.fields(point, &mut text);
            }
            text.push(b'\n');
        }
        text
    }

    /// World coordinates, each the shortest decimal that restores the cloud's own numbers.
    fn position(&self, cloud: &PointCloud, point: usize, text: &mut Vec<u8>) {
        let position = cloud.positions()[point];
        let residual = cloud.residuals().map(|residuals| residuals[point]);
        let origin = cloud.origin();
        let bare = origin == DVec3::ZERO && residual.is_none();
        // A sum never is a negative zero.
        let world = if bare { DVec3::from(position.map(f64::from)) } else { cloud.world_position(point) };
        for axis in 0..3 {
            if axis > 0 {
                text.push(self.separator);
            }
            // The last digits of an integer times a step carry no information.
            let meaningless = cloud.resolution().map_or(0.0, |step| 1e-6 * step[axis].abs());
            decimal::push(text, world[axis], |read| {
                if (read - world[axis]).abs() < meaningless {
                    return true;
                }
                let local = read - origin[axis];
                let near = local as f32;
                near == position[axis]
                    && residual.is_none_or(|residual| (local - f64::from(near)) as f32 == residual[axis])
            });
        }
    }

    fn fields(&self, point: usize, text: &mut Vec<u8>) {
        for field in &self.fields {
            text.push(self.separator);
            value(&field.values, point, text);
        }
    }
}

fn value(values: &FieldValues, point: usize, text: &mut Vec<u8>) {
    match values {
        FieldValues::F32(v) => decimal::push(text, v[point].into(), |read| read as f32 == v[point]),
        FieldValues::F64(v) => decimal::push(text, v[point], |read| read == v[point]),
        FieldValues::U64(v) => decimal::push_integer(text, v[point]),
        #[allow(clippy::unnecessary_cast, clippy::cast_lossless, reason = "one of the types is i64 itself")]
        values => each_type!(values, v => {
            let value = v[point] as i64;
            if value < 0 {
                text.push(b'-');
            }
            decimal::push_integer(text, value.unsigned_abs());
        }),
    }
}
