//! Points in text: XYZ, PTS, CSV and similar, which share columns of numbers and little else.
//!
//! The columns are named by the caller, or by a header line or comment. Otherwise they are guessed from their number
//! and the first rows, and the guess is noted. Three columns are positions; four add an intensity, six a colour or a
//! normal, and seven both intensity and colour.

mod cells;
mod columns;
mod dialect;
mod guess;
mod header;
mod layout;
mod naming;
mod numbers;
pub(super) mod parts;
mod preamble;
mod rows;
mod settle;
mod survey;

use autosplats_cloud::{Contents, Error, PointCloud};
use glam::DVec3;

pub(super) use self::preamble::looks_like_rows;
use self::{
    columns::Columns,
    layout::Layout,
    preamble::Preamble,
    rows::{Parser, Piece},
    settle::Look,
    survey::{Survey, survey},
};
use super::{Attribute, Description, Format, Job, cuts::Text, table::ProgressRange};

/// Fraction of the work that parsing takes.
const PARSING: f32 = 0.95;

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
    Ok(points(job, &layout, &preamble)?.into())
}

/// Reads the rows. Besides the cloud, only one batch of pieces is in memory.
fn points(job: &Job<'_>, layout: &Layout, preamble: &Preamble) -> Result<PointCloud, Error> {
    let (text, start, exact) = (Text::Held(job.bytes), preamble.start, job.options.exact);
    let Survey { origin, crs, row_len } = survey(job, layout, start);
    job.check_memory((text.len() - start) / row_len, layout.bytes_per_point(exact))?;
    let parser = Parser { layout, origin, exact, counts_between: preamble.promised.is_some() };
    let (mut all, mut look) = (Columns::new(layout), Look::default());
    let part = ProgressRange { start: 0.0, len: PARSING };
    parser.each(job, text, start, part, |pieces| {
        job.preview(|| preview(&Job { progress: &(), ..*job }, layout, origin, &pieces))?;
        for piece in pieces {
            all.append(&piece.columns)?;
            look.add(piece.look);
        }
        Ok(())
    })?;
    look.check(job, &text, preamble.promised)?;
    job.tick(PARSING)?;
    let settled = look.settle(job, layout.has_color, origin, exact);
    let mut cloud = settled.build(all, layout, origin)?.with_crs(crs);
    settled.drop_no_heights(&mut cloud);
    Ok(cloud)
}

/// The points of some pieces, with what these alone tell.
fn preview(job: &Job<'_>, layout: &Layout, origin: DVec3, pieces: &[Piece]) -> Result<PointCloud, Error> {
    let (mut chunk, mut look) = (Columns::new(layout), Look::default());
    for Piece { columns, .. } in pieces {
        chunk.append(columns)?;
        look.add(Look::of(columns, origin, false));
    }
    let settled = look.settle(job, layout.has_color, origin, false);
    settled.build(chunk, layout, origin)
}
