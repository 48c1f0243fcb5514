//! `ept.json`: the root's cube, the values of a point, the coordinate system.

use std::path::Path;

use autosplats_cloud::{Axes, Crs, CrsDefinition, Error, TreeInfo, excerpt, shown_number};
use glam::DVec3;
use serde::Deserialize;

use super::MAX_LAZ_HEAD;
use crate::{
    read::{Description, table::Scalar, units},
    tree::columns::{Column, Columns},
};

/// Bytes of a LAZ file per byte of its points, at most; compression fails on random values.
const MAX_LAZ_GROWTH: u64 = 2;

/// How nodes are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Laz,
    Binary,
    Zstandard,
}

impl Encoding {
    pub(super) fn extension(self) -> &'static str {
        match self {
            Self::Laz => "laz",
            Self::Binary => "bin",
            Self::Zstandard => "zst",
        }
    }
}

/// Contents of `ept.json`, checked as far as reading needs.
#[derive(Debug)]
pub(super) struct Meta {
    pub(super) encoding: Encoding,
    pub(super) columns: Columns,
    raw: Raw,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Raw {
    bounds: [f64; 6],
    bounds_conforming: Option<[f64; 6]>,
    data_type: String,
    hierarchy_type: Option<String>,
    #[serde(default)]
    points: u64,
    schema: Vec<Dimension>,
    #[serde(alias = "ticks")]
    span: f64,
    srs: Option<Srs>,
    version: Option<String>,
}

#[derive(Debug, Deserialize)]
struct Dimension {
    name: String,
    #[serde(rename = "type")]
    kind: String,
    size: usize,
    scale: Option<f64>,
    offset: Option<f64>,
}

#[derive(Debug, Default, Deserialize)]
struct Srs {
    authority: Option<String>,
    horizontal: Option<String>,
    wkt: Option<String>,
}

impl Dimension {
    fn column(&self, at: usize) -> Result<Column, String> {
        use Scalar::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
        let scalar = match (&*self.kind, self.size) {
            ("signed", 1) => I8,
            ("signed", 2) => I16,
            ("signed", 4) => I32,
            ("signed", 8) => I64,
            ("unsigned", 1) => U8,
            ("unsigned", 2) => U16,
            ("unsigned", 4) => U32,
            ("unsigned", 8) => U64,
            ("float", 4) => F32,
            ("float", 8) => F64,
            (kind, size) => {
                let name = excerpt(self.name.as_bytes());
                return Err(format!(
                    "'{name}' is of {size} bytes, type '{}', which is not read",
                    excerpt(kind.as_bytes())
                ));
            }
        };
        Column::new(&self.name, scalar, at, [self.scale.unwrap_or(1.0), self.offset.unwrap_or(0.0)])
    }
}

impl Meta {
    /// Reads the metadata; `path` is for messages.
    pub(super) fn read(path: &Path, json: &[u8]) -> Result<Self, Error> {
        let fail = |what: String| Error::malformed(path, "metadata", what);
        let raw: Raw = serde_json::from_slice(json)
            .map_err(|error| Error::malformed(path, format!("line {}", error.line().max(1)), error.to_string()))?;
        let encoding = match &*raw.data_type {
            "laszip" => Encoding::Laz,
            "binary" => Encoding::Binary,
            "zstandard" => Encoding::Zstandard,
            other => {
                let what = format!("nodes of type '{}' are not read", excerpt(other.as_bytes()));
                return Err(Error::unsupported(path, what));
            }
        };
        if let Some(other) = raw.hierarchy_type.as_ref().filter(|kind| *kind != "json") {
            let what = format!("a hierarchy of type '{}' is not read", excerpt(other.as_bytes()));
            return Err(Error::unsupported(path, what));
        }
        let [low, high] = corners(raw.bounds);
        if !(low.is_finite() && high.is_finite() && low.cmplt(high).all()) {
            return Err(fail("the bounds of the root are no box".into()));
        }
        if !(raw.span >= 1.0 && raw.span.is_finite()) {
            return Err(fail(format!("the span is {}; it must be 1 or more", shown_number(raw.span))));
        }
        let mut at = 0;
        let mut list = Vec::new();
        for dimension in &raw.schema {
            let column = dimension.column(at).map_err(fail)?;
            at += column.scalar.size();
            list.push(column);
        }
        Ok(Self { encoding, columns: Columns::new(list).map_err(fail)?, raw })
    }

