//! A triangle in space.

use glam::{DVec2, DVec3};

/// Corners in space. The curve runs from the first to the second.
#[derive(Clone, Copy)]
pub(super) struct Triangle(pub(super) [DVec3; 3]);

impl Triangle {
    pub(super) fn area(&self) -> f64 {
        let [a, b, c] = self.0;
        0.5 * (b - a).cross(c - a).length()
    }

    pub(super) fn at(&self, second: f32, third: f32) -> DVec3 {
        let [a, b, c] = self.0;
        a + (b - a) * f64::from(second) + (c - a) * f64::from(third)
    }

    /// Weights of the second and third corner at the place of the triangle nearest to `point`.
    pub(super) fn nearest(&self, point: DVec3) -> DVec2 {
        let [a, b, c] = self.0;
        let (ab, ac, ap) = (b - a, c - a, point - a);
        let (bb, bc, cc) = (ab.dot(ab), ab.dot(ac), ac.dot(ac));
        let (pb, pc) = (ap.dot(ab), ap.dot(ac));
        let within = bb * cc - bc * bc;
        let inner = DVec2::new(cc * pb - bc * pc, bb * pc - bc * pb) / within;
        if inner.x >= 0.0 && inner.y >= 0.0 && inner.x + inner.y <= 1.0 {
            return inner;
        }
        let clamp = |t: f64| if t > 0.0 { t.min(1.0) } else { 0.0 };
        let on_ab = DVec2::new(clamp(pb / bb), 0.0);
        let on_ac = DVec2::new(0.0, clamp(pc / cc));
        let along = clamp((point - b).dot(c - b) / (c - b).length_squared());
        let on_bc = DVec2::new(1.0 - along, along);
        let distance = |weights: &DVec2| (ab * weights.x + ac * weights.y - ap).length_squared();
        let nearest = [on_ab, on_ac, on_bc].into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.unwrap_or(DVec2::splat(1.0 / 3.0))
    }
}
