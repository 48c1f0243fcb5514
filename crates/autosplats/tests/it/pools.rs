//! Pools: what is cut into runs looks like the whole, whatever came and went before.

use std::ops::Range;

use autosplats::cloud::glam::{DVec3, Vec3};
use autosplats::cloud::{Field, FieldValues, Key, NodeKey, PointCloud, PointPool, SLOT_POINTS};
use autosplats::{
    Camera, ColorMode, Error, Frame, Projection, Reconstruction, Renderer, SearchEngine, Settings, usual_exposure,
};

use crate::backends::devices::own_device;
use crate::backends::{MAX_DIFFERENT_SHARE, scene, unlike};
use crate::test_clouds::Random;

const SIZE: [u32; 2] = [240, 150];

/// Keys of a deep level.
fn key(number: usize) -> NodeKey {
    Key::new(20, [number as u32, 0, 0]).expect("a place").into()
}

/// The keys of `count` nodes.
fn keys(count: usize) -> Vec<NodeKey> {
    (0..count).map(key).collect()
}

/// Points of a cloud about an origin.
fn piece(cloud: &PointCloud, points: Range<usize>, origin: DVec3) -> PointCloud {
    let position = |index: usize| {
        let is_same = origin == cloud.origin();
        if is_same { cloud.positions()[index] } else { (cloud.world_position(index) - origin).as_vec3().to_array() }
    };
    let mut piece = PointCloud::new(origin, points.clone().map(position).collect());
    if let Some(colors) = cloud.colors() {
        piece = piece.with_colors(colors[points.clone()].to_vec()).expect("a colour each");
    }
    for Field { name, values } in cloud.fields() {
        let values = points.clone().map(|index| values.get(index)).collect();
        piece = piece.with_field(name, FieldValues::F64(values)).expect("a value each");
    }
    piece
}

/// A pool of pieces of `len` points each, all of them chosen, with the origin of the cloud or origins of their own.
fn cut(cloud: &PointCloud, len: usize, own_origins: bool) -> PointPool {
    let slots = cloud.len().div_ceil(len) * len.div_ceil(SLOT_POINTS);
    let mut pool = PointPool::new(cloud, slots * SLOT_POINTS).expect("a pool");
    for (number, first) in (0..cloud.len()).step_by(len).enumerate() {
        let origin = if own_origins { cloud.world_position(first) } else { cloud.origin() };
        assert!(pool.insert(key(number), &piece(cloud, first..cloud.len().min(first + len), origin)), "there is room");
    }
    assert_eq!(pool.choose(&keys(cloud.len().div_ceil(len))), [], "all are there");
    pool
}

/// All that a frame leaves, with the node and place of each pixel's point.
fn result(frame: &Frame<'_>, pool: Option<(&PointPool, usize)>) -> impl PartialEq + use<> {
    let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    let layers = frame.layers;
    let point = |&index: &u32| match pool {
        Some((pool, len)) => pool.place_of(index).map(|(key, point)| key.key.x as usize * len + point),
        None => (index != u32::MAX).then_some(index as usize),
    };
    let points: Vec<_> = layers.point.iter().map(point).collect();
    let planes = [&layers.depth, &layers.weight, &layers.k_radius, &layers.scalar].map(|plane| bits(plane));
    let colors: Vec<_> = layers.color.iter().flatten().map(|channel| channel.to_bits()).collect();
    (frame.image.pixels.clone(), frame.counts, points, planes, colors)
}

fn by(color: ColorMode) -> Settings {
    let mut settings = Settings { all_layers: true, ..Settings::default() };
    settings.shading.color = color;
    settings
}

/// A cloud with a colour and a field.
fn colored(name: &str, count: usize) -> (PointCloud, Camera) {
    let (cloud, camera) = scene(name, count);
    let mut random = Random::new(7);
    let colors = (0..cloud.len()).map(|_| [0, 80, 160].map(|base| base + (60.0 * random.unit()) as u8)).collect();
    let times = (0..cloud.len()).map(|index| 3e8 + index as f64 * 1e-3).collect();
    let classes = (0..cloud.len()).map(|index| (index / 1000 % 24) as u8).collect();
    let cloud = cloud.with_colors(colors).expect("a colour each");
    let cloud = cloud.with_field("GpsTime", FieldValues::F64(times)).expect("a value each");
    (cloud.with_field("Classification", FieldValues::U8(classes)).expect("a value each"), camera)
}

