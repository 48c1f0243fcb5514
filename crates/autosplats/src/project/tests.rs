//! Projection against brute force over all points in `f64`.

use std::collections::HashMap;

use autosplats_cloud::PointCloud;
use autosplats_cloud::glam::DVec3;

use super::cpu::MAX_SECOND_DEPTH_PX;
use super::{Dropped, ProjectRules, Projector, ScreenPoint, ScreenPoints, whole};
use crate::camera::{Camera, Projection};
use crate::test_clouds::{self, EYE, Positions, Random};

const SIZES: [[u32; 2]; 6] = [[1, 1], [7, 3], [3, 70], [300, 2], [64, 64], [121, 90]];

fn cameras() -> [Camera; 2] {
    let camera = |projection| Camera { eye: EYE, look_at: DVec3::ZERO, up: DVec3::new(0.1, -1.0, 0.0), projection };
    [camera(Projection::PerspectiveFovDeg(30.0)), camera(Projection::OrthographicHeight(2.1))]
}

/// Projection of a point in `f64`.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    NotFinite,
    Behind,
    /// Pixel coordinates and view-space position.
    Ahead([f64; 2], DVec3),
}

fn place(camera: &Camera, size: [u32; 2], position: [f32; 3]) -> Place {
    let [right, down, forward] = camera.axes().expect("a valid camera");
    let offset = DVec3::from(position.map(f64::from)) - camera.eye;
    let view = DVec3::new(offset.dot(right), offset.dot(down), offset.dot(forward));
    let [width, height] = size.map(f64::from);
    let (near, scale) = match camera.projection {
        Projection::PerspectiveFovDeg(fov) => {
            let focal_px = 0.5 * height / (0.5 * fov.to_radians()).tan();
            (1e-5 * (camera.look_at - camera.eye).length(), focal_px / view.z)
        }
        Projection::OrthographicHeight(world) => (0.0, height / world),
        Projection::Pinhole { .. } => unreachable!("not among these cameras"),
    };
    if !view.is_finite() {
        Place::NotFinite
    } else if view.z <= near {
        Place::Behind
    } else {
        Place::Ahead([view.x * scale + 0.5 * width, view.y * scale + 0.5 * height], view)
    }
}

/// Expected result of a projection.
#[derive(Default)]
struct Oracle {
    /// Index and view-space position of the owner of each pixel or half pixel.
    owners: HashMap<([usize; 2], usize), (usize, DVec3)>,
    /// For each pixel that holds points, the bits of the sixteenths that hold any.
    sixteenths: HashMap<[usize; 2], u16>,
    dropped: Dropped,
}

/// Index of the half of a pixel that a place falls into: left or right, upper or lower.
fn half([x, y]: [f64; 2]) -> usize {
    let along = if (x as usize + y as usize) % 2 == 1 { x } else { y };
    usize::from(along.fract() >= 0.5)
}

/// Depth beyond which the second point of a pixel does not count.
fn gate(camera: &Camera, size: [u32; 2], near: f64) -> f64 {
    near + f64::from(MAX_SECOND_DEPTH_PX) * unit(camera, size, near)
}

/// Size of a pixel in world units at a depth.
fn unit(camera: &Camera, [_, height]: [u32; 2], depth: f64) -> f64 {
    match camera.projection {
        Projection::PerspectiveFovDeg(fov) => 2.0 * (0.5 * fov.to_radians()).tan() * depth / f64::from(height),
        Projection::OrthographicHeight(world) => world / f64::from(height),
        Projection::Pinhole { .. } => unreachable!("not among these cameras"),
    }
}

