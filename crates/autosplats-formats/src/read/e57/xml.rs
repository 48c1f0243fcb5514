//! The XML section: scans, their poses and the elements of their points.

use autosplats_cloud::{Crs, Error, Unit, excerpt, guard, printable, shown_number};
use glam::{DMat4, DQuat, DVec3};
use roxmltree::{Document, Node, ParsingOptions};

use super::super::Job;
use super::{
    element::{Element, Stored},
    pages::Pages,
    repair::repaired,
};

/// Longest tag, in bytes: the parser compares all attributes of a tag with one another.
const MAX_TAG: usize = 1 << 13;

/// Longest name of a coordinate system, in characters.
const MAX_NAME: usize = 200;

/// Largest difference of the length of a pose's quaternion from 1; the digits of `f32` lose far less.
const MAX_LENGTH_ERROR: f64 = 1e-3;

/// Most namespace declarations. More are an attack: the parser keeps nested ones at every level.
const MAX_NAMESPACES: usize = 1 << 10;

/// Contents of the XML section.
pub(super) struct Root {
    pub(super) writer: Option<String>,
    pub(super) guid: Option<String>,
    /// Seconds of GPS time.
    pub(super) created: Option<f64>,
    pub(super) crs: Crs,
    pub(super) scans: Vec<ScanHeader>,
    /// Scans that cannot be described, and why.
    pub(super) faults: Vec<(String, String)>,
    /// Names of the images.
    pub(super) images: Vec<String>,
    pub(super) notes: Vec<String>,
}

impl Root {
    /// Whether this project wrote the file.
    pub(super) fn is_ours(&self) -> bool {
        self.writer.as_ref().is_some_and(|writer| writer.starts_with("autosplats "))
    }
}

/// One scan, an entry of `data3D`.
pub(super) struct ScanHeader {
    /// Number in the file, counted from 1.
    number: usize,
    pub(super) name: Option<String>,
    pub(super) description: Option<String>,
    /// Vendor, model and serial number.
    pub(super) sensor: Option<String>,
    /// Start of the time stamps, in seconds of GPS time.
    pub(super) start: Option<f64>,
    pub(super) pose: Option<DMat4>,
    /// What is wrong with the pose.
    pub(super) pose_note: Option<String>,
    /// Physical address of the points.
    pub(super) offset: u64,
    pub(super) points: u64,
    pub(super) elements: Vec<Element>,
    /// Bounds in the scanner's frame.
    pub(super) bounds: Option<[DVec3; 2]>,
    pub(super) max_range: Option<f64>,
    /// Least and greatest row, and least and greatest column.
    pub(super) indices: Option<[[i64; 2]; 2]>,
    /// Least and greatest value of red, green and blue.
    pub(super) color_limits: [Option<[f64; 2]>; 3],
}

impl ScanHeader {
    /// Index of the standard's element of that name.
    pub(super) fn element(&self, name: &str) -> Option<usize> {
        self.elements.iter().position(|element| element.is(name))
    }

    pub(super) fn elements<const LEN: usize>(&self, names: [&str; LEN]) -> Option<[usize; LEN]> {
        let found = names.map(|name| self.element(name));
        found.iter().all(Option::is_some).then(|| found.map(Option::unwrap_or_default))
    }

    /// The scan's number and name, for a message.
    pub(super) fn shown(&self) -> String {
        shown(self.number, self.name.as_deref())
    }
}

fn shown(number: usize, name: Option<&str>) -> String {
    match name {
        Some(name) => format!("scan {number} '{}'", excerpt(name.as_bytes())),
        None => format!("scan {number}"),
    }
}

impl Root {
    pub(super) fn parse(job: &Job<'_>, xml: &[u8]) -> Result<Self, Error> {
        let mut notes = Vec::new();
        let text = String::from_utf8_lossy(xml);
        if text.contains('\u{fffd}') {
            notes.push("the XML section is not UTF-8 in places; names may have lost letters".into());
        }
        let text = text.trim_end_matches('\0');
        let fail = |what: String| job.malformed("XML section", what);
        check(text).map_err(fail)?;
        guard(|| {
            let fault = match Document::parse_with_options(text, options(text)) {
                Ok(document) => return Self::of(&document, notes),
                Err(error) => printable(&error.to_string().chars().take(MAX_NAME).collect::<String>()),
            };
            let repaired = repaired(text);
            let document = Document::parse_with_options(&repaired, options(&repaired))
                .map_err(|_| format!("{fault}; copy the file again"))?;
            notes.push(format!("the XML section is not well formed ({fault}); what is clear of it is read"));
            Self::of(&document, notes)
        })
        .map_err(fail)
    }

