//! The rays of a scanner, and which of them may hit something.

use std::{
    f64::consts::{FRAC_PI_2, TAU},
    ops::Range,
};

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::Scanner;

/// Minimum number of rows per thread, and maximum number of bands of rows.
const BAND_LIMITS: [usize; 2] = [16, 32];

/// Margins of windows against rounding: share of the angle between rays, angle in radians, share of a ball's radius.
const WINDOW_MARGINS: [f64; 3] = [1e-3, 1e-12, 1e-6];

/// Rays from one place, at equal steps of azimuth and elevation.
pub(super) struct Rays {
    pub(super) columns: u32,
    pub(super) rows: u32,
    /// Start of the rays, in world coordinates.
    pub(super) eye: DVec3,
    world_from_sensor: DMat3,
    sensor_from_world: DMat3,
    /// Sine and cosine of the azimuth of each column. `elevations` has those of the elevation of each row.
    azimuths: Vec<(f64, f64)>,
    elevations: Vec<(f64, f64)>,
    fov: [f64; 2],
}

/// Neighbouring rays: a range of rows and up to two ranges of columns, two where the window crosses the back.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Window {
    rows: Range<u32>,
    columns: [Range<u32>; 2],
}

impl Window {
    /// Number of rays.
    pub(super) fn len(&self) -> u64 {
        self.rows.len() as u64 * self.columns.iter().map(|run| run.len() as u64).sum::<u64>()
    }
}

impl Rays {
    pub(super) fn new(scanner: &Scanner) -> Self {
        let Scanner { columns, rows, fov_degrees, world_from_sensor, .. } = scanner;
        let angles = |degrees: f64, count: u32| {
            let part = move |index: u32| (f64::from(index) + 0.5) / f64::from(count) - 0.5;
            (0..count).map(move |index| (degrees * part(index)).to_radians().sin_cos()).collect()
        };
        let turn = DMat3::from_mat4(*world_from_sensor);
        Self {
            columns: *columns,
            rows: *rows,
            eye: world_from_sensor.w_axis.truncate(),
            world_from_sensor: turn,
            sensor_from_world: turn.inverse(),
            azimuths: angles(fov_degrees[0], *columns),
            elevations: angles(fov_degrees[1], *rows),
            fov: fov_degrees.map(f64::to_radians),
        }
    }

    /// Direction of a ray in the scanner's frame.
    pub(super) fn direction(&self, column: u32, row: u32) -> DVec3 {
        let ((sin, cos), (down, level)) = (self.azimuths[column as usize], self.elevations[row as usize]);
        DVec3::new(sin * level, down, cos * level)
    }

    /// Rotates a direction from the scanner's frame to the world.
    pub(super) fn in_world(&self, direction: DVec3) -> DVec3 {
        self.world_from_sensor * direction
    }

    /// Rotates an offset from the eye from the world to the scanner's frame.
    pub(super) fn in_sensor(&self, from_eye: DVec3) -> DVec3 {
        self.sensor_from_world * from_eye
    }

