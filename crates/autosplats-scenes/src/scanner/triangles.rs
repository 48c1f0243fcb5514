//! Intersects rays of a scanner with triangles.
//!
//! Rays form a regular grid of angles, so triangles are drawn into the grid as into an image. Each triangle tests the
//! rays in the window of a ball around it, and each ray keeps its nearest triangle. Large triangles are cut into parts
//! with small windows. A bounding volume hierarchy is slower: most rays hit nothing, and each frame would need a new
//! hierarchy.

use autosplats_cloud::{Contents, Error, check_memory};
use glam::DVec3;
use rayon::prelude::*;

use super::rays::{Rays, Window};

/// Bytes per triangle, including its windows.
const BYTES_PER_TRIANGLE: u64 = 300;

/// Number of rays in a window up to which a triangle is not cut.
const MAX_UNCUT_RAYS: u64 = 64;

/// Maximum number of times a triangle is halved. Parts left after that are so near that all rays may hit them.
const MAX_CUTS: u32 = 40;

/// Relative rounding error of the products in [`TriangleProducts`]. Larger than the slack on the weights of a hit.
const ROUNDING: f64 = 1e-8;

/// Number of triangles per parallel task.
const TASK_TRIANGLES: usize = 1 << 10;

/// The triangles with an area.
pub(super) struct Triangles(Vec<Triangle>);

struct Triangle {
    corners: [u32; 3],
    /// Corners relative to the cloud's origin.
    places: [DVec3; 3],
}

/// The triangle hit by a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Nearest {
    /// Distance along the ray; infinite without a hit.
    pub(super) distance: f64,
    index: u32,
}

impl Triangles {
    pub(super) fn new(mesh: &Contents) -> Result<Self, Error> {
        check_memory("the triangles that scanners see", mesh.triangles.len() as u64 * BYTES_PER_TRIANGLE)?;
        let positions = mesh.cloud.positions();
        let sound = |&corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|corner| positions.get(corner as usize).copied());
            let places = [a?, b?, c?].map(|position| DVec3::from(position.map(f64::from)));
            let [a, b, c] = places;
            let area = (b - a).cross(c - a).length();
            (area > 0.0 && area.is_finite()).then_some(Triangle { corners, places })
        };
        let triangles: Vec<Triangle> = mesh.triangles.iter().filter_map(sound).collect();
        if triangles.is_empty() { Err(Error::NoSurface) } else { Ok(Self(triangles)) }
    }

    /// The nearest triangle of each ray, row by row. `origin` is the cloud's.
    pub(super) fn nearest(&self, rays: &Rays, origin: DVec3) -> Vec<Nearest> {
        let eye = rays.eye - origin;
        let windows = self.0.par_chunks(TASK_TRIANGLES).enumerate().flat_map_iter(|(piece, triangles)| {
            let mut windows = Vec::new();
            for (index, triangle) in (piece * TASK_TRIANGLES..).zip(triangles) {
                let places = triangle.places.map(|place| rays.in_sensor(place - eye));
                let sides = TriangleProducts::new(index as u32, places);
                cover(rays, places, MAX_CUTS, &mut |window| windows.push((window, sides)));
            }
            windows
        });
        let windows: Vec<(Window, TriangleProducts)> = windows.collect();
        let none = Nearest { distance: f64::INFINITY, index: u32::MAX };
        rays.put_all(&windows, none, |nearest, sides, column, row| {
            let direction = rays.direction(column, row);
            if !sides.may_meet(direction) {
                return;
            }
            let index = sides.index;
            let Some((distance, _)) = self.0[index as usize].hit(eye, rays.in_world(direction)) else { return };
            // An edge belongs to two triangles. At equal distance the lower index wins, in any order.
            if (distance, index) < (nearest.distance, nearest.index) {
                *nearest = Nearest { distance, index };
            }
        })
    }

    /// Corners of the triangle that a ray hits, and the weights of the second and the third corner there.
    pub(super) fn place(&self, nearest: Nearest, eye: DVec3, direction: DVec3) -> ([u32; 3], [f64; 2]) {
        let triangle = &self.0[nearest.index as usize];
        (triangle.corners, triangle.hit(eye, direction).map_or([0.0; 2], |(_, weights)| weights))
    }
}

/// A triangle as seen from one scanner. Products shared by all rays rule out most rays with a few dot products.
#[derive(Clone, Copy)]
struct TriangleProducts {
    index: u32,
    /// Where a ray meets the plane, the second and third corner have the weights `second` and `third` divided by
    /// `plane`, each as a dot product with the ray's direction.
    plane: DVec3,
    second: DVec3,
    third: DVec3,
    /// Bound on the rounding error of these products.
    slack: f64,
}

impl TriangleProducts {
    /// Creates the products from corners in the scanner's frame.
    fn new(index: u32, [a, b, c]: [DVec3; 3]) -> Self {
        let (ab, ac) = (b - a, c - a);
        let (plane, second, third) = (ac.cross(ab), a.cross(ac), ab.cross(a));
        let slack = ROUNDING * (a.length_squared() + b.length_squared() + c.length_squared());
        Self { index, plane, second, third, slack }
    }

    /// Whether a ray needs the exact test.
    fn may_meet(&self, direction: DVec3) -> bool {
        let plane = self.plane.dot(direction);
        let least = -(self.slack + ROUNDING * plane.abs());
        // Seen from behind, all products have the opposite sign.
        let [second, third] = [self.second, self.third].map(|side| side.dot(direction) * plane.signum());
        second >= least && third >= least && second + third <= plane.abs() - least
    }
}

