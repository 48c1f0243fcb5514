//! Names of columns: what files call coordinates, colours and attributes, and what the caller says they are.

use super::{Job, shown, table::MAX_COLUMNS};
use crate::Error;

/// The names that the caller gives to the columns, nothing for one to leave out.
pub(super) fn given(job: &Job<'_>) -> Result<Option<Vec<Option<String>>>, Error> {
    let Some(names) = &job.options.columns else { return Ok(None) };
    if names.len() > MAX_COLUMNS {
        return Err(job.unsupported(format!("--columns names {} columns; at most {MAX_COLUMNS}", names.len())));
    }
    for axis in ["x", "y", "z"] {
        let count = names.iter().filter(|name| name.eq_ignore_ascii_case(axis)).count();
        if count != 1 {
            let names = shown(names.join(" ").as_bytes());
            let what = format!("--columns {names}: {axis} is named {count} times; name each of x, y and z once");
            return Err(job.unsupported(what));
        }
    }
    let name = |name: &String| (name != "-" && name != "_").then(|| name.clone());
    Ok(Some(names.iter().map(name).collect()))
}

/// Columns that a note lists.
const LISTED: usize = 24;

/// What columns were taken for, for a note.
pub(super) fn taken_for(names: &[Option<String>]) -> String {
    let shown = names.iter().map(|name| name.as_deref().map_or("-".into(), |name| shown(name.as_bytes())));
    let more = if names.len() > LISTED { format!(" and {} more", names.len() - LISTED) } else { String::new() };
    format!("columns taken for {}{more}; --columns overrides", shown.take(LISTED).collect::<Vec<_>>().join(" "))
}

/// Names of coordinates, the surer ones first.
const AXES: [&[&str]; 3] = [
    &[
        "x",
        "xcoord",
        "xcoordinate",
        "coordx",
        "posx",
        "positionx",
        "px",
        "points0",
        "easting",
        "east",
        "e",
        "longitude",
        "lon",
        "long",
        "lng",
    ],
    &[
        "y",
        "ycoord",
        "ycoordinate",
        "coordy",
        "posy",
        "positiony",
        "py",
        "points1",
        "northing",
        "north",
        "n",
        "latitude",
        "lat",
    ],
    &[
        "z",
        "zcoord",
        "zcoordinate",
        "coordz",
        "posz",
        "positionz",
        "pz",
        "points2",
        "elevation",
        "elev",
        "height",
        "altitude",
        "alt",
        "h",
    ],
];

/// A name as it is compared: without case, blanks and signs between words.
pub(super) fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// Where x, y and z are among the names, if they all are.
pub(super) fn find_axes(names: &[String]) -> Option<[usize; 3]> {
    let plain: Vec<String> = names.iter().map(|name| plain(name)).collect();
    let find = |axis: &[&str]| axis.iter().find_map(|name| plain.iter().position(|found| found == name));
    Some([find(AXES[0])?, find(AXES[1])?, find(AXES[2])?])
}

/// Whether this is how a longitude is called.
pub(super) fn is_longitude(name: &str) -> bool {
    ["longitude", "lon", "long", "lng"].contains(&&*plain(name))
}

/// Names of the three channels of a colour; of several colours the first is taken.
const COLORS: [[&str; 3]; 5] = [
    ["red", "green", "blue"],
    ["diffusered", "diffusegreen", "diffuseblue"],
    ["r", "g", "b"],
    ["colorred", "colorgreen", "colorblue"],
    ["rf", "gf", "bf"],
];

/// Where red, green and blue are among the names, if they all are.
pub(super) fn find_color(names: &[String]) -> Option<[usize; 3]> {
    let plain: Vec<String> = names.iter().map(|name| plain(name)).collect();
    let find = |name: &str| plain.iter().position(|found| found == name);
    COLORS.iter().find_map(|[red, green, blue]| Some([find(red)?, find(green)?, find(blue)?]))
}

/// PDAL's name for what files call by several; others stay as they are.
pub(super) fn field_name(name: &str) -> String {
    let plain = plain(name);
    // CloudCompare writes the fields of a PLY with this before them.
    let known = match plain.strip_prefix("scalar").unwrap_or(&plain) {
        "intensity" | "i" => "Intensity",
        "classification" | "class" => "Classification",
        "returnnumber" => "ReturnNumber",
        "numberofreturns" => "NumberOfReturns",
        "scandirectionflag" => "ScanDirectionFlag",
        "edgeofflightline" => "EdgeOfFlightLine",
        "scananglerank" => "ScanAngleRank",
        "scanchannel" => "ScanChannel",
        "userdata" => "UserData",
        "pointsourceid" => "PointSourceId",
        "gpstime" => "GpsTime",
        "infrared" | "nir" => "Infrared",
        "alpha" | "a" => "Alpha",
        "nx" | "normalx" => "NormalX",
        "ny" | "normaly" => "NormalY",
        "nz" | "normalz" => "NormalZ",
        "curvature" => "Curvature",
        "ring" => "Ring",
        _ => name,
    };
    known.into()
}

/// Values that a field may have for each of them to become one of its own. Descriptors have more.
pub(super) const MAX_COUNT: usize = 16;

/// Names of the columns that a field of so many values is read as: none for padding, which `_` stands for, and for fields
/// of too many.
pub(crate) fn numbered(name: &str, count: usize) -> Vec<String> {
    match count {
        _ if name == "_" => Vec::new(),
        1 => vec![name.to_owned()],
        2..=MAX_COUNT => (0..count).map(|index| format!("{name}_{index}")).collect(),
        _ => Vec::new(),
    }
}
