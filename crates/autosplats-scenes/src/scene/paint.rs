//! Colours of materials, as functions of position only. They contain no light.

use glam::DVec3;

/// A material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Paint {
    /// One colour, sRGB 0 to 255.
    Plain(u8, u8, u8),
    /// A colour with soft variations, `grain` metres across.
    Mottled { rgb: [u8; 3], grain: f64, depth: f32 },
    /// Weathered marble with veins, darker in the low parts.
    Marble,
    /// Squared stone in courses along x and z.
    Courses,
    /// Chequered floor tiles.
    Tiles,
    /// Window panes in a pattern of colours.
    Glass,
    /// Grass with paths of dry earth.
    Grass,
}

impl Paint {
    /// Colour at a place, sRGB 0 to 1.
    pub(super) fn rgb(self, p: DVec3) -> [f32; 3] {
        match self {
            Self::Plain(r, g, b) => bytes([r, g, b]),
            Self::Mottled { rgb, grain, depth } => scale(bytes(rgb), 1.0 + depth * (2.0 * clouds(p, grain) - 1.0)),
            Self::Marble => {
                let bend = 5.0 * f64::from(clouds(p, 0.35));
                let vein = (9.0 * (p.x + 0.6 * p.z) + 7.0 * p.y + bend).sin().abs() as f32;
                let vein = 1.0 - 0.13 * (1.0 - vein).powi(5);
                scale(mix([0.80, 0.77, 0.71], [0.88, 0.86, 0.82], clouds(p, 0.12)), vein)
            }
            Self::Courses => {
                let course = (p.z / 0.42).floor();
                let block = ((p.x + p.y) / 0.85 + 0.5 * course).floor();
                let tone = lattice(block as i64, course as i64, if p.y > 0.0 { 7 } else { 3 });
                let base = mix([0.72, 0.66, 0.56], [0.80, 0.75, 0.66], tone);
                scale(base, 0.95 + 0.1 * clouds(p, 0.25))
            }
            Self::Tiles => {
                // Rotated by 45 degrees, with a line between tiles.
                let (u, v) = ((p.x + p.y) / 0.72, (p.x - p.y) / 0.72);
                let (iu, iv) = (u.floor(), v.floor());
                let edge = (u - iu - 0.5).abs().max((v - iv - 0.5).abs());
                let tone = 0.93 + 0.12 * lattice(iu as i64, iv as i64, 1);
                let dark = (iu as i64 + iv as i64).rem_euclid(2) == 0;
                let base = if dark { [0.42, 0.36, 0.34] } else { [0.78, 0.73, 0.66] };
                scale(if edge > 0.475 { [0.58, 0.54, 0.49] } else { base }, tone)
            }
            Self::Glass => {
                let cell = |s: f64| (s / 0.28).floor() as i64;
                let across = if p.y.abs() > 4.0 { p.x.abs() } else { p.y.abs() };
                let pick = lattice(cell(across), cell(p.z), 9);
                let tone = 0.9 + 0.2 * lattice(cell(across), cell(p.z), 4);
                let base = match (pick * 6.0) as u32 {
                    0 | 1 => [0.20, 0.33, 0.62],
                    2 => [0.62, 0.20, 0.22],
                    3 => [0.80, 0.64, 0.26],
                    4 => [0.28, 0.50, 0.40],
                    _ => [0.45, 0.56, 0.74],
                };
                scale(base, tone)
            }
            Self::Grass => {
                let patch = clouds(p * DVec3::new(1.0, 1.0, 0.0), 1.3);
                let fine = clouds(p, 0.09);
                let base = mix([0.44, 0.50, 0.27], [0.60, 0.56, 0.36], patch);
                scale(base, 0.9 + 0.2 * fine)
            }
        }
    }
}

fn bytes(rgb: [u8; 3]) -> [f32; 3] {
    rgb.map(|c| f32::from(c) / 255.0)
}

fn mix(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t)
}

fn scale(rgb: [f32; 3], by: f32) -> [f32; 3] {
    rgb.map(|c| c * by)
}

/// Value noise, 0 to 1, with features `grain` metres across.
fn clouds(p: DVec3, grain: f64) -> f32 {
    let q = p / grain;
    let base = q.floor();
    let t = (q - base).as_vec3();
    let t = t * t * (3.0 - 2.0 * t);
    let [x, y, z] = [base.x as i64, base.y as i64, base.z as i64];
    let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let edge = |j: i64, k: i64| lerp(lattice(x, y + j, z + k), lattice(x + 1, y + j, z + k), t.x);
    lerp(lerp(edge(0, 0), edge(1, 0), t.y), lerp(edge(0, 1), edge(1, 1), t.y), t.z)
}

/// A fixed pseudo-random number from 0 to 1 for a lattice point.
pub(super) fn lattice(x: i64, y: i64, z: i64) -> f32 {
    let mut h = (x as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ (y as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F)
        ^ (z as u64).wrapping_mul(0x1656_67B1_9E37_79F9);
    h = (h ^ (h >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (h >> 40) as f32 / (1 << 24) as f32
}
