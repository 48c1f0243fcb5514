//! Points in text: XYZ, PTS, CSV and similar, which share columns of numbers and little else.
//!
//! The columns are named by the caller, or by a header line or comment. Otherwise they are guessed from their number
//! and the first rows, and the guess is noted. Three columns are positions; four add an intensity, six a colour or a
//! normal, and seven both intensity and colour.

mod cells;
mod dialect;
mod guess;
mod header;
mod layout;
mod naming;
mod numbers;
mod preamble;
mod rows;

use autosplats_cloud::{Contents, Error, PointCloud};

pub(super) use self::preamble::looks_like_rows;
use self::{layout::Layout, preamble::Preamble};
use super::{Attribute, Description, Format, Job};

pub(super) const FORMAT: Format = Format {
    name: "text",
    extensions: &["xyz", "txt", "csv", "pts", "asc"],
    recognised: |_| false,
    sensor_frame: false,
    describe,
    read,
};

fn check_is_text(job: &Job<'_>) -> Result<(), Error> {
    let start = &job.bytes[..job.bytes.len().min(1 << 16)];
    if start.is_empty() {
        return Err(job.malformed("byte 0", "the file is empty; copy it again"));
    }
    if let Some(at) = start.iter().position(|&byte| byte == 0) {
        return Err(job.malformed(
            format!("byte {at}"),
            "this is not 8-bit text, nor UTF-16 with a byte order mark; save it as UTF-8 text",
        ));
    }
    if !start.contains(&b'\n') && start.trim_ascii_end().contains(&b'\r') {
        return Err(job.unsupported("lines end in carriage returns alone; save them with line feeds"));
    }
    Ok(())
}

fn describe(job: &Job<'_>) -> Result<Description, Error> {
    check_is_text(job)?;
    let preamble = Preamble::parse(job)?;
    let layout = Layout::of(job, &preamble)?;
    let mut description = Description {
        format: "text".into(),
        points: preamble.promised.map(|promised| promised as u64),
        ..Description::default()
    };
    description.details.push(("encoding".into(), "UTF-8 or ASCII".into()));
    if let Some(layout) = layout {
        let mark = if layout.dialect.notation.decimal_comma { ", decimal commas" } else { "" };
        description.details.push(("separated by".into(), format!("{}{mark}", layout.dialect.separator.name())));
        let attribute = |name: &Option<String>| Attribute::new(name.as_deref().unwrap_or("-"), "text");
        description.attributes = layout.names.iter().map(attribute).collect();
        description.notes = layout.notes;
        description.crs = layout.crs;
    }
    Ok(description)
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    check_is_text(job)?;
    let preamble = Preamble::parse(job)?;
    let Some(layout) = Layout::of(job, &preamble)? else {
        return match preamble.promised {
            Some(points) if points > 0 => Err(job.malformed(
                job.line(preamble.start),
                format!("the file ends after 0 of {points} points; copy it again"),
            )),
            _ => Ok(PointCloud::default().into()),
        };
    };
    layout.notes.iter().for_each(|note| job.note(note));
    Ok(rows::read(job, &layout, preamble.start, preamble.promised)?.into())
}
