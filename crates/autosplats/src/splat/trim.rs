//! Trim: takes off the rim of tails that splats leave around a silhouette.
//!
//! # How it works
//! The outer half of a splat closes the gaps between scattered points, but where there are no more points it sticks out.
//! The inner half, the *core*, ends about where the surface does. A pixel that lies in no core stays if it is closed in:
//! if on one of eight lines through it there is a core in both directions, at most five times as far as the splat there
//! reaches, and nothing empty in between; or if there is no core around it at all.
// Differs from the paper: it draws what its splats cover, and silhouettes are as much too wide as splats are.

use super::tiled_index;
use crate::camera::View;

/// Weight of a splat from which a pixel belongs to its core: the kernel at 0.42 splat radii.
pub(super) const CORE_WEIGHT: f32 = 0.68;
/// Sum of weights from which a pixel belongs to the surface whatever its heaviest splat: inside a surface the sum is
/// about 2, at its border 1. Where many points fall into each pixel, the nearest one may lie at the same edge of every
/// pixel, and no pixel's centre in a core.
pub(super) const INNER_WEIGHT: f32 = 1.3;
/// How far lines go, in reaches of the splat.
pub(super) const FURTHEST: f32 = 5.0;
/// Strides that a line takes in the reach of a splat wider than so many pixels.
pub(super) const STRIDES_PER_REACH: f32 = 6.0;
/// Longest stride, in pixels, that stops where those of neighbours do.
pub(super) const LONGEST_ALIGNED: isize = 3;
/// Added to how far lines go: what is a pixel wide has cores here and there along it.
pub(super) const LEAST_REACH_PX: usize = 2;
/// Directions of the eight lines.
const LINES: [[isize; 2]; 8] = [[1, 0], [0, 1], [1, 1], [1, -1], [2, 1], [1, 2], [2, -1], [1, -2]];

/// What trimming knows of a pixel: [`EMPTY`], [`CORE`], or how far its heaviest splat reaches in pixels.
pub(super) type Rim = f32;
const EMPTY: Rim = 0.0;
const CORE: Rim = -1.0;

/// The rim of a pixel by its sum of weights, and the weight and the reach of its heaviest splat.
pub(super) fn rim(weight: f32, heaviest: f32, reach_px: f32) -> Rim {
    if heaviest >= CORE_WEIGHT || weight >= INNER_WEIGHT {
        CORE
    } else if heaviest > 0.0 {
        reach_px
    } else {
        EMPTY
    }
}

/// Whether pixel (x, y) is a tail that nothing closes in. `rims` is stored tile by tile.
pub(super) fn sticks_out(rims: &[Rim], x: usize, y: usize, view: &View) -> bool {
    let [width, height] = [view.width as usize, view.height as usize];
    let own = rims[tiled_index(width, x, y)];
    if own == EMPTY || own == CORE {
        return false;
    }
    // Wide splats have wide cores, which strides do not miss; so the work per pixel is bounded whatever the density.
    let stride = (own / STRIDES_PER_REACH).max(1.0) as isize;
    let strides = (FURTHEST * own) as usize / stride as usize + LEAST_REACH_PX;
    let meets_core = |[dx, dy]: [isize; 2]| {
        // Lines of neighbours stop at the same places: if one saw what the next strides over, borders would be dotted. Not
        // with long strides, which would make rays of what all of them miss.
        let (along, place) = if dx.abs() == 1 { (dx, x as isize) } else { (dy, y as isize) };
        let beyond = place % stride;
        let first = match (stride > LONGEST_ALIGNED, along > 0 || beyond == 0) {
            (true, _) => stride,
            (false, true) => stride - beyond,
            (false, false) => beyond,
        };
        for at in 0..strides as isize {
            let distance = first + at * stride;
            let (x, y) = match (x.checked_add_signed(dx * distance), y.checked_add_signed(dy * distance)) {
                (Some(x), Some(y)) if x < width && y < height => (x, y),
                // Beyond the picture the surface goes on.
                _ => return true,
            };
            match rims[tiled_index(width, x, y)] {
                EMPTY => return false,
                CORE => return true,
                _ => {}
            }
        }
        false
    };
    // What has no core anywhere around, as a point alone, sticks out of nothing.
    let mut sticks_out = false;
    for [dx, dy] in LINES {
        match (meets_core([dx, dy]), meets_core([-dx, -dy])) {
            (true, true) => return false,
            (false, false) => {}
            _ => sticks_out = true,
        }
    }
    sticks_out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Projection};
    use autosplats_cloud::glam::DVec3;

    /// The pixels of a drawing (`#` core, `+` tail that reaches 2 pixels, `*` one that reaches 12, blank empty) that trimming
    /// takes off, as `x`.
    fn trimmed(drawing: &[&str]) -> Vec<String> {
        let camera = Camera {
            eye: DVec3::ZERO,
            look_at: DVec3::X,
            up: DVec3::Z,
            projection: Projection::OrthographicHeight(1.0),
        };
        let size = [drawing[0].len() as u32, drawing.len() as u32];
        let view = camera.view(DVec3::ZERO, size).expect("a view");
        let mut rims = vec![EMPTY; super::super::TILE_AREA];
        for (y, row) in drawing.iter().enumerate() {
            for (x, pixel) in row.bytes().enumerate() {
                rims[tiled_index(size[0] as usize, x, y)] = match pixel {
                    b'#' => CORE,
                    b'+' => 2.0,
                    b'*' => 12.0,
                    _ => EMPTY,
                };
            }
        }
        let row = |(y, row): (usize, &&str)| {
            let pixel = |(x, pixel): (usize, char)| if sticks_out(&rims, x, y, &view) { 'x' } else { pixel };
            row.chars().enumerate().map(pixel).collect()
        };
        drawing.iter().enumerate().map(row).collect()
    }

    #[test]
    fn a_rim_is_taken_off_and_a_gap_stays() {
        let drawing = [
            "            ", //
            "            ",
            "  ++++++++  ",
            "  +######+  ",
            "  +#++###+  ",
            "  +#++###+  ",
            "  +######+  ",
            "  ++++++++  ",
            "            ",
            "            ",
        ];
        let expected = [
            "            ", //
            "            ",
            "  xxxxxxxx  ",
            "  x######x  ",
            "  x#++###x  ",
            "  x#++###x  ",
            "  x######x  ",
            "  xxxxxxxx  ",
            "            ",
            "            ",
        ];
        assert_eq!(trimmed(&drawing), expected, "only what nothing closes in goes");
    }

    #[test]
    fn neighbours_that_take_strides_agree() {
        // Every other pixel of this row would meet the core at the left end, were lines to begin wherever they do.
        let empty = "                    ";
        let mut drawing = vec![empty; 40];
        drawing[20] = "  *# ***********##  ";
        drawing[21] = "  ################  ";
        let row = &trimmed(&drawing)[20][5..16];
        assert!(row.bytes().all(|pixel| pixel == row.as_bytes()[0]), "all or none: {row}");
    }

    #[test]
    fn thin_lines_and_the_border_of_the_picture_stay() {
        let drawing = [
            "            ", //
            " #++#+#+++# ",
            "            ",
            "###         ",
            "++#         ",
            "###         ",
            "            ",
            "            ",
        ];
        assert_eq!(trimmed(&drawing), drawing, "nothing sticks out here");
        let alone = ["      ", "      ", "  ++  ", "  +   ", "      ", "      "];
        assert_eq!(trimmed(&alone), alone, "nor here");
    }
}
