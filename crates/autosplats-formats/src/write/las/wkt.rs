//! Well-known text for coordinate systems that a cloud knows by code.

use autosplats_cloud::Crs;

/// The system's own text, or that of its EPSG code. Point formats 6 to 10 state a system by text alone [LAS 1.4, 2.4].
/// `None` for systems without a code, and where the cloud's unit is not that of the code.
pub(in crate::write) fn well_known_text(crs: &Crs) -> Option<String> {
    if let Some(own) = &crs.wkt {
        return Some(own.clone());
    }
    let horizontal = crs_definitions::from_code(u16::try_from(crs.epsg?).ok()?)?.wkt;
    let unit = Crs::from_wkt(horizontal).unit?;
    if crs.unit.is_some_and(|own| own != unit) {
        return None;
    }
    let keys = crs.geotiff.as_ref();
    let code = keys.and_then(|keys| keys.heights());
    let heights = crs.vertical_unit.or_else(|| keys.and_then(|keys| keys.read().heights));
    let Some((heights, metres)) = heights.and_then(|unit| Some((unit, unit.metres()?))) else {
        return Some(horizontal.to_owned());
    };
    let authority = |code: u32| format!(r#",AUTHORITY["EPSG","{code}"]"#);
    let name = code.map_or("heights".to_owned(), |code| format!("EPSG:{code}"));
    Some(format!(
        r#"COMPD_CS["{} + {name}",{horizontal},VERT_CS["{name}",VERT_DATUM["unknown",2005],UNIT["{}",{metres}{}],AXIS["Up",UP]{}]]"#,
        Crs::from_wkt(horizontal).name.unwrap_or_default(),
        heights.name(),
        authority(heights.epsg().into()),
        code.map(authority).unwrap_or_default()
    ))
}

#[cfg(test)]
mod tests {
    use autosplats_cloud::{GeoKeys, Unit};

    use super::*;

    #[test]
    fn systems_known_by_code_have_text_that_says_the_same() {
        let feet = Some(Unit::Foot);
        for (epsg, unit, vertical_unit) in [
            (2994, feet, None),
            (2994, None, None),
            (32_617, Some(Unit::Metre), Some(Unit::UsSurveyFoot)),
            (4326, Some(Unit::Degree), Some(Unit::Metre)),
            (2154, Some(Unit::Metre), None),
        ] {
            let crs = Crs { epsg: Some(epsg), unit, vertical_unit, ..Crs::default() };
            let back = Crs::from_wkt(&well_known_text(&crs).expect("a text"));
            assert_eq!((back.epsg, back.vertical_unit), (Some(epsg), vertical_unit), "{epsg}");
            assert!(unit.is_none() || back.unit == unit, "{epsg}");
        }
    }

    #[test]
    fn what_a_code_does_not_say_has_none() {
        let known = |epsg, unit| well_known_text(&Crs { epsg, unit, ..Crs::default() });
        assert_eq!(known(None, Some(Unit::Metre)), None);
        assert_eq!(known(Some(2994), Some(Unit::Metre)), None, "its unit is the foot");
        assert_eq!(known(Some(70_000), None), None);
        assert_eq!(known(Some(5703), None), None, "a system of heights");
    }

    #[test]
    fn heights_of_keys_keep_their_code() {
        let keys = GeoKeys { directory: vec![1, 1, 0, 2, 3072, 0, 1, 26_917, 4096, 0, 1, 5703], ..GeoKeys::default() };
        let text = well_known_text(&keys.read().crs).expect("a text");
        assert!(text.contains(r#"AXIS["Up",UP],AUTHORITY["EPSG","5703"]"#), "{text}");
        assert_eq!(Crs::from_wkt(&text).epsg, Some(26_917));
    }
}