/// Finds windows that contain all rays that may hit a triangle, given in the scanner's frame.
fn cover(rays: &Rays, places: [DVec3; 3], cuts: u32, found: &mut impl FnMut(Window)) {
    let [a, b, c] = places;
    let middle = (a + b + c) / 3.0;
    let radius = places.map(|place| place.distance_squared(middle)).into_iter().fold(0.0, f64::max).sqrt();
    let Some(window) = rays.window(middle, radius) else { return };
    if window.len() <= MAX_UNCUT_RAYS || cuts == 0 {
        return found(window);
    }
    // Halves the longest side.
    let [ab, bc, ca] = [a.distance_squared(b), b.distance_squared(c), c.distance_squared(a)];
    let [a, b, c] = if ab >= bc && ab >= ca {
        [a, b, c]
    } else if bc >= ca {
        [b, c, a]
    } else {
        [c, a, b]
    };
    let between = 0.5 * (a + b);
    cover(rays, [a, between, c], cuts - 1, found);
    cover(rays, [between, b, c], cuts - 1, found);
}

impl Triangle {
    /// Distance along the ray, and the weights of the second and the third corner.
    fn hit(&self, origin: DVec3, direction: DVec3) -> Option<(f64, [f64; 2])> {
        let [a, b, c] = self.places;
        let (ab, ac, to_origin) = (b - a, c - a, origin - a);
        let across = direction.cross(ac);
        let determinant = ab.dot(across);
        let beside = to_origin.cross(ab);
        let [second, third, distance] =
            [to_origin.dot(across), direction.dot(beside), ac.dot(beside)].map(|part| part / determinant);
        // Written so that NaN misses. The slack closes the seams between triangles.
        let slack = 1e-9;
        let is_hit = second >= -slack && third >= -slack && second + third <= 1.0 + slack && distance > 0.0;
        is_hit.then_some((distance, [second, third]))
    }
}

#[cfg(test)]
mod tests {
    use autosplats_cloud::{PointCloud, Random};
    use glam::{DMat4, DQuat};

    use super::*;
    use crate::Scanner;

    /// Triangles of all sizes and shapes around the origin, some of them slivers, and one around everything.
    fn scattered() -> Contents {
        let mut random = Random::new(1, 0);
        let mut positions = vec![[-90.0, 20.0, -80.0], [90.0, 25.0, -80.0], [0.0, 30.0, 95.0]];
        for number in 0..300 {
            let at = random.direction() * (1.0 + 9.0 * random.unit());
            let size = [2.0, 0.05, 8.0][number % 3];
            let side = random.direction() * size;
            let width = if number % 5 == 0 { 1e-3 } else { 1.0 };
            positions.extend([at, at + side, at + random.direction() * size * width].map(|p| p.as_vec3().to_array()));
        }
        let count = positions.len() as u32 / 3;
        let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).chain([[0, 0, 1], [1, 2, 5000]]).collect();
        Contents { cloud: PointCloud::new(DVec3::ZERO, positions), triangles }
    }

    #[test]
    fn rays_end_where_a_look_at_all_triangles_says() -> Result<(), Error> {
        let triangles = Triangles::new(&scattered())?;
        assert_eq!(triangles.0.len(), 301, "those without area, or without corners, are left out");
        let mut hits = 0;
        for (number, view) in [[57.0, 43.0], [360.0, 180.0], [360.0, 30.0], [3.0, 2.0]].into_iter().enumerate() {
            // The second scanner stands inside a triangle, in its plane.
            let [a, b, c] = triangles.0[number].places;
            let eye = if number == 1 { (a + b + c) / 3.0 } else { DVec3::new(0.1, -0.2, 0.3) };
            let turn = DQuat::from_rotation_y(1.1 * number as f64);
            let world_from_sensor = DMat4::from_rotation_translation(turn, eye);
            let scanner =
                Scanner { world_from_sensor, columns: 120, rows: 90, fov_degrees: view, ..Scanner::default() };
            let rays = Rays::new(&scanner);
            let found = triangles.nearest(&rays, DVec3::ZERO);
            for (ray, nearest) in found.iter().enumerate() {
                let direction = rays.in_world(rays.direction(ray as u32 % 120, ray as u32 / 120));
                let all = triangles.0.iter().filter_map(|triangle| triangle.hit(eye, direction));
                let least = all.map(|(distance, _)| distance).fold(f64::INFINITY, f64::min);
                assert_eq!(nearest.distance, least, "ray {ray} of {view:?} degrees");
                hits += usize::from(least.is_finite());
            }
        }
        assert!(hits > 10_000 && hits < 40_000, "{hits} of 43200 rays met something");
        Ok(())
    }

    #[test]
    fn a_mesh_without_area_is_none() {
        let cloud = PointCloud::new(DVec3::ZERO, vec![[0.0; 3], [1.0; 3], [2.0; 3], [f32::NAN; 3]]);
        for triangles in [vec![], vec![[0, 1, 2], [0, 1, 3], [0, 0, 0]]] {
            let mesh = Contents { cloud: cloud.clone(), triangles };
            assert!(matches!(Triangles::new(&mesh), Err(Error::NoSurface)), "{:?}", mesh.triangles);
        }
    }
}
