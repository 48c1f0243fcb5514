//! Selects the meshes that a glTF shows, and their places.

use std::{collections::HashMap, rc::Rc};

use autosplats_cloud::Error;
use glam::DMat4;

use super::super::Job;
use super::accessor;
use super::animation::Pose;
use super::json::{Attributes, Primitive, Root};

/// Most points per byte of the files; meshes placed repeatedly yield more points than bytes.
const MAX_POINTS_PER_BYTE: usize = 64;

/// Number of points, and of primitives, that is allowed for files of any size.
const ALWAYS_ALLOWED: usize = 1 << 16;

/// Least bytes of the file per placed primitive, beyond those allowed for any file. A node with a mesh takes more.
const BYTES_PER_SHOWN: usize = 8;

/// A primitive at one of its places.
pub(super) struct PlacedPrimitive<'a> {
    pub(super) primitive: &'a Primitive,
    pub(super) world_from_mesh: DMat4,
    /// Index of its first point.
    pub(super) first: usize,
    /// Number of its points.
    pub(super) count: usize,
    /// Whether its points are those of an earlier primitive.
    pub(super) shared: bool,
    /// Weights of the morph targets.
    pub(super) weights: Rc<[f64]>,
}

impl<'a> PlacedPrimitive<'a> {
    /// The morph targets with a weight other than zero, and these weights.
    pub(super) fn targets(&self) -> impl Iterator<Item = (&'a Attributes, f64)> {
        self.primitive.targets.iter().zip(self.weights.iter().copied()).filter(|(_, weight)| *weight != 0.0)
    }
}

/// Everything that the scene shows.
#[derive(Default)]
pub(super) struct Plan<'a> {
    pub(super) shown: Vec<PlacedPrimitive<'a>>,
    pub(super) points: usize,
    /// Corners of triangles, strips and fans.
    pub(super) corners: usize,
    pub(super) faces: usize,
    pub(super) notes: Vec<String>,
}

/// glTF's drawing modes for triangles, triangle strips and triangle fans.
pub(super) const TRIANGLES: u32 = 4;
pub(super) const STRIP: u32 = 5;
pub(super) const FAN: u32 = 6;

impl<'a> Plan<'a> {
    pub(super) fn of(job: &Job<'_>, root: &'a Root<'_>, pose: Option<&Pose>) -> Result<Self, Error> {
        for extension in &root.extensions_required {
            match &**extension {
                "KHR_draco_mesh_compression" => return Err(draco(job)),
                "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
                    return Err(accessor::unsupported_meshopt(job));
                }
                _ => {}
            }
        }
        let mut plan = Self::default();
        let (mut lines, mut morphed) = (0, 0);
        let places = places(job, root, pose, &mut plan.notes)?;
        let most = (job.bytes.len() / BYTES_PER_SHOWN).max(ALWAYS_ALLOWED);
        let mut looked_at = 0;
        for (mesh, world_from_mesh, node) in places {
            let Some(mesh) = root.meshes.get(mesh) else {
                return Err(job.malformed(format!("mesh {mesh}"), "there is no such mesh; export the file again"));
            };
            let weights: Rc<[f64]> = pose.map_or_else(Rc::default, |pose| pose.weights(root, node, mesh).into());
            looked_at += mesh.primitives.len();
            if looked_at > most {
                let what = format!("they show more than {most} primitives, too many for this file; split it");
                return Err(job.malformed("nodes", what));
            }
            let mut known: HashMap<Attributes, usize> = HashMap::new();
            for primitive in &mesh.primitives {
                if matches!(primitive.mode, 1..=3) {
                    lines += 1;
                    continue;
                }
                let Some(position) = primitive.attributes.position else { continue };
                let Some(accessor) = root.accessors.get(position) else {
                    let what = "there is no such accessor; export the file again";
                    return Err(job.malformed(format!("accessor {position}"), what));
                };
                if primitive.is_draco() && accessor.buffer_view.is_none() {
                    return Err(draco(job));
                }
                // Morphing moves the same vertices in several ways, so morphed points are not shared.
                let moved = !primitive.targets.is_empty() && !weights.is_empty();
                let shared = known.get(&primitive.attributes).copied().filter(|_| !moved);
                let first = shared.unwrap_or(plan.points);
                if shared.is_none() {
                    if !moved {
                        known.insert(primitive.attributes, first);
                    }
                    plan.points = plan.points.saturating_add(accessor.count);
                }
                let indices = primitive.indices.and_then(|index| root.accessors.get(index));
                let corners = indices.map_or(accessor.count, |indices| indices.count);
                let faces = match primitive.mode {
                    TRIANGLES => corners / 3,
                    STRIP | FAN => corners.saturating_sub(2),
                    _ => 0,
                };
                if faces > 0 {
                    plan.corners = plan.corners.saturating_add(corners);
                    plan.faces = plan.faces.saturating_add(faces);
                }
                morphed += usize::from(!primitive.targets.is_empty() && pose.is_none());
                let count = accessor.count;
                let (shared, weights) = (shared.is_some(), Rc::clone(&weights));
                plan.shown.push(PlacedPrimitive { primitive, world_from_mesh, first, count, shared, weights });
            }
        }
        if lines > 0 {
            plan.notes.push(format!("{lines} primitives are lines; left out"));
        }
        if morphed > 0 {
            plan.notes.push("the mesh has morph targets; its base shape is taken".into());
        }
        Ok(plan)
    }

    /// Fails if meshes are placed so often that a small file would fill the memory.
    pub(super) fn check_size(&self, job: &Job<'_>, bytes: usize) -> Result<(), Error> {
        let bound = bytes.saturating_mul(MAX_POINTS_PER_BYTE).max(ALWAYS_ALLOWED);
        let moved = |shown: &PlacedPrimitive<'_>| shown.count.saturating_mul(shown.targets().count());
        let moved = self.shown.iter().map(moved).fold(0, usize::saturating_add);
        let most = self.points.max(moved).max(if job.triangles { self.corners } else { 0 });
        if most > bound {
            let what =
                format!("they show {most} points, too many for a file of {bytes} bytes; split it or export it again");
            return Err(job.malformed("nodes", what));
        }
        // Positions are kept as `f64` until their origin is known.
        job.check_memory(self.points, 24 + 12)?;
        job.check_memory(if job.triangles { self.corners } else { 0 }, 12)
    }
}