#[test]
fn a_cloud_cut_into_runs_is_the_same_to_the_byte() {
    let (statue, close) = colored("statue", 20_000);
    let (herd, whole) = colored("herd", 15_000);
    let poison = vec![[f32::NAN; 3], [3e38, -3e38, 1.0], [0.0, f32::INFINITY, 0.0]];
    let poisoned = PointCloud::new(DVec3::ZERO, [statue.positions()[..5000].to_vec(), poison].concat());
    let few = PointCloud::new(DVec3::ZERO, statue.positions()[..3].to_vec());
    // Points closer to a walker than a few of their distances are listed by themselves.
    let mut random = Random::new(91);
    let ground = (0..20_000).map(|_| [60.0 * random.signed(), 60.0 * random.signed(), 0.0]).collect();
    let ground = PointCloud::new(DVec3::ZERO, ground);
    let eye = DVec3::new(0.3, -0.2, 1.7);
    let projection = Projection::PerspectiveFovDeg(60.0);
    let walker = Camera { eye, look_at: eye + DVec3::new(10.0, 3.0, -2.0), up: DVec3::Z, projection };
    let all = [ColorMode::Auto, ColorMode::Height, ColorMode::Field("gpstime".into()), ColorMode::Classification];
    let cases = [
        (&statue, close, 4096, &all[..]),
        (&statue, close, 5000, &all[2..3]),
        (&statue, close, 20_000, &all[..1]),
        (&herd, whole, 777, &all[..2]),
        (&poisoned, close, 100, &all[..1]),
        (&few, close, 1, &all[..1]),
        (&ground, walker, 1300, &all[1..2]),
    ];
    for mut renderer in crate::renderers() {
        for (cloud, camera, len, colors) in &cases {
            let pool = cut(cloud, *len, false);
            for settings in colors.iter().cloned().map(by) {
                let expected = result(&renderer.render(*cloud, camera, SIZE, &settings).expect("a picture"), None);
                let frame = renderer.render(&pool, camera, SIZE, &settings).expect("a picture");
                let case = format!("{} points in runs of {len}: {:?}", cloud.len(), settings.shading.color);
                assert!(frame.counts.covered > 0, "{case}: nothing is seen");
                assert!(result(&frame, Some((&pool, *len))) == expected, "{case}, {:?}", renderer.adapter());
            }
        }
    }
}

#[test]
fn origins_of_their_own_change_next_to_nothing() {
    for mut renderer in crate::renderers() {
        for (name, len) in [("statue", 3000), ("cathedral", 10_000)] {
            let (cloud, camera) = scene(name, 40_000);
            let cloud = cloud.with_scans(Vec::new());
            let pool = cut(&cloud, len, true);
            let expected = renderer.render(&cloud, &camera, SIZE, &Settings::default()).expect("a picture");
            let (expected, counts) = (expected.image.clone(), expected.counts);
            let frame = renderer.render(&pool, &camera, SIZE, &Settings::default()).expect("a picture");
            let unlike = unlike(frame.image, &expected);
            assert!(unlike <= MAX_DIFFERENT_SHARE, "{name}: {unlike} of the pixels differ");
            assert!(frame.counts.visible.abs_diff(counts.visible) <= 2 + counts.visible / 100, "{name}");
        }
    }
}

/// A wavy floor with a point on each square of `step`, each a little beside its middle, `away` from the world's origin.
fn floor(away: DVec3, step: f64) -> impl Fn(usize) -> DVec3 {
    let mut random = Random::new(3);
    let aside: Vec<[f64; 2]> = (0..40_000).map(|_| [0; 2].map(|_| 0.3 * f64::from(random.signed()))).collect();
    move |index| {
        let [x, y] = [index % 200, index / 200].map(|at| at as f64 - 100.0);
        let [x, y] = [step * (x + aside[index][0]), step * (y + aside[index][1])];
        away + DVec3::new(x, y, 3.0 * step * (0.3 * x / step).sin() * (0.2 * y / step).cos())
    }
}

