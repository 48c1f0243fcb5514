//! The solids of bodies, each as a signed distance bound.
//!
//! A bound `f` is zero on the surface, negative inside, and changes by at most one metre per metre. Pruning, tracing
//! and sampling rely on this property: there is no surface within `|f(p)|` metres of `p`.

use glam::{DMat3, DVec2, DVec3};

/// Pose of a solid: a position and three orthonormal axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    pub(super) origin: DVec3,
    pub(super) axes: DMat3,
}

impl Placement {
    /// A pose with axes parallel to the world's.
    pub(super) const fn at(origin: DVec3) -> Self {
        Self { origin, axes: DMat3::IDENTITY }
    }

    /// A pose with local z along `up` and local x as close to `side` as possible.
    pub(super) fn along(origin: DVec3, up: DVec3, side: DVec3) -> Self {
        let z = up.normalize();
        let fallback = z.any_orthonormal_vector();
        let x = (side - z * side.dot(z)).try_normalize().unwrap_or(fallback);
        Self { origin, axes: DMat3::from_cols(x, z.cross(x), z) }
    }

    fn local(&self, p: DVec3) -> DVec3 {
        let p = p - self.origin;
        DVec3::new(self.axes.x_axis.dot(p), self.axes.y_axis.dot(p), self.axes.z_axis.dot(p))
    }

    /// World position of a local position.
    pub(super) fn world(&self, p: DVec3) -> DVec3 {
        self.origin + self.axes * p
    }
}

/// A rotation, translation and uniform scale, applied to solids when they are added to a body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Similarity {
    pub(super) placement: Placement,
    pub(super) scale: f64,
}

impl Similarity {
    pub(super) const IDENTITY: Self = Self { placement: Placement::at(DVec3::ZERO), scale: 1.0 };

    fn point(&self, p: DVec3) -> DVec3 {
        self.placement.world(p * self.scale)
    }

    fn placement(&self, at: Placement) -> Placement {
        Placement { origin: self.point(at.origin), axes: self.placement.axes * at.axes }
    }
}

/// Two spheres and the cone tangent to both.
#[derive(Clone, Copy, Debug)]
pub(super) struct RoundCone {
    a: DVec3,
    axis: DVec3,
    radius_a: f64,
    radius_b: f64,
    length2: f64,
    inverse_length2: f64,
    slope: f64,
    slant2: f64,
}

impl RoundCone {
    fn new(a: DVec3, b: DVec3, radius_a: f64, radius_b: f64) -> Self {
        let axis = if a.distance_squared(b) > 1e-12 { b - a } else { DVec3::Z * 1e-6 };
        // If one sphere contained the other, no cone would be tangent to both.
        let limit = 0.95 * axis.length();
        let radius_b = radius_b.max(radius_a - limit);
        let radius_a = radius_a.max(radius_b - limit);
        let length2 = axis.length_squared();
        let slope = radius_a - radius_b;
        let slant2 = length2 - slope * slope;
        Self { a, axis, radius_a, radius_b, length2, inverse_length2: 1.0 / length2, slope, slant2 }
    }

    fn distance(&self, p: DVec3) -> f64 {
        let p = p - self.a;
        let y = p.dot(self.axis);
        let z = y - self.length2;
        // All terms are scaled by `length2`, so that one division by it suffices.
        let x2 = (p * self.length2 - self.axis * y).length_squared();
        let y2 = y * y.abs() * self.length2;
        let z2 = z * z.abs() * self.length2;
        let k = self.slope * self.slope.abs() * x2;
        if self.slant2 * z2 > k {
            (x2 + z2.abs()).sqrt() * self.inverse_length2 - self.radius_b
        } else if self.slant2 * y2 < k {
            (x2 + y2.abs()).sqrt() * self.inverse_length2 - self.radius_a
        } else {
            ((x2 * self.slant2 * self.inverse_length2).sqrt() + y * self.slope) * self.inverse_length2 - self.radius_a
        }
    }
}

/// A solid.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    RoundCone(RoundCone),
    /// `radii` are the half axes along the axes of the pose.
    Ellipsoid {
        at: Placement,
        radii: DVec3,
    },
    /// `half` are half the sides. Edges are rounded by `round` without growing the block.
    Block {
        at: Placement,
        half: DVec3,
        round: f64,
    },
    /// Axis along local z. Edges are rounded by `round` without growing the cylinder.
    Cylinder {
        at: Placement,
        radius: f64,
        half_height: f64,
        round: f64,
    },
    /// A torus with its axis along local z.
    Ring {
        at: Placement,
        major: f64,
        minor: f64,
    },
    /// The half space opposite to `normal`.
    HalfSpace {
        normal: DVec3,
        offset: f64,
    },
    /// A passage along local y over the floor z = 0, `half_length` to either side of the origin. Walls stand at x =
    /// ±`half_width` up to `spring`. Above them are two arcs of `radius`, which form a pointed arch if `radius` exceeds
    /// `half_width`.
    Passage {
        at: Placement,
        half_width: f64,
        spring: f64,
        radius: f64,
        half_length: f64,
    },
    /// A rolling meadow: a disc of `radius` about the origin, half a metre thick.
    Meadow {
        radius: f64,
    },
}

