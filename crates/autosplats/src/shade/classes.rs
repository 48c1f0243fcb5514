//! Colours of point classes.

use autosplats_cloud::RelativeValues;
use rayon::prelude::*;

/// sRGB colours of the ASPRS standard classes 0 to 18 (LAS 1.4, table 17), after their usual look on maps.
const ASPRS: [[u8; 3]; 19] = [
    [170, 170, 170], // never classified
    [200, 200, 200], // unclassified
    [166, 124, 82],  // ground
    [170, 210, 120], // low vegetation
    [105, 180, 85],  // medium vegetation
    [40, 130, 60],   // high vegetation
    [220, 110, 80],  // building
    [230, 60, 160],  // low point (noise)
    [240, 220, 80],  // model key point
    [70, 140, 220],  // water
    [140, 110, 160], // rail
    [120, 120, 130], // road surface
    [190, 190, 150], // overlap
    [250, 190, 60],  // wire: guard
    [250, 150, 40],  // wire: conductor
    [130, 90, 200],  // transmission tower
    [200, 160, 90],  // wire connector
    [90, 190, 200],  // bridge deck
    [255, 40, 90],   // high noise
];

/// A colour for each point by its class. Classes beyond the standard ones get hues far from those of neighbouring
/// classes.
pub(crate) fn class_colors(classes: &RelativeValues<'_>) -> Vec<[u8; 3]> {
    (0..classes.len()).into_par_iter().map(|index| class_color(classes.absolute(index))).collect()
}

fn class_color(class: f64) -> [u8; 3] {
    let class = class.clamp(0.0, 65535.0) as usize;
    ASPRS.get(class).copied().unwrap_or_else(|| {
        // Steps of the golden angle around the colour circle.
        let color = colorous::SINEBOW.eval_continuous((class as f64 * 0.618_034).fract());
        [color.r, color.g, color.b]
    })
}
