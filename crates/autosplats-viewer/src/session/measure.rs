//! Lengths, angles and areas between picked points, and their texts.
//!
//! All values are in `f64` world coordinates. If heights and plane coordinates have different units, both are converted
//! to metres first, since a length has one unit.

use autosplats::cloud::{
    Crs, Unit,
    glam::{DVec3, dvec3},
};

/// Measures in the unit of a coordinate system.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ruler {
    /// Factors from coordinates to `unit`.
    scale: DVec3,
    unit: Option<Unit>,
    /// Unit vector upward.
    up: DVec3,
}

impl Ruler {
    /// A ruler for coordinates of `crs`. There is no unit if none is known, if it is degrees, or if mixed units cannot
    /// be converted.
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

    /// Length of a polyline.
    pub(crate) fn polyline(&self, points: &[DVec3]) -> f64 {
        points.windows(2).map(|ends| self.distance(ends[0], ends[1])).sum()
    }

    /// Height of `to` above `from`.
    pub(crate) fn height_difference(&self, from: DVec3, to: DVec3) -> f64 {
        self.way(from, to).dot(self.up)
    }

    /// Distance as seen from above.
    pub(crate) fn horizontal_distance(&self, from: DVec3, to: DVec3) -> f64 {
        self.way(from, to).reject_from_normalized(self.up).length()
    }

    /// Angle at `corner` between the lines to the other two points, degrees; `None` if one of them is at the corner.
    pub(crate) fn angle(&self, from: DVec3, corner: DVec3, to: DVec3) -> Option<f64> {
        let (a, b) = (self.way(corner, from), self.way(corner, to));
        // Accurate for small and flat angles, where the arc cosine is not.
        let angle = a.cross(b).length().atan2(a.dot(b)).to_degrees();
        (a != DVec3::ZERO && b != DVec3::ZERO && angle.is_finite()).then_some(angle)
    }

    /// Area of a polygon; if it is not flat, the area of its projection onto the plane perpendicular to its vector
    /// area.
    pub(crate) fn area(&self, corners: &[DVec3]) -> f64 {
        let Some(&first) = corners.first() else { return 0.0 };
        let doubled = corners.windows(2).map(|ends| self.way(first, ends[0]).cross(self.way(first, ends[1])));
        0.5 * doubled.sum::<DVec3>().length()
    }

    /// A length with its unit.
    pub(crate) fn length_text(&self, length: f64) -> String {
        with_unit(length, self.unit.map(symbol))
    }

