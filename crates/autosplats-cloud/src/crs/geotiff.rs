//! Keys of GeoTIFF headers, which LAS 1.0 to 1.3 use for coordinate systems.

use super::definition::{Crs, CrsDefinition, GeoKeys, Unit};

const MODEL: u16 = 1024;
const CITATION: u16 = 1026;
const GEOGRAPHIC: u16 = 2048;
const GEOGRAPHIC_CITATION: u16 = 2049;
const ANGULAR_UNIT: u16 = 2054;
const PROJECTED: u16 = 3072;
const PROJECTED_CITATION: u16 = 3073;
const LINEAR_UNIT: u16 = 3076;
const LINEAR_UNIT_SIZE: u16 = 3077;
/// Keys of heights: system, citation, datum, unit.
const VERTICAL: u16 = 4096;
const VERTICAL_UNIT: u16 = 4099;

/// Tag numbers of floating-point values and of texts.
const DOUBLES_TAG: u16 = 34736;
const ASCII_TAG: u16 = 34737;

/// Code of a user-defined system.
const USER_DEFINED: u16 = 32767;

impl GeoKeys {
    /// Decodes the contents of the three tags.
    pub fn from_bytes(directory: &[u8], doubles: &[u8], ascii: &[u8]) -> Self {
        Self {
            directory: directory.as_chunks().0.iter().map(|raw| u16::from_le_bytes(*raw)).collect(),
            doubles: doubles.as_chunks().0.iter().map(|raw| f64::from_le_bytes(*raw)).collect(),
            ascii: String::from_utf8_lossy(ascii).trim_end_matches('\0').to_owned(),
        }
    }

    fn keys(&self) -> impl Iterator<Item = [u16; 4]> {
        let count = self.directory.get(3).copied().unwrap_or(0);
        self.directory.as_chunks().0.iter().skip(1).take(count.into()).copied()
    }

    /// The value of a key that is stored in the directory itself.
    fn number(&self, key: u16) -> Option<u16> {
        self.keys().find(|[id, tag, ..]| (*id, *tag) == (key, 0)).map(|[.., value]| value)
    }

    fn double(&self, key: u16) -> Option<f64> {
        let [.., index] = self.keys().find(|[id, tag, ..]| (*id, *tag) == (key, DOUBLES_TAG))?;
        self.doubles.get(usize::from(index)).copied()
    }

    fn text(&self, key: u16) -> Option<String> {
        let [.., count, index] = self.keys().find(|[id, tag, ..]| (*id, *tag) == (key, ASCII_TAG))?;
        let start = usize::from(index);
        let bytes = self.ascii.as_bytes();
        let text = bytes.get(start..bytes.len().min(start + usize::from(count)))?;
        let text: String = String::from_utf8_lossy(text).chars().filter(|c| !c.is_control()).collect();
        let text = text.trim_matches(['|', ' ']).to_owned();
        (!text.is_empty()).then_some(text)
    }

    /// Decodes the coordinate system.
    pub fn read(&self) -> CrsDefinition {
        let code = |key| self.code(key);
        let model = self.number(MODEL);
        let projected = code(PROJECTED);
        let is_projected = model == Some(1) || projected.is_some();
        let geographic = model == Some(2) || model.is_none() && !is_projected && self.number(GEOGRAPHIC).is_some();
        let linear = || {
            let own = || self.double(LINEAR_UNIT_SIZE).and_then(Unit::of_metres);
            code(LINEAR_UNIT).and_then(Unit::of_epsg).or_else(own).or_else(|| projected.and_then(unit_of_utm))
        };
        let unit = if geographic {
            // The default angular unit is the degree.
            match code(ANGULAR_UNIT) {
                None => Some(Unit::Degree),
                Some(unit) => Unit::of_epsg(unit),
            }
        } else {
            linear()
        };
        let names = if geographic {
            [GEOGRAPHIC_CITATION, CITATION, PROJECTED_CITATION]
        } else {
            [PROJECTED_CITATION, CITATION, GEOGRAPHIC_CITATION]
        };
        let vertical = code(VERTICAL_UNIT).and_then(Unit::of_epsg).or_else(|| code(VERTICAL).and_then(unit_of_heights));
        let crs = Crs {
            name: names.into_iter().find_map(|key| self.text(key)),
            epsg: if geographic { code(GEOGRAPHIC) } else { projected },
            wkt: None,
            unit,
            vertical_unit: vertical.filter(|&vertical| Some(vertical) != unit),
            geotiff: Some(self.clone()),
        };
        CrsDefinition { crs, geocentric: model == Some(3), heights: vertical }
    }

    /// EPSG code of the system of heights.
    pub fn heights(&self) -> Option<u32> {
        self.code(VERTICAL)
    }

    /// The value of a key that is a code, unless it says that there is none.
    fn code(&self, key: u16) -> Option<u32> {
        self.number(key).filter(|&code| code != 0 && code != USER_DEFINED).map(u32::from)
    }

    /// The keys without those of heights.
    pub(super) fn without_heights(mut self) -> Self {
        let mut keys: Vec<[u16; 4]> = self.keys().collect();
        keys.retain(|[id, ..]| !(VERTICAL..=VERTICAL_UNIT).contains(id));
        if let Some(count) = self.directory.get_mut(3) {
            *count = keys.len() as u16;
            self.directory.truncate(4);
            self.directory.extend(keys.as_flattened());
        }
        self
    }

