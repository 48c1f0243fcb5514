//! Point clouds for tests: synthetic, seeded and named, around the world's origin and about two units wide.

#![allow(dead_code, reason = "unit tests and tests of the public API use different ones")]

use autosplats_cloud::glam::{DQuat, DVec3};

/// Reproducible random numbers in `f32`.
pub(crate) struct Random(autosplats_cloud::Random);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(autosplats_cloud::Random::from_state(seed))
    }

    pub(crate) fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    /// Within 0..1.
    pub(crate) fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }

    /// Within -1..1.
    pub(crate) fn signed(&mut self) -> f32 {
        2.0 * self.unit() - 1.0
    }

    /// Normally distributed with standard deviation 1.
    pub(crate) fn gaussian(&mut self) -> f32 {
        let [u, v] = [1.0 - self.unit(), self.unit()];
        (-2.0 * u.ln()).sqrt() * (std::f32::consts::TAU * v).cos()
    }

    pub(crate) fn below(&mut self, end: usize) -> usize {
        self.0.modulo(end)
    }

    /// A unit vector; all directions are equally likely.
    pub(crate) fn direction(&mut self) -> [f32; 3] {
        loop {
            let v = [self.signed(), self.signed(), self.signed()];
            let length = v.iter().map(|c| c * c).sum::<f32>().sqrt();
            if (0.1..1.0).contains(&length) {
                return v.map(|c| c / length);
            }
        }
    }

    pub(crate) fn shuffle<T>(&mut self, list: &mut [T]) {
        for last in (1..list.len()).rev() {
            list.swap(last, self.below(last + 1));
        }
    }
}

/// Position of the test cameras.
pub(crate) const EYE: DVec3 = DVec3::new(0.5, -0.8, -4.0);

/// Centre of the ball in a [`room`], in the room's axes.
const BALL: DVec3 = DVec3::new(-0.3, 0.2, 2.0);

pub(crate) type Positions = Vec<[f32; 3]>;

/// `count` points of a square patch. `at` maps its coordinates, -1 to 1, to space.
fn patch(seed: u64, count: usize, at: impl Fn(f32, f32) -> [f32; 3]) -> Positions {
    let mut random = Random::new(seed);
    (0..count).map(|_| at(random.signed(), random.signed())).collect()
}

/// Normal of [`plane`] towards the eye, not normalised.
pub(crate) const PLANE_NORMAL: DVec3 = DVec3::new(0.3, -0.2, -1.0);

pub(crate) fn plane(count: usize) -> Positions {
    patch(1, count, |x, y| [x, y, 0.3 * x - 0.2 * y])
}

/// A dense square, and a few points in its plane beyond a border, further away than points are apart. Returns the index
/// of the first of these.
pub(crate) fn beyond_a_border() -> (Positions, u32) {
    let mut random = Random::new(5);
    let mut positions: Positions = (0..40_000).map(|_| [0.5 * random.signed(), 0.5 * random.signed(), 0.0]).collect();
    let surface = positions.len() as u32;
    positions.extend((0..60).map(|_| [0.53 + 0.07 * random.unit(), 0.5 * random.signed(), 0.0]));
    (positions, surface)
}

/// A sheet with waves of this height before a wall forty times as dense. Returns the index of the wall's first point.
pub(crate) fn before_a_wall(waves: f32) -> (Positions, u32) {
    let mut random = Random::new(23);
    let mut square = |half: f32, per_unit: f32| -> Vec<[f32; 2]> {
        let count = (per_unit * 4.0 * half * half) as usize;
        (0..count).map(|_| [half * random.signed(), half * random.signed()]).collect()
    };
    let sheet = square(1.5, 100.0).into_iter().map(|[x, y]| [x, y, waves * (6.0 * x).sin()]);
    let mut positions: Positions = sheet.collect();
    let sheet = positions.len() as u32;
    positions.extend(square(2.5, 4000.0).into_iter().map(|[x, y]| [x, y, 1.0]));
    (positions, sheet)
}

