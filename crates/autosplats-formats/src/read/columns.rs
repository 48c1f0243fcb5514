//! Names of columns: coordinates, colours and attributes as files name them, and names that the caller gives.

use autosplats_cloud::{Error, excerpt};

use super::{Attribute, Job};

/// Largest number of values of a point; a header with more is broken.
pub const MAX_COLUMNS: usize = 1024;

/// The names that the caller gives to the columns; `None` for a column to leave out.
pub(super) fn given(job: &Job<'_>) -> Result<Option<Vec<Option<String>>>, Error> {
    let Some(names) = &job.options.columns else { return Ok(None) };
    if names.len() > MAX_COLUMNS {
        return Err(job.unsupported(format!("--columns names {} columns; at most {MAX_COLUMNS}", names.len())));
    }
    for axis in ["x", "y", "z"] {
        let count = names.iter().filter(|name| name.eq_ignore_ascii_case(axis)).count();
        if count != 1 {
            let names = excerpt(names.join(" ").as_bytes());
            let what = format!("--columns {names}: {axis} is named {count} times; name each of x, y and z once");
            return Err(job.unsupported(what));
        }
    }
    let name = |name: &String| (name != "-" && name != "_").then(|| name.clone());
    Ok(Some(names.iter().map(name).collect()))
}

/// Largest number of columns that a note lists.
const MAX_NOTED_COLUMNS: usize = 24;

/// Note that tells which names the columns got.
pub(super) fn taken_for(names: &[Option<String>]) -> String {
    let shown = names.iter().map(|name| name.as_deref().map_or("-".into(), |name| excerpt(name.as_bytes())));
    let more = if names.len() > MAX_NOTED_COLUMNS {
        format!(" and {} more", names.len() - MAX_NOTED_COLUMNS)
    } else {
        String::new()
    };
    format!(
        "columns taken for {}{more}; --columns overrides",
        shown.take(MAX_NOTED_COLUMNS).collect::<Vec<_>>().join(" ")
    )
}

/// Names of x, y and z, the likeliest first.
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

/// A name for comparison: lower case, letters and digits only.
pub(super) fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// Indices of x, y and z among the names, if all are there.
pub(super) fn find_axes(names: &[String]) -> Option<[usize; 3]> {
    let plain: Vec<String> = names.iter().map(|name| plain(name)).collect();
    let find = |axis: &[&str]| axis.iter().find_map(|name| plain.iter().position(|found| found == name));
    Some([find(AXES[0])?, find(AXES[1])?, find(AXES[2])?])
}

/// Whether a name is one of longitude.
pub(super) fn is_longitude(name: &str) -> bool {
    ["longitude", "lon", "long", "lng"].contains(&&*plain(name))
}

/// Suffix of a name that comes again though it has a meaning, as `x`.
pub(super) const AGAIN: &str = "_2";

/// Attributes whose names differ: a suffix is added to each that comes again, as to the fields of a cloud.
pub(super) fn unrepeated(attributes: impl Iterator<Item = Attribute>) -> Vec<Attribute> {
    let mut all: Vec<Attribute> = Vec::new();
    for mut attribute in attributes.take(MAX_COLUMNS) {
        while all.iter().any(|other| other.name.eq_ignore_ascii_case(&attribute.name)) {
            attribute.name.push_str(AGAIN);
        }
        all.push(attribute);
    }
    all
}

/// Names of the three channels of a colour. If a file has several colours, the first in this list is taken.
const COLORS: [[&str; 3]; 5] = [
    ["red", "green", "blue"],
    ["diffusered", "diffusegreen", "diffuseblue"],
    ["r", "g", "b"],
    ["colorred", "colorgreen", "colorblue"],
    ["rf", "gf", "bf"],
];

/// Indices of red, green and blue among the names, if all are there.
pub(super) fn find_color(names: &[String]) -> Option<[usize; 3]> {
    let plain: Vec<String> = names.iter().map(|name| plain(name)).collect();
    let find = |name: &str| plain.iter().position(|found| found == name);
    COLORS.iter().find_map(|[red, green, blue]| Some([find(red)?, find(green)?, find(blue)?]))
}

/// PDAL's name of a field, if the field is known to PDAL; otherwise `name`.
pub(super) fn field_name(name: &str) -> String {
    let plain = plain(name);
    // CloudCompare prefixes the fields of a PLY with `scalar`.
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

/// Largest number of values per point for which each becomes a field of its own. Descriptors have more.
pub(super) const MAX_COUNT: usize = 16;

/// Names of a field's columns, one per value. Padding (`_`) and fields of more than 16 values get none.
pub fn numbered(name: &str, count: usize) -> Vec<String> {
    match count {
        _ if name == "_" => Vec::new(),
        1 => vec![name.to_owned()],
        2..=MAX_COUNT => (0..count).map(|index| format!("{name}_{index}")).collect(),
        _ => Vec::new(),
    }
}
