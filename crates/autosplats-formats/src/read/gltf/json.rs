//! The parts of a glTF's JSON that describe points. Everything else is skipped while parsing. What is kept takes at
//! most a few dozen times the bytes of the text.

use std::borrow::Cow;

use autosplats_cloud::{Error, check_memory, guard};
use glam::{DMat4, DQuat, DVec3};
use serde::{Deserialize, de::IgnoredAny};

use super::super::Job;

/// Bytes of memory that a byte of the text takes at most.
const BYTES_PER_BYTE: u64 = 64;

/// The whole document.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Root<'a> {
    #[serde(borrow)]
    pub(super) asset: Asset<'a>,
    pub(super) scene: Option<usize>,
    #[serde(default)]
    pub(super) scenes: Vec<Scene>,
    #[serde(default)]
    pub(super) nodes: Vec<Node>,
    #[serde(default)]
    pub(super) meshes: Vec<Mesh>,
    #[serde(default)]
    pub(super) materials: Vec<Material>,
    #[serde(default)]
    pub(super) accessors: Vec<Accessor>,
    #[serde(default)]
    pub(super) buffer_views: Vec<View>,
    #[serde(default, borrow)]
    pub(super) buffers: Vec<Buffer<'a>>,
    #[serde(default, borrow)]
    pub(super) animations: Vec<Animation<'a>>,
    #[serde(default, borrow)]
    pub(super) extensions_required: Vec<Cow<'a, str>>,
}

#[derive(Deserialize)]
pub(super) struct Asset<'a> {
    #[serde(borrow)]
    pub(super) version: Cow<'a, str>,
    #[serde(borrow)]
    pub(super) generator: Option<Cow<'a, str>>,
}

#[derive(Deserialize)]
pub(super) struct Scene {
    #[serde(default)]
    pub(super) nodes: Vec<usize>,
}

#[derive(Deserialize)]
pub(super) struct Node {
    #[serde(default)]
    pub(super) children: Vec<usize>,
    pub(super) mesh: Option<u32>,
    skin: Option<u32>,
    matrix: Option<Box<[f64; 16]>>,
    translation: Option<Box<[f64; 3]>>,
    rotation: Option<Box<[f64; 4]>>,
    scale: Option<Box<[f64; 3]>>,
    pub(super) weights: Option<Box<[f64]>>,
    extensions: Option<Box<NodeExtensions>>,
}

#[derive(Deserialize)]
struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    instancing: Option<IgnoredAny>,
}

impl Node {
    /// Maps the node's own coordinates to its parent's. Animated values replace the file's.
    pub(super) fn parent_from_node(&self, animated: Option<&NodePose>) -> DMat4 {
        if let Some(matrix) = &self.matrix {
            return DMat4::from_cols_array(matrix);
        }
        let still = NodePose::default();
        let animated = animated.unwrap_or(&still);
        let vector = |animated: &Option<[f64; 3]>, own: &Option<Box<[f64; 3]>>, default| {
            animated.or_else(|| own.as_deref().copied()).map_or(default, DVec3::from)
        };
        // A rotation of length zero means none.
        let rotation = animated.rotation.or_else(|| self.rotation.as_deref().copied()).map_or(DQuat::IDENTITY, |own| {
            let rotation = DQuat::from_array(own);
            if rotation.length() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY }
        });
        DMat4::from_scale_rotation_translation(
            vector(&animated.scale, &self.scale, DVec3::ONE),
            rotation,
            vector(&animated.translation, &self.translation, DVec3::ZERO),
        )
    }

    pub(super) fn is_skinned(&self) -> bool {
        self.skin.is_some()
    }

    /// Whether an extension repeats the node's mesh.
    pub(super) fn is_instanced(&self) -> bool {
        self.extensions.as_ref().is_some_and(|extensions| extensions.instancing.is_some())
    }
}

#[derive(Deserialize)]
pub(super) struct Mesh {
    pub(super) primitives: Vec<Primitive>,
    pub(super) weights: Option<Box<[f64]>>,
}

#[derive(Deserialize)]
pub(super) struct Primitive {
    pub(super) attributes: Attributes,
    pub(super) indices: Option<usize>,
    pub(super) material: Option<usize>,
    #[serde(default = "triangles")]
    pub(super) mode: u32,
    #[serde(default)]
    pub(super) targets: Vec<Attributes>,
    extensions: Option<PrimitiveExtensions>,
}

fn triangles() -> u32 {
    4
}

impl Primitive {
    pub(super) fn is_draco(&self) -> bool {
        self.extensions.as_ref().is_some_and(|extensions| extensions.draco.is_some())
    }
}

/// Accessors of the vertices' values.
#[derive(Clone, Copy, Deserialize, PartialEq, Eq, Hash)]
pub(super) struct Attributes {
    #[serde(rename = "POSITION")]
    pub(super) position: Option<usize>,
    #[serde(rename = "NORMAL")]
    pub(super) normal: Option<usize>,
    #[serde(rename = "COLOR_0")]
    pub(super) color: Option<usize>,
}