    /// Radius of the ball around a cube of half side 1 after the rotation to the scanner's frame.
    pub(super) fn cube_radius(&self) -> f64 {
        let DMat3 { x_axis, y_axis, z_axis } = self.sensor_from_world;
        let diagonals =
            [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]].map(|[a, b]| x_axis + a * y_axis + b * z_axis);
        diagonals.map(DVec3::length).into_iter().fold(0.0, f64::max)
    }

    /// The rays that may hit a ball, given in the scanner's frame; `None` if no ray does.
    pub(super) fn window(&self, centre: DVec3, radius: f64) -> Option<Window> {
        let distance = centre.length();
        let sine = radius * (1.0 + WINDOW_MARGINS[2]) / distance;
        // Written so that NaN gives all rays.
        if !(sine < 0.99) {
            return Some(Window { rows: 0..self.rows, columns: [0..self.columns, 0..0] });
        }
        let (reach, elevation) = (sine.asin(), (centre.y / distance).asin());
        let rows = self.run(1, elevation, reach);
        if rows.is_empty() {
            return None;
        }
        if elevation.abs() + reach > FRAC_PI_2 - WINDOW_MARGINS[1] {
            return Some(Window { rows, columns: [0..self.columns, 0..0] });
        }
        let (azimuth, reach) = (centre.x.atan2(centre.z), (sine / elevation.cos()).min(1.0).asin());
        let mut columns = [0.0, -TAU, TAU].map(|turn| self.run(0, azimuth + turn, reach));
        columns.sort_by_key(|run| run.is_empty());
        let [first, second, _] = columns;
        (!first.is_empty()).then_some(Window { rows, columns: [first, second] })
    }

    /// Columns (axis 0) or rows (axis 1) whose angles are within `reach` of `angle`, both in radians.
    fn run(&self, axis: usize, angle: f64, reach: f64) -> Range<u32> {
        let count = [self.columns, self.rows][axis];
        let per_radian = f64::from(count) / self.fov[axis];
        let (middle, reach) = (
            angle * per_radian + 0.5 * f64::from(count) - 0.5,
            (reach + WINDOW_MARGINS[1]) * per_radian + WINDOW_MARGINS[0],
        );
        // Clamps the ends to the first and the last ray.
        (middle - reach).ceil().max(0.0) as u32..((middle + reach).floor() + 1.0).clamp(0.0, f64::from(count)) as u32
    }

    /// Calls `put` for each ray with everything whose window contains the ray, in the order of `things`. Returns the
    /// results row by row from the top; a ray in no window keeps `start`.
    pub(super) fn put_all<I: Sync, T: Clone + Send>(
        &self,
        things: &[(Window, I)],
        start: T,
        put: impl Fn(&mut T, &I, u32, u32) + Sync,
    ) -> Vec<T> {
        let (columns, rows) = (self.columns as usize, self.rows as usize);
        let mut all = vec![start; columns * rows];
        let band = BAND_LIMITS[0].max(rows.div_ceil(BAND_LIMITS[1]));
        let mut by_band = vec![Vec::new(); rows.div_ceil(band)];
        for (index, (window, _)) in things.iter().enumerate() {
            let bands = window.rows.start as usize / band..(window.rows.end as usize).div_ceil(band);
            by_band[bands].iter_mut().for_each(|own| own.push(index));
        }
        all.par_chunks_mut(columns * band).zip(by_band).enumerate().for_each(|(index, (own, things_in))| {
            let first = (index * band) as u32;
            let end = first + (own.len() / columns) as u32;
            for (Window { rows, columns: runs }, thing) in things_in.into_iter().map(|index| &things[index]) {
                for row in rows.start.max(first)..rows.end.min(end) {
                    let own = &mut own[(row - first) as usize * columns..][..columns];
                    for column in runs.iter().cloned().flatten() {
                        put(&mut own[column as usize], thing, column, row);
                    }
                }
            }
        });
        all
    }
}

#[cfg(test)]
mod tests {
    use autosplats_cloud::Random;
    use glam::DMat4;

    use super::*;

    /// Whether a ray passes within `radius` of `centre`.
    fn meets(rays: &Rays, column: u32, row: u32, centre: DVec3, radius: f64) -> bool {
        let direction = rays.direction(column, row);
        let along = direction.dot(centre).max(0.0);
        (direction * along).distance(centre) <= radius
    }

    #[test]
    fn windows_have_all_rays_that_meet_a_ball_and_few_others() {
        let mut random = Random::new(5, 0);
        let views = [[57.0, 43.0], [360.0, 180.0], [360.0, 40.0], [0.1, 0.1]];
        for (view, number) in views.into_iter().flat_map(|view| (0..300).map(move |number| (view, number))) {
            let rays = Rays::new(&Scanner { columns: 37, rows: 23, fov_degrees: view, ..Scanner::default() });
            let towards = match number % 3 {
                // At the poles and straight behind as well.
                0 => DVec3::AXES[number % 9 / 3] * if number % 2 == 0 { 1.0 } else { -1.0 },
                1 => random.direction(),
                _ => rays.direction(number as u32 % 37, number as u32 % 23),
            };
            let centre = (towards + 1e-3 * random.direction()) * (0.5 + 3.0 * random.unit());
            let radius = centre.length() * random.unit().powi(3);
            let window = rays.window(centre, radius);
            let mut met = 0;
            for (row, column) in (0..23).flat_map(|row| (0..37).map(move |column| (row, column))) {
                if meets(&rays, column, row, centre, radius) {
                    met += 1;
                    let window = window.as_ref().expect("there is a window");
                    let inside = window.rows.contains(&row) && window.columns.iter().any(|run| run.contains(&column));
                    assert!(inside, "ray {column}, {row} of {view:?} degrees meets {radius} about {centre}");
                }
            }
            let len = window.map_or(0, |window| window.len());
            // Windows near a pole, or as large as the whole field of view, may hold many more rays.
            let small = radius < 0.3 * centre.length() && (centre.y / centre.length()).abs() < 0.5 && view[0] > 1.0;
            assert!(!small || len <= 2 * met + 100, "{len} rays where {met} meet {radius} about {centre}, {view:?}");
        }
    }

    #[test]
    fn directions_turn_with_the_scanner() {
        let pose = DMat4::from_rotation_translation(glam::DQuat::from_rotation_y(0.7), DVec3::new(1.0, 2.0, 3.0));
        let rays = Rays::new(&Scanner { world_from_sensor: pose, ..Scanner::default() });
        let direction = rays.direction(100, 200);
        assert!((direction.length() - 1.0).abs() < 1e-12, "of length one");
        let back = rays.in_sensor(rays.in_world(direction));
        assert!(back.abs_diff_eq(direction, 1e-12), "and back");
        assert!((rays.cube_radius() - 3.0_f64.sqrt()).abs() < 1e-12, "turning keeps lengths");
    }
}