fn oracle(camera: &Camera, size: [u32; 2], positions: &[[f32; 3]], halves: bool) -> Oracle {
    let mut oracle = Oracle::default();
    for (index, &position) in positions.iter().enumerate() {
        match place(camera, size, position) {
            Place::NotFinite => oracle.dropped.not_finite += 1,
            Place::Behind => oracle.dropped.behind += 1,
            Place::Ahead(px, view) => {
                if (0..2).all(|i| (0.0..f64::from(size[i])).contains(&px[i])) {
                    let [column, row] = px.map(|c| (4.0 * c.fract()) as usize);
                    *oracle.sixteenths.entry(px.map(|c| c as usize)).or_default() |= 1 << (4 * row + column);
                    let slot = if halves { half(px) } else { 0 };
                    let owner = oracle.owners.entry((px.map(|c| c as usize), slot)).or_insert((index, view));
                    if view.z < owner.1.z {
                        *owner = (index, view);
                    }
                } else {
                    oracle.dropped.outside += 1;
                }
            }
        }
    }
    let nearest = oracle.owners.clone();
    oracle.owners.retain(|&(pixel, slot), (_, view)| {
        nearest.get(&(pixel, 1 - slot)).is_none_or(|(_, other)| view.z <= gate(camera, size, other.z))
    });
    oracle
}

/// The points whose result `f32` and `f64` must agree on. They lie more than 2e-3 px from the border of a pixel or of
/// a quarter of a pixel; rounding of positions and of the rotation reaches 1e-4 px here. In depth they lie more than
/// 1e-5 from the other points of their pixel, copies excepted, and from the gate of the second point.
fn settled(camera: &Camera, size: [u32; 2], positions: &[[f32; 3]]) -> Positions {
    let mut taken: HashMap<[i64; 2], Vec<([f32; 3], f64)>> = HashMap::new();
    let mut settled = Positions::new();
    for &position in positions {
        if let Place::Ahead(px, view) = place(camera, size, position) {
            let others = taken.entry(px.map(|c| c.floor() as i64)).or_default();
            let clear = others.iter().all(|&(other, depth)| {
                let far = depth.max(view.z) - gate(camera, size, depth.min(view.z));
                other == position || ((depth - view.z).abs() > 1e-5 && far.abs() > 1e-5)
            });
            if !clear || px.iter().any(|c| (4.0 * c - (4.0 * c).round()).abs() < 8e-3) {
                continue;
            }
            others.push((position, view.z));
        }
        settled.push(position);
    }
    settled
}

/// Checks owners, drops, sixteenths, order, starts of cells, density grid and the split by depth.
fn compare(screen: &ScreenPoints, oracle: &Oracle, camera: &Camera, size: [u32; 2]) -> Result<(), String> {
    let ensure = |ok: bool, what: &str| if ok { Ok(()) } else { Err(what.to_owned()) };
    let ScreenPoints { points, source, near_first, cells, density, active, passive, sixteenths, dropped, .. } = screen;
    ensure(*near_first == points.len(), "points are listed without being asked for")?;
    ensure(*dropped == oracle.dropped, &format!("dropped {dropped:?}, not {:?}", oracle.dropped))?;
    for (pixel, [x, y]) in (0..size[1] as usize).flat_map(|y| (0..size[0] as usize).map(move |x| [x, y])).enumerate() {
        let expected = oracle.sixteenths.get(&[x, y]).copied().unwrap_or(0);
        let found = sixteenths.of(pixel);
        ensure(found == expected, &format!("sixteenths of {x}, {y}: {found:x}, not {expected:x}"))?;
    }
    ensure(points.len() == oracle.owners.len() && source.len() == points.len(), "number of screen points")?;
    for (point, &source) in points.iter().zip(source) {
        let owners = [0, 1].map(|slot| oracle.owners.get(&(point.pixel_xy(), slot)));
        let owner = owners.into_iter().flatten().find(|(index, _)| *index == source as usize);
        let &(_, view) = owner.ok_or_else(|| format!("point {source} owns no half of {:?}", point.pixel_xy()))?;
        let error = (DVec3::from(point.position_view.map(f64::from)) - view).abs().max_element();
        // f32 rounding of a rotation of coordinates up to 50.
        ensure(error < 2e-5, &format!("position of point {source} is off by {error}"))?;
    }

    let [width, height] = size.map(|side| side as usize);
    let cell = |p: &ScreenPoint| p.pixel_xy()[1] / cells.strip_px * width + p.pixel_xy()[0];
    let order: Vec<_> = points.iter().map(|p| (cell(p), p.pixel_xy()[1])).collect();
    ensure(order.is_sorted(), "screen points are not in cell order")?;
    ensure(cells.columns == width, "a strip is as long as the picture")?;
    ensure(cells.start.len() == height.div_ceil(cells.strip_px) * width + 1, "length of the start table")?;
    for (index, &start) in cells.start.iter().enumerate() {
        let before = points.iter().filter(|p| cell(p) < index).count();
        ensure(start as usize == before, &format!("cell {index} starts at {start}, not {before}"))?;
    }

    let coarse = |p: &ScreenPoint| p.pixel_xy().map(|c| c / density.cell_px);
    ensure(density.columns == width.div_ceil(density.cell_px), "columns of the density grid")?;
    ensure(density.count.len() == density.columns * height.div_ceil(density.cell_px), "cells of the density grid")?;
    let mut culled = vec![false; points.len()];
    for index in 0..density.count.len() {
        let here = [index % density.columns, index / density.columns];
        let members: Vec<usize> = (0..points.len()).filter(|&i| coarse(&points[i]) == here).collect();
        ensure(density.count[index] as usize == members.len(), &format!("count of density cell {index}"))?;
        let nearest = members.iter().map(|&i| points[i].position_view[2]).fold(f32::INFINITY, f32::min);
        ensure(density.nearest[index] == nearest, &format!("nearest depth of density cell {index}"))?;
        let plane = f64::from(nearest) + density.cell_px as f64 * unit(camera, size, f64::from(nearest));
        let error = (f64::from(density.culling[index]) - plane).abs();
        // f32 rounding of a product and a sum.
        ensure(members.is_empty() || error < 1e-5 * plane, &format!("culling plane of density cell {index}"))?;
        members.iter().for_each(|&i| culled[i] = points[i].position_view[2] > density.culling[index]);
    }
    let listed = |culled_or_not: bool| (0..points.len() as u32).filter(move |&i| culled[i as usize] == culled_or_not);
    ensure(active.iter().copied().eq(listed.clone()(false)), "active points")?;
    ensure(passive.iter().copied().eq(listed(true)), "passive points")
}