pub(crate) fn sphere(count: usize) -> Positions {
    let mut random = Random::new(2);
    (0..count).map(|_| random.direction()).collect()
}

/// Two planes, one close behind the other.
pub(crate) fn two_layers(count: usize) -> Positions {
    let mut layers = patch(3, count / 2, |x, y| [x, y, 0.0]);
    layers.extend(patch(4, count - count / 2, |x, y| [x, y, 0.25]));
    layers
}

/// Two planes that meet at a right angle.
pub(crate) fn edge(count: usize) -> Positions {
    patch(5, count, |x, y| [x, y, x.abs()])
}

/// Two halves of a plane, one 0.1 before the other.
pub(crate) fn step(count: usize) -> Positions {
    patch(1, count, |x, y| [x, y, if x > 0.0 { -0.1 } else { 0.0 }])
}

/// A plane with a density that rises towards one side.
pub(crate) fn density_ramp(count: usize) -> Positions {
    patch(6, count, |x, y| [x * x * x, y, 0.1 * y])
}

/// Each point of a plane three times.
pub(crate) fn duplicates(count: usize) -> Positions {
    plane(count / 3).iter().flat_map(|&point| [point; 3]).collect()
}

pub(crate) fn behind(count: usize) -> Positions {
    let eye = EYE.as_vec3();
    sphere(count).iter().map(|p| [p[0] + 2.0 * eye.x, p[1] + 2.0 * eye.y, p[2] + 2.0 * eye.z]).collect()
}

/// Groups of 1 to 16 points, far from each other.
pub(crate) fn clumps(count: usize) -> Positions {
    let mut random = Random::new(7);
    let mut points = Vec::new();
    while points.len() < count {
        let center = [random.signed(), random.signed(), random.signed()];
        for _ in 0..1 + random.below(16) {
            points.push(center.map(|c| c + 0.02 * random.signed()));
        }
    }
    points
}

pub(crate) fn line(count: usize) -> Positions {
    patch(8, count, |t, _| [t, 0.6 * t, -0.4 * t])
}

/// Isolated points along the line of sight, in a space far deeper than wide.
pub(crate) fn outliers(count: usize) -> Positions {
    let mut random = Random::new(9);
    let forward = (EYE / EYE.z).as_vec3();
    let mut point = || {
        let depth = 40.0 * random.unit();
        [random.signed() + depth * forward.x, random.signed() + depth * forward.y, depth]
    };
    (0..count).map(|_| point()).collect()
}

/// Adds noise with standard deviation `sigma` along each axis.
pub(crate) fn noisy(mut points: Positions, sigma: f32) -> Positions {
    let mut random = Random::new(10);
    points.iter_mut().flatten().for_each(|c| *c += sigma * random.gaussian());
    points
}

/// A sphere with every other point moved by `apart` along x, like two misaligned scans.
pub(crate) fn misfit(count: usize, apart: f32) -> Positions {
    let mut points = sphere(count);
    points.iter_mut().step_by(2).for_each(|point| point[0] += apart);
    points
}

/// A surface of hills and hollows.
pub(crate) fn bumpy(count: usize) -> Positions {
    patch(11, count, |x, y| [x, y, 0.15 * (5.0 * x).sin() * (4.0 * y).cos()])
}

/// A floor that leads away from the eye to three times the depth of its near end. Noise grows with the square of depth,
/// as with depth cameras: `sigma` at depth 1.
pub(crate) fn receding(count: usize, sigma: f32) -> Positions {
    let eye = EYE.as_vec3();
    let forward = eye / eye.z;
    let mut random = Random::new(12);
    let mut point = || {
        // Spacing grows with depth, as in a scan.
        let depth = 4.0 * 3f32.powf(random.unit());
        let [x, y] = [0.25 * depth * random.signed(), 0.8 - 0.4 * (depth - 4.0)];
        let point = [eye.x + forward.x * depth + x, eye.y + forward.y * depth + y, eye.z + depth];
        point.map(|c| c + sigma * depth * depth * random.gaussian())
    };
    (0..count).map(|_| point()).collect()
}