#[test]
fn far_from_the_origin_runs_are_better_than_one_origin() {
    for mut renderer in crate::renderers() {
        // A scan of 10 km about its middle, with a millimetre between points; and 5,000 km without an origin at all.
        for (away, step) in [(DVec3::new(5e3, -4e3, 12.0), 1e-3), (DVec3::new(5e6, -4e6, 12.0), 1e-2)] {
            let camera = |about: DVec3| {
                let eye = about + step * DVec3::new(60.0, -150.0, 90.0);
                let projection = Projection::PerspectiveFovDeg(40.0);
                Camera { eye, look_at: about, up: DVec3::Z, projection }
            };
            let about = |away: DVec3, origin: DVec3| {
                let place = floor(away, step);
                PointCloud::new(origin, (0..40_000).map(|index| (place(index) - origin).as_vec3().to_array()).collect())
            };
            let mut picture = |cloud: &PointCloud, at: DVec3| {
                renderer.render(cloud, &camera(at), SIZE, &Settings::default()).expect("a picture").image.clone()
            };
            let truth = picture(&about(DVec3::ZERO, DVec3::ZERO), DVec3::ZERO);
            let one_origin = unlike(&picture(&about(away, DVec3::ZERO), away), &truth);
            let sample = about(away, DVec3::ZERO);
            let mut pool = PointPool::new(&sample, 100_000).expect("a pool");
            let place = floor(away, step);
            for (number, first) in (0..40_000).step_by(4000).enumerate() {
                let origin = place(first).round();
                let local = (first..first + 4000).map(|index| (place(index) - origin).as_vec3().to_array());
                assert!(pool.insert(key(number), &PointCloud::new(origin, local.collect())));
            }
            pool.choose(&keys(10));
            let frame = renderer.render(&pool, &camera(away), SIZE, &Settings::default()).expect("a picture");
            let runs = unlike(frame.image, &truth);
            assert!(runs <= MAX_DIFFERENT_SHARE, "{away}: {runs} of the pixels differ");
            assert!(one_origin > 20.0 * MAX_DIFFERENT_SHARE, "{away}: one origin does as well, {one_origin}");
        }
    }
}

/// A pool through which nodes came and went draws what a fresh one does, on a device that has seen all of it.
#[test]
fn nodes_that_left_leave_no_trace() {
    let (cloud, camera) = colored("herd", 60_000);
    let settings = by(ColorMode::Auto);
    let len = 2500;
    // Points of nodes that are twelve apart are in the same places, with other colours: of such points one is seen.
    let colors = cloud.colors().expect("colours");
    let node = |number: usize| {
        let places = piece(&cloud, number % 12 * len..(number % 12 + 1) * len, cloud.origin());
        places.with_colors(colors[number * len..(number + 1) * len].to_vec()).expect("a colour each")
    };
    for mut renderer in crate::renderers() {
        let mut random = Random::new(19);
        let mut pool = PointPool::new(&cloud, 14 * SLOT_POINTS).expect("a pool");
        for round in 0..6 {
            let wanted: Vec<usize> = (0..24).filter(|_| random.unit() < 0.4).take(14).collect();
            let wanted_keys: Vec<NodeKey> = wanted.iter().map(|&number| key(number)).collect();
            for missing in pool.choose(&wanted_keys) {
                assert!(pool.insert(missing, &node(missing.key.x as usize)), "what is not chosen leaves");
            }
            assert_eq!(pool.choose(&wanted_keys), []);
            // A part of the choice, drawn after more was.
            for chosen in [&wanted[..], &wanted[..wanted.len() / 2]] {
                let chosen_keys: Vec<NodeKey> = chosen.iter().map(|&number| key(number)).collect();
                pool.choose(&chosen_keys);
                let mut fresh = PointPool::new(&cloud, 24 * SLOT_POINTS).expect("a pool");
                chosen.iter().for_each(|&number| assert!(fresh.insert(key(number), &node(number))));
                fresh.choose(&chosen_keys);
                let mut other = renderer.another().expect("a renderer");
                let frame = other.render(&fresh, &camera, SIZE, &settings).expect("a picture");
                let expected = result(&frame, Some((&fresh, len)));
                let frame = renderer.render(&pool, &camera, SIZE, &settings).expect("a picture");
                assert_eq!(frame.counts.points, chosen.len() * len);
                assert!(result(&frame, Some((&pool, len))) == expected, "round {round}, {:?}", renderer.adapter());
            }
        }
    }
}

