//! glTF 2 and GLB: the points of all meshes in the scene, at their places.
//!
//! # How it works
//!
//! The JSON states which meshes are placed where ([`plan`]), and thus the number of points before any is made. Then the
//! buffers that are needed are loaded, and the vertices of every primitive are transformed to the world.

mod accessor;
mod animation;
mod buffers;
mod json;
mod plan;

use autosplats_cloud::{Axes, Contents, Crs, Error, FieldValues, Unit, normal_matrix};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use self::{
    accessor::{Values, part},
    animation::Pose,
    buffers::{Buffers, buffers_of},
    json::{Attributes, Container, Root},
    plan::{FAN, PlacedPrimitive, Plan, STRIP, TRIANGLES},
};
pub(super) use self::{animation::animation, buffers::linked};
use super::{
    Attribute, Description, Format, Job,
    mesh::{self, Faces},
    table::{ProgressRange, reserve},
};
use crate::color_scale::ColorScale;

pub(super) const FORMAT: Format = Format {
    name: "glTF",
    extensions: &["glb", "gltf"],
    recognised: |bytes| bytes.starts_with(b"glTF"),
    sensor_frame: false,
    describe,
    read,
};

fn crs() -> Crs {
    Crs { unit: Some(Unit::Metre), ..Crs::default() }
}

fn describe(job: &Job<'_>) -> Result<Description, Error> {
    let container = Container::open(job)?;
    let root = container.root(job)?;
    let plan = Plan::of(job, &root, None)?;
    let attributes = plan.shown.first().map(|shown| shown.primitive.attributes);
    let named = attributes.map_or([const { ("", None) }; 3], |Attributes { position, normal, color }| {
        [("POSITION", position), ("NORMAL", normal), ("COLOR_0", color)]
    });
    let stored = |(name, index): (&str, Option<usize>)| {
        let accessor = root.accessors.get(index?)?;
        let scalar = accessor::scalar(accessor.component_type)?.name();
        Some(Attribute::new(name, format!("{scalar} × {}", accessor::width(accessor.shape)?)))
    };
    let generator = root.asset.generator.as_deref().map(|name| name.replace(char::is_control, " "));
    let counts = [("nodes", root.nodes.len()), ("meshes", root.meshes.len())];
    let details = counts.map(|(name, count)| (name.to_owned(), count.to_string()));
    let version: String = root.asset.version.chars().take(20).flat_map(char::escape_debug).collect();
    Ok(Description {
        format: format!("glTF {version}, {}", if container.binary { "binary" } else { "text" }),
        points: Some(plan.points as u64),
        faces: Some(plan.faces as u64),
        attributes: named.into_iter().filter_map(stored).collect(),
        crs: crs(),
        details: generator.map(|name| ("generator".into(), name)).into_iter().chain(details).collect(),
        notes: plan.notes,
        ..Description::default()
    })
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    read_at(job, None)
}

/// The scene at a time of its first animation; as modelled without a time.
pub(super) fn read_at(job: &Job<'_>, seconds: Option<f64>) -> Result<Contents, Error> {
    let container = Container::open(job)?;
    let root = container.root(job)?;
    let pose = seconds.map(|seconds| Pose::at(job, &root, container.chunk, seconds)).transpose()?;
    let plan = Plan::of(job, &root, pose.as_ref())?;
    let buffers = Buffers::load(job, &root, container.chunk, wanted(job, &root, &plan))?;
    plan.check_size(job, job.bytes.len().saturating_add(buffers.len_beside()))?;
    buffers.checked(contents(job, &root, &plan, &buffers))
}