    fn of(document: &Document<'_>, mut notes: Vec<String>) -> Result<Self, String> {
        let root = document.root_element();
        if root.tag_name().name() != "e57Root" {
            return Err(format!("it begins with '{}', not with e57Root", excerpt(root.tag_name().name().as_bytes())));
        }
        let mut scans = Vec::new();
        let (mut empty, mut faults) = (Vec::new(), Vec::new());
        for (index, node) in children(root, "data3D").enumerate() {
            if child(node, "points").is_none() {
                empty.push(index + 1);
                continue;
            }
            match scan(node, index) {
                Ok(scan) => scans.push(scan),
                Err(what) => faults.push((shown(index + 1, text(node, "name").as_deref()), what)),
            }
        }
        if let (true, Some((scan, what))) = (scans.is_empty(), faults.first()) {
            return Err(format!("{scan}: {what}"));
        }
        match empty[..] {
            [] => {}
            [index] => notes.push(format!("scan {index} has no points")),
            [first, ..] => notes.push(format!("{} scans have no points, the first is scan {first}", empty.len())),
        }
        Ok(Self {
            writer: text(root, "e57LibraryVersion"),
            guid: text(root, "guid"),
            created: time(root, "creationDateTime"),
            crs: crs(text(root, "coordinateMetadata").as_deref()),
            scans,
            faults,
            images: children(root, "images2D").map(|node| text(node, "name").unwrap_or_default()).collect(),
            notes,
        })
    }
}

/// Limits of the parser: a node takes far more memory than its text.
fn options(text: &str) -> ParsingOptions<'_> {
    ParsingOptions {
        nodes_limit: u32::try_from(text.len() / 8 + 1000).unwrap_or(u32::MAX),
        ..ParsingOptions::default()
    }
}

/// Rejects text that would take the parser long; see [`MAX_TAG`] and [`MAX_NAMESPACES`].
fn check(text: &str) -> Result<(), String> {
    let bytes = text.as_bytes();
    let mut at = 0;
    let mut namespaces = 0;
    let find = |from: usize, what: &str| text.get(from..).and_then(|rest| rest.find(what)).map(|len| from + len);
    while let Some(start) = find(at, "<") {
        let rest = &bytes[start..];
        let closing = if rest.starts_with(b"<![CDATA[") {
            "]]>"
        } else if rest.starts_with(b"<!--") {
            "-->"
        } else {
            ">"
        };
        let Some(end) = find(start, closing) else { break };
        if closing == ">" {
            if end - start > MAX_TAG {
                return Err(format!("a tag of {} bytes", end - start));
            }
            namespaces += text[start..end].matches("xmlns").count();
            if namespaces > MAX_NAMESPACES {
                return Err(format!("more than {MAX_NAMESPACES} namespaces"));
            }
        }
        at = end + closing.len();
    }
    Ok(())
}

