//! One unit along all axes: degrees and feet to metres, and heights to the unit of x and y.

use glam::DVec3;
use rayon::prelude::*;

use crate::{
    Crs, PointCloud, Unit,
    identity::Identity,
    precision::{degree_origin, residual},
};

/// Semi-major axis of the WGS 84 ellipsoid, in metres.
const SEMI_MAJOR: f64 = 6_378_137.0;
/// Squared eccentricity of the WGS 84 ellipsoid.
const ECCENTRICITY_2: f64 = 6.694_379_990_141_316e-3;

impl PointCloud {
    /// Converts to metres if x and y are longitude and latitude in [degrees](Unit::Degree), and returns whether they
    /// were. The new x points east and y north from the cloud's middle. z is converted to metres and keeps its zero.
    ///
    /// Lengths are right at the cloud's middle. As on any flat map they are wrong elsewhere: 100 km north or south,
    /// east-west lengths are off by one or two percent. Residuals join the new positions. Sensors are moved but not
    /// rotated.
    pub fn to_local_metres(&mut self) -> bool {
        self.local_metres(None).is_some_and(|local| self.to_metres_on(&local))
    }

    /// The flat map about the cloud's middle, if x and y are longitude and latitude. With `beside`, the new map has the
    /// same centre, so that clouds on both maps keep their relative places.
    pub fn local_metres(&self, beside: Option<&LocalMetres>) -> Option<LocalMetres> {
        if self.crs.unit != Some(Unit::Degree) {
            return None;
        }
        let middle = beside.map_or_else(
            || degree_origin(self.len(), |i| self.world_position(i)),
            |LocalMetres { middle, .. }| *middle,
        );
        Some(LocalMetres::at(middle, self.crs.vertical_unit.and_then(Unit::metres).unwrap_or(1.0)))
    }

    /// Like [`to_local_metres`](Self::to_local_metres), on the given map.
    pub fn to_metres_on(&mut self, local: &LocalMetres) -> bool {
        if self.crs.unit != Some(Unit::Degree) {
            return false;
        }
        let count = self.len();
        let LocalMetres { middle, scale } = *local;
        let origin = DVec3::new(0.0, 0.0, (middle.z * scale.z).round());
        let positions: Vec<[f32; 3]> = (0..count)
            .into_par_iter()
            .map(|i| (local.metres(self.world_position(i)) - origin).as_vec3().to_array())
            .collect();
        for scan in &mut self.scans {
            scan.world_from_sensor.w_axis = local.metres(scan.position()).extend(1.0);
        }
        self.positions = positions;
        self.origin = origin;
        self.identity = Identity::default();
        self.residuals = None;
        self.resolution = self.resolution.map(|step| step * scale);
        let name = format!("metres about {:.6}° E, {:.6}° N", middle.x, middle.y);
        self.crs = Crs { name: Some(name), unit: Some(Unit::Metre), ..Crs::default() };
        true
    }

    /// Metres per unit of x, y and z, if they are lengths.
    pub fn metres_per_unit(&self) -> Option<DVec3> {
        let Crs { unit, vertical_unit, .. } = &self.crs;
        let across = (*unit)?.metres()?;
        Some(DVec3::new(across, across, vertical_unit.map_or(Some(across), Unit::metres)?))
    }

    /// Multiplies world coordinates by `scale`, in metres per unit. The coordinate system is dropped, because it has
    /// another unit. Sensors are moved but not rotated.
    pub fn scale_to_metres(&mut self, scale: DVec3) {
        self.scale(scale);
        self.crs = Crs { unit: Some(Unit::Metre), ..Crs::default() };
    }

    /// Converts heights to the unit of x and y, if both are lengths and differ. Returns whether they did. The
    /// coordinate system loses its heights, because they have another unit. Sensors are moved but not rotated.
    pub fn scale_heights(&mut self) -> bool {
        let Some(scale) = self.crs.height_scale() else { return false };
        self.scale(DVec3::new(1.0, 1.0, scale));
        self.crs = std::mem::take(&mut self.crs).horizontal();
        true
    }