fn cloud(positions: &[[f32; 3]]) -> PointCloud {
    PointCloud::new(DVec3::ZERO, positions.to_vec())
}

#[test]
fn every_cloud_at_every_size() {
    let mut projector = Projector::default();
    for camera in cameras() {
        for (name, positions) in test_clouds::all(3000) {
            for size in SIZES {
                let positions = settled(&camera, size, &positions);
                let view = camera.view(DVec3::ZERO, size).expect("a view");
                for halves in [false, true] {
                    let rules = ProjectRules { halves, ..ProjectRules::usual(10) };
                    let screen = projector.project(&cloud(&positions), &view, &rules, &crate::cancel::NEVER);
                    let outcome = compare(screen, &oracle(&camera, size, &positions, halves), &camera, size);
                    assert_eq!(outcome, Ok(()), "{name}, {size:?}, {:?}, {halves}", camera.projection);
                }
            }
        }
    }
}

#[test]
fn comparison_sees_each_kind_of_error() {
    let (camera, size) = (cameras()[0], [121, 90]);
    let positions = settled(&camera, size, &test_clouds::two_layers(2000));
    let view = camera.view(DVec3::ZERO, size).expect("a view");
    let oracle = oracle(&camera, size, &positions, true);
    type Spoil = fn(&mut ScreenPoints);
    let errors: [(&str, Spoil); 10] = [
        ("other owner", |s| s.source[3] += 1),
        ("moved point", |s| s.points[5].position_view[0] += 1e-4),
        ("other pixel", |s| s.points[0].pixel += 1 << 16),
        ("other order", |s| {
            s.points.swap(1, 400);
            s.source.swap(1, 400);
        }),
        ("missing point", |s| {
            s.points.pop();
            s.source.pop();
        }),
        ("wrong start", |s| s.cells.start[500] += 1),
        ("wrong count", |s| s.density.count[7] += 1),
        ("wrong drop", |s| s.dropped.outside += 1),
        ("wrong sixteenth", |s| (0..16).for_each(|sixteenth| s.sixteenths.add(7, sixteenth))),
        ("wrong list", |s| s.passive.extend(s.active.pop())),
    ];
    let mut projector = Projector::default();
    let right = projector.project(&cloud(&positions), &view, &ProjectRules::usual(10), &crate::cancel::NEVER);
    assert_eq!(compare(right, &oracle, &camera, size), Ok(()), "nothing is wrong yet");
    for (name, spoil) in errors {
        let mut wrong = right.clone();
        spoil(&mut wrong);
        assert!(compare(&wrong, &oracle, &camera, size).is_err(), "not noticed: {name}");
    }
}