/// Frames are averaged by the index of a point, which other nodes' comings and goings do not change.
#[test]
fn averages_over_time_find_the_point_again() {
    let mut random = Random::new(1);
    let wave = |random: &mut Random| {
        let [x, y] = [random.signed(), random.signed()];
        Vec3::new(x, y, 0.1 * (3.0 * x).sin() + 0.02 * random.gaussian()).to_array()
    };
    let cloud = PointCloud::new(DVec3::ZERO, (0..20_000).map(|_| wave(&mut random)).collect());
    let camera = |frame: usize| Camera {
        eye: DVec3::new(0.3 + 0.02 * frame as f64, 0.2, 3.0),
        look_at: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::PerspectiveFovDeg(40.0),
    };
    let settings = |frames_averaged| {
        let reconstruction = Reconstruction { frames_averaged, ..Reconstruction::default() };
        Settings { reconstruction, all_layers: true, ..Settings::default() }
    };
    let node = |number: usize| piece(&cloud, number * 5000..(number + 1) * 5000, DVec3::ZERO);
    let elsewhere = PointCloud::new(DVec3::ZERO, vec![[90.0; 3]; 9000]);
    // Depths of the picture, of which each pixel is known by its column and row.
    let depths = |frame: &Frame<'_>| -> Vec<f32> {
        let pixels = (0..SIZE[1] as usize).flat_map(|y| (0..SIZE[0] as usize).map(move |x| (x, y)));
        pixels.map(|(x, y)| frame.layers.depth[frame.layers.index(x, y)]).collect()
    };
    let moved = |a: &[f32], b: &[f32]| {
        let others = a.iter().zip(b).filter(|(a, b)| a != b && !((*a - *b).abs() <= 1e-4)).count();
        others as f64 / a.len() as f64
    };
    for mut renderer in crate::renderers() {
        let of_cloud = |frames_averaged| {
            let mut renderer = renderer.another().expect("a renderer");
            let pictures = (0..10).map(|frame| {
                depths(&renderer.render(&cloud, &camera(frame), SIZE, &settings(frames_averaged)).expect("a picture"))
            });
            pictures.last().expect("ten frames")
        };
        let [alone, expected] = [of_cloud(1), of_cloud(8)];
        // The last of ten frames of pools in which points stay, or move before each frame.
        let mut of_pool = |moves: bool| {
            let mut pool = PointPool::new(&cloud, 14 * SLOT_POINTS).expect("a pool");
            let mut last = Vec::new();
            for frame in 0..10 {
                for number in (0..4).filter(|_| moves) {
                    pool.remove(key(number));
                }
                for number in (0..4).map(|number| (number + frame) % 4) {
                    assert!(pool.insert(key(number), &node(number)));
                }
                pool.choose(&keys(4));
                // Something else comes, and before it something else goes.
                assert!(pool.insert(key(100 + frame), &elsewhere));
                last = depths(&renderer.render(&pool, &camera(frame), SIZE, &settings(8)).expect("a picture"));
            }
            last
        };
        let [stays, moves] = [false, true].map(|moves| moved(&of_pool(moves), &expected));
        let averaged = moved(&alone, &expected);
        assert!(averaged > 0.2, "averaging changes {averaged}");
        assert!(stays < 0.01 * averaged, "{stays} of the depths are not the cloud's");
        assert!(moves > 0.2 * averaged, "points that move count as the same: {moves} of {averaged}");
    }
}

#[test]
fn exposure_is_that_of_the_scan_whatever_is_loaded() {
    let (cloud, camera) = scene("statue", 20_000);
    // The first half is dark, and the second is not.
    let colors = (0..20_000).map(|index| if index < 10_000 { [60; 3] } else { [200; 3] }).collect();
    let cloud = PointCloud::new(cloud.origin(), cloud.positions().to_vec()).with_colors(colors).expect("colours");
    let dark = piece(&cloud, 0..10_000, cloud.origin());
    let [of_dark, of_all] = [&dark, &cloud].map(usual_exposure);
    assert!(of_dark > 2.0 * of_all, "{of_dark} {of_all}");
    let mut pool = PointPool::new(&cloud, 10 * SLOT_POINTS).expect("a pool");
    assert!(pool.insert(key(0), &dark));
    pool.choose(&[key(0)]);
    let mut renderer = Renderer::new();
    let image = renderer.render(&pool, &camera, SIZE, &Settings::default()).expect("a picture").image.clone();
    let mut settings = Settings::default();
    settings.shading.exposure = Some(of_all);
    assert_eq!(&image, renderer.render(&dark, &camera, SIZE, &settings).expect("a picture").image);
    let mut settings = Settings::default();
    renderer.settle(&mut settings, &pool, &camera, SIZE, &|| true).expect("a picture");
    assert_eq!(settings.shading.exposure, Some(of_all));
}

#[test]
fn a_pool_in_several_bindings_on_the_callers_own_device() {
    if crate::gpu().is_none() {
        return;
    }
    let (cloud, camera) = scene("statue", 700_000);
    let pool = cut(&cloud, 60_000, true);
    assert!(pool.capacity() * 12 > 2 * (4 << 20), "the points take three bindings");
    let (device, queue) = own_device(4 << 20).expect("a device");
    let mut own = Renderer::with_device(device, queue).expect("a renderer");
    let size = [170, 120];
    let expected = Renderer::new().render(&pool, &camera, size, &Settings::default()).expect("a picture").image.clone();
    let frame = own.render(&pool, &camera, size, &Settings::default()).expect("a picture");
    let unlike = unlike(&expected, frame.image);
    assert!(unlike <= MAX_DIFFERENT_SHARE, "{unlike} of the pixels differ");
}

