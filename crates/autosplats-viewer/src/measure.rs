//! Lengths, angles and areas between picked points, in words.
//!
//! All of it is in `f64` world coordinates. Where the heights of a coordinate system have another unit than its plane, both
//! become metres first, since there is no length across two units.

use autosplats::cloud::{
    Crs, Unit,
    glam::{DVec3, dvec3},
};

/// Measures in the unit of a coordinate system.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ruler {
    /// What coordinates are multiplied by.
    scale: DVec3,
    unit: Option<Unit>,
    /// Upward, of length 1.
    up: DVec3,
}

impl Ruler {
    /// A ruler for coordinates of `crs`, `up` being upward; without a unit where none is known or where it is no length.
    ///
    /// # Panics
    /// If `up` is zero.
    pub(crate) fn new(crs: &Crs, up: DVec3) -> Self {
        let Crs { unit, vertical_unit, .. } = crs;
        let metres = |unit: Unit| unit.metres();
        let (scale, unit) = match (unit.filter(|unit| *unit != Unit::Degree), *vertical_unit) {
            (Some(across), Some(along)) if along != across => match (metres(across), metres(along)) {
                (Some(across), Some(along)) => (dvec3(across, across, along), Some(Unit::Metre)),
                _ => (DVec3::ONE, None),
            },
            (unit, _) => (DVec3::ONE, unit),
        };
        Self { scale, unit, up: up.normalize() }
    }

    fn way(&self, from: DVec3, to: DVec3) -> DVec3 {
        (to - from) * self.scale
    }

    /// Length of the straight line.
    pub(crate) fn distance(&self, from: DVec3, to: DVec3) -> f64 {
        self.way(from, to).length()
    }

    /// Length of a line through points.
    pub(crate) fn polyline(&self, points: &[DVec3]) -> f64 {
        points.windows(2).map(|ends| self.distance(ends[0], ends[1])).sum()
    }

    /// How much higher `to` is than `from`.
    pub(crate) fn height_difference(&self, from: DVec3, to: DVec3) -> f64 {
        self.way(from, to).dot(self.up)
    }

    /// Distance as seen from above.
    pub(crate) fn horizontal_distance(&self, from: DVec3, to: DVec3) -> f64 {
        self.way(from, to).reject_from_normalized(self.up).length()
    }

    /// Angle at `corner` between the ways to the other two, in degrees; nothing if one of them is at the corner.
    pub(crate) fn angle(&self, from: DVec3, corner: DVec3, to: DVec3) -> Option<f64> {
        let (a, b) = (self.way(corner, from), self.way(corner, to));
        // Exact for small and for flat angles, where the cosine is not.
        let angle = a.cross(b).length().atan2(a.dot(b)).to_degrees();
        (a != DVec3::ZERO && b != DVec3::ZERO && angle.is_finite()).then_some(angle)
    }

    /// Area of a polygon of points; of its shadow on the plane that fits it best, if it is not flat.
    pub(crate) fn area(&self, corners: &[DVec3]) -> f64 {
        let Some(&first) = corners.first() else { return 0.0 };
        let doubled = corners.windows(2).map(|ends| self.way(first, ends[0]).cross(self.way(first, ends[1])));
        0.5 * doubled.sum::<DVec3>().length()
    }

    /// A length with its unit.
    pub(crate) fn length_text(&self, length: f64) -> String {
        with_unit(length, self.unit.map(symbol))
    }

    /// A length of few digits with its unit, as on a scale bar.
    pub(crate) fn round_text(&self, length: f64) -> String {
        let digits = if length < 1e-4 || length >= 1e7 { format!("{length:e}") } else { length.to_string() };
        self.unit.map_or_else(|| digits.clone(), |unit| format!("{digits} {}", symbol(unit)))
    }

    /// An area with its unit.
    pub(crate) fn area_text(&self, area: f64) -> String {
        with_unit(area, self.unit.map(|unit| format!("{}²", symbol(unit))))
    }
}

/// An angle in degrees.
pub(crate) fn angle_text(degrees: f64) -> String {
    format!("{degrees:.2}°")
}

fn symbol(unit: Unit) -> &'static str {
    match unit {
        Unit::Metre => "m",
        Unit::Millimetre => "mm",
        Unit::Foot => "ft",
        Unit::UsSurveyFoot => "ftUS",
        Unit::Degree => "°",
    }
}

/// Three decimals, as surveys have them, and more where they would be less than five digits.
fn with_unit(value: f64, unit: Option<impl std::fmt::Display>) -> String {
    let magnitude = value.abs().log10().floor();
    let decimals = if magnitude.is_finite() { (4.0 - magnitude).clamp(3.0, 12.0) as usize } else { 3 };
    let number = format!("{value:.decimals$}");
    unit.map_or_else(|| number.clone(), |unit| format!("{number} {unit}"))
}
