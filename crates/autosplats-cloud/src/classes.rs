//! Names of point classes.

/// Names of the ASPRS standard classes from 0 on (LAS 1.4 R15, table 17), and the words that choose them.
pub(crate) const CLASSES: [(&str, &str); 23] = [
    ("never classified", "never-classified"),
    ("unclassified", "unclassified"),
    ("ground", "ground"),
    ("low vegetation", "low-vegetation"),
    ("medium vegetation", "medium-vegetation"),
    ("high vegetation", "high-vegetation"),
    ("building", "building"),
    ("low point (noise)", "low-noise"),
    ("model key point", "model-key-point"),
    ("water", "water"),
    ("rail", "rail"),
    ("road surface", "road"),
    ("overlap", "overlap"),
    ("wire, guard", "wire-guard"),
    ("wire, conductor", "wire-conductor"),
    ("transmission tower", "tower"),
    ("wire connector", "wire-connector"),
    ("bridge deck", "bridge"),
    ("high noise", "high-noise"),
    ("overhead structure", "overhead-structure"),
    ("ignored ground", "ignored-ground"),
    ("snow", "snow"),
    ("temporal exclusion", "temporal-exclusion"),
];

/// Name of an ASPRS class (LAS 1.4 R15, table 17). `None` if `class` is no class of LAS.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::class_name;
///
/// assert_eq!(class_name(6.0), Some("building"));
/// assert_eq!(class_name(2.5), None);
/// ```
pub fn class_name(class: f64) -> Option<&'static str> {
    match class {
        _ if class.fract() != 0.0 => None,
        0.0..=22.0 => Some(CLASSES[class as usize].0),
        23.0..=63.0 => Some("reserved"),
        64.0..=255.0 => Some("user-defined"),
        _ => None,
    }
}