impl Shape {
    pub(super) fn cone(a: DVec3, b: DVec3, radius_a: f64, radius_b: f64) -> Self {
        Self::RoundCone(RoundCone::new(a, b, radius_a, radius_b))
    }

    pub(super) fn ball(center: DVec3, radius: f64) -> Self {
        Self::Ellipsoid { at: Placement::at(center), radii: DVec3::splat(radius) }
    }

    /// The same solid in the space that `by` maps to.
    pub(super) fn mapped(self, by: &Similarity) -> Self {
        let s = by.scale;
        match self {
            Self::RoundCone(RoundCone { a, axis, radius_a, radius_b, .. }) => {
                Self::cone(by.point(a), by.point(a + axis), radius_a * s, radius_b * s)
            }
            Self::Ellipsoid { at, radii } => Self::Ellipsoid { at: by.placement(at), radii: radii * s },
            Self::Block { at, half, round } => Self::Block { at: by.placement(at), half: half * s, round: round * s },
            Self::Cylinder { at, radius, half_height, round } => Self::Cylinder {
                at: by.placement(at),
                radius: radius * s,
                half_height: half_height * s,
                round: round * s,
            },
            Self::Ring { at, major, minor } => Self::Ring { at: by.placement(at), major: major * s, minor: minor * s },
            Self::HalfSpace { normal, offset } => {
                let normal = by.placement.axes * normal;
                Self::HalfSpace { normal, offset: offset * s + normal.dot(by.placement.origin) }
            }
            Self::Passage { at, half_width, spring, radius, half_length } => Self::Passage {
                at: by.placement(at),
                half_width: half_width * s,
                spring: spring * s,
                radius: radius * s,
                half_length: half_length * s,
            },
            Self::Meadow { radius } => Self::Meadow { radius: radius * s },
        }
    }

    /// Signed distance bound at `p`.
    #[inline]
    pub(super) fn distance(&self, p: DVec3) -> f64 {
        match self {
            Self::RoundCone(cone) => cone.distance(p),
            Self::Ellipsoid { at, radii } => {
                // Distance in the space where the ellipsoid is the unit ball, times the least radius: never too large.
                ((at.local(p) / *radii).length() - 1.0) * radii.min_element()
            }
            Self::Block { at, half, round } => {
                let q = at.local(p).abs() - (*half - DVec3::splat(*round));
                q.max(DVec3::ZERO).length() + q.max_element().min(0.0) - round
            }
            Self::Cylinder { at, radius, half_height, round } => {
                let p = at.local(p);
                let q = DVec2::new(p.truncate().length() - radius, p.z.abs() - half_height) + DVec2::splat(*round);
                q.max(DVec2::ZERO).length() + q.max_element().min(0.0) - round
            }
            Self::Ring { at, major, minor } => {
                let p = at.local(p);
                DVec2::new(p.truncate().length() - major, p.z).length() - minor
            }
            Self::HalfSpace { normal, offset } => normal.dot(p) - offset,
            Self::Passage { at, half_width, spring, radius, half_length } => {
                let p = at.local(p);
                let (x, z) = (p.x.abs(), p.z - spring);
                let across =
                    if z < 0.0 { x - half_width } else { DVec2::new(x + radius - half_width, z).length() - radius };
                across.max(-p.z).max(p.y.abs() - half_length)
            }
            Self::Meadow { radius } => {
                // The slope of the waves is below 0.16; the factor restores a change of at most one metre per metre.
                let top = (p.z - meadow_height(p.x, p.y)) * 0.98;
                top.max(-0.5 - p.z).max(p.truncate().length() - radius)
            }
        }
    }
}

/// Height of the meadow in metres: flat to about a hand's width.
pub(super) fn meadow_height(x: f64, y: f64) -> f64 {
    0.06 * ((0.9 * x + 0.5 * y).sin() + (1.1 * y - 0.4 * x + 1.0).sin())
        + 0.012 * ((3.1 * x + 0.7).sin() * (2.7 * y).cos())
}
