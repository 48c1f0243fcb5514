//! The XML section.

use std::fmt::Write as _;

use glam::{DMat4, DQuat, DVec3};

use autosplats_cloud::{Crs, Random};

/// Namespace of the extension for surface normals, which other programs know.
const NORMALS: &str = "http://www.libe57.org/E57_NOR_surface_normals.txt";

/// Namespace of fields without a name in E57.
const FIELDS: &str = "urn:autosplats:fields";

/// Description of a scan.
pub(super) struct ScanEntry {
    pub(super) name: Option<String>,
    /// Pose of the sensor; `None` for points of no sensor.
    pub(super) pose: Option<DMat4>,
    pub(super) bounds: Option<[DVec3; 2]>,
    pub(super) max_color: Option<u16>,
    /// Least and greatest intensity, and whether intensities are integers.
    pub(super) intensity: Option<([f64; 2], bool)>,
    pub(super) offset: u64,
    pub(super) points: usize,
    /// The XML elements of a point's values.
    pub(super) prototype: String,
}

/// The whole section; identifiers are derived from `hash`.
pub(super) fn xml(scans: &[ScanEntry], crs: &Crs, hash: u64) -> String {
    let mut xml = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    xml += "<e57Root type=\"Structure\" xmlns=\"http://www.astm.org/COMMIT/E57/2010-e57-v1.0\"";
    for (prefix, uri) in [("nor", NORMALS), ("autosplats", FIELDS)] {
        if scans.iter().any(|scan| scan.prototype.contains(&format!("<{prefix}:"))) {
            xml += &format!(" xmlns:{prefix}=\"{uri}\"");
        }
    }
    xml += ">\n";
    let text = |xml: &mut String, name: &str, value: &str| {
        *xml += &format!("<{name} type=\"String\">{}</{name}>\n", escaped(value));
    };
    text(&mut xml, "formatName", "ASTM E57 3D Imaging Data File");
    text(&mut xml, "guid", &guid(hash, 0));
    xml += "<versionMajor type=\"Integer\">1</versionMajor>\n<versionMinor type=\"Integer\">0</versionMinor>\n";
    text(&mut xml, "e57LibraryVersion", concat!("autosplats ", env!("CARGO_PKG_VERSION")));
    let epsg = crs.epsg.map(|code| format!("EPSG:{code}"));
    text(&mut xml, "coordinateMetadata", crs.wkt.as_ref().or(epsg.as_ref()).or(crs.name.as_ref()).map_or("", |it| it));
    xml += "<data3D type=\"Vector\" allowHeterogeneousChildren=\"1\">\n";
    for (index, scan) in scans.iter().enumerate() {
        xml += "<vectorChild type=\"Structure\">\n";
        text(&mut xml, "guid", &guid(hash, index as u64 + 1));
        if let Some(name) = &scan.name {
            text(&mut xml, "name", name);
        }
        scan.write(&mut xml);
        xml += "</vectorChild>\n";
    }
    xml + "</data3D>\n<images2D type=\"Vector\" allowHeterogeneousChildren=\"1\">\n</images2D>\n</e57Root>\n"
}

impl ScanEntry {
    fn write(&self, xml: &mut String) {
        let float = |name: &str, value: f64| format!("<{name} type=\"Float\">{value:?}</{name}>");
        if let Some(pose) = self.pose {
            let rotation = DQuat::from_mat4(&pose).normalize();
            let translation = pose.w_axis;
            let rotation = [("w", rotation.w), ("x", rotation.x), ("y", rotation.y), ("z", rotation.z)];
            let translation = [("x", translation.x), ("y", translation.y), ("z", translation.z)];
            let all =
                |values: &[(&str, f64)]| values.iter().map(|(name, value)| float(name, *value)).collect::<String>();
            let _ = writeln!(
                xml,
                "<pose type=\"Structure\"><rotation type=\"Structure\">{}</rotation>\
                 <translation type=\"Structure\">{}</translation></pose>",
                all(&rotation),
                all(&translation)
            );
        }
        if let Some([low, high]) = self.bounds {
            *xml += "<cartesianBounds type=\"Structure\">";
            for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
                *xml += &float(&format!("{name}Minimum"), low[axis]);
                *xml += &float(&format!("{name}Maximum"), high[axis]);
            }
            *xml += "</cartesianBounds>\n";
        }
        let integer = |name: &str, value: i64| format!("<{name} type=\"Integer\">{value}</{name}>");
        if let Some(([low, high], integers)) = self.intensity {
            let number = |name, value: f64| if integers { integer(name, value as i64) } else { float(name, value) };
            *xml += "<intensityLimits type=\"Structure\">";
            *xml += &(number("intensityMinimum", low) + &number("intensityMaximum", high));
            *xml += "</intensityLimits>\n";
        }
        if let Some(max) = self.max_color {
            *xml += "<colorLimits type=\"Structure\">";
            for name in ["colorRed", "colorGreen", "colorBlue"] {
                *xml += &integer(&format!("{name}Minimum"), 0);
                *xml += &integer(&format!("{name}Maximum"), max.into());
            }
            *xml += "</colorLimits>\n";
        }
        let _ = writeln!(
            xml,
            "<points type=\"CompressedVector\" fileOffset=\"{}\" recordCount=\"{}\">\n\
             <prototype type=\"Structure\">\n{}</prototype>\n\
             <codecs type=\"Vector\" allowHeterogeneousChildren=\"1\"></codecs>\n</points>",
            self.offset, self.points, self.prototype
        );
    }
}

/// An identifier derived from the content, so that the same cloud gives the same file.
fn guid(hash: u64, index: u64) -> String {
    let mix = |seed: u64| Random::scrambled(hash ^ seed.wrapping_mul(Random::STEP));
    let (a, b) = (mix(2 * index + 1), mix(2 * index + 2));
    // Version 8: made in a custom way.
    format!(
        "{{{:08X}-{:04X}-8{:03X}-{:04X}-{:012X}}}",
        a >> 32,
        a >> 16 & 0xffff,
        a & 0xfff,
        b >> 48 & 0x3fff | 0x8000,
        b & 0xffff_ffff_ffff
    )
}

/// Escapes text for XML; characters that XML does not allow become blanks.
fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for c in text.chars() {
        match c {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '\n' | '\t' => escaped.push(c),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => escaped.push(' '),
            c => escaped.push(c),
        }
    }
    escaped
}
