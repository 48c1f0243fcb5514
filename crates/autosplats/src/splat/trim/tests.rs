//! Tests of trimming on drawings, and on borders of points scattered below lines.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use super::super::centers::one;
use super::blurred::{BLOCK_PX, FRINGE_BLOCKS};
use super::*;
use crate::adapt::Noise;
use crate::camera::{Camera, Projection};
use crate::test_clouds::Random;
use autosplats_cloud::glam::DVec3;

/// The very edge of a surface that curves away.
const SHOWN: PixelSurface = PixelSurface { depth: 1.0, normal: [1.0, 0.0, 0.0] };

/// A picture of one tile.
static ONE_TILE: LazyLock<Tiles> = LazyLock::new(|| Tiles::all([TILE; 2]));

/// The outline of a picture of one tile, without noise.
fn of_a_tile<'a>(rims: &'a [Rim], centers: &'a [u32], sixteenths: &'a Sixteenths, view: &'a View) -> Outline<'a> {
    Outline { rims, centers, sixteenths, tiles: &ONE_TILE, view, blurred: None }
}

fn view(size: [u32; 2]) -> View {
    let camera =
        Camera { eye: DVec3::ZERO, look_at: DVec3::X, up: DVec3::Z, projection: Projection::OrthographicHeight(1.0) };
    camera.view(DVec3::ZERO, size).expect("a view")
}

