//! Well-known text of coordinate systems, versions 1 and 2, as far as names, codes and units need it.
//!
//! The text is a tree: a keyword with values in brackets, some of which are keywords with values again.

use super::definition::{Crs, CrsDefinition, GeoKeys, Unit};

/// Largest depth of brackets; deeper text is not parsed.
const MAX_DEPTH: usize = 32;
/// Largest length of parsed text, in bytes.
const MAX_LEN: usize = 1 << 20;

impl Crs {
    /// The system of x and y alone, without what it states of heights. A definition of which the heights cannot be
    /// taken away is dropped.
    #[must_use]
    pub fn horizontal(self) -> Self {
        let geotiff = self.geotiff.map(GeoKeys::without_heights);
        let Some(wkt) = self.wkt else { return Self { vertical_unit: None, geotiff, ..self } };
        match horizontal(&wkt) {
            Some(part) if part == wkt => Self { vertical_unit: None, wkt: Some(wkt), geotiff, ..self },
            Some(part) => {
                let keys = || geotiff.as_ref().and_then(|keys| keys.read().crs.epsg);
                let Self { name, epsg, .. } = Self::from_wkt(part);
                let epsg = epsg.or_else(keys);
                Self { name, epsg, wkt: Some(part.to_owned()), unit: self.unit, vertical_unit: None, geotiff }
            }
            None => Self { unit: self.unit, geotiff, ..Self::default() },
        }
    }

    /// Parses well-known text of version 1 or 2. Text that cannot be parsed is kept in `wkt`.
    pub fn from_wkt(text: &str) -> Self {
        CrsDefinition::from_wkt(text).crs
    }
}

impl CrsDefinition {
    /// Parses well-known text of version 1 or 2.
    pub fn from_wkt(text: &str) -> Self {
        read(text)
    }
}

/// Keywords of vertical systems; ESRI's is `VERTCS`.
const VERTICAL: &[&str] = &["VERT_CS", "VERTCS", "VERTCRS", "VERTICALCRS"];
/// Keywords of systems that join a horizontal and a vertical one.
const COMPOUND: &[&str] = &["COMPD_CS", "COMPOUNDCRS"];
/// Keywords around a system that do not belong to its description.
const AROUND: &[&str] = &["BOUNDCRS", "SOURCECRS", "COORDINATEOPERATION"];

/// A keyword with its values.
struct Node<'a> {
    keyword: String,
    /// The text from the keyword on; once the node is complete, to its last bracket.
    text: &'a str,
    values: Vec<Value<'a>>,
}

enum Value<'a> {
    /// Quoted text, or a bare word such as a number.
    Text(&'a str),
    Node(Node<'a>),
}

impl Node<'_> {
    fn is(&self, keywords: &[&str]) -> bool {
        keywords.contains(&self.keyword.as_str())
    }

    fn children(&self) -> impl Iterator<Item = &Self> {
        self.values.iter().filter_map(|value| match value {
            Value::Node(node) => Some(node),
            Value::Text(_) => None,
        })
    }

    fn child(&self, keywords: &[&str]) -> Option<&Self> {
        self.children().find(|child| child.is(keywords))
    }

    fn text(&self, index: usize) -> Option<&str> {
        match self.values.get(index)? {
            Value::Text(text) => Some(text),
            Value::Node(_) => None,
        }
    }

    fn name(&self) -> Option<String> {
        let name: String = self.text(0)?.chars().filter(|c| !c.is_control()).take(200).collect();
        let name = name.trim();
        (!name.is_empty() && !name.eq_ignore_ascii_case("unnamed")).then(|| name.to_owned())
    }

    fn epsg(&self) -> Option<u32> {
        let authority = self.children().filter(|child| child.is(&["AUTHORITY", "ID"]));
        let mut epsg = authority.filter(|child| child.text(0).is_some_and(|name| name.eq_ignore_ascii_case("EPSG")));
        epsg.next()?.text(1)?.trim().parse().ok()
    }

    /// The unit stated by a system or an axis.
    fn unit(&self) -> Option<Unit> {
        let unit = self.child(&["UNIT", "LENGTHUNIT", "ANGLEUNIT"])?;
        let factor: f64 = unit.text(1)?.trim().parse().ok()?;
        let degree = std::f64::consts::PI / 180.0;
        if (factor / degree - 1.0).abs() < 1e-6 { Some(Unit::Degree) } else { Unit::of_metres(factor) }
    }

    /// Whether the third axis of a system is that of heights.
    fn has_heights(&self) -> bool {
        self.children().filter(|child| child.is(&["AXIS"])).count() > 2
    }

    /// The unit of axis `index`: its own, or that of the system.
    fn axis_unit(&self, index: usize) -> Option<Unit> {
        let own = self.children().filter(|child| child.is(&["AXIS"])).nth(index).and_then(Node::unit);
        own.or_else(|| self.unit())
    }
}

