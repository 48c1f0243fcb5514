//! `metadata.json`: the root's cube, the values of a point, the coordinate system.

use std::path::Path;

use autosplats_cloud::{Axes, Crs, Error, TreeInfo, excerpt, shown_number};
use glam::DVec3;
use serde::Deserialize;

use crate::{
    read::{
        Description,
        table::{MAX_COLUMNS, Scalar},
        units,
    },
    tree::columns::{Column, Columns},
};

/// Cells along the root's cube, by which its spacing is known where the metadata state none.
const CELLS: f64 = 128.0;

/// How nodes are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Plain,
    Brotli,
}

/// How an attribute is stored in compressed nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packing {
    /// As in records, of so many bytes.
    Plain(usize),
    /// Coordinates with woven bits.
    Position,
    /// Colours with woven bits.
    Color,
}

impl Packing {
    /// Bytes of a value in a record.
    pub(super) fn plain(self) -> usize {
        match self {
            Self::Plain(bytes) => bytes,
            Self::Position => 12,
            Self::Color => 6,
        }
    }

    /// Bytes of a value in a compressed node.
    pub(super) fn packed(self) -> usize {
        match self {
            Self::Plain(bytes) => bytes,
            Self::Position => 16,
            Self::Color => 8,
        }
    }
}

/// Contents of `metadata.json`, checked as far as reading needs.
#[derive(Debug)]
pub(super) struct Meta {
    pub(super) encoding: Encoding,
    /// Bytes of the root's page.
    pub(super) first_page: u64,
    pub(super) columns: Columns,
    pub(super) packings: Vec<Packing>,
    /// The coordinate system whose heights are those of the nodes.
    pub(super) crs: Crs,
    raw: Raw,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Raw {
    version: String,
    points: u64,
    #[serde(default)]
    projection: String,
    hierarchy: Hierarchy,
    offset: [f64; 3],
    scale: [f64; 3],
    #[serde(default)]
    spacing: f64,
    bounding_box: Corners,
    encoding: String,
    attributes: Vec<Attribute>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Hierarchy {
    first_chunk_size: u64,
}

#[derive(Debug, Deserialize)]
struct Corners {
    min: [f64; 3],
    max: [f64; 3],
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Attribute {
    name: String,
    size: usize,
    num_elements: usize,
    #[serde(rename = "type")]
    kind: String,
    #[serde(default)]
    min: Vec<f64>,
    #[serde(default)]
    max: Vec<f64>,
    #[serde(default)]
    scale: Vec<f64>,
    #[serde(default)]
    offset: Vec<f64>,
}

/// Names of the attributes that LAS has too, and LAS's.
const NAMES: [(&str, &str); 9] = [
    ("intensity", "Intensity"),
    ("return number", "ReturnNumber"),
    ("number of returns", "NumberOfReturns"),
    ("classification", "Classification"),
    ("scan angle rank", "ScanAngleRank"),
    ("scan angle", "ScanAngleRank"),
    ("user data", "UserData"),
    ("point source id", "PointSourceId"),
    ("gps-time", "GpsTime"),
];

impl Attribute {
    fn scalar(&self) -> Result<Scalar, String> {
        use Scalar::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
        let scalar = match &*self.kind {
            "int8" => I8,
            "int16" => I16,
            "int32" => I32,
            "int64" => I64,
            "uint8" => U8,
            "uint16" => U16,
            "uint32" => U32,
            "uint64" => U64,
            "float" => F32,
            "double" => F64,
            other => {
                let name = excerpt(self.name.as_bytes());
                return Err(format!("'{name}' is of type '{}', which is not read", excerpt(other.as_bytes())));
            }
        };
        // LAS's angles have a sign, which PotreeConverter does not state.
        let scalar = if self.name == "scan angle rank" && scalar == U8 { I8 } else { scalar };
        let fits = (1..=MAX_COLUMNS).contains(&self.num_elements) && self.size == self.num_elements * scalar.size();
        if !fits {
            let (name, size) = (excerpt(self.name.as_bytes()), self.size);
            return Err(format!("'{name}' has {size} bytes for {} values of {}", self.num_elements, self.kind));
        }
        Ok(scalar)
    }

    fn is_position(&self) -> bool {
        ["position", "POSITION_CARTESIAN"].contains(&&*self.name) && self.num_elements == 3
    }

    fn is_color(&self) -> bool {
        ["rgb", "rgba"].contains(&&*self.name) && self.num_elements == 3
    }

    /// The columns from byte `at` of a record on. Coordinates have the scale and offset of `raw`.
    fn columns(&self, raw: &Raw, at: usize) -> Result<Vec<Column>, String> {
        let scalar = self.scalar()?;
        let column = |index: usize| {
            let axis = |names: [&str; 3]| names[index].to_owned();
            let known = NAMES.iter().find(|(name, _)| *name == self.name);
            let stated = |list: &[f64], usual: f64| list.get(index).copied().unwrap_or(usual);
            let own = [stated(&self.scale, 1.0), stated(&self.offset, 0.0)];
            let (name, scaled) = if self.is_position() {
                (axis(["X", "Y", "Z"]), [raw.scale[index], raw.offset[index]])
            } else if self.is_color() {
                (axis(["Red", "Green", "Blue"]), [1.0, 0.0])
            } else if self.num_elements == 1 {
                (known.map_or(&*self.name, |(_, name)| *name).to_owned(), own)
            } else {
                (format!("{}_{index}", self.name), own)
            };
            Column::new(&name, scalar, at + index * scalar.size(), scaled)
        };
        (0..self.num_elements).map(column).collect()
    }

    fn packing(&self) -> Packing {
        if self.is_position() {
            Packing::Position
        } else if self.is_color() {
            Packing::Color
        } else {
            Packing::Plain(self.size)
        }
    }
}

impl Meta {
    /// Reads the metadata; `path` is for messages.
    pub(super) fn read(path: &Path, json: &[u8]) -> Result<Self, Error> {
        let fail = |what: String| Error::malformed(path, "metadata", what);
        let raw: Raw = serde_json::from_slice(json)
            .map_err(|error| Error::malformed(path, format!("line {}", error.line().max(1)), error.to_string()))?;
        if raw.version.split('.').next() != Some("2") {
            let what = format!("version '{}' of Potree is not read, only 2", excerpt(raw.version.as_bytes()));
            return Err(Error::unsupported(path, what));
        }
        let encoding = match &*raw.encoding {
            "DEFAULT" | "UNCOMPRESSED" => Encoding::Plain,
            "BROTLI" => Encoding::Brotli,
            other => {
                let what = format!("nodes of encoding '{}' are not read", excerpt(other.as_bytes()));
                return Err(Error::unsupported(path, what));
            }
        };
        let [low, high] = raw.cube();
        if !(low.is_finite() && high.is_finite() && low.cmplt(high).all()) {
            return Err(fail("the bounding box of the root is no box".into()));
        }
        let mut list = Vec::new();
        let mut at = 0;
        for attribute in &raw.attributes {
            list.extend(attribute.columns(&raw, at).map_err(fail)?);
            at += attribute.size;
        }
        let columns = Columns::new(list).map_err(fail)?;
        let woven = |attribute: &&Attribute| match attribute.packing() {
            Packing::Plain(_) => false,
            packing => packing.plain() != attribute.size,
        };
        if let Some(odd) = raw.attributes.iter().find(woven) {
            let what = format!("'{}' of type '{}' is not read", excerpt(odd.name.as_bytes()), odd.kind);
            return Err(Error::unsupported(path, what));
        }
        let packings = raw.attributes.iter().map(Attribute::packing).collect();
        let crs = crs(&raw.projection);
        Ok(Self { encoding, first_page: raw.hierarchy.first_chunk_size, columns, packings, crs, raw })
    }

    /// Bytes of a record.
    pub(super) fn stride(&self) -> usize {
        self.columns.stride
    }

    /// What the metadata state, and the factor of heights.
    pub(super) fn info(&self) -> (TreeInfo, f64) {
        let raw = &self.raw;
        let cube = raw.cube();
        let size = (cube[1] - cube[0]).x;
        let spacing = if raw.spacing > 0.0 && raw.spacing.is_finite() { raw.spacing } else { size / CELLS };
        let position = raw.attributes.iter().find(|attribute| attribute.is_position());
        let corner = |list: &[f64]| Some(DVec3::from(*list.first_chunk::<3>()?)).filter(|corner| corner.is_finite());
        let bounds = position.and_then(|position| Some([corner(&position.min)?, corner(&position.max)?]));
        let columns = &self.columns;
        let all = columns.xyz.iter().chain(&columns.others).chain(columns.rgb.iter().flatten());
        let mut stored: Vec<&Column> = all.collect();
        stored.sort_by_key(|column| column.at);
        let mut description = Description {
            bounds: Some(bounds.unwrap_or(cube)),
            attributes: stored.into_iter().map(Column::attribute).collect(),
            crs: self.crs.clone(),
            resolution: columns.resolution(),
            ..Description::default()
        };
        units::settle_description(&mut description);
        let height_scale = self.crs.height_scale().unwrap_or(1.0);
        let info = TreeInfo {
            format: format!("Potree {}, nodes as {}", excerpt(raw.version.as_bytes()), raw.encoding),
            points: raw.points,
            cube: cube.map(|corner| corner * DVec3::new(1.0, 1.0, height_scale)),
            bounds: description.bounds.unwrap_or(cube),
            spacing,
            attributes: description.attributes.into_iter().map(|value| (value.name, value.stored)).collect(),
            colors: columns.rgb.is_some(),
            fields: columns.others.iter().map(|column| column.name.clone()).collect(),
            axes: Some(Axes::ZUp),
            crs: description.crs,
            resolution: description.resolution,
            details: vec![("spacing".into(), format!("{} at the root", shown_number(spacing)))],
            notes: description.notes,
        };
        (info, height_scale)
    }
}

impl Raw {
    fn cube(&self) -> [DVec3; 2] {
        [DVec3::from(self.bounding_box.min), DVec3::from(self.bounding_box.max)]
    }
}

/// The coordinate system of `projection`: well-known text, a code, or a definition of PROJ, which is only a name here.
fn crs(projection: &str) -> Crs {
    let text = projection.trim();
    if text.contains('[') {
        return Crs::from_wkt(text);
    }
    let code = text.split_once(':').filter(|(authority, _)| authority.eq_ignore_ascii_case("EPSG"));
    let epsg = code.and_then(|(_, code)| code.parse().ok());
    Crs { name: Some(excerpt(text.as_bytes())).filter(|name| !name.is_empty()), epsg, ..Crs::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_that_cannot_be_are_refused() {
        let good = r#"{"version":"2.0","points":9,"projection":"EPSG:32632","encoding":"DEFAULT","spacing":0.5,
            "hierarchy":{"firstChunkSize":22,"stepSize":4,"depth":1},"offset":[1,2,3],"scale":[0.01,0.01,0.01],
            "boundingBox":{"min":[0,0,0],"max":[8,8,8]},"attributes":[
            {"name":"position","size":12,"numElements":3,"elementSize":4,"type":"int32"},
            {"name":"classification","size":1,"numElements":1,"elementSize":1,"type":"uint8"},
            {"name":"rgb","size":6,"numElements":3,"elementSize":2,"type":"uint16"},
            {"name":"flow","size":8,"numElements":2,"elementSize":4,"type":"float"}]}"#;
        let read = |text: &str| Meta::read("metadata.json".as_ref(), text.as_bytes());
        let meta = read(good).expect("it is sound");
        let info = meta.info().0;
        assert_eq!((meta.stride(), info.spacing, info.crs.epsg), (27, 0.5, Some(32_632)));
        assert_eq!(info.fields, ["Classification", "flow_0", "flow_1"]);
        assert_eq!(meta.packings, [Packing::Position, Packing::Plain(1), Packing::Color, Packing::Plain(8)]);
        for (from, to, words) in [
            ("\"2.0\"", "\"1.8\"", "version '1.8'"),
            ("\"DEFAULT\"", "\"tar\"", "encoding 'tar'"),
            ("[8,8,8]", "[8,8,0]", "no box"),
            ("[8,8,8]", "[8,8]", "line 3: invalid length 2"),
            ("0.01,0.01,0.01", "0.01,0,0.01", "invalid scale 0"),
            ("\"position\"", "\"place\"", "no X, Y and Z"),
            ("\"size\":6", "\"size\":5", "'rgb' has 5 bytes for 3 values of uint16"),
            ("\"size\":8,\"numElements\":2", "\"size\":8,\"numElements\":0", "'flow' has 8 bytes for 0 values"),
            ("\"float\"", "\"half\"", "type 'half'"),
            ("{\"version", "[{\"version", "line 1"),
        ] {
            let told = read(&good.replace(from, to)).expect_err(words).to_string();
            assert!(told.contains(words), "{told} should contain {words}");
        }
    }
}