fn scan(node: Node<'_, '_>, place: usize) -> Result<ScanHeader, String> {
    let points = child(node, "points").ok_or("no points")?;
    let attribute = |name: &str| {
        let value = points.attribute(name).ok_or_else(|| format!("its points have no {name}"))?;
        value.trim().parse::<u64>().map_err(|_| format!("'{}' is not a valid {name}", excerpt(value.as_bytes())))
    };
    let prototype = child(points, "prototype").ok_or("its points have no prototype")?;
    let mut elements = Vec::new();
    for node in prototype.descendants().skip(1).filter(Node::is_element) {
        // Structures and vectors are skipped; their members are among the descendants.
        if !matches!(node.attribute("type"), Some("Structure" | "Vector")) {
            elements.push(element(node)?);
        }
    }
    let sensor = ["sensorVendor", "sensorModel", "sensorSerialNumber"].map(|name| text(node, name));
    let sensor = sensor.into_iter().flatten().collect::<Vec<_>>().join(" ");
    let axes = ["x", "y", "z"];
    let limits = |parent: &str, name: &str| {
        let parent = child(node, parent)?;
        Some([number(child(parent, &format!("{name}Minimum"))?)?, number(child(parent, &format!("{name}Maximum"))?)?])
    };
    let cartesian = axes.map(|axis| limits("cartesianBounds", axis).filter(|[low, high]| low <= high));
    let bounds = match cartesian {
        // Writers without bounds write the greatest number there is.
        [Some(x), Some(y), Some(z)] if [x, y, z].iter().flatten().all(|value| value.abs() < 1e30) => {
            Some([DVec3::new(x[0], y[0], z[0]), DVec3::new(x[1], y[1], z[1])])
        }
        _ => None,
    };
    let index = |name| limits("indexBounds", name).map(|limits| limits.map(|value| value as i64));
    let range = child(node, "sphericalBounds").and_then(|bounds| number(child(bounds, "rangeMaximum")?));
    let (pose, pose_note) = match pose(node) {
        Ok((pose, note)) => (pose, note),
        Err(what) => (None, Some(format!("its pose cannot be read ({what}); its points stay in the scanner's frame"))),
    };
    Ok(ScanHeader {
        number: place + 1,
        name: text(node, "name"),
        description: text(node, "description"),
        sensor: (!sensor.is_empty()).then_some(sensor),
        start: time(node, "acquisitionStart"),
        pose,
        pose_note,
        offset: attribute("fileOffset")?,
        points: attribute("recordCount")?,
        elements,
        bounds,
        max_range: range.filter(|range| (0.0..1e30).contains(range)),
        indices: index("row").zip(index("column")).map(|(row, column)| [row, column]),
        color_limits: ["colorRed", "colorGreen", "colorBlue"].map(|name| limits("colorLimits", name)),
    })
}

fn element(node: Node<'_, '_>) -> Result<Element, String> {
    let name = node.tag_name().name();
    let integer = |attribute: &str, default: i64| match node.attribute(attribute) {
        None => Ok(default),
        Some(text) => text
            .trim()
            .parse()
            .map_err(|_| format!("{attribute} of {name}: '{}' is not an integer", excerpt(text.as_bytes()))),
    };
    let float = |attribute: &str, default: f64| match node.attribute(attribute) {
        None => Ok(default),
        Some(text) => match text.trim().parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(format!("{attribute} of {name}: '{}' is not a number", excerpt(text.as_bytes()))),
        },
    };
    let bounds = || {
        let (min, max) = (integer("minimum", i64::MIN)?, integer("maximum", i64::MAX)?);
        if min > max { Err(format!("{name}: minimum {min} is above maximum {max}")) } else { Ok((min, max)) }
    };
    let stored = match node.attribute("type") {
        Some("Float") if node.attribute("precision") == Some("single") => Stored::Single,
        Some("Float") => Stored::Double,
        Some("Integer") => bounds().map(|(min, max)| Stored::Integer { min, max })?,
        Some("ScaledInteger") => {
            let (min, max) = bounds()?;
            Stored::Scaled { min, max, scale: float("scale", 1.0)?, offset: float("offset", 0.0)? }
        }
        Some("String") => Stored::Text,
        other => {
            let other = excerpt(other.unwrap_or_default().as_bytes());
            return Err(format!("{name} is of unknown type '{other}'"));
        }
    };
    // The standard's own elements are in the root's namespace, which has no prefix.
    let own = node.tag_name().namespace() == node.document().root_element().tag_name().namespace();
    let prefix = node.tag_name().namespace().and_then(|uri| node.lookup_prefix(uri)).map(String::from);
    Ok(Element { name: name.into(), prefix: prefix.filter(|prefix| !own && !prefix.is_empty()), stored })
}

/// The pose of a scan, and what is odd about the pose.
fn pose(node: Node<'_, '_>) -> Result<(Option<DMat4>, Option<String>), String> {
    let Some(pose) = child(node, "pose") else { return Ok((None, None)) };
    let rotation = components(pose, "rotation", ["x", "y", "z", "w"])?;
    let translation = components(pose, "translation", ["x", "y", "z"])?;
    let length = rotation.map(|rotation| DQuat::from_array(rotation).length());
    let mut odd = Vec::new();
    match length {
        None => odd.push("it has no rotation".to_owned()),
        Some(length) if length < 1e-9 => odd.push("its rotation is zero".to_owned()),
        Some(length) if (length - 1.0).abs() > MAX_LENGTH_ERROR => {
            odd.push(format!("its quaternion has length {}, not 1", shown_number(length)));
        }
        Some(_) => {}
    }
    if translation.is_none() {
        odd.push("it has no translation".to_owned());
    }
    let rotation = rotation.map_or(DQuat::IDENTITY, DQuat::from_array);
    let rotation = if rotation.length() < 1e-9 { DQuat::IDENTITY } else { rotation.normalize() };
    let matrix = DMat4::from_rotation_translation(rotation, translation.map_or(DVec3::ZERO, DVec3::from_array));
    let note = (!odd.is_empty()).then(|| format!("its pose is incomplete: {}", odd.join(", ")));
    if matrix.is_finite() { Ok((Some(matrix), note)) } else { Err("its quaternion is too long".into()) }
}