/// Parses a definition; `text` is kept even if it cannot be parsed.
fn read(text: &str) -> CrsDefinition {
    let text = text.trim_end_matches('\0').trim();
    let mut found =
        CrsDefinition { crs: Crs { wkt: Some(text.to_owned()), ..Crs::default() }, ..CrsDefinition::default() };
    if text.is_empty() {
        found.crs.wkt = None;
    } else if text.len() <= MAX_LEN
        && let Some((root, rest)) = parse(text)
    {
        system(&root, &mut found);
        // ESRI writes a vertical system behind the horizontal one.
        if let Some((vertical, _)) = parse(rest).filter(|(node, _)| node.is(VERTICAL)) {
            system(&vertical, &mut found);
        }
    }
    let CrsDefinition { crs, geocentric, heights } = &mut found;
    *heights = if *geocentric { crs.unit } else { crs.vertical_unit };
    if crs.vertical_unit == crs.unit {
        crs.vertical_unit = None;
    }
    found
}

/// Stores name, code and units of a system. Parts of a compound system add only what is still unknown.
fn system(node: &Node<'_>, found: &mut CrsDefinition) {
    let crs = &mut found.crs;
    if node.is(AROUND) {
        node.children().take(1).for_each(|child| system(child, found));
        return;
    }
    let vertical = node.is(VERTICAL);
    if !vertical {
        crs.name = crs.name.take().or_else(|| node.name());
        crs.epsg = crs.epsg.or_else(|| node.epsg());
    }
    if vertical {
        crs.vertical_unit = node.axis_unit(0);
    } else if node.is(COMPOUND) {
        node.children().for_each(|child| system(child, found));
    } else if node.is(&["GEOCCS"]) || is_cartesian_3d(node) {
        found.geocentric = true;
        crs.unit = node.axis_unit(0);
    } else if !node.is(&["AUTHORITY", "ID"]) && crs.unit.is_none() {
        crs.unit = node.axis_unit(0);
        // The third axis of a three-dimensional system.
        if node.has_heights() {
            crs.vertical_unit = node.axis_unit(2).filter(|unit| *unit != Unit::Degree);
        }
    }
}

/// The part of the text that describes x and y; `None` if no part does so without heights.
fn horizontal(text: &str) -> Option<&str> {
    let (mut node, _) = parse(text)?;
    while node.is(AROUND) || node.is(COMPOUND) {
        let children = node.values.into_iter().filter_map(|value| match value {
            Value::Node(child) => Some(child),
            Value::Text(_) => None,
        });
        node = children.into_iter().find(|child| !child.is(VERTICAL))?;
    }
    (!node.has_heights()).then_some(node.text)
}

/// Whether a geodetic system of version 2 is geocentric.
fn is_cartesian_3d(node: &Node<'_>) -> bool {
    let geodetic = node.is(&["GEODCRS", "GEODETICCRS", "GEOGCRS"]);
    let cartesian = |cs: &Node<'_>| cs.text(0).is_some_and(|kind| kind.trim().eq_ignore_ascii_case("cartesian"));
    geodetic && node.child(&["CS"]).is_some_and(cartesian)
}