/// A camera that looks along z from the origin, so that transforms are exact.
fn straight(projection: Projection) -> Camera {
    Camera { eye: DVec3::ZERO, look_at: DVec3::Z, up: DVec3::NEG_Y, projection }
}

#[test]
fn each_drop_is_counted_for_its_reason() {
    const NEAR: f32 = 1e-5;
    let perspective = straight(Projection::PerspectiveFovDeg(90.0));
    let parallel = straight(Projection::OrthographicHeight(2.0));
    let (nan, inf, huge) = (f32::NAN, f32::INFINITY, 1e38);
    let not_finite = Dropped { not_finite: 1, ..Dropped::default() };
    let behind = Dropped { behind: 1, ..Dropped::default() };
    let outside = Dropped { outside: 1, ..Dropped::default() };
    let visible = Dropped::default();
    let cases = [
        ("NaN", [0.0, nan, 1.0], not_finite, not_finite),
        ("NaN depth", [0.0, 0.0, nan], not_finite, not_finite),
        ("infinite", [inf, 0.0, 1.0], not_finite, not_finite),
        ("infinite depth", [0.0, 0.0, inf], not_finite, not_finite),
        ("infinitely far behind", [0.0, 0.0, -inf], not_finite, not_finite),
        ("behind", [0.0, 0.0, -1.0], behind, behind),
        ("at the eye", [0.0, 0.0, 0.0], behind, behind),
        ("minus zero", [0.0, 0.0, -0.0], behind, behind),
        ("on the near plane", [0.0, 0.0, NEAR], behind, visible),
        ("past the near plane", [0.0, 0.0, NEAR.next_up()], visible, visible),
        ("smallest depth", [0.0, 0.0, f32::from_bits(1)], behind, visible),
        ("beside", [1.5, 0.0, 1.0], outside, outside),
        ("above", [0.0, -1.5, 1.0], outside, outside),
        ("left border", [-1.0, 0.0, 1.0], visible, visible),
        ("right border", [1.0, 0.0, 1.0], outside, outside),
        ("lower border", [0.0, 1.0, 1.0], outside, outside),
        ("huge and beside", [huge, 0.0, 1.0], outside, outside),
        ("huge depth", [0.0, 0.0, huge], visible, visible),
        ("huge and behind", [0.0, 0.0, -huge], behind, behind),
        ("huge diagonal", [huge, huge, huge], outside, outside),
    ];
    for (name, position, in_perspective, in_parallel) in cases {
        for (camera, expected) in [(perspective, in_perspective), (parallel, in_parallel)] {
            let view = camera.view(DVec3::ZERO, [8, 8]).expect("a view");
            let mut projector = Projector::default();
            let screen = projector.project(&cloud(&[position]), &view, &ProjectRules::usual(10), &crate::cancel::NEVER);
            assert_eq!(screen.dropped, expected, "{name}, {:?}", camera.projection);
            assert_eq!(screen.points.len(), usize::from(expected == visible), "{name}: number of screen points");
        }
    }
}

