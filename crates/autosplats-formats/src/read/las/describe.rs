//! Describes a file by its header and variable length records.

use autosplats_cloud::{Error, shown_number};

use super::super::{Attribute, Description, Job};
use super::{
    chunks::Look,
    coordinates::{self, CoordinateSystem},
    dimension::{Dimension, Source, dimensions},
    header::{Header, bytes_at},
    laz,
    records::Records,
};
use crate::las;

/// Bytes of the COPC info record.
const COPC_INFO: usize = 160;

pub(super) fn describe(job: &Job<'_>) -> Result<Description, Error> {
    let mut header = Header::read(job)?;
    let records = Records::read(job.bytes, &header);
    let (dimensions, mut notes) = dimensions(&header, &records);
    notes.extend(records.notes.iter().cloned());
    let meaning = coordinates::of(&header, &records);
    let mut description = of_records(&header, &records, &dimensions, &meaning);
    notes.extend(meaning.notes);
    description.points = points(job, &mut header, &records, &mut notes);
    description.notes.splice(..0, notes);
    Ok(description)
}

/// The description by header and records, without the number of points.
pub(super) fn of_records(
    header: &Header,
    records: &Records<'_>,
    dimensions: &[Dimension],
    meaning: &CoordinateSystem,
) -> Description {
    let tree = records.find("copc", 1).filter(|record| record.data.len() == COPC_INFO && header.compressed);

    let coordinate = |(axis, scale): (&str, f64)| Attribute::new(axis, format!("int32 × {}", shown_number(scale)));
    let mut attributes: Vec<Attribute> =
        ["X", "Y", "Z"].into_iter().zip(header.scale.to_array()).map(coordinate).collect();
    let colors = ["Red", "Green", "Blue"].map(|name| Attribute::new(name, "uint16"));
    let mut colors = las::colors(header.format).map(|_| colors).into_iter().flatten().peekable();
    for dimension in dimensions {
        let stored = match &dimension.source {
            Source::Own(place) => place.stored(),
            Source::Color(_) => "uint16".into(),
            Source::Extra(extra) => extra.stored(),
        };
        // Colours are listed after the time and before the other values.
        if dimension.name == "Infrared" || matches!(dimension.source, Source::Extra(_)) {
            attributes.extend(colors.by_ref());
        }
        attributes.push(Attribute::new(&dimension.name, stored));
    }
    attributes.extend(colors);

    let mut notes = Vec::new();
    // A header without a number of points was never finished.
    let bounds = header.sane_bounds().filter(|_| header.stated > 0);
    if header.stated > 0 && bounds.is_none() {
        notes.push("the bounds in the header cannot be those of the points".into());
    }

    let mut details = details(header, records);
    if let Some(tree) = tree {
        details.extend(tree_details(tree.data));
    }
    let version = header.version_name();
    let format = match (tree, header.compressed) {
        (Some(_), _) => format!("COPC 1.0 ({version} point format {})", header.format),
        (None, true) => format!("{version}, point format {}, compressed (LAZ)", header.format),
        (None, false) => format!("{version}, point format {}", header.format),
    };
    Description {
        format,
        bounds,
        attributes,
        crs: meaning.crs.clone(),
        resolution: Some(header.scale.abs()),
        details,
        notes,
        ..Description::default()
    }
}

/// The number of points, if it shows without decompressing; notes tell where the header states another.
fn points(job: &Job<'_>, header: &mut Header, records: &Records<'_>, notes: &mut Vec<String>) -> Option<u64> {
    if !header.compressed {
        notes.extend(header.more_than_stated(header.held));
        let held = ((job.bytes.len() - header.point_data) / header.record_len) as u64;
        if held < header.points {
            notes.push(format!("the file is cut off: it holds {held} of {} points", header.points));
        }
        return Some(header.points);
    }
    let look = if header.stated == 0 { Look::Points } else { Look::Starts };
    match laz::Compressed::open(job, header, records, look) {
        Ok(Some(compressed)) => {
            notes.extend(compressed.note);
            notes.extend(header.more_than_stated(compressed.points));
            header.points = header.points.max(compressed.points as u64);
        }
        Ok(None) => {}
        // Reading looks for the chunks one after the other, which takes time.
        Err(Error::Malformed { .. }) if header.stated > 0 => {
            notes
                .push("the table of the compressed chunks cannot be used; reading tells which points are there".into());
            return Some(header.stated);
        }
        Err(Error::Malformed { place, what, .. }) => {
            notes.push(format!("{place}: {what}"));
            return None;
        }
        Err(error) => notes.push(error.to_string()),
    }
    Some(header.points)
}

fn details(header: &Header, records: &Records<'_>) -> Vec<(String, String)> {
    let mut details = Vec::new();
    let mut detail = |name: &str, value: String| {
        if !value.is_empty() {
            details.push((name.to_owned(), value));
        }
    };
    detail("generating software", header.software.clone());
    detail("system identifier", header.system.clone());
    detail("created", date(header.created));
    let flags = ["GPS time is standard time", "waveforms inside", "waveforms outside", "returns are synthetic", "WKT"];
    let set = flags.into_iter().enumerate().filter(|(bit, _)| header.global_encoding >> bit & 1 == 1);
    detail("global encoding", set.map(|(_, flag)| flag).collect::<Vec<_>>().join(", "));
    // Some files store -0.
    detail("offset of coordinates", header.offset.to_array().map(|value| shown_number(value + 0.0)).join(", "));
    detail("variable length records", records.all.len().to_string());
    let returns = &header.points_by_return;
    let last = returns.iter().rposition(|&count| count > 0).map_or(0, |index| index + 1);
    detail("points by return", returns[..last].iter().map(u64::to_string).collect::<Vec<_>>().join(" "));
    details
}

/// A day of the year and a year as a date; empty if invalid.
fn date((day, year): (u16, u16)) -> String {
    let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let lengths = [31, if leap { 29 } else { 28 }, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let mut left = day;
    for (month, length) in lengths.into_iter().enumerate() {
        if (1..=length).contains(&left) && year > 1 {
            return format!("{year:04}-{:02}-{left:02}", month + 1);
        }
        left = left.saturating_sub(length);
    }
    String::new()
}

/// Shortens decimal text: removes zeros at the end.
fn short(digits: &str) -> String {
    digits.parse::<f64>().map_or_else(|_| digits.to_owned(), |value| value.to_string())
}

/// Facts about the octree of a COPC file.
fn tree_details(info: &[u8]) -> Vec<(String, String)> {
    let double = |index: usize| f64::from_le_bytes(bytes_at(info, 8 * index));
    let center = [0, 1, 2].map(|axis| short(&format!("{:.3}", double(axis)))).join(", ");
    let six = |value: f64| short(&format!("{value:.5e}"));
    let times = format!("{} to {}", double(7), double(8));
    vec![
        ("COPC root cube".into(), format!("{} wide about {center}", six(2.0 * double(3)))),
        ("COPC spacing".into(), format!("{} at the root", six(double(4)))),
        ("COPC times".into(), times),
    ]
}
