//! Coordinate system of a LAS file.

use autosplats_cloud::{Crs, CrsDefinition, GeoKeys, Unit, looks_like_degrees, shown_number};

use super::{super::units::LOOKS_LIKE_DEGREES, header::Header, records::Records};
use crate::las;

/// Coarsest scale of coordinates that may be degrees: 1e-5 degrees are about a metre.
const COARSEST_DEGREE: f64 = 1e-5;

/// How much higher than wide a box in degrees looks, with a scale as fine as degrees need: a relief of a thousandth.
const DEGREES_RATIO: f64 = 100.0;

/// The coordinate system, and notes about it.
pub(super) struct CoordinateSystem {
    pub(super) crs: Crs,
    pub(super) notes: Vec<String>,
}

/// Reads the coordinate system. Well-known text takes precedence; GeoTIFF keys add what the text does not state.
pub(super) fn of(header: &Header, records: &Records<'_>) -> CoordinateSystem {
    let mut notes = Vec::new();
    let data = |id| records.find(las::PROJECTION, id).map(|record| record.data);
    let wkt = data(las::WKT).map(|text| CrsDefinition::from_wkt(&String::from_utf8_lossy(text)));
    let keys = data(las::GEO_KEYS).map(|directory| {
        let (doubles, ascii) = (data(las::GEO_DOUBLES), data(las::GEO_ASCII));
        GeoKeys::from_bytes(directory, doubles.unwrap_or_default(), ascii.unwrap_or_default()).read()
    });
    let CrsDefinition { mut crs, geocentric, .. } = match (wkt, keys) {
        (Some(wkt), Some(keys)) => {
            if let (Some(text), Some(key)) = (wkt.crs.epsg, keys.crs.epsg)
                && text != key
            {
                notes.push(format!("the coordinate system is EPSG:{text} by its text and EPSG:{key} by its keys"));
            }
            let mut crs = wkt.crs;
            crs.epsg = crs.epsg.or(keys.crs.epsg);
            crs.name = crs.name.or(keys.crs.name);
            crs.unit = crs.unit.or(keys.crs.unit);
            // Text of a horizontal system does not describe heights.
            let heights = wkt.heights.or(keys.heights);
            crs.vertical_unit = heights.filter(|&unit| Some(unit) != crs.unit);
            crs.geotiff = keys.crs.geotiff;
            CrsDefinition { crs, geocentric: wkt.geocentric, heights }
        }
        (found, other) => found.or(other).unwrap_or_default(),
    };

    let bounds = header.sane_bounds().filter(|_| header.points > 0);
    if let Some([low, high]) = bounds {
        let distance = ((low + high) / 2.0).length();
        // The range covers the bottom of the sea and the height of aeroplanes.
        if geocentric && !(6.3e6..6.5e6).contains(&distance) {
            let metres = format!("{} km", shown_number((distance / 1000.0).round()));
            notes.push(format!(
                "the coordinate system is geocentric, but the points are {metres} from its origin, not 6400"
            ));
        }
        if crs.unit.is_none()
            && crs.epsg.is_none()
            && finely_scaled(header)
            && looks_like_degrees([low, high], DEGREES_RATIO)
        {
            crs.unit = Some(Unit::Degree);
            notes.push(LOOKS_LIKE_DEGREES.into());
        }
    }
    CoordinateSystem { crs, notes }
}

fn finely_scaled(header: &Header) -> bool {
    header.scale.abs().truncate().max_element() <= COARSEST_DEGREE
}