fn draco(job: &Job<'_>) -> Error {
    job.unsupported("the mesh is compressed by Draco, which is not read; export it without compression")
}

/// The meshes of the scene, each with its node and the node's transform. A node has one parent, so each node is visited
/// once. Cycles thus end, and nothing repeats beyond the number of nodes.
fn places(
    job: &Job<'_>,
    root: &Root<'_>,
    pose: Option<&Pose>,
    notes: &mut Vec<String>,
) -> Result<Vec<(usize, DMat4, Option<usize>)>, Error> {
    if root.nodes.is_empty() {
        return Ok((0..root.meshes.len()).map(|mesh| (mesh, DMat4::IDENTITY, None)).collect());
    }
    let mut roots: Vec<usize> = match root.scene {
        Some(scene) => {
            let found = root.scenes.get(scene);
            let what = "there is no such scene; export the file again";
            found.ok_or_else(|| job.malformed(format!("scene {scene}"), what))?.nodes.clone()
        }
        None => root.scenes.iter().flat_map(|scene| &scene.nodes).copied().collect(),
    };
    if root.scenes.is_empty() {
        let mut is_child = vec![false; root.nodes.len()];
        for &child in root.nodes.iter().flat_map(|node| &node.children) {
            is_child.get_mut(child).into_iter().for_each(|is_child| *is_child = true);
        }
        roots = (0..root.nodes.len()).filter(|&node| !is_child[node]).collect();
    }
    let mut visited = vec![false; root.nodes.len()];
    let mut again = 0;
    let (mut skinned, mut instanced) = (false, false);
    let mut places = Vec::new();
    let mut stack: Vec<(usize, DMat4)> = roots.into_iter().rev().map(|node| (node, DMat4::IDENTITY)).collect();
    while let Some((index, world_from_parent)) = stack.pop() {
        let Some(node) = root.nodes.get(index) else {
            return Err(job.malformed(format!("node {index}"), "there is no such node; export the file again"));
        };
        if std::mem::replace(&mut visited[index], true) {
            again += 1;
            continue;
        }
        let world_from_node = world_from_parent * node.parent_from_node(pose.and_then(|pose| pose.node(index)));
        skinned |= node.mesh.is_some() && node.is_skinned();
        instanced |= node.mesh.is_some() && node.is_instanced();
        if let Some(mesh) = node.mesh {
            places.push((mesh as usize, world_from_node, Some(index)));
        }
        stack.extend(node.children.iter().rev().map(|&child| (child, world_from_node)));
    }
    if again > 0 && root.scene.is_some() {
        notes.push(format!("nodes are listed {again} times too often, which glTF forbids; each is shown once"));
    }
    if skinned {
        notes.push("the mesh has a skeleton; it is taken as modelled, not as posed".into());
    }
    if instanced {
        notes.push("the repeated instances of EXT_mesh_gpu_instancing are shown once".into());
    }
    Ok(places)
}