    /// Multiplies world coordinates by `scale`. Residuals keep all digits.
    fn scale(&mut self, scale: DVec3) {
        let world = |i: usize| self.world_position(i) * scale;
        let origin = (self.origin * scale).round();
        let positions = (0..self.len()).into_par_iter().map(|i| (world(i) - origin).as_vec3().to_array()).collect();
        let residuals = (0..self.len()).into_par_iter().map(|i| residual(world(i) - origin)).collect();
        (self.origin, self.positions, self.residuals) = (origin, positions, Some(residuals));
        self.identity = Identity::default();
        for scan in &mut self.scans {
            scan.world_from_sensor.w_axis = (scan.position() * scale).extend(1.0);
        }
        self.resolution = self.resolution.map(|step| step * scale);
    }
}

/// Whether coordinates that state no unit look like longitude and latitude with heights in metres or feet: they are on
/// the globe, and their box is more than `ratio` times higher than wide.
pub fn looks_like_degrees([low, high]: [DVec3; 2], ratio: f64) -> bool {
    let size = high - low;
    let on_globe = low.x >= -180.0 && high.x <= 180.0 && low.y >= -90.0 && high.y <= 90.0;
    let edge = size.x.max(size.y);
    on_globe && edge > 0.0 && size.z > ratio * edge
}

/// A flat map that touches the ellipsoid at one place. It maps longitude and latitude to metres east and north of that
/// place, and heights to metres.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{Crs, PointCloud, Unit, glam::DVec3};
///
/// let crs = Crs { unit: Some(Unit::Degree), ..Crs::default() };
/// let places = vec![[0.0, 0.0, 0.0], [0.0, 0.001, 0.0]];
/// let mut cloud = PointCloud::new(DVec3::new(10.0, 50.0, 300.0), places).with_crs(crs);
/// let map = cloud.local_metres(None).ok_or("the cloud is not in degrees")?;
/// cloud.to_metres_on(&map);
/// let north = cloud.world_position(1).y - cloud.world_position(0).y;
/// assert!((north - 111.2).abs() < 0.1, "a thousandth of a degree is {north} m");
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalMetres {
    middle: DVec3,
    /// Metres per unit of x, y and z.
    scale: DVec3,
}

impl LocalMetres {
    /// The map about `middle`; `height` is the unit of z in metres.
    fn at(middle: DVec3, height: f64) -> Self {
        let (sin, cos) = middle.y.clamp(-90.0, 90.0).to_radians().sin_cos();
        let root = 1.0 - ECCENTRICITY_2 * sin * sin;
        let meridian = SEMI_MAJOR * (1.0 - ECCENTRICITY_2) / root.powf(1.5);
        let parallel = SEMI_MAJOR / root.sqrt() * cos;
        Self { middle, scale: DVec3::new(parallel.to_radians(), meridian.to_radians(), height) }
    }

    /// Converts a place in degrees to metres on the map.
    pub fn metres(&self, degrees: DVec3) -> DVec3 {
        // The short way round, also across the 180th meridian.
        let east = (degrees.x - self.middle.x + 180.0).rem_euclid(360.0) - 180.0;
        DVec3::new(east, degrees.y - self.middle.y, degrees.z) * self.scale
    }

