//! Describes a file by its XML section, without reading the points.

use autosplats_cloud::{Error, Scan, excerpt, printable};
use glam::{DMat4, DVec3};

use super::super::{Attribute, Description, Job};
use super::{
    cloud::is_of_scanner,
    xml::{Root, ScanHeader, open},
};

/// Largest number of scans described one by one.
const MAX_DESCRIBED_SCANS: usize = 100;

pub(super) fn describe(job: &Job<'_>) -> Result<Description, Error> {
    let (pages, root) = open(job)?;
    let (major, minor) = pages.version;
    let writer = root.writer.as_ref().map(|writer| format!(" ({})", shown_text(writer))).unwrap_or_default();
    let mut attributes: Vec<Attribute> = Vec::new();
    let mut known = std::collections::HashSet::new();
    for element in root.scans.iter().flat_map(|scan| &scan.elements) {
        if known.insert(element.full_name()) {
            attributes.push(Attribute::new(element.full_name(), element.stored.describe()));
        }
    }
    let mut start = 0;
    let scans = root.scans.iter().filter_map(|scan| {
        let end = usize::try_from(scan.points).unwrap_or(usize::MAX).saturating_add(start);
        let points = start..end;
        start = end;
        let scan_of =
            || Scan { name: scan.name.clone(), world_from_sensor: scan.pose.unwrap_or(DMat4::IDENTITY), points };
        is_of_scanner(scan, root.is_ours()).then(scan_of)
    });
    let scans = scans.collect();
    let mut notes = root.notes.clone();
    notes.extend(root.faults.iter().map(|(scan, what)| format!("{scan} is left out: XML section: {what}")));
    let poses = root.scans.iter().filter_map(|scan| Some(format!("{}: {}", scan.shown(), scan.pose_note.as_ref()?)));
    notes.extend(poses);
    if pages.cut_off() {
        notes.push(format!("the file is cut off at byte {}", job.bytes.len()));
    }
    // A point takes a byte at least, so a file holds no more points than bytes.
    let stated = root.scans.iter().try_fold(0_u64, |sum, scan| sum.checked_add(scan.points));
    let points = stated.filter(|&stated| stated <= job.bytes.len() as u64);
    if points.is_none() {
        let stated = stated.map_or("more points than numbers can tell".into(), |stated| format!("{stated} points"));
        notes.push(format!("the scans state {stated}, which {} bytes cannot hold", job.bytes.len()));
    }
    Ok(Description {
        format: format!("E57 {major}.{minor}{writer}"),
        points,
        bounds: bounds(&root.scans),
        attributes,
        crs: root.crs.clone(),
        scans,
        details: details(&root),
        notes,
        ..Description::default()
    })
}

fn details(root: &Root) -> Vec<(String, String)> {
    let mut details = Vec::new();
    let mut add = |name: &str, value: Option<String>| details.extend(value.map(|value| (name.to_string(), value)));
    add("guid", root.guid.as_deref().map(shown_text));
    add("created", root.created.map(date));
    add("scans", Some(root.scans.len().to_string()));
    if !root.images.is_empty() {
        let names: Vec<_> =
            root.images.iter().filter(|name| !name.is_empty()).take(5).map(|name| shown_text(name)).collect();
        let names = if names.is_empty() { String::new() } else { format!(" ({})", names.join(", ")) };
        add("images", Some(format!("{}{names}; not read", root.images.len())));
    }
    for scan in root.scans.iter().take(MAX_DESCRIBED_SCANS) {
        let mut facts = vec![format!("{} points", scan.points)];
        if let Some([row, column]) = scan.indices {
            facts.push(format!("rows {} to {}, columns {} to {}", row[0], row[1], column[0], column[1]));
        }
        facts.extend(scan.pose.is_none().then(|| "no pose".into()));
        facts.extend(scan.sensor.as_deref().map(shown_text));
        facts.extend(scan.start.map(|start| format!("begun {}", date(start))));
        facts.extend(scan.description.as_deref().map(shown_text));
        add(&scan.shown(), Some(facts.join("; ")));
    }
    details
}

/// The bounds of all scans in world coordinates, if all scans have bounds.
fn bounds(scans: &[ScanHeader]) -> Option<[DVec3; 2]> {
    let mut all: Option<[DVec3; 2]> = None;
    for scan in scans.iter().filter(|scan| scan.points > 0) {
        let [low, high] = scan.bounds.or(scan.max_range.map(|range| [DVec3::splat(-range), DVec3::splat(range)]))?;
        let pose = scan.pose.unwrap_or(DMat4::IDENTITY);
        for corner in 0..8 {
            let side = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
            let corner = pose.transform_point3(DVec3::new(side(0), side(1), side(2)));
            let [low, high] = all.unwrap_or([corner; 2]);
            all = Some([low.min(corner), high.max(corner)]);
        }
    }
    all
}

/// GPS time as a date. Leap seconds are ignored: they would need a table that grows.
fn date(seconds: f64) -> String {
    if !(0.0..1e11).contains(&seconds) {
        return format!("{seconds} s of GPS time");
    }
    let whole = seconds as i64;
    // Days since 0000-03-01, so that leap days end a year. GPS time begins on 1980-01-06.
    let days = whole / 86400 + 723_125;
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * of_year + 2) / 153;
    let day = of_year - (153 * shifted + 2) / 5 + 1;
    let month = if shifted < 10 { shifted + 3 } else { shifted - 9 };
    let year = era * 400 + year_of_era + i64::from(month <= 2);
    let (hour, minute, second) = (whole / 3600 % 24, whole / 60 % 60, whole % 60);
    format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02} GPS time")
}

/// Text of the file in one line, without characters that act on a terminal.
fn shown_text(text: &str) -> String {
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if line.len() > 40 { printable(&line.chars().take(200).collect::<String>()) } else { excerpt(line.as_bytes()) }
}

#[cfg(test)]
mod tests {
    use super::date;

    #[test]
    fn dates_of_gps_time() {
        assert_eq!(date(0.0), "1980-01-06 00:00:00 GPS time", "the epoch");
        assert_eq!(date(1e9), "2011-09-14 01:46:40 GPS time", "a billion seconds later");
        assert_eq!(date(55.0 * 86400.0), "1980-03-01 00:00:00 GPS time", "55 days later, past a leap day");
        assert_eq!(date(-1.0), "-1 s of GPS time", "before it all");
    }
}