/// The points and triangles of a plan.
fn contents(job: &Job<'_>, root: &Root<'_>, plan: &Plan<'_>, buffers: &Buffers<'_>) -> Result<Contents, Error> {
    plan.notes.iter().for_each(|note| job.note(note));
    if plan.shown.is_empty() {
        job.note("the scene shows no mesh");
    }
    let mut points = Points::new(job, root, plan)?;
    let mut faces = Faces::new(plan.points);
    for (index, shown) in plan.shown.iter().enumerate() {
        let done = 0.7 * index as f32 / plan.shown.len() as f32;
        job.tick(done)?;
        let scene = Scene { job, root, buffers, part: part(done) };
        if !shown.shared {
            points.add(&scene, shown)?;
        }
        if job.triangles {
            add_faces(&scene, shown, &mut faces)?;
        }
    }
    if let Some(full) = points.full {
        job.note(format!("the colours are in 0 to {full}, not in 0 to 1; read as such"));
    }
    let mut cloud = mesh::cloud(job, &points.positions, 0.7)?.with_axes(Axes::YUp).with_crs(crs());
    if let Some(colors) = &points.colors {
        cloud = mesh::with_colors(job, cloud, |i| colors[i].map(|value| f32::from(value) / 65535.0))?;
    }
    for (axis, values) in points.normals.into_iter().flatten().enumerate() {
        cloud = cloud.with_field(["NormalX", "NormalY", "NormalZ"][axis], FieldValues::F32(values))?;
    }
    Ok(Contents { cloud, triangles: faces.finish(job) })
}

/// Indices of the buffers that the placed primitives need.
fn wanted(job: &Job<'_>, root: &Root<'_>, plan: &Plan<'_>) -> impl Iterator<Item = usize> {
    let mut needed = vec![false; root.accessors.len()];
    for shown in &plan.shown {
        let primitive = shown.primitive;
        let Attributes { position, normal, color } = primitive.attributes;
        let indices = primitive.indices.filter(|_| job.triangles);
        let targets = shown.targets().flat_map(|(target, _)| [target.position, target.normal]);
        for index in [position, normal, color, indices].into_iter().chain(targets).flatten() {
            needed.get_mut(index).into_iter().for_each(|needed| *needed = true);
        }
    }
    buffers_of(root, needed)
}

/// Context of reading a primitive.
struct Scene<'a> {
    job: &'a Job<'a>,
    root: &'a Root<'a>,
    buffers: &'a Buffers<'a>,
    part: ProgressRange,
}

impl Scene<'_> {
    /// Vectors of the vertices, with the weighted morph targets added.
    fn morphed(
        &self,
        index: usize,
        shown: &PlacedPrimitive<'_>,
        of_target: impl Fn(&Attributes) -> Option<usize>,
    ) -> Result<Vec<[f32; 3]>, Error> {
        let mut vectors = self.vectors(index, &[3], Some(shown.count))?;
        for (target, weight) in shown.targets() {
            self.job.go_on()?;
            let Some(index) = of_target(target) else { continue };
            let steps = self.vectors(index, &[3], Some(shown.count))?;
            vectors.par_iter_mut().zip(steps).for_each(|(vector, step)| {
                (0..3).for_each(|axis| vector[axis] += (weight * f64::from(step[axis])) as f32);
            });
        }
        Ok(vectors)
    }

    fn vectors(&self, index: usize, widths: &[usize], count: Option<usize>) -> Result<Vec<[f32; 3]>, Error> {
        let values = Values::find(self.job, self.root, self.buffers, index, widths)?;
        if count.is_some_and(|count| count != values.count()) {
            let what =
                format!("it has {} values for {} vertices; export the file again", values.count(), count.unwrap_or(0));
            return Err(self.job.malformed(format!("accessor {index}"), what));
        }
        values.vectors(self.job, self.part)
    }
}

/// The points of all primitives.
struct Points {
    positions: Vec<[f64; 3]>,
    /// 16-bit sRGB, if any primitive has colours.
    colors: Option<Vec<[u16; 3]>>,
    /// Full brightness of colours that are not in 0 to 1.
    full: Option<f32>,
    /// Present if all primitives have normals.
    normals: Option<[Vec<f32>; 3]>,
}

impl Points {
    fn new(job: &Job<'_>, root: &Root<'_>, plan: &Plan<'_>) -> Result<Self, Error> {
        let what = "the points of a glTF";
        let has = |shown: &PlacedPrimitive<'_>| shown.primitive.attributes;
        let colored = |shown: &PlacedPrimitive<'_>| has(shown).color.is_some() || base_color(root, shown) != [1.0; 3];
        let mut colors = plan.shown.iter().any(colored).then(Vec::new);
        let normal = plan.shown.iter().filter(|shown| has(shown).normal.is_some()).count();
        if normal > 0 && normal < plan.shown.len() {
            job.note("some primitives have no normals; those of the others are left out");
        }
        let mut normals = (normal > 0 && normal == plan.shown.len()).then(<[Vec<f32>; 3]>::default);
        let mut positions = Vec::new();
        reserve(&mut positions, plan.points, what)?;
        colors.iter_mut().try_for_each(|colors| reserve(colors, plan.points, what))?;
        normals.iter_mut().flatten().try_for_each(|axis| reserve(axis, plan.points, what))?;
        Ok(Self { positions, colors, full: None, normals })
    }