/// A drawing with the pixels that trimming removes as `x`. In the drawing `#` is core, `+` a tail that reaches 4
/// pixels, `*` one that reaches 12, and blank is empty.
fn trimmed(drawing: &[&str]) -> Vec<String> {
    let size = [drawing[0].len() as u32, drawing.len() as u32];
    let view = view(size);
    let mut rims = vec![EMPTY; TILE_AREA];
    for (y, row) in drawing.iter().enumerate() {
        for (x, pixel) in row.bytes().enumerate() {
            rims[y * TILE + x] = match pixel {
                b'#' => -4.0,
                b'+' => 4.0,
                b'*' => 12.0,
                _ => EMPTY,
            };
        }
    }
    let sixteenths = Sixteenths::with(size.map(|side| side as usize), []);
    let outline = of_a_tile(&rims, &[0; TILE_AREA], &sixteenths, &view);
    let edges = outline.edges([0, 0]);
    let row = |(y, row): (usize, &&str)| {
        let goes = |x: usize| outline.sticks_out(x, y, SHOWN, edges.near([x, y]));
        let pixel = |(x, pixel): (usize, char)| if goes(x) { 'x' } else { pixel };
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
    // Every other pixel of this row would meet the core at the left end if each line began one stride from its pixel.
    let empty = "                    ";
    let mut drawing = vec![empty; 40];
    drawing[20] = "  *# ***********##  ";
    drawing[21] = "  ################  ";
    let row = &trimmed(&drawing)[20][5..16];
    assert!(row.bytes().all(|pixel| pixel == row.as_bytes()[0]), "all or none: {row}");
}

/// Whether a pixel (column, row) stays, for points and drawn splats in pixels. Splats have discs of 1.6 pixels and
/// cores of 1 pixel.
fn stays(size: [usize; 2], points: &[[f32; 2]], drawn: &[[f32; 2]]) -> impl Fn(usize, usize) -> bool {
    let mut centers = vec![0; TILE_AREA];
    for &[x, y] in drawn {
        centers[y as usize * TILE + x as usize] += one([x as usize, y as usize], [x, y]);
    }
    let rim = |pixel: usize| {
        let [x, y] = [pixel % TILE, pixel / TILE].map(|at| at as f32 + 0.5);
        let nearest = drawn.iter().map(|point| (point[0] - x).hypot(point[1] - y)).fold(f32::INFINITY, f32::min);
        if nearest > 1.6 {
            EMPTY
        } else if nearest > 1.0 {
            1.5
        } else {
            -1.5
        }
    };
    let rims: Vec<_> = (0..TILE_AREA).map(rim).collect();
    let view = view(size.map(|side| side as u32));
    let sixteenths = Sixteenths::with(size, points.iter().copied());
    move |x, y| {
        let outline = of_a_tile(&rims, &centers, &sixteenths, &view);
        let edges = outline.edges([0, 0]);
        rims[y * TILE + x] != EMPTY && !outline.sticks_out(x, y, SHOWN, edges.near([x, y]))
    }
}

#[test]
fn dense_points_end_where_they_end() {
    // Points scattered evenly below a slanted line, `density` per pixel. Two of each pixel are drawn.
    let size = [TILE, 40];
    let below = |x: f32, y: f32| y - (12.0 + 0.27 * x);
    for (density, most) in [(1.5, 24), (4.0, 18), (40.0, 5)] {
        let mut random = Random::new(51);
        let strewn =
            (0..(density * (size[0] * size[1]) as f32) as usize).map(|_| size.map(|side| random.unit() * side as f32));
        let points: Vec<_> = strewn.filter(|&[x, y]| below(x, y) > 0.0).collect();
        let mut of_pixel = vec![0; TILE_AREA];
        let is_drawn = |point: &&[f32; 2]| {
            let count = &mut of_pixel[point[1] as usize * TILE + point[0] as usize];
            *count += 1;
            *count <= 2
        };
        let drawn: Vec<_> = points.iter().filter(is_drawn).copied().collect();
        let wrong = |points: &[[f32; 2]]| {
            let stays = stays(size, points, &drawn);
            let pixels = (3..size[0] - 3).flat_map(|x| (3..size[1] - 3).map(move |y| (x, y)));
            let is_wrong = |&(x, y): &(usize, usize)| {
                let depth = below(x as f32 + 0.5, y as f32 + 0.5);
                let is_wrong = stays(x, y) != (depth > 0.0);
                assert!(!is_wrong || depth.abs() < 2.0, "{x}, {y}: {depth} below the line");
                is_wrong
            };
            pixels.filter(is_wrong).count()
        };
        let (all, some) = (wrong(&points), wrong(&drawn));
        assert!(all <= most, "{density} points a pixel: {all} wrong over {} columns", size[0]);
        // Where points are dense, the outermost ones are seldom drawn.
        assert!(
            density < 10.0 || some > 2 * all,
            "{density} points a pixel: {some} wrong by those drawn, {all} by all"
        );
    }
}

/// Results for pixels within two pixels of a slanted line with points below it. `depth` turns a number from 0 to 1 into
/// a point's depth in pixels. Returns the share of pixels that points decide, and the share of those that are right.
fn told(wide: bool, per_column: usize, depth: impl Fn(f32) -> f32) -> [f64; 2] {
    let size = [TILE, TILE];
    let line = |x: f32| 12.0 + 0.27 * x;
    let mut random = Random::new(54);
    let point = |at: usize| {
        let x = (at / per_column) as f32 + random.unit();
        [x, line(x) + depth(random.unit())]
    };
    let points: Vec<_> = (0..size[0] * per_column).map(point).filter(|point| point[1] < TILE as f32).collect();
    let mut centers = vec![0; TILE_AREA];
    for &[x, y] in &points {
        centers[y as usize * TILE + x as usize] += one([x as usize, y as usize], [x, y]);
    }
    let (sixteenths, view) = (Sixteenths::with(size, points), view(size.map(|side| side as u32)));
    let outline = of_a_tile(&[4.0; TILE_AREA], &centers, &sixteenths, &view);
    let mut counts = [0, 0, 0];
    for (x, y) in (3..TILE - 3).flat_map(|x| (3..TILE - 3).map(move |y| (x, y))) {
        let below = y as f32 + 0.5 - line(x as f32 + 0.5);
        if below.abs() < 2.0 {
            let is_beside = outline.is_beside([x, y], wide, EmptyNearby::Border);
            let is_right = is_beside == Some(below < 0.0);
            counts = [counts[0] + 1, counts[1] + usize::from(is_beside.is_some()), counts[2] + usize::from(is_right)];
        }
    }
    [counts[1] as f64 / counts[0] as f64, counts[2] as f64 / counts[1] as f64]
}

#[test]
fn wide_splats_end_by_points_where_these_lie_close() {
    // A surface that curves away: of the points of 30 pixels nearly a fifth lie in the last pixel before the end.
    let [share, right] = told(true, 20, |part| 30.0 * part * part);
    assert!(share > 0.9 && right > 0.85, "of a curved surface {share} told, {right} of them right");
    // The border of a gap among points three pixels apart.
    let sparse = |wide: bool| told(wide, 3, |part| 30.0 * part)[0];
    let [narrow, wide] = [false, true].map(sparse);
    assert!(narrow > 0.1 && wide < 0.02, "of a gap's border {wide} told, {narrow} if splats were narrow");
}

/// Height in pixels up to which pixels above a line stay, in the middle columns. Points are scattered evenly below the
/// line, `per_pixel` in each pixel. Noise moves them, and they are drawn with discs of two pixels. `sure` is the
/// certainty of the noise; with `None` the frame has no noise.
fn above_the_line(per_pixel: usize, noise_px: f32, sure: Option<f32>) -> Vec<f32> {
    let size = [TILE, TILE];
    let line = |x: f32| 28.0 + 0.1 * x;
    let mut random = Random::new(55);
    let mut strewn =
        (0..per_pixel * TILE_AREA).map(|_| size.map(|side| random.unit() * side as f32)).collect::<Vec<_>>();
    strewn.retain(|&[x, y]| y > line(x));
    let mut points: Vec<_> =
        strewn.into_iter().map(|point| point.map(|along| along + noise_px * random.gaussian())).collect();
    points.retain(|point| point.iter().zip(size).all(|(&at, side)| at >= 0.0 && at < side as f32));
    let rim = |pixel: usize| {
        let [x, y] = [pixel % TILE, pixel / TILE].map(|at| at as f32 + 0.5);
        if points.iter().any(|point| (point[0] - x).hypot(point[1] - y) < 2.0) { -2.0 } else { EMPTY }
    };
    let rims: Vec<_> = (0..TILE_AREA).map(rim).collect();
    let (sixteenths, view) = (Sixteenths::with(size, points), view(size.map(|side| side as u32)));
    let known = |sure: f32| Noise { level: noise_px * view.pixel_size(1.0), sure, ..Noise::NONE };
    let blurred = BlurredBorders::new(sure.map_or(Noise::NONE, known), 1.6, (&rims, &ONE_TILE), &sixteenths, &view);
    assert_eq!(blurred.is_some(), sure.is_some(), "nothing is blurred without noise");
    let outline = Outline {
        rims: &rims,
        centers: &[0; TILE_AREA],
        sixteenths: &sixteenths,
        tiles: &ONE_TILE,
        view: &view,
        blurred: blurred.as_ref(),
    };
    if sure.is_some() {
        let told = |reach_px: f32| outline.is_beside_blurred([32, 28], SHOWN, reach_px);
        assert!(told(2.0).is_some() && told(60.0).is_none(), "where splats are wide, windows tell of rows");
        let facing = PixelSurface { normal: [0.0, 0.0, -1.0], ..SHOWN };
        assert!(outline.is_beside_blurred([32, 28], facing, 2.0).is_none(), "what faces the eye is not blurred");
    }
    let edges = outline.edges([0, 0]);
    let stays =
        |x: usize, y: usize| rims[y * TILE + x] != EMPTY && !outline.sticks_out(x, y, SHOWN, edges.near([x, y]));
    let above = |x: usize| Some(line(x as f32 + 0.5) - (0..TILE).find(|&y| stays(x, y))? as f32);
    (24..40).map(|x| above(x).expect("what is below stays")).collect()
}

#[test]
fn what_noise_has_blurred_ends_about_where_the_surface_does() {
    // Noise levels whose windows are summed in pixels, in pairs of pixels, and in blocks.
    for noise_px in [1.5, 3.0, 5.0] {
        let [with, without] = [Some(0.0), None].map(|sure| above_the_line(3, noise_px, sure));
        // Some columns have an isolated point far out, about which too few points decide.
        let median = |above: &[f32]| {
            let mut above = above.to_vec();
            above.sort_by(f32::total_cmp);
            above[above.len() / 2]
        };
        // Too far in by half of the noise, as ends are straight.
        assert!((-0.9..0.0).contains(&(median(&with) / noise_px)), "noise of {noise_px} pixels: {with:?}");
        assert!(median(&without) > 1.5 * noise_px, "noise of {noise_px} pixels that is not known: {without:?}");
    }
}

#[test]
fn thin_noise_blurs_if_it_is_sure_and_points_are_close() {
    let mean = |per_pixel: usize, noise_px: f32, sure: f32| {
        let above = above_the_line(per_pixel, noise_px, Some(sure));
        above.iter().sum::<f32>() / above.len() as f32
    };
    for noise_px in [0.4, 0.5, 0.6] {
        // At least one of sixteen columns differs, as ends are whole pixels.
        let [unsure, sure] = [0.0, 1.0].map(|sure| mean(12, noise_px, sure));
        assert!(sure < unsure, "{noise_px}: {unsure} pixels, sure {sure}");
        assert_eq!(mean(2, noise_px, 1.0), mean(2, noise_px, 0.0), "where 1.25 distances are more than is sure anyway");
    }
}

#[test]
fn a_surface_before_a_denser_one_is_no_fringe() {
    // Dense on the left, where another surface stands behind; empty on the right.
    let size = [TILE, TILE];
    let mut random = Random::new(57);
    let mut strewn = |count: usize, left: f32, right: f32| {
        let place = |_| [left + (right - left) * random.unit(), TILE as f32 * random.unit()];
        (0..count * TILE * (right - left) as usize).map(place).collect::<Vec<_>>()
    };
    let points = [strewn(12, 0.0, 30.0), strewn(2, 30.0, 44.0)].concat();
    let rims: Vec<_> = (0..TILE_AREA).map(|pixel| if pixel % TILE < 44 { -7.0 } else { EMPTY }).collect();
    let (sixteenths, view) = (Sixteenths::with(size, points), view(size.map(|side| side as u32)));
    let noise = Noise { level: 2.0 * view.pixel_size(1.0), ..Noise::NONE };
    let blurred = BlurredBorders::new(noise, 1.6, (&rims, &ONE_TILE), &sixteenths, &view);
    assert!(blurred.is_some(), "there is noise");
    let blurred = blurred.as_ref();
    let outline = Outline {
        rims: &rims,
        centers: &[0; TILE_AREA],
        sixteenths: &sixteenths,
        tiles: &ONE_TILE,
        view: &view,
        blurred,
    };
    let told = |x: usize| outline.is_beside_blurred([x, 32], SHOWN, 7.0);
    assert_eq!([30, 31, 32].map(told), [Some(false); 3], "where points become fewer, but go on");
    assert_eq!(told(43), Some(true), "where they end");
}

#[test]
fn blocks_know_how_far_an_empty_one_is() {
    let [width, height] = [TILE + 37, TILE + 5];
    let tiles = Tiles::all([width, height]);
    let view = view([width as u32, height as u32]);
    let mut random = Random::new(56);
    let mut seen = BTreeSet::new();
    for holes in [0, 1, 60] {
        let mut rims = vec![2.0; 4 * TILE_AREA];
        for _ in 0..holes {
            let [x0, y0] = [random.below(width - 7), random.below(height - 7)];
            for (x, y) in (x0..x0 + 7).flat_map(|x| (y0..y0 + 7).map(move |y| (x, y))) {
                rims[tiles.index([x, y])] = EMPTY;
            }
        }
        let noise = Noise { level: 1.0, ..Noise::NONE };
        let blurred = BlurredBorders::new(noise, 1.6, (&rims, &tiles), &Sixteenths::with([width, height], []), &view)
            .expect("noise");
        let [columns, rows] = [width, height].map(|side| side.div_ceil(BLOCK_PX));
        let is_empty = |bx: usize, by: usize| {
            let pixels =
                (0..BLOCK_PX * BLOCK_PX).map(|at| [BLOCK_PX * bx + at % BLOCK_PX, BLOCK_PX * by + at / BLOCK_PX]);
            pixels.filter(|&[x, y]| x < width && y < height).all(|[x, y]| rims[tiles.index([x, y])] == EMPTY)
        };
        let empty: Vec<_> =
            (0..columns).flat_map(|x| (0..rows).map(move |y| (x, y))).filter(|&(x, y)| is_empty(x, y)).collect();
        for (x, y) in (0..columns).flat_map(|x| (0..rows).map(move |y| (x, y))) {
            let ways = empty.iter().map(|&(ex, ey)| ex.abs_diff(x).max(ey.abs_diff(y)));
            let expected = ways.min().map_or(FRINGE_BLOCKS + 2, |way| way.min(FRINGE_BLOCKS + 2));
            assert_eq!(usize::from(blurred.blocks_to_empty(x, y)), expected, "{holes} holes, block {x}, {y}");
            seen.insert(expected);
        }
    }
    assert!((0..8).chain([FRINGE_BLOCKS + 2]).all(|way| seen.contains(&way)), "all ways there are: {seen:?}");
}

#[test]
fn what_is_empty_lies_where_it_does() {
    let view = view([TILE as u32; 2]);
    let found = |is_empty: fn(usize, usize) -> bool, at: [usize; 2]| {
        let rim = |pixel: usize| if is_empty(pixel % TILE, pixel / TILE) { EMPTY } else { 2.0 };
        let rims: Vec<_> = (0..TILE_AREA).map(rim).collect();
        let noise = Noise { level: 1.0, ..Noise::NONE };
        let blurred = BlurredBorders::new(noise, 1.6, (&rims, &ONE_TILE), &Sixteenths::with([TILE; 2], []), &view)
            .expect("noise");
        blurred.towards_empty(at, 16.0)
    };
    let is_near = |found: Option<[f32; 2]>, [x, y]: [f32; 2]| {
        found.is_some_and(|[fx, fy]| (fx - x).hypot(fy - y) < 0.1 && (fx.hypot(fy) - 1.0).abs() < 1e-5)
    };
    assert!(is_near(found(|_, y| y < 20, [32, 28]), [0.0, -1.0]), "up to a straight border");
    assert!(is_near(found(|x, y| x > 40 && y > 40, [35, 35]), [0.5f32.sqrt(); 2]), "into a corner");
    // The nearest empty side counts most: left is nearer than right.
    assert!(is_near(found(|x, _| !(27..46).contains(&x), [32, 32]), [-1.0, 0.0]), "of two");
    assert!(found(|x, _| x > 52, [32, 32]).is_none() && found(|_, _| false, [0, 63]).is_none(), "too far away");
}

#[test]
fn what_is_thin_stays() {
    // A wire a fifth of a pixel thick, which misses the middles of most pixels, and an isolated point.
    let size = [TILE, 40];
    let mut random = Random::new(53);
    let wire = |_| {
        let x = 5.0 + 45.0 * random.unit();
        [x, 12.2 + 0.05 * x + 0.2 * random.unit()]
    };
    let mut points: Vec<_> = (0..1000).map(wire).collect();
    points.push([30.1, 30.1]);
    let stays = stays(size, &points, &points);
    for x in 6..49 {
        let height = (5..25).filter(|&y| stays(x, y)).count();
        assert!((1..=2).contains(&height), "{height} pixels in column {x}");
    }
    assert!(stays(30, 30), "that of a point alone");
}

#[test]
fn borders_are_pixels_close_to_an_empty_square_and_gaps_those_close_to_an_empty_pixel() {
    let [width, height] = [TILE + 37, TILE + 5];
    let tiles = Tiles::all([width, height]);
    let view = view([width as u32, height as u32]);
    let mut random = Random::new(52);
    let mut all = [0; 3];
    for empty_percent in [60, 5] {
        // Pixels of tiles beyond the picture do not matter.
        let rim = |_| if random.below(100) < empty_percent { EMPTY } else { 1.0 };
        let rims: Vec<_> = (0..4 * TILE_AREA).map(rim).collect();
        let outline = Outline {
            rims: &rims,
            centers: &[],
            sixteenths: &Sixteenths::default(),
            tiles: &tiles,
            view: &view,
            blurred: None,
        };
        let is_empty = |x: usize, y: usize| x < width && y < height && rims[tiles.index([x, y])] == EMPTY;
        // (x, y) is the upper left pixel of the square.
        let is_square = |x: usize, y: usize| (0..9).all(|at| is_empty(x + at % 3, y + at / 3));
        for tile in [[0, 0], [TILE, 0], [0, TILE], [TILE, TILE]] {
            let edges = outline.edges(tile);
            for (y, x) in (0..TILE).flat_map(|y| (0..TILE).map(move |x| (y, x))) {
                let [column, row] = [tile[0] + x, tile[1] + y];
                if column >= width || row >= height {
                    continue;
                }
                // Whether `holds` is true for a pixel of a square without its corners, which begins `back` pixels up
                // and left of this one.
                let around = |side: usize, back: usize, holds: &dyn Fn(usize, usize) -> bool| {
                    let places = (0..side * side).map(|at| [at % side, at / side]);
                    let mut places = places.filter(|at| !at.iter().all(|along| along % (side - 1) == 0));
                    places.any(|[dx, dy]| {
                        let place = (column + dx).checked_sub(back).zip((row + dy).checked_sub(back));
                        place.is_some_and(|(x, y)| holds(x, y))
                    })
                };
                let expected = match [around(7, 4, &is_square), around(5, 2, &is_empty)] {
                    [true, _] => EmptyNearby::Border,
                    [_, true] => EmptyNearby::Gap,
                    _ => EmptyNearby::Nothing,
                };
                assert_eq!(edges.near([x, y]), expected, "{column}, {row}");
                all[expected as usize] += 1;
            }
        }
    }
    assert!(all.iter().all(|&count| count > 1000), "there are all: {all:?}");
}

#[test]
fn slits_between_dense_points_open_beside_single_empty_pixels() {
    // A slit between two surfaces of dense points; splats have closed it but for a pixel of each column.
    let size = [TILE, 40];
    let mut random = Random::new(58);
    let strewn = (0..20 * size[0] * size[1]).map(|_| size.map(|side| random.unit() * side as f32));
    let depth = |x: f32, y: f32| (y - (18.0 + 0.1 * x)).abs() - 1.0;
    let points: Vec<_> = strewn.filter(|&[x, y]| depth(x, y) > 0.0).collect();
    let rim = |pixel: usize| {
        let [x, y] = [pixel % TILE, pixel / TILE].map(|at| at as f32 + 0.5);
        if depth(x, y) < -0.5 { EMPTY } else { -2.0 }
    };
    let rims: Vec<_> = (0..TILE_AREA).map(rim).collect();
    let (sixteenths, view) = (Sixteenths::with(size, points), view(size.map(|side| side as u32)));
    let outline = of_a_tile(&rims, &[0; TILE_AREA], &sixteenths, &view);
    let edges = outline.edges([0, 0]);
    let pixels = (3..size[0] - 3).flat_map(|x| (3..size[1] - 3).map(move |y| [x, y]));
    // Right pixels and all pixels, inside the surfaces and inside the slit.
    let mut counts = [[0, 0], [0, 0]];
    for [x, y] in pixels {
        let inside = depth(x as f32 + 0.5, y as f32 + 0.5);
        let near = edges.near([x, y]);
        assert_ne!(near, EmptyNearby::Border, "no square of the slit is empty: {x}, {y}");
        // Further from the slit's border too few points decide.
        if near == EmptyNearby::Gap && (0.2..0.5).contains(&inside.abs()) {
            let is_beside = inside < 0.0;
            let [right, all] = &mut counts[usize::from(is_beside)];
            *right += u32::from(outline.sticks_out(x, y, SHOWN, near) == is_beside);
            *all += 1;
        }
    }
    let [[right_in, all_in], [right_out, all_out]] = counts;
    assert!(right_in == all_in && all_in > 20, "of surfaces {right_in} of {all_in} stay");
    // On a slanted border the empty pixel is not always straight ahead.
    assert!(4 * right_out > 3 * all_out && all_out > 20, "of the slit {right_out} of {all_out} go");
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