/// The tree at the start of the text, and the text after it. Brackets missing at the end are added.
fn parse(text: &str) -> Option<(Node<'_>, &str)> {
    let mut open: Vec<Node<'_>> = Vec::new();
    let mut rest = text;
    loop {
        rest = rest.trim_start_matches(|c: char| c.is_whitespace() || c == ',');
        let Some(first) = rest.chars().next() else { break };
        if first == '"' {
            let end = rest[1..].find('"').map_or(rest.len(), |end| end + 1);
            open.last_mut()?.values.push(Value::Text(&rest[1..end]));
            rest = rest.get(end + 1..).unwrap_or_default();
        } else if first == ']' || first == ')' {
            rest = &rest[1..];
            let mut done = open.pop()?;
            done.text = &done.text[..done.text.len() - rest.len()];
            match open.last_mut() {
                Some(parent) => parent.values.push(Value::Node(done)),
                None => return Some((done, rest)),
            }
        } else {
            let end = rest.find(['[', '(', ']', ')', ',', '"']).unwrap_or(rest.len());
            let word = rest[..end].trim();
            if rest[end..].starts_with(['[', '(']) {
                if word.is_empty() || open.len() == MAX_DEPTH {
                    return None;
                }
                open.push(Node { keyword: word.to_ascii_uppercase(), text: rest, values: Vec::new() });
                rest = &rest[end + 1..];
            } else {
                open.last_mut()?.values.push(Value::Text(word));
                rest = &rest[end..];
            }
        }
    }
    while open.len() > 1 {
        let done = open.pop()?;
        open.last_mut()?.values.push(Value::Node(done));
    }
    open.pop().map(|root| (root, ""))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FEET: &str = r#"PROJCS["NAD83 / Oregon",GEOGCS["NAD83",DATUM["d",SPHEROID["s",6378137,298.25]],
        PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["x"],UNIT["foot",0.3048,AUTHORITY["EPSG",
        "9002"]],AUTHORITY["EPSG","2994"]]"#;

    #[test]
    fn names_codes_and_units() {
        let facts = |text: &str| {
            let Crs { name, epsg, unit, vertical_unit, .. } = Crs::from_wkt(text);
            (name, epsg, unit, vertical_unit)
        };
        let name = |name: &str| Some(name.to_owned());
        assert_eq!(facts(FEET), (name("NAD83 / Oregon"), Some(2994), Some(Unit::Foot), None), "projected, version 1");
        let compound = format!(
            r#"COMPD_CS["both",{FEET},VERT_CS["NAVD88",VERT_DATUM["v",2005],UNIT["US survey foot",0.3048006096012192]]]"#
        );
        let expected = (name("both"), Some(2994), Some(Unit::Foot), Some(Unit::UsSurveyFoot));
        assert_eq!(facts(&compound), expected, "compound: the feet are told apart");
        let second = r#"COMPOUNDCRS["c",PROJCRS["p",BASEGEOGCRS["b",DATUM["d",ELLIPSOID["e",6378137,298.2,
            LENGTHUNIT["metre",1]]]],CONVERSION["u",METHOD["m"]],CS[Cartesian,2],AXIS["E",east,LENGTHUNIT["metre",1]],
            AXIS["N",north,LENGTHUNIT["metre",1]],ID["EPSG",32632]],VERTCRS["v",VDATUM["w"],CS[vertical,1],
            AXIS["H",up,LENGTHUNIT["metre",1]]],ID["EPSG",9999]]"#;
        assert_eq!(facts(second), (name("c"), Some(9999), Some(Unit::Metre), None), "version 2, compound");
        let degrees = r#"GEOGCS("WGS 84",DATUM("WGS_1984"),UNIT("degree",0.0174532925199433),AUTHORITY("EPSG",4326))"#;
        assert_eq!(facts(degrees), (name("WGS 84"), Some(4326), Some(Unit::Degree), None), "other brackets");
        let three = r#"GEOGCRS["WGS 84 3D",CS[ellipsoidal,3],AXIS["lat",north,ANGLEUNIT["degree",0.0174532925199433]],
            AXIS["lon",east,ANGLEUNIT["degree",0.0174532925199433]],AXIS["h",up,LENGTHUNIT["metre",1]],ID["EPSG",4979]]"#;
        assert_eq!(facts(three), (name("WGS 84 3D"), Some(4979), Some(Unit::Degree), Some(Unit::Metre)), "three axes");
        let bound = format!("BOUNDCRS[SOURCECRS[{FEET}],TARGETCRS[{degrees}]]");
        assert_eq!(facts(&bound), facts(FEET), "bound to another");
    }

    #[test]
    fn heights_can_be_taken_away() {
        let heights = r#"VERT_CS["NAVD88 (ftUS)",VERT_DATUM["v",2005],UNIT["US survey foot",0.3048006096012192]]"#;
        let plane = r#"PROJCS["plane",GEOGCS["g"],UNIT["metre",1],AUTHORITY["EPSG","26917"]]"#;
        let both = format!(r#" COMPD_CS["both", {plane}, {heights}, AUTHORITY["EPSG","9999"]]"#);
        let esri = format!("{plane},{}", heights.replace("VERT_CS", "VERTCS"));
        let bound = format!("BOUNDCRS[SOURCECRS[{both}],TARGETCRS[{plane}]]");
        for text in [&both, &esri, &bound] {
            let crs = Crs::from_wkt(text);
            assert_eq!((crs.unit, crs.vertical_unit), (Some(Unit::Metre), Some(Unit::UsSurveyFoot)), "{text}");
            let flat = crs.horizontal();
            assert_eq!((flat.wkt.as_deref(), flat.epsg), (Some(plane), Some(26917)), "{text}");
            assert_eq!((flat.name.as_deref(), flat.vertical_unit), (Some("plane"), None), "{text}");
            assert_eq!(flat.clone().horizontal(), flat, "{text}: once");
        }
        let three = r#"GEOGCRS["3D",CS[ellipsoidal,3],AXIS["lat",north],AXIS["lon",east],
            AXIS["h",up,LENGTHUNIT["foot",0.3048]],ANGLEUNIT["degree",0.0174532925199433],ID["EPSG",4979]]"#;
        let flat = Crs::from_wkt(three).horizontal();
        assert_eq!(flat, Crs { unit: Some(Unit::Degree), ..Crs::default() }, "three axes are one system");
    }

    #[test]
    fn geocentric_systems() {
        assert!(read(r#"GEOCCS["unnamed",UNIT["metre",1]]"#).geocentric, "version 1");
        let second = r#"GEODCRS["WGS 84",CS[Cartesian,3],AXIS["X",geocentricX],LENGTHUNIT["metre",1]]"#;
        assert!(read(second).geocentric, "version 2");
        assert!(!read(FEET).geocentric, "projected");
    }

    #[test]
    fn text_of_any_kind_is_survived() {
        let deep = "A[".repeat(100_000);
        for text in ["", "\0\0", "no brackets", "[", "]", "A[", "A[\"", "A[\"b\"", "PROJCS[]", "é[é]", &deep] {
            let crs = Crs::from_wkt(text);
            assert_eq!((crs.epsg, crs.unit), (None, None), "{:?} says nothing", text.get(..20));
        }
        for end in 0..FEET.len() {
            Crs::from_wkt(&FEET[..end]);
        }
        let long = "A[".to_owned() + &"1,".repeat(400_000) + "]";
        assert_eq!(Crs::from_wkt(&long).unit, None, "many values");
    }
}
