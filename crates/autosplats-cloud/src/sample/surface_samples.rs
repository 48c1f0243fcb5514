//! Sampled points of a mesh, which follow its vertices.

use glam::DVec3;
use rayon::prelude::*;

use super::triangle::Triangle;
use crate::{Error, Field, FieldValues, PointCloud, Progress};

/// Places of points on the triangles of a mesh. The points follow the vertices if these move.
pub struct SurfaceSamples {
    /// Number of vertices of the mesh.
    pub(super) vertices: usize,
    /// Corners of the triangles that have an area, in the curve's order.
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) places: Vec<Place>,
}

impl SurfaceSamples {
    /// Whether the places were computed on a mesh with this number of vertices.
    pub fn fits(&self, vertices: usize) -> bool {
        self.vertices == vertices
    }

    /// The points on the mesh whose vertices are at the positions of `cloud`.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` says so.
    ///
    /// # Panics
    /// If `cloud` has fewer points than the mesh had vertices.
    pub fn on(&self, cloud: &PointCloud, progress: &dyn Progress) -> Result<PointCloud, Error> {
        progress.tick(0.8)?;
        let world = |place: &Place| {
            let corner = |corner: usize| DVec3::from(cloud.positions()[corner].map(f64::from));
            Triangle(self.corners(place).map(corner)).at(place.second, place.third).as_vec3().to_array()
        };
        let positions = self.places.par_iter().map(world).collect();
        let mut sampled = PointCloud::new(cloud.origin(), positions).with_crs(cloud.crs().clone());
        sampled.axes = cloud.axes();
        if let Some(colors) = cloud.colors() {
            let mixed = |place: &Place| {
                let corners = self.corners(place).map(|corner| colors[corner]);
                [0, 1, 2].map(|c| (place.mix(corners.map(|color| color[c].into())) + 0.5) as u8)
            };
            sampled.colors = Some(self.places.par_iter().map(mixed).collect());
        }
        for field in cloud.fields() {
            progress.tick(0.9)?;
            sampled.fields.push(Field { name: field.name.clone(), values: self.field(&field.values) });
        }
        normalize_normals(&mut sampled);
        Ok(sampled)
    }

    fn corners(&self, place: &Place) -> [usize; 3] {
        self.triangles[place.triangle as usize].map(|corner| corner as usize)
    }

    fn field(&self, values: &FieldValues) -> FieldValues {
        let mixed = |value: &(dyn Fn(usize) -> f64 + Sync), place: &Place| place.mix(self.corners(place).map(value));
        macro_rules! nearest {
            ($($variant:ident),*) => {
                match values {
                    FieldValues::F32(v) => FieldValues::F32(
                        self.places.par_iter().map(|place| mixed(&|i| v[i].into(), place) as f32).collect(),
                    ),
                    FieldValues::F64(v) => FieldValues::F64(
                        self.places.par_iter().map(|place| mixed(&|i| v[i], place)).collect(),
                    ),
                    $(FieldValues::$variant(v) => FieldValues::$variant(
                        self.places.par_iter().map(|place| v[self.corners(place)[place.nearest()]]).collect(),
                    ),)*
                }
            };
        }
        nearest!(U8, I8, U16, I16, U32, I32, U64, I64)
    }
}

/// A place on the surface: an index into `SurfaceSamples::triangles`, and the weights of the second and third corner.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub(super) triangle: u32,
    pub(super) second: f32,
    pub(super) third: f32,
}

impl Place {
    fn weights(&self) -> [f64; 3] {
        let (second, third) = (f64::from(self.second), f64::from(self.third));
        [(1.0 - second - third).max(0.0), second, third]
    }

    fn mix(&self, [a, b, c]: [f64; 3]) -> f64 {
        let [first, second, third] = self.weights();
        // A corner of weight zero may be NaN.
        let part = |weight: f64, value: f64| if weight > 0.0 { weight * value } else { 0.0 };
        part(first, a) + part(second, b) + part(third, c)
    }

    /// Index of the corner with the largest weight.
    fn nearest(&self) -> usize {
        let [first, second, third] = self.weights();
        if first >= second && first >= third {
            0
        } else if second >= third {
            1
        } else {
            2
        }
    }
}

/// Makes interpolated normals unit vectors, because interpolation shortens them.
fn normalize_normals(cloud: &mut PointCloud) {
    let find =
        |cloud: &PointCloud, name: &str| cloud.fields.iter().position(|field| field.name.eq_ignore_ascii_case(name));
    for names in [["NormalX", "NormalY", "NormalZ"], ["nx", "ny", "nz"], ["normal_x", "normal_y", "normal_z"]] {
        let [Some(x), Some(y), Some(z)] = names.map(|name| find(cloud, name)) else { continue };
        let value = |axis: usize, i: usize| cloud.fields[axis].values.get(i);
        let unit = |i: usize| DVec3::new(value(x, i), value(y, i), value(z, i)).normalize_or_zero();
        let units: Vec<DVec3> = (0..cloud.len()).into_par_iter().map(unit).collect();
        for (axis, index) in [x, y, z].into_iter().enumerate() {
            match &mut cloud.fields[index].values {
                FieldValues::F32(v) => v.iter_mut().zip(&units).for_each(|(v, unit)| *v = unit[axis] as f32),
                FieldValues::F64(v) => v.iter_mut().zip(&units).for_each(|(v, unit)| *v = unit[axis]),
                _ => {}
            }
        }
    }
}