    fn add(&mut self, scene: &Scene<'_>, shown: &PlacedPrimitive<'_>) -> Result<(), Error> {
        let Attributes { position, normal, color } = shown.primitive.attributes;
        let Some(position) = position else { return Ok(()) };
        let local = scene.morphed(position, shown, |target| target.position)?;
        let vector = |value: [f32; 3]| DVec3::from(value.map(f64::from));
        let matrix = shown.world_from_mesh;
        self.positions.par_extend(local.par_iter().map(|&value| matrix.transform_point3(vector(value)).to_array()));
        if let Some(colors) = &mut self.colors {
            let factor = base_color(scene.root, shown);
            let srgb = |value: [f32; 3]| [0, 1, 2].map(|c| srgb(value[c] * factor[c]));
            match color {
                Some(color) => {
                    let linear = scene.vectors(color, &[3, 4], Some(shown.count))?;
                    // The format has colours of 0 to 1, but some programs write bytes without "normalized".
                    let scale = ColorScale::of(linear.len(), true, |i| linear[i].map(f64::from));
                    let full = scale.full() as f32;
                    if full > 1.0 {
                        self.full = Some(full);
                    }
                    colors.par_extend(linear.into_par_iter().map(|value| srgb(value.map(|channel| channel / full))));
                }
                None => colors.resize(colors.len() + shown.count, srgb([1.0; 3])),
            }
        }
        if let (Some(normals), Some(normal)) = (&mut self.normals, normal) {
            let local = scene.morphed(normal, shown, |target| target.normal)?;
            let matrix = normal_matrix(DMat3::from_mat4(matrix));
            for (axis, values) in normals.iter_mut().enumerate() {
                let turned = |&value: &[f32; 3]| (matrix * vector(value)).normalize_or_zero()[axis] as f32;
                values.par_extend(local.par_iter().map(turned));
            }
        }
        Ok(())
    }
}

fn base_color(root: &Root<'_>, shown: &PlacedPrimitive<'_>) -> [f32; 3] {
    let material = shown.primitive.material.and_then(|index| root.materials.get(index));
    material.map_or([1.0; 3], |material| material.base_color())
}

/// A linear brightness as 16-bit sRGB.
fn srgb(linear: f32) -> u16 {
    let value = if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (value * 65535.0 + 0.5) as u16
}

fn add_faces(scene: &Scene<'_>, shown: &PlacedPrimitive<'_>, faces: &mut Faces) -> Result<(), Error> {
    let mode = shown.primitive.mode;
    if !matches!(mode, TRIANGLES | STRIP | FAN) {
        return Ok(());
    }
    let indices = match shown.primitive.indices {
        Some(index) => {
            Some(Values::find(scene.job, scene.root, scene.buffers, index, &[1])?.indices(scene.job, scene.part)?)
        }
        None => None,
    };
    let count = indices.as_ref().map_or(shown.count, Vec::len);
    let corner = |i: usize| {
        let own = indices.as_ref().map_or(i, |indices| indices[i] as usize);
        if own < shown.count { (shown.first + own) as i64 } else { i64::MIN }
    };
    let before = faces.triangles.len();
    match mode {
        TRIANGLES => {
            reserve(&mut faces.triangles, count / 3, "the triangles of a mesh")?;
            (0..count / 3).try_for_each(|i| faces.polygon(&[0, 1, 2].map(|c| corner(3 * i + c))))?;
        }
        STRIP => faces.strip((0..count).map(corner))?,
        _ => faces.fan((0..count).map(corner))?,
    }
    // Mirroring reverses the orientation of triangles.
    if shown.world_from_mesh.determinant() < 0.0 {
        faces.triangles[before..].iter_mut().for_each(|[_, b, c]| std::mem::swap(b, c));
    }
    Ok(())
}
