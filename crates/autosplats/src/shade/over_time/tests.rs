use glam::DVec3;

use super::*;
use crate::camera::{Camera, Projection};

const SIZE: [u32; 2] = [8, 4];
/// Depth of a wall. One unit is one pixel of these orthographic pictures.
const DEPTH: f32 = 100.0;
const BLACK: [u8; 4] = [0, 0, 0, 255];
const WHITE: [u8; 4] = [255; 4];
const HALF: [u8; 4] = [188, 188, 188, 255];

/// A view from the front, moved right by this many pixels.
fn seen(right: f64) -> PlacedView {
    let eye = DVec3::new(right, 0.0, 0.0);
    let camera = Camera {
        eye,
        look_at: eye + DVec3::Z,
        up: DVec3::NEG_Y,
        projection: Projection::OrthographicHeight(SIZE[1].into()),
    };
    PlacedView { view: camera.view(DVec3::ZERO, SIZE).expect("a view"), origin: DVec3::ZERO }
}

/// A wall that covers all but the uppermost row of pixels.
fn wall(depth: f32) -> GBuffer {
    let mut layers = GBuffer::new(SIZE[0], SIZE[1]);
    for y in 1..SIZE[1] as usize {
        for x in 0..SIZE[0] as usize {
            let at = layers.index(x, y);
            (layers.weight[at], layers.depth[at]) = (1.0, depth);
        }
    }
    layers
}

/// Shows `layers` in one colour as the picture after `last`.
fn show(last: &mut LastPicture<u32>, (layers, color): (&GBuffer, [u8; 4]), seen: PlacedView, settings: u32) -> Image {
    let pixels = vec![color; (SIZE[0] * SIZE[1]) as usize];
    let mut image = Image { width: SIZE[0], height: SIZE[1], pixels, linear: Vec::new() };
    last.begin(seen, 1, &settings);
    last.following(seen.view).average(layers, &mut image, &crate::cancel::NEVER);
    last.end(seen, 1, settings);
    image
}

/// The second row of a picture of a white wall, further right and with these settings, after one of a black wall with
/// settings 0.
fn second_row(depths: [f32; 2], right: f64, settings: u32) -> Vec<[u8; 4]> {
    let mut last = LastPicture::default();
    let first = show(&mut last, (&wall(depths[0]), BLACK), seen(0.0), 0);
    assert!(first.pixels.iter().all(|pixel| *pixel == BLACK), "nothing was before it");
    let second = show(&mut last, (&wall(depths[1]), WHITE), seen(right), settings);
    assert!(second.pixels[..SIZE[0] as usize].iter().all(|pixel| *pixel == WHITE), "the background has no past");
    second.pixels[SIZE[0] as usize..][..SIZE[0] as usize].to_vec()
}

#[test]
fn a_surface_seen_before_is_the_mean_of_both() {
    let row = second_row([DEPTH; 2], 2.0, 0);
    assert_eq!(row[..5], [HALF; 5], "half the light, where both pictures show it");
    assert_eq!(row[6..], [WHITE; 2], "what was beside the picture has no past");
    assert_eq!(second_row([DEPTH; 2], 0.5, 0)[1..6], [HALF; 5], "between two pixels");
}

#[test]
fn another_surface_is_not() {
    let as_deep = DEPTH + 0.9 * MAX_SAME_DEPTH_PX;
    assert_eq!(second_row([DEPTH, as_deep], 0.0, 0)[1], HALF, "nearly as deep");
    for depth in [DEPTH + 1.1 * MAX_SAME_DEPTH_PX, DEPTH - 1.1 * MAX_SAME_DEPTH_PX] {
        assert_eq!(second_row([DEPTH, depth], 0.0, 0), [WHITE; 8], "{depth}");
    }
}

#[test]
fn pictures_made_in_another_way_do_not_follow() {
    let row = second_row([DEPTH; 2], 0.0, 1);
    assert_eq!(row, [WHITE; 8], "other settings");
    let mut last = LastPicture::default();
    let _ = show(&mut last, (&wall(DEPTH), BLACK), seen(0.0), 0);
    last.forget();
    let after = show(&mut last, (&wall(DEPTH), WHITE), seen(0.0), 0);
    assert!(after.pixels.iter().all(|pixel| *pixel == WHITE), "nothing is known any more");
}

#[test]
fn the_past_fades_by_half() {
    let mut last = LastPicture::default();
    let layers = wall(DEPTH);
    let mut shown = |color| show(&mut last, (&layers, color), seen(0.0), 0).pixels[SIZE[0] as usize + 1][0];
    let levels = [BLACK, WHITE, WHITE, WHITE].map(&mut shown);
    // A half, three quarters and seven eighths of the light, each rounded to a step.
    let off = levels.iter().zip([0u8, 188, 225, 240]).map(|(level, expected)| level.abs_diff(expected));
    assert!(off.max() <= Some(1), "{levels:?}: more of the new with each picture");
}