/// Points without a place leave the others unchanged, wherever they stand in the list.
#[test]
fn poison_harms_nobody() {
    let poison = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1e38, 1e38];
    for camera in cameras() {
        let view = camera.view(DVec3::ZERO, [90, 70]).expect("a view");
        let healthy = test_clouds::sphere(2000);
        let mut random = Random::new(11);
        let mut mixed: Vec<[f32; 3]> = (0..500)
            .map(|_| {
                let mut point = random.direction();
                point[random.below(3)] = poison[random.below(poison.len())];
                point
            })
            .collect();
        // Huge points on the screen lie behind everything else.
        mixed.extend(&healthy);
        random.shuffle(&mut mixed);
        let (mut clean, mut mixed_projector) = (Projector::default(), Projector::default());
        let clean = clean.project(&cloud(&healthy), &view, &ProjectRules::usual(10), &crate::cancel::NEVER);
        let screen = mixed_projector.project(&cloud(&mixed), &view, &ProjectRules::usual(10), &crate::cancel::NEVER);
        let near = screen.points.iter().filter(|point| point.position_view[2] < 100.0);
        let by_pixel = |point: &&ScreenPoint| point.pixel;
        let mut near: Vec<_> = near.collect();
        let mut healthy: Vec<_> = clean.points.iter().collect();
        near.sort_by_key(by_pixel);
        healthy.sort_by_key(by_pixel);
        assert_eq!(near, healthy, "{:?}", camera.projection);
        let Dropped { not_finite, behind, outside } = screen.dropped;
        assert!(not_finite > 100 && behind + outside > 50, "poison is dropped: {:?}", screen.dropped);
    }
}

#[test]
fn order_of_points_does_not_matter() {
    for camera in cameras() {
        let view = camera.view(DVec3::ZERO, [121, 90]).expect("a view");
        for (name, positions) in test_clouds::all(3000) {
            let mut shuffled = positions.clone();
            Random::new(12).shuffle(&mut shuffled);
            let (mut first, mut second) = (Projector::default(), Projector::default());
            let first = first.project(&cloud(&positions), &view, &ProjectRules::usual(10), &crate::cancel::NEVER);
            let second = second.project(&cloud(&shuffled), &view, &ProjectRules::usual(10), &crate::cancel::NEVER);
            assert_eq!(first.points, second.points, "{name}: screen points");
            assert_eq!(first.cells.start, second.cells.start, "{name}: cells");
            let places = |screen: &ScreenPoints, cloud: &[[f32; 3]]| -> Positions {
                screen.source.iter().map(|&source| cloud[source as usize]).collect()
            };
            assert_eq!(places(first, &positions), places(second, &shuffled), "{name}: sources");
        }
    }
}

#[test]
fn equal_points_go_to_the_lower_index() {
    let camera = straight(Projection::PerspectiveFovDeg(60.0));
    let view = camera.view(DVec3::ZERO, [5, 5]).expect("a view");
    let mut positions = vec![[0.5, 0.0, 3.0]; 40_000];
    positions[..100].fill([0.5, 0.0, 4.0]);
    let mut projector = Projector::default();
    let screen = projector.project(&cloud(&positions), &view, &ProjectRules::usual(10), &crate::cancel::NEVER);
    assert_eq!(screen.source, [100], "the first of the nearest");
}

/// A pixel keeps two points of one surface, even a steep one, but no second point of a surface behind.
#[test]
fn halves_keep_a_point_each_of_one_surface() {
    let camera = straight(Projection::OrthographicHeight(4.0));
    let view = camera.view(DVec3::ZERO, [4, 4]).expect("a view");
    // A pixel is 1 wide. The pixel right of and below the centre is split top/bottom, the next left/right.
    let kept = |positions: &[[f32; 3]]| -> Vec<u32> {
        let mut projector = Projector::default();
        let mut source =
            projector.project(&cloud(positions), &view, &ProjectRules::usual(10), &crate::cancel::NEVER).source.clone();
        source.sort_unstable();
        source
    };
    assert_eq!(kept(&[[0.5, 0.2, 5.0], [0.5, 0.8, 6.0], [0.2, 0.8, 7.0]]), [0, 1], "the nearest of each half");
    assert_eq!(kept(&[[0.2, 0.2, 5.0], [0.8, 0.2, 4.0]]), [1], "halves lie one below the other here");
    assert_eq!(kept(&[[1.2, 0.2, 5.0], [1.8, 0.2, 4.0]]), [0, 1], "and side by side there");
    assert_eq!(
        kept(&[[0.5, 0.2, 5.0], [0.5, 0.8, 5.1 + MAX_SECOND_DEPTH_PX]]),
        [0],
        "what is far behind is another surface"
    );
    assert_eq!(kept(&[[0.5, 0.2, 5.1 + MAX_SECOND_DEPTH_PX], [0.5, 0.8, 5.0]]), [1], "in either half");
    assert_eq!(kept(&[[0.5, 0.2, 5.0], [0.5, 0.8, 4.9 + MAX_SECOND_DEPTH_PX]]), [0, 1], "steep surfaces are one");
}