    /// Converts metres on the map to a place in degrees. Longitudes may exceed 180 degrees.
    pub fn degrees(&self, metres: DVec3) -> DVec3 {
        metres / self.scale + self.middle.with_z(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Latitude, length of a degree of longitude and of latitude in metres, from published tables of WGS 84.
    const TABLE: [(f64, f64, f64); 4] = [
        (0.0, 111_320.0, 110_574.0),
        (30.0, 96_486.0, 110_852.0),
        (45.0, 78_847.0, 111_132.0),
        (60.0, 55_800.0, 111_412.0),
    ];

    fn cloud(points: &[[f64; 3]]) -> PointCloud {
        let origin = DVec3::from(points[0]);
        let positions = points.iter().map(|&point| (DVec3::from(point) - origin).as_vec3().to_array()).collect();
        let crs = Crs { unit: Some(Unit::Degree), vertical_unit: Some(Unit::Metre), ..Crs::default() };
        PointCloud::new(origin, positions).with_crs(crs)
    }

    #[test]
    fn a_degree_is_as_long_as_tables_say() {
        for (latitude, east, north) in TABLE {
            let step = 0.01;
            let mut cloud = cloud(&[[10.0, latitude, 5.0], [10.0 + step, latitude, 5.0], [10.0, latitude + step, 7.5]]);
            assert!(cloud.to_local_metres(), "degrees are converted");
            let way = |i: usize| cloud.world_position(i) - cloud.world_position(0);
            assert!((way(1).x / step - east).abs() < 12.0, "at {latitude}: {} is not {east}", way(1).x / step);
            assert!((way(2).y / step - north).abs() < 12.0, "at {latitude}: {} is not {north}", way(2).y / step);
            assert!((way(2).z - 2.5).abs() < 1e-6, "heights stay");
            assert_eq!(cloud.crs().unit, Some(Unit::Metre), "and says so");
        }
    }

    #[test]
    fn maps_are_shared_and_go_back() {
        let (mut first, mut second) = (cloud(&[[10.0, 50.0, 5.0], [10.01, 50.01, 5.0]]), cloud(&[[10.03, 50.0, 7.0]]));
        let local = first.local_metres(None).expect("in degrees");
        for index in 0..2 {
            let place = first.world_position(index);
            let back = local.degrees(local.metres(place));
            // A few steps of `f64` at 180.
            assert!(back.abs_diff_eq(place, 1e-13), "{place} comes back as {back}");
        }
        assert_eq!(second.local_metres(Some(&local)), Some(local), "a neighbour on the same map");
        assert!(first.to_metres_on(&local) && second.to_metres_on(&local), "both are converted");
        let way = second.world_position(0) - first.world_position(0);
        assert!((way - DVec3::new(2151.0, 0.0, 2.0)).abs().max_element() < 1.0, "keeps its place: {way}");
        assert!(!first.to_metres_on(&local) && first.local_metres(None).is_none(), "metres stay");
    }

    #[test]
    fn heights_get_the_unit_of_the_plane() {
        let survey = 1200.0 / 3937.0;
        for (unit, vertical_unit, scale) in [
            (Unit::Metre, Unit::UsSurveyFoot, survey),
            (Unit::Metre, Unit::Foot, 0.3048),
            (Unit::Foot, Unit::Metre, 1.0 / 0.3048),
            (Unit::Foot, Unit::UsSurveyFoot, survey / 0.3048),
        ] {
            let crs = Crs { unit: Some(unit), vertical_unit: Some(vertical_unit), ..Crs::default() };
            let mut scaled = cloud(&[[5e5, 5e6, 1000.0], [5e5 + 1.0, 5e6, 1001.0]]).with_crs(crs);
            let before = [0, 1].map(|i| scaled.world_position(i));
            assert!(scaled.scale_heights(), "{unit:?}, {vertical_unit:?}");
            for (i, before) in before.into_iter().enumerate() {
                let expected = before * DVec3::new(1.0, 1.0, scale);
                assert!(
                    scaled.world_position(i).abs_diff_eq(expected, 1e-9),
                    "{unit:?}, {vertical_unit:?}: every digit"
                );
            }
            assert_eq!(scaled.crs(), &Crs { unit: Some(unit), ..Crs::default() }, "one unit");
            assert!(!scaled.scale_heights(), "once");
        }
        let mut degrees = cloud(&[[8.5, 47.0, 400.0]]);
        assert!(!degrees.scale_heights(), "no length is a degree");
    }

    #[test]
    fn other_units_and_places() {
        let mut feet = cloud(&[[0.0, 0.0, 0.0], [0.0, 0.0, 100.0]]);
        feet.crs.vertical_unit = Some(Unit::Foot);
        feet.to_local_metres();
        assert!((feet.world_position(1).z - feet.world_position(0).z - 30.48).abs() < 1e-5, "feet to metres");
        let mut date_line = cloud(&[[179.999, 0.0, 0.0], [-179.999, 0.0, 0.0]]);
        date_line.to_local_metres();
        let way = date_line.world_position(1) - date_line.world_position(0);
        // One `f32` step at 360 degrees is 3 m.
        assert!((way.x - 222.6).abs() < 3.5, "across the 180th meridian: {way}");
        let mut metres = cloud(&[[1.0, 2.0, 3.0]]).with_crs(Crs::default());
        let before = metres.clone();
        assert!(!metres.to_local_metres() && metres == before, "a cloud in no degrees stays as it is");
    }
}