    /// Symbol of the unit, if there is one.
    pub(crate) fn unit(&self) -> Option<&'static str> {
        self.unit.map(symbol)
    }

    /// A length of few digits with its unit, for a scale bar.
    pub(crate) fn round_text(&self, length: f64) -> String {
        let digits = if (1e-4..1e7).contains(&length) { length.to_string() } else { format!("{length:e}") };
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

/// Three decimals, as usual in surveys; more if the number would otherwise have fewer than five digits.
fn with_unit(value: f64, unit: Option<impl std::fmt::Display>) -> String {
    let magnitude = value.abs().log10().floor();
    let decimals = if magnitude.is_finite() { (4.0 - magnitude).clamp(3.0, 12.0) as usize } else { 3 };
    let number = format!("{value:.decimals$}");
    unit.map_or_else(|| number.clone(), |unit| format!("{number} {unit}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A place so far from the origin that the step of `f32` is half a metre.
    const FAR: DVec3 = DVec3::new(512_000.0, 5_400_000.0, 300.0);

    fn crs(unit: Option<Unit>, vertical_unit: Option<Unit>) -> Crs {
        Crs { unit, vertical_unit, ..Crs::default() }
    }

    fn near(found: f64, wanted: f64) {
        // Some steps of f64 at 5e6.
        assert!((found - wanted).abs() < 1e-8, "{found} is not {wanted}");
    }

    #[test]
    fn lengths() {
        let ruler = Ruler::new(&Crs::default(), DVec3::Z * 9.0);
        let [a, b, c] = [FAR, FAR + dvec3(3.0, 4.0, 12.0), FAR + dvec3(3.0, 4.0, 2.0)];
        near(ruler.distance(a, b), 13.0);
        near(ruler.horizontal_distance(a, b), 5.0);
        near(ruler.height_difference(a, b), 12.0);
        near(ruler.height_difference(b, c), -10.0);
        near(ruler.polyline(&[a, b, c]), 23.0);
        assert_eq!([ruler.polyline(&[]), ruler.polyline(&[a])], [0.0; 2], "of no way");
        let tilted = Ruler::new(&Crs::default(), DVec3::NEG_Y);
        near(tilted.height_difference(a, b), -4.0);
        near(tilted.horizontal_distance(a, b), 3.0_f64.hypot(12.0));
    }

    #[test]
    fn angles() {
        let ruler = Ruler::new(&Crs::default(), DVec3::Z);
        for degrees in [0.0, 1e-3, 30.0, 90.0, 179.999, 180.0] {
            let (sin, cos) = f64::to_radians(degrees).sin_cos();
            let angle = ruler.angle(FAR + 2.0 * DVec3::X, FAR, FAR + 5.0 * dvec3(cos, sin, 0.0)).expect("an angle");
            // A step of f64 at 5e6, seen over two metres.
            assert!((angle - degrees).abs() < 1e-7, "{angle} is not {degrees}");
        }
        assert_eq!(ruler.angle(FAR, FAR, FAR + 1.0), None, "no way, no angle");
        assert_eq!(ruler.angle(FAR, DVec3::NAN, FAR + 1.0), None, "no place");
        assert_eq!(angle_text(45.0), "45.00°", "with a sign");
    }

    #[test]
    fn areas() {
        let ruler = Ruler::new(&Crs::default(), DVec3::Z);
        let wall = [dvec3(0.0, 0.0, 0.0), dvec3(3.0, 4.0, 0.0), dvec3(3.0, 4.0, 2.0), dvec3(0.0, 0.0, 2.0)];
        near(ruler.area(&wall.map(|corner| FAR + corner)), 10.0);
        let notched = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0]];
        near(ruler.area(&notched.map(|[x, y]| FAR + dvec3(x, y, 0.0))), 10.0);
        assert_eq!([ruler.area(&[]), ruler.area(&[FAR]), ruler.area(&[FAR, FAR + 1.0])], [0.0; 3], "of no polygon");
    }

    #[test]
    fn units_are_those_of_the_coordinates() {
        let text = |unit, vertical: Option<Unit>| {
            let ruler = Ruler::new(&crs(unit, vertical), DVec3::Z);
            ruler.length_text(ruler.distance(DVec3::ZERO, dvec3(3.0, 4.0, 0.0)))
        };
        assert_eq!(text(None, None), "5.0000", "nothing is known");
        assert_eq!(text(Some(Unit::Metre), None), "5.0000 m", "metres");
        assert_eq!(text(Some(Unit::Foot), Some(Unit::Foot)), "5.0000 ft", "feet");
        assert_eq!(text(Some(Unit::UsSurveyFoot), None), "5.0000 ftUS", "other feet");
        assert_eq!(text(Some(Unit::Degree), None), "5.0000", "no length");
        assert_eq!(text(Some(Unit::Foot), Some(Unit::Metre)), "1.5240 m", "feet and metres are metres");
        let mixed = Ruler::new(&crs(Some(Unit::Metre), Some(Unit::Foot)), DVec3::Z);
        near(mixed.height_difference(DVec3::ZERO, 100.0 * DVec3::Z), 30.48);
        assert_eq!(mixed.area_text(12.0), "12.000 m²", "areas");
    }

    #[test]
    fn digits_are_as_many_as_make_sense() {
        let ruler = Ruler::new(&Crs::default(), DVec3::Z);
        let texts = [1_234_567.891_6, 123.456_78, 12.345_67, 1.234_567, 0.012_345_67, 1.5e-9, 0.0, -0.25];
        let wanted = ["1234567.892", "123.457", "12.346", "1.2346", "0.012346", "0.000000001500", "0.000", "-0.25000"];
        assert_eq!(texts.map(|length| ruler.length_text(length)), wanted, "three decimals, five digits");
        assert_eq!(ruler.length_text(f64::NAN), "NaN", "no number");
    }
}