/// Points in the margin serve as neighbours of points in the picture, and leave the picture's own points unchanged.
#[test]
fn a_margin_adds_neighbours_and_few_queries() {
    const SIZE: [u32; 2] = [121, 90];
    const MARGIN: usize = 30;
    let cloud = cloud(&test_clouds::sphere(40_000));
    let [camera, _] = cameras();
    let camera = Camera { projection: Projection::PerspectiveFovDeg(10.0), ..camera };
    for grid_culling in [true, false] {
        let rules = ProjectRules { grid_culling, ..ProjectRules::usual(10) };
        let picture = camera.view(DVec3::ZERO, SIZE).expect("a view");
        let alone = Projector::default().project(&cloud, &picture, &rules, &crate::cancel::NEVER).clone();
        let view = picture.with_margin(MARGIN as u32);
        let mut projector = Projector::default();
        let screen = projector.project(&cloud, &view, &rules, &crate::cancel::NEVER);
        let beside_px = |&index: &u32| view.beside_picture(screen.points[index as usize].pixel_xy());
        let all: Vec<u32> = (0..screen.points.len() as u32).collect();
        let mut seen: Vec<u32> =
            all.iter().filter(|index| beside_px(index) == 0).map(|&i| screen.source[i as usize]).collect();
        let mut seen_alone = alone.source.clone();
        seen.sort_unstable();
        seen_alone.sort_unstable();
        assert_eq!(seen, seen_alone, "what the picture itself has stays");
        let mut listed = [&screen.active[..], &screen.passive].concat();
        listed.sort_unstable();
        assert_eq!(listed, all, "each once");
        let furthest = screen.active.iter().map(beside_px).max().expect("some");
        assert!((2..MARGIN / 2).contains(&furthest), "queries up to {furthest} pixels beside the picture");
        let least = |index: &u32| beside_px(index) == 0 && !grid_culling;
        assert!(!screen.passive.iter().any(least), "without culling all in the picture are active");
        let far = screen.passive.iter().filter(|index| beside_px(index) > MARGIN / 2).count();
        assert!(far > 1000, "{far} points are neighbours only");
    }
}

/// A density cell holds about k points where there are points.
#[test]
fn density_cells_hold_about_k_points() {
    let camera = straight(Projection::OrthographicHeight(1.8));
    let view = camera.view(DVec3::ZERO, [200, 200]).expect("a view");
    let positions: Positions = test_clouds::plane(5000).iter().map(|&[x, y, _]| [x, y, 2.0]).collect();
    for k in [4, 10, 64] {
        let mut projector = Projector::default();
        let screen = projector.project(&cloud(&positions), &view, &ProjectRules::usual(k), &crate::cancel::NEVER);
        let area = (screen.density.cell_px * screen.density.cell_px) as f32;
        let mean = screen.points.len() as f32 / (200.0 * 200.0) * area;
        // Cells have a whole number of pixels.
        assert!((0.6..1.6).contains(&(mean / k as f32)), "k = {k}: {mean} points to a cell");
    }
}

#[test]
fn whole_parts_are_those_of_casts() {
    let mut random = Random::new(92);
    let edges =
        (0..200).flat_map(|number| [number as f32, (number as f32).next_up(), (number as f32 + 1.0).next_down()]);
    let tie = (1 << 22) as f32 + 0.5;
    let others = (0..10_000).map(|_| 8_388_607.0 * random.unit().powi(4)).chain([-0.0, 0.5, tie, 8_388_607.5]);
    for number in edges.chain(others) {
        assert_eq!(whole(number), number as u32, "{number}");
    }
}