/// The numbers of a part of a pose; `None` if the pose has no such part.
fn components<const LEN: usize>(
    pose: Node<'_, '_>,
    part: &str,
    names: [&str; LEN],
) -> Result<Option<[f64; LEN]>, String> {
    let Some(part_node) = child(pose, part) else { return Ok(None) };
    let mut values = [0.0; LEN];
    for (value, name) in values.iter_mut().zip(names) {
        let node = child(part_node, name).ok_or_else(|| format!("its {part} has no {name}"))?;
        *value = number(node).filter(|value| value.is_finite()).ok_or_else(|| {
            let text = excerpt(node.text().unwrap_or_default().trim().as_bytes());
            format!("'{text}' is no number, {name} of its {part}")
        })?;
    }
    Ok(Some(values))
}

fn crs(metadata: Option<&str>) -> Crs {
    let mut crs = Crs { unit: Some(Unit::Metre), ..Crs::default() };
    let Some(metadata) = metadata else { return crs };
    let keyword = metadata.split(['[', '(']).next().unwrap_or_default().trim();
    let wkt =
        metadata.contains('[') && keyword.len() > 4 && keyword.bytes().all(|b| b.is_ascii_uppercase() || b == b'_');
    let name = if wkt {
        crs.wkt = Some(metadata.into());
        metadata.split('"').nth(1)
    } else {
        crs.epsg = metadata.strip_prefix("EPSG:").and_then(|code| code.trim().parse().ok());
        Some(metadata)
    };
    crs.name = name.map(|name| name.chars().map(|c| if c.is_control() { ' ' } else { c }).take(MAX_NAME).collect());
    crs
}

fn child<'a, 'input>(node: Node<'a, 'input>, name: &str) -> Option<Node<'a, 'input>> {
    node.children().find(|child| child.is_element() && child.tag_name().name() == name)
}

/// The elements of a list.
fn children<'a, 'input>(node: Node<'a, 'input>, name: &str) -> impl Iterator<Item = Node<'a, 'input>> {
    child(node, name).into_iter().flat_map(|list| list.children().filter(Node::is_element))
}

/// The text of a child, unless it is empty.
fn text(node: Node<'_, '_>, name: &str) -> Option<String> {
    let text = child(node, name)?.children().filter_map(|piece| piece.text()).collect::<String>();
    let text = text.trim();
    (!text.is_empty()).then(|| text.into())
}

/// The value of a node of any number type; zero if the node has no text.
fn number(node: Node<'_, '_>) -> Option<f64> {
    let value = match node.text().map(str::trim) {
        None | Some("") => 0.0,
        Some(text) => text.parse().ok()?,
    };
    let attribute = |name: &str, default: f64| node.attribute(name).map_or(Some(default), |text| text.parse().ok());
    let scaled = node.attribute("type") == Some("ScaledInteger");
    if scaled { Some(value * attribute("scale", 1.0)? + attribute("offset", 0.0)?) } else { Some(value) }
}

/// A date in seconds of GPS time. Writers that do not know the date write zero.
fn time(node: Node<'_, '_>, name: &str) -> Option<f64> {
    number(child(child(node, name)?, "dateTimeValue")?).filter(|&value| value != 0.0 && value.is_finite())
}

/// Reads the header and the XML section.
pub(super) fn open<'a>(job: &Job<'a>) -> Result<(Pages<'a>, Root), Error> {
    let pages = Pages::new(job)?;
    let (xml, cut) = pages.xml(job)?;
    match (Root::parse(job, &xml), cut) {
        (Ok(root), None) => Ok((pages, root)),
        (Ok(root), Some(_)) if !root.scans.is_empty() => Ok((pages, root)),
        (_, Some(cut)) => Err(cut),
        (Err(error), None) => Err(error),
    }
}