    /// What the metadata state, the coordinate system of nodes, and the factor of their heights.
    pub(super) fn info(&self) -> (TreeInfo, Crs, f64) {
        let raw = &self.raw;
        let mut notes = Vec::new();
        let crs = self.crs();
        let cube = corners(raw.bounds);
        let size = cube[1] - cube[0];
        if size.max_element() > 1.001 * size.min_element() {
            notes.push("the root is no cube; its spacing is that along x".into());
        }
        let attributes = raw.schema.iter().filter_map(|dimension| Some(dimension.column(0).ok()?.attribute()));
        let mut description = Description {
            bounds: Some(raw.bounds_conforming.map_or(cube, corners)),
            attributes: attributes.collect(),
            crs: crs.clone(),
            resolution: self.columns.resolution(),
            notes,
            ..Description::default()
        };
        units::settle_description(&mut description);
        let height_scale = crs.height_scale().unwrap_or(1.0);
        let version = excerpt(raw.version.as_deref().unwrap_or("1").as_bytes());
        let info = TreeInfo {
            format: format!("EPT {version}, nodes as {}", raw.data_type),
            points: raw.points,
            cube: cube.map(|corner| corner * DVec3::new(1.0, 1.0, height_scale)),
            bounds: description.bounds.unwrap_or(cube),
            spacing: size.x / raw.span,
            attributes: description.attributes.into_iter().map(|value| (value.name, value.stored)).collect(),
            colors: self.columns.rgb.is_some(),
            fields: self.columns.others.iter().map(|column| column.name.clone()).collect(),
            axes: Some(Axes::ZUp),
            crs: description.crs,
            resolution: description.resolution,
            details: vec![("spacing".into(), format!("{} at the root", shown_number(size.x / raw.span)))],
            notes: description.notes,
        };
        (info, crs, height_scale)
    }

    fn crs(&self) -> Crs {
        let Some(srs) = &self.raw.srs else { return Crs::default() };
        let wkt = srs.wkt.as_deref().filter(|text| !text.trim().is_empty());
        let CrsDefinition { mut crs, heights, .. } = wkt.map(CrsDefinition::from_wkt).unwrap_or_default();
        crs.vertical_unit = heights.filter(|&unit| Some(unit) != crs.unit).or(crs.vertical_unit);
        if srs.authority.as_deref() == Some("EPSG") {
            crs.epsg = crs.epsg.or_else(|| srs.horizontal.as_ref()?.parse().ok());
        }
        crs
    }

    /// Bytes of a node with so many points, an estimate where they are compressed.
    pub(super) fn stored_bytes(&self, points: u32) -> u64 {
        let plain = u64::from(points) * self.columns.stride as u64;
        if self.encoding == Encoding::Binary { plain } else { plain / 4 }
    }

    /// Most bytes of a node with so many points.
    pub(super) fn most_bytes(&self, points: u32) -> u64 {
        // Records of LAZ may have values that the schema leaves out.
        let record = self.columns.stride.max(usize::from(u8::MAX)) as u64;
        MAX_LAZ_HEAD + MAX_LAZ_GROWTH * u64::from(points) * record
    }
}

fn corners([a, b, c, d, e, f]: [f64; 6]) -> [DVec3; 2] {
    [DVec3::new(a, b, c), DVec3::new(d, e, f)]
}

#[cfg(test)]
mod tests {
    use autosplats_cloud::Key;

    use super::*;

    #[test]
    fn metadata_that_cannot_be_are_refused() {
        let good = r#"{"bounds":[0,0,0,8,8,8],"dataType":"binary","hierarchyType":"json","points":9,"span":128,
            "version":"1.1.0","schema":[{"name":"X","type":"signed","size":4,"scale":0.01},
            {"name":"Y","type":"float","size":8},{"name":"Z","type":"unsigned","size":2,"offset":5},
            {"name":"Intensity","type":"unsigned","size":2}],"srs":{"authority":"EPSG","horizontal":"32632"}}"#;
        let read = |text: &str| Meta::read("ept.json".as_ref(), text.as_bytes());
        let meta = read(good).expect("it is sound");
        assert_eq!((meta.columns.stride, meta.columns.others[0].at, meta.info().0.spacing), (16, 14, 0.0625));
        assert_eq!(meta.info().0.cube, Key::ROOT.cube([DVec3::ZERO, DVec3::splat(8.0)]));
        assert_eq!(meta.info().1.epsg, Some(32_632));
        for (from, to, words) in [
            ("[0,0,0,8,8,8]", "[0,0,0,8,8]", "line 1: invalid length 5"),
            ("[0,0,0,8,8,8]", "[0,0,0,8,8,0]", "no box"),
            ("\"binary\"", "\"tar\"", "nodes of type 'tar'"),
            ("\"json\"", "\"gzip\"", "hierarchy of type 'gzip'"),
            ("128", "0", "the span is 0"),
            ("\"X\"", "\"W\"", "no X, Y and Z"),
            ("\"size\":8", "\"size\":3", "'Y' is of 3 bytes"),
            ("0.01", "0", "invalid scale 0"),
            ("{\"bounds", "[{\"bounds", "line 1"),
        ] {
            let told = read(&good.replace(from, to)).expect_err(words).to_string();
            assert!(told.contains(words), "{told} should contain {words}");
        }
    }
}