/// All clouds by name, most with about `count` points.
pub(crate) fn all(count: usize) -> Vec<(&'static str, Positions)> {
    vec![
        ("plane", plane(count)),
        ("sphere", sphere(count)),
        ("two layers", two_layers(count)),
        ("edge", edge(count)),
        ("density ramp", density_ramp(count)),
        ("one point", plane(1)),
        ("four points", plane(4)),
        ("duplicates", duplicates(count)),
        ("behind", behind(count)),
        ("clumps", clumps(count / 4)),
        ("line", line(count / 4)),
        ("outliers", outliers(count / 4)),
    ]
}

/// Rotation from the axes of [`room`]'s tilted camera to those of the room.
pub(crate) fn askew() -> DQuat {
    DQuat::from_rotation_z(0.2) * DQuat::from_rotation_x(0.15) * DQuat::from_rotation_y(-0.1)
}

/// A room with a ball, seen by a depth camera at the origin, in the camera's axes, with `width` columns. `measured`
/// maps true to measured depths. In the room's axes the floor is at y = 1, one wall at x = 1.5, another at z = 8.
pub(crate) fn room(width: usize, mut measured: impl FnMut(f32) -> f32) -> Positions {
    let height = width / 4 * 3;
    let mut points = Vec::with_capacity(width * height);
    for pixel in 0..width * height {
        let [column, row] = [pixel % width, pixel / width].map(|at| at as f32);
        let [x, y] = [(column - width as f32 / 2.0) / width as f32, (row - height as f32 / 2.0) / width as f32];
        let way = askew() * DVec3::new(x.into(), y.into(), 1.0);
        let until = |at: f64, way: f64| if way > 0.0 { at / way } else { f64::INFINITY };
        // The ball's radius is 0.5.
        let [a, b, c] = [way.length_squared(), way.dot(BALL), BALL.length_squared() - 0.25];
        let root = b * b - a * c;
        let ball = if root > 0.0 { (b - root.sqrt()) / a } else { f64::INFINITY };
        let depth = until(1.0, way.y).min(until(1.5, way.x)).min(until(8.0, way.z)).min(ball);
        let depth = measured(depth as f32);
        points.push([x * depth, y * depth, depth]);
    }
    points
}

/// A depth rounded to a Kinect's steps, which are `step` wide at depth 1.
pub(crate) fn stepped(depth: f32, step: f32) -> f32 {
    1.0 / (step * (1.0 / (step * depth)).round())
}

/// Number of beams of the lidar of [`swept`], all below the horizon.
pub(crate) const BEAMS: usize = 24;

/// Rings of a spinning lidar one unit above the ground y = 1, up to a wall z = 4. Rings are ten to thirty times as far
/// apart as their points. `measured` maps true to measured distances.
pub(crate) fn swept(mut measured: impl FnMut(f32) -> f32) -> Positions {
    const TURN: usize = 3000;
    let one = |ray: usize| {
        let [beam, step] = [ray / TURN, ray % TURN];
        let (sin, cos) = (beam_radians(beam)).sin_cos();
        let azimuth = std::f32::consts::TAU * step as f32 / TURN as f32;
        let way = [cos * azimuth.sin(), sin, cos * azimuth.cos()];
        let distance = (1.0 / way[1]).min(if way[2] > 0.0 { 4.0 / way[2] } else { f32::INFINITY });
        let distance = measured(distance);
        way.map(|along| along * distance)
    };
    (0..BEAMS * TURN).map(one).collect()
}

/// Angle of a beam of [`swept`] below the horizon.
pub(crate) fn beam_radians(beam: usize) -> f32 {
    0.1 + 0.025 * beam as f32
}