#[derive(Deserialize)]
struct PrimitiveExtensions {
    #[serde(rename = "KHR_draco_mesh_compression")]
    draco: Option<IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Material {
    pbr_metallic_roughness: Option<Box<Pbr>>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Pbr {
    base_color_factor: Option<[f32; 4]>,
}

impl Material {
    /// Linear factor of the colours.
    pub(super) fn base_color(&self) -> [f32; 3] {
        let factor = self.pbr_metallic_roughness.as_ref().and_then(|pbr| pbr.base_color_factor);
        factor.map_or([1.0; 3], |[red, green, blue, _]| [red, green, blue])
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<usize>,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) component_type: u32,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: usize,
    #[serde(rename = "type")]
    pub(super) shape: Shape,
    pub(super) sparse: Option<Box<Sparse>>,
}

/// Numbers per element of an accessor.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum Shape {
    Scalar,
    Vec2,
    Vec3,
    Vec4,
    Mat2,
    Mat3,
    Mat4,
}

#[derive(Deserialize)]
pub(super) struct Sparse {
    pub(super) count: usize,
    pub(super) indices: SparseIndices,
    pub(super) values: SparseValues,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) component_type: u32,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: usize,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct View {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) byte_length: usize,
    pub(super) byte_stride: Option<usize>,
    extensions: Option<Box<ViewExtensions>>,
}

#[derive(Deserialize)]
struct ViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    ext: Option<IgnoredAny>,
    #[serde(rename = "KHR_meshopt_compression")]
    khr: Option<IgnoredAny>,
}

impl View {
    pub(super) fn is_meshopt(&self) -> bool {
        self.extensions.as_ref().is_some_and(|extensions| extensions.ext.is_some() || extensions.khr.is_some())
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer<'a> {
    #[serde(borrow)]
    pub(super) uri: Option<Cow<'a, str>>,
    pub(super) byte_length: usize,
}

/// The JSON and the binary chunk of a file of either kind.
pub(super) struct Container<'a> {
    pub(super) binary: bool,
    pub(super) json: &'a [u8],
    pub(super) chunk: Option<&'a [u8]>,
}

const JSON: u32 = 0x4E4F_534A;
const BIN: u32 = 0x004E_4942;

impl<'a> Container<'a> {
    pub(super) fn open(job: &Job<'a>) -> Result<Self, Error> {
        let bytes = job.bytes;
        if !bytes.starts_with(b"glTF") {
            if bytes.is_empty() {
                return Err(job.malformed("byte 0", "the file is empty; copy it again"));
            }
            return Ok(Self { binary: false, json: bytes, chunk: None });
        }
        let word = |at: usize| bytes.get(at..at + 4).map(|raw| u32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]]));
        let cut = |what: &str| {
            job.malformed(
                format!("byte {}", bytes.len()),
                format!("the file ends inside {what}; it is cut off, copy it again"),
            )
        };
        let (Some(version), Some(length)) = (word(4), word(8)) else { return Err(cut("its header")) };
        if version != 2 {
            return Err(job.unsupported(format!("binary glTF of version {version}; save it as version 2")));
        }
        if length as usize > bytes.len() {
            return Err(cut("what its header announces"));
        }
        let mut at = 12;
        let mut chunk = || {
            let (len, kind) = (word(at)? as usize, word(at + 4)?);
            let content = bytes[..length as usize].get(at + 8..)?.get(..len)?;
            at += 8 + len;
            Some((kind, content))
        };
        let Some((JSON, json)) = chunk() else {
            return Err(job.malformed("byte 12", "the first chunk is not JSON or does not fit; copy the file again"));
        };
        job.check_not_text_converted(20 + json.len())?;
        let chunk = chunk().filter(|(kind, _)| *kind == BIN).map(|(_, content)| content);
        Ok(Self { binary: true, json, chunk })
    }

    pub(super) fn root(&self, job: &Job<'_>) -> Result<Root<'a>, Error> {
        // What begins otherwise fails at its first character.
        if self.json.trim_ascii_start().starts_with(b"{") {
            let name = job.path.file_name().unwrap_or_default().to_string_lossy();
            check_memory(&format!("the JSON of {name}"), (self.json.len() as u64).saturating_mul(BYTES_PER_BYTE))?;
        }
        let parsed: serde_json::Result<Root<'a>> =
            guard(|| Ok(serde_json::from_slice(self.json))).map_err(|what| job.malformed("JSON", what))?;
        let root = parsed.map_err(|error| {
            let (line, column) = (error.line(), error.column());
            let place = if self.binary {
                format!("JSON chunk, column {column}")
            } else {
                format!("line {line}, column {column}")
            };
            // The message may contain names from the file.
            let what = error.to_string().replace(char::is_control, " ");
            let what = what.split(" at line ").next().unwrap_or_default();
            let what: String = what.chars().take(200).collect();
            job.malformed(place, format!("{what}; this is not glTF 2, export it again"))
        })?;
        if !root.asset.version.starts_with("2.") {
            let version: String = root.asset.version.chars().take(20).flat_map(char::escape_debug).collect();
            return Err(job.unsupported(format!("glTF of version {version}; save it as version 2")));
        }
        Ok(root)
    }
}

#[derive(Deserialize)]
pub(super) struct Animation<'a> {
    #[serde(default, borrow)]
    pub(super) channels: Vec<Channel<'a>>,
    #[serde(default)]
    pub(super) samplers: Vec<Sampler>,
}

#[derive(Deserialize)]
pub(super) struct Channel<'a> {
    pub(super) sampler: usize,
    #[serde(borrow)]
    pub(super) target: Target<'a>,
}

#[derive(Deserialize)]
pub(super) struct Target<'a> {
    pub(super) node: Option<usize>,
    pub(super) path: Cow<'a, str>,
}

#[derive(Deserialize)]
pub(super) struct Sampler {
    pub(super) input: usize,
    pub(super) output: usize,
    #[serde(default)]
    pub(super) interpolation: Interpolation,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum Interpolation {
    #[default]
    Linear,
    Step,
    CubicSpline,
}

/// Values of a node that an animation replaces.
#[derive(Default)]
pub(super) struct NodePose {
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) weights: Option<Vec<f64>>,
}