/// What a device that uploads only what changed must not miss: another scan, another field, a stopped upload.
#[test]
fn uploads_are_complete() {
    let Some(mut gpu) = crate::gpu() else { return };
    let (cloud, camera) = colored("statue", 30_000);
    let [by_time, by_color] = [ColorMode::Field("GpsTime".into()), ColorMode::Auto].map(by);
    let mut pool = PointPool::new(&cloud, 20 * SLOT_POINTS).expect("a pool");
    let node = |number: usize| piece(&cloud, number * 10_000..(number + 1) * 10_000, cloud.origin());
    let check = |gpu: &mut Renderer, pool: &PointPool, settings: &Settings, case: &str| {
        let mut fresh = gpu.another().expect("a renderer");
        let expected = result(&fresh.render(pool, &camera, SIZE, settings).expect("a picture"), None);
        assert!(result(&gpu.render(pool, &camera, SIZE, settings).expect("a picture"), None) == expected, "{case}");
    };
    assert!(pool.insert(key(0), &node(0)));
    pool.choose(&keys(1));
    check(&mut gpu, &pool, &by_color, "one node");
    assert!(pool.insert(key(1), &node(1)));
    pool.choose(&keys(2));
    check(&mut gpu, &pool, &by_time, "another node by another field");
    assert!(pool.insert(key(2), &node(2)));
    pool.choose(&keys(3));
    assert!(matches!(gpu.upload(&pool, &by_time, &|_| false), Err(Error::Cancelled)));
    check(&mut gpu, &pool, &by_time, "after a stopped upload");
    gpu.render(&cloud, &camera, SIZE, &by_time).expect("a picture");
    check(&mut gpu, &pool, &by_time, "after a cloud");
    check(&mut gpu, &cut(&cloud, 5000, true), &by_time, "another pool");
    pool.remove(key(1));
    assert!(pool.insert(key(1), &piece(&cloud, 0..4000, DVec3::ONE)));
    pool.choose(&keys(3));
    gpu.upload(&pool, &by_time, &|_| true).expect("an upload");
    check(&mut gpu, &pool, &by_time, "other points in the same slots");
}

#[test]
fn nothing_chosen_is_nothing_seen() {
    let (cloud, camera) = scene("statue", 5000);
    for mut renderer in crate::renderers() {
        let mut pool = PointPool::new(&cloud, 4 * SLOT_POINTS).expect("a pool");
        let settings = Settings::default();
        let empty = renderer.render(&pool, &camera, SIZE, &settings).expect("a picture");
        assert_eq!((empty.counts.points, empty.counts.covered), (0, 0));
        let empty = empty.image.clone();
        assert!(pool.insert(key(0), &cloud));
        let frame = renderer.render(&pool, &camera, SIZE, &settings).expect("a picture");
        assert_eq!((frame.counts.points, frame.image), (0, &empty), "not chosen");
        pool.choose(&keys(1));
        let frame = renderer.render(&pool, &camera, SIZE, &settings).expect("a picture");
        assert!(frame.counts.points == 5000 && frame.counts.covered > 0);
        pool.remove(key(0));
        assert_eq!(renderer.render(&pool, &camera, SIZE, &settings).expect("a picture").image, &empty, "removed");
        let mut no_room = PointPool::new(&cloud, 0).expect("a pool");
        assert!(!no_room.insert(key(0), &cloud));
        assert_eq!(renderer.render(&no_room, &camera, SIZE, &settings).expect("a picture").image, &empty, "no room");
    }
}

#[test]
fn what_a_pool_lacks_is_refused() {
    let (cloud, camera) = scene("statue", 5000);
    let plain = PointCloud::new(cloud.origin(), cloud.positions().to_vec());
    let pool = cut(&plain, 1000, false);
    for mut renderer in crate::renderers() {
        let refused = renderer.render(&pool, &camera, SIZE, &by(ColorMode::Field("Intensity".into()))).err();
        assert!(matches!(refused, Some(Error::MissingAttribute { .. })), "{refused:?}");
        let reconstruction =
            Reconstruction { engine: SearchEngine::KdTree { first_radius: 0.1 }, ..Reconstruction::default() };
        let settings = Settings { reconstruction, ..Settings::default() };
        let refused = renderer.render(&pool, &camera, SIZE, &settings).err();
        assert!(matches!(refused, Some(Error::Device(_))), "{refused:?}");
    }
}