    /// Keys that state what is known of a coordinate system.
    pub fn describe(crs: &Crs) -> Self {
        let degrees = crs.unit == Some(Unit::Degree);
        let code = crs.epsg.and_then(|code| u16::try_from(code).ok()).unwrap_or(USER_DEFINED);
        let mut keys = vec![[MODEL, 0, 1, if degrees { 2 } else { 1 }], [1025, 0, 1, 1]];
        let name: String =
            crs.name.iter().flat_map(|name| name.chars()).filter(|&c| c.is_ascii() && c != '|').collect();
        let ascii = if name.is_empty() { name } else { name + "|" };
        if !ascii.is_empty() {
            keys.push([CITATION, ASCII_TAG, ascii.len().min(usize::from(u16::MAX)) as u16, 0]);
        }
        if degrees {
            keys.extend([[GEOGRAPHIC, 0, 1, code], [ANGULAR_UNIT, 0, 1, Unit::Degree.epsg()]]);
        } else {
            keys.push([PROJECTED, 0, 1, code]);
            keys.extend(crs.unit.map(|unit| [LINEAR_UNIT, 0, 1, unit.epsg()]));
        }
        keys.extend(crs.vertical_unit.map(|unit| [VERTICAL_UNIT, 0, 1, unit.epsg()]));
        let mut directory = vec![1, 1, 0, keys.len() as u16];
        directory.extend(keys.as_flattened());
        Self { directory, doubles: Vec::new(), ascii }
    }
}

/// Metre, if the code is that of a UTM zone on WGS 84, ETRS89 or NAD83.
fn unit_of_utm(epsg: u32) -> Option<Unit> {
    let utm = matches!(epsg, 32601..=32660 | 32701..=32760 | 25828..=25838 | 26901..=26923);
    utm.then_some(Unit::Metre)
}

/// Unit of the EPSG vertical systems in feet, and of the usual ones in metres.
fn unit_of_heights(epsg: u32) -> Option<Unit> {
    match epsg {
        // NAVD88, NGVD29 and their depths.
        6360 | 5702 | 6358 | 6359 => Some(Unit::UsSurveyFoot),
        // NAVD88, mean sea level, Cayman islands.
        8228 | 8050 | 8052 | 6130..=6132 => Some(Unit::Foot),
        // NAVD88, NGVD29, CGVD28 and 2013, EGM84, 96 and 2008, Newlyn, NAP, AHD.
        5703 | 7968 | 5713 | 6647 | 5798 | 5773 | 3855 | 5701 | 5709 | 5711 => Some(Unit::Metre),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_say_what_they_were_made_of() {
        let systems = [
            Crs {
                name: Some("somewhere".into()),
                epsg: Some(2994),
                unit: Some(Unit::Foot),
                vertical_unit: Some(Unit::Metre),
                ..Crs::default()
            },
            Crs { epsg: Some(4326), unit: Some(Unit::Degree), ..Crs::default() },
            Crs { name: Some("own".into()), unit: Some(Unit::UsSurveyFoot), ..Crs::default() },
        ];
        for crs in systems {
            let keys = GeoKeys::describe(&crs);
            let back = keys.read();
            assert_eq!(back.crs, Crs { geotiff: Some(keys), ..crs }, "what was known comes back");
        }
    }

    #[test]
    fn heights_are_known_by_unit_or_system_and_can_be_taken_away() {
        let keys = |vertical: &[[u16; 4]]| {
            let keys = [&[[1, 1, 0, 1 + vertical.len() as u16], [PROJECTED, 0, 1, 26917]], vertical].concat();
            GeoKeys { directory: keys.into_flattened(), ..GeoKeys::default() }
        };
        let (unit, system) = ([VERTICAL_UNIT, 0, 1, 9003], [VERTICAL, 0, 1, 8228]);
        for (vertical, heights) in [
            (&[unit][..], Some(Unit::UsSurveyFoot)),
            (&[system], Some(Unit::Foot)),
            (&[system, unit], Some(Unit::UsSurveyFoot)),
            (&[[VERTICAL, 0, 1, 5703]], Some(Unit::Metre)),
            (&[[VERTICAL, 0, 1, 5103]], None),
        ] {
            let keys = keys(vertical);
            assert_eq!(keys.read().heights, heights, "{vertical:?}");
            let without = keys.without_heights();
            assert_eq!((without.read().heights, without.directory[3]), (None, 1), "{vertical:?}");
            assert_eq!(without.read().crs.epsg, Some(26917), "{vertical:?}: the rest stays");
        }
        assert_eq!(GeoKeys::default().without_heights(), GeoKeys::default(), "no keys");
    }

    #[test]
    fn keys_of_any_kind_are_survived() {
        let directories: [&[u16]; 5] = [
            &[],
            &[1, 1, 0, 65535],
            &[1, 1, 0, 1, 1026, ASCII_TAG, 65535, 65535],
            &[1, 1, 0, 2, 3077, DOUBLES_TAG, 1, 9],
            &[1, 1, 0, 1, 3072],
        ];
        for directory in directories {
            let keys = GeoKeys { directory: directory.into(), doubles: vec![1.0], ascii: "aé|".into() };
            assert_eq!(keys.read().crs.unit, None, "{directory:?} says nothing");
        }
        let utm = GeoKeys { directory: vec![1, 1, 0, 1, PROJECTED, 0, 1, 32633], ..GeoKeys::default() };
        assert_eq!((utm.read().crs.epsg, utm.read().crs.unit), (Some(32633), Some(Unit::Metre)), "UTM is in metres");
    }
}
