//! Properties of the pictures of any cloud, through the public API.

use std::collections::HashMap;

use crate::test_clouds::{EYE, PLANE_NORMAL, Positions, Random};
use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::{DQuat, DVec3, EulerRot};
use autosplats::{
    Background, Camera, ColorMode, Counts, Error, GBuffer, Image, Projection, Reconstruction, Renderer, Settings,
    Shading,
};

const SIZE: [u32; 2] = [150, 110];

/// A picture with its layers and counts.
struct Picture {
    image: Image,
    layers: GBuffer,
    counts: Counts,
}

fn render(cloud: &PointCloud, camera: &Camera, size: [u32; 2], settings: &Settings) -> Picture {
    let mut renderer = Renderer::new();
    let frame = renderer.render(cloud, camera, size, settings).expect("a picture");
    Picture { image: frame.image.clone(), layers: frame.layers.clone(), counts: frame.counts }
}

fn cameras() -> [Camera; 2] {
    let camera = |projection| Camera { eye: EYE, look_at: DVec3::ZERO, up: DVec3::new(0.1, -1.0, 0.0), projection };
    [camera(Projection::PerspectiveFovDeg(36.0)), camera(Projection::OrthographicHeight(2.4))]
}

fn cloud(positions: &[[f32; 3]]) -> PointCloud {
    PointCloud::new(DVec3::ZERO, positions.to_vec())
}

/// Settings that fill every layer and show values unlit.
fn settings() -> Settings {
    let shading = Shading { color: ColorMode::Plain, lighting: true, occlusion: 0.0, ..Shading::default() };
    Settings { shading, all_layers: true, ..Settings::default() }
}

/// The visible surface per pixel: weight, depth, normal, radius, k-radius, curvature.
fn pixels(layers: &GBuffer) -> Vec<[f32; 8]> {
    let [width, height] = [layers.width as usize, layers.height as usize];
    let indices = (0..width * height).map(|pixel| layers.index(pixel % width, pixel / width));
    let values = indices.map(|i| {
        let [x, y, z] = layers.normal[i];
        [layers.weight[i], layers.depth[i], x, y, z, layers.radius[i], layers.k_radius[i], layers.curvature[i]]
    });
    values.collect()
}

/// Asserts equal bits, except for the choice among equal points.
fn assert_same(a: &Picture, b: &Picture, what: &str) {
    assert_eq!(a.counts, b.counts, "{what}: counts");
    assert!(a.image == b.image, "{what}: image");
    let bits = |picture: &Picture| pixels(&picture.layers).into_iter().flatten().map(f32::to_bits).collect::<Vec<_>>();
    assert!(bits(a) == bits(b), "{what}: layers");
}

/// Fraction of the pixels where two pictures differ in coverage, or by more than 1 % in depth or splat radius. `b` is
/// in units of `unit`.
fn difference(a: &GBuffer, b: &GBuffer, unit: f64) -> f64 {
    let near = |a: f32, b: f32| (f64::from(a) - f64::from(b) / unit).abs() <= 0.01 * f64::from(a).abs();
    let differs = |(a, b): &(&[f32; 8], &[f32; 8])| {
        let covered = [a[0] > 0.0, b[0] > 0.0];
        covered[0] != covered[1] || (covered[0] && !(near(a[1], b[1]) && near(a[5], b[5])))
    };
    let (a, b) = (pixels(a), pixels(b));
    a.iter().zip(&b).filter(differs).count() as f64 / a.len() as f64
}

#[test]
fn difference_sees_another_picture() {
    let [camera, _] = cameras();
    let sphere = render(&cloud(&crate::test_clouds::sphere(4000)), &camera, SIZE, &settings());
    let other = render(&cloud(&crate::test_clouds::sphere(3000)), &camera, SIZE, &settings());
    let moved = Camera { eye: EYE + DVec3::X * 0.1, ..camera };
    let moved = render(&cloud(&crate::test_clouds::sphere(4000)), &moved, SIZE, &settings());
    assert_eq!(difference(&sphere.layers, &sphere.layers, 1.0), 0.0, "a picture is like itself");
    assert!(difference(&sphere.layers, &other.layers, 1.0) > 0.05, "not noticed: fewer points");
    assert!(difference(&sphere.layers, &moved.layers, 1.0) > 0.05, "not noticed: another place");
    assert!(difference(&sphere.layers, &sphere.layers, 1.02) > 0.3, "not noticed: another unit");
}

/// Removes points that are as deep, to f32, as another point near them on the screen. Such ties go to the lower index,
/// so the order of points would matter. Copies of a point stay.
fn without_ties(positions: &[[f32; 3]], camera: &Camera) -> Positions {
    let axes = camera.axes().expect("a valid camera");
    let mut taken: HashMap<[i64; 2], Vec<([f32; 3], f64)>> = HashMap::new();
    let mut kept = Positions::new();
    for &position in positions {
        let offset = DVec3::from(position.map(f64::from)) - camera.eye;
        let [x, y, depth] = axes.map(|axis| axis.dot(offset));
        let scale = match camera.projection {
            Projection::PerspectiveFovDeg(fov) => 0.5 / (0.5 * fov.to_radians()).tan() / depth,
            Projection::OrthographicHeight(height) => 1.0 / height,
            Projection::Pinhole { .. } => unreachable!("not among these cameras"),
        };
        // Squares of about a pixel, independent of the pixels' borders: a square and those around it contain the pixel.
        let square = [x, y].map(|c| (c * scale * f64::from(SIZE[1])).floor() as i64);
        let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| [square[0] + dx, square[1] + dy]));
        let others = || around.clone().filter_map(|square| taken.get(&square)).flatten();
        // Steps of f32 at these depths are 5e-7.
        if others().all(|&(other, other_depth)| other == position || (other_depth - depth).abs() > 2e-6) {
            taken.entry(square).or_default().push((position, depth));
            kept.push(position);
        }
    }
    kept
}

#[test]
fn order_of_points_does_not_matter() {
    for camera in cameras() {
        for (name, positions) in crate::test_clouds::all(5000) {
            let positions = without_ties(&positions, &camera);
            let mut shuffled = positions.clone();
            Random::new(41).shuffle(&mut shuffled);
            let first = render(&cloud(&positions), &camera, SIZE, &settings());
            assert_same(&first, &render(&cloud(&shuffled), &camera, SIZE, &settings()), name);
        }
    }
}

#[test]
fn same_bytes_again_and_with_any_number_of_threads() {
    let mut renderer = Renderer::new();
    for camera in cameras() {
        for (name, positions) in crate::test_clouds::all(20_000) {
            let cloud = cloud(&positions);
            let first = render(&cloud, &camera, SIZE, &settings());
            // One renderer for all frames: the last frame must not show.
            let frame = renderer.render(&cloud, &camera, SIZE, &settings()).expect("a picture");
            let again = Picture { image: frame.image.clone(), layers: frame.layers.clone(), counts: frame.counts };
            assert_same(&first, &again, name);
            assert_eq!(first.layers.point, again.layers.point, "{name}: source points");
            for threads in [1, 2] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool");
                let picture = pool.install(|| render(&cloud, &camera, SIZE, &settings()));
                assert_same(&first, &picture, name);
                assert_eq!(first.layers.point, picture.layers.point, "{name}: source points of {threads} threads");
            }
        }
    }
}

/// Cloud and camera moved and turned together give the same picture up to rounding.
#[test]
fn only_the_relative_place_matters() {
    let turn = DQuat::from_euler(EulerRot::XYZ, 0.4, -1.1, 2.0);
    let shift = DVec3::new(12.0, -7.0, 3.0);
    for camera in cameras() {
        for positions in [crate::test_clouds::sphere(4000), crate::test_clouds::edge(4000)] {
            let moved: Positions = positions
                .iter()
                .map(|&p| (turn * DVec3::from(p.map(f64::from)) + shift).as_vec3().to_array())
                .collect();
            let moved_camera = Camera {
                eye: turn * camera.eye + shift,
                look_at: turn * camera.look_at + shift,
                up: turn * camera.up,
                ..camera
            };
            let [a, b] = [(&positions, camera), (&moved, moved_camera)]
                .map(|(positions, camera)| render(&cloud(positions), &camera, SIZE, &settings()));
            let difference = difference(&a.layers, &b.layers, 1.0);
            // Moved coordinates are rounded at 16, to 1e-6. A few points change pixels, and with them the nearest
            // points there.
            assert!(difference < 0.01, "{difference} of the picture changes: {:?}", camera.projection);
            // Survey coordinates: a far origin changes nothing at all.
            let far = DVec3::new(4_500_000.0, 5_000_000.0, 300.0);
            let far_camera = Camera { eye: camera.eye + far, look_at: camera.look_at + far, ..camera };
            let c = render(&PointCloud::new(far, positions.clone()), &far_camera, SIZE, &settings());
            let difference = self::difference(&a.layers, &c.layers, 1.0);
            // The sums eye + origin are rounded at 5e6, to 1e-9.
            assert!(difference < 0.001, "{difference} of the picture changes far away: {:?}", camera.projection);
        }
    }
}

#[test]
fn units_do_not_matter() {
    for camera in cameras() {
        for positions in [crate::test_clouds::sphere(4000), crate::test_clouds::density_ramp(4000)] {
            let base = render(&cloud(&positions), &camera, SIZE, &settings());
            // Powers of two do not change rounding, powers of ten do.
            for (unit, limit) in [(1.0 / 1048576.0, 1e-9), (1048576.0, 1e-9), (1e-6, 0.01), (1e3, 0.01), (1e6, 0.01)] {
                let scaled: Positions = positions.iter().map(|p| p.map(|c| (f64::from(c) * unit) as f32)).collect();
                let projection = match camera.projection {
                    Projection::OrthographicHeight(height) => Projection::OrthographicHeight(height * unit),
                    perspective => perspective,
                };
                let camera = Camera { eye: camera.eye * unit, projection, ..camera };
                let camera = Camera { look_at: camera.look_at * unit, ..camera };
                let picture = render(&cloud(&scaled), &camera, SIZE, &settings());
                let difference = difference(&base.layers, &picture.layers, unit);
                assert!(difference <= limit, "{difference} of the picture changes in units of {unit}");
            }
        }
    }
}

/// For the same points and pixels, the k-radius does not decrease with k.
#[test]
fn k_radius_does_not_decrease_with_k() {
    for camera in cameras() {
        for (name, positions) in crate::test_clouds::all(3000) {
            let mut before: Vec<f32> = Vec::new();
            for k in [1, 2, 5, 10, 11, 30, 64] {
                // Dots, so that each pixel with a point shows this point's own k-radius; without adaptation, which may
                // move them.
                let reconstruction = Reconstruction {
                    k,
                    outlier_expansions: None,
                    gap_factor: None,
                    splat_scale: 0.01,
                    grid_culling: false,
                    ..Reconstruction::paper()
                };
                let layers =
                    render(&cloud(&positions), &camera, SIZE, &Settings { reconstruction, ..settings() }).layers;
                let mut k_radius = vec![0f32; positions.len()];
                for i in 0..layers.point.len() {
                    if let Some(value) = k_radius.get_mut(layers.point[i] as usize) {
                        *value = value.max(layers.k_radius[i]);
                    }
                }
                // A pixel averages the dots that reach into it, which rounds the mean.
                let alone = |i: &usize| before.get(*i).is_some_and(|&r| r > 0.0) && k_radius[*i] > 0.0;
                let smaller = (0..positions.len()).filter(alone).filter(|&i| k_radius[i] < 0.9999 * before[i]).count();
                assert_eq!(smaller, 0, "{name}: k-radii that fall at k = {k}");
                before = k_radius;
            }
        }
    }
}

#[test]
fn normals_of_a_plane_are_the_planes() {
    for camera in cameras() {
        let picture = render(&cloud(&crate::test_clouds::plane(6000)), &camera, SIZE, &settings());
        let [right, down, forward] = camera.axes().expect("a valid camera");
        let expected = DVec3::from([right, down, forward].map(|axis| PLANE_NORMAL.normalize().dot(axis)));
        let mut covered = 0;
        for pixel in pixels(&picture.layers).iter().filter(|pixel| pixel[0] > 0.0) {
            let normal = DVec3::new(f64::from(pixel[2]), f64::from(pixel[3]), f64::from(pixel[4]));
            // f32 rounds positions to 1e-7; neighbourhoods are 0.05 wide.
            assert!((normal - expected).length() < 1e-4, "{normal} is not {expected}");
            assert!(pixel[7] < 1e-6, "a plane has no curvature: {}", pixel[7]);
            covered += 1;
        }
        assert!(covered > 5000, "there is a plane: {covered} pixels");
    }
}

#[test]
fn one_color_stays_that_color() {
    const COLOR: [u8; 3] = [200, 31, 90];
    for camera in cameras() {
        for (name, positions) in crate::test_clouds::all(4000) {
            let cloud = cloud(&positions).with_colors(vec![COLOR; positions.len()]).expect("a colour for each point");
            let shading =
                Shading { lighting: false, occlusion: 0.0, background: Background::Transparent, ..Shading::default() };
            let picture = render(&cloud, &camera, SIZE, &Settings { shading, ..Settings::default() });
            let [r, g, b] = COLOR;
            for (pixel, color) in picture.image.pixels.iter().enumerate() {
                let index = picture.layers.index(pixel % SIZE[0] as usize, pixel / SIZE[0] as usize);
                let alpha = color[3];
                let expected = if alpha > 0 { [r, g, b, alpha] } else { [0; 4] };
                assert_eq!(*color, expected, "{name}: pixel {pixel}");
                // At edges alpha is the covered fraction.
                assert_eq!(alpha >= 128, picture.layers.weight[index] > 0.0, "{name}: pixel {pixel}, alpha {alpha}");
            }
        }
    }
}

/// Points that are not finite or astronomically far away do not change the picture.
#[test]
fn poison_changes_nothing() {
    let poison = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1e38, 1e38, 1e30, -1e25];
    let rules = [
        Reconstruction::default(),
        // Not adaptive: far points in the picture make slabs of cells thicker, which may uncover a pixel of a
        // silhouette.
        Reconstruction {
            k: 64,
            outlier_expansions: None,
            gap_factor: None,
            adaptive: false,
            ..Reconstruction::default()
        },
    ];
    for camera in cameras() {
        for (name, positions) in crate::test_clouds::all(3000) {
            for reconstruction in &rules {
                let mut random = Random::new(42);
                let mut mixed = positions.clone();
                for _ in 0..300 {
                    let mut point = random.direction();
                    for _ in 0..1 + random.below(3) {
                        point[random.below(3)] = poison[random.below(poison.len())];
                    }
                    mixed.push(point);
                }
                let settings = Settings { reconstruction: reconstruction.clone(), ..settings() };
                let clean = render(&cloud(&positions), &camera, SIZE, &settings);
                let picture = render(&cloud(&mixed), &camera, SIZE, &settings);
                let mut freed = 0;
                for (clean, pixel) in pixels(&clean.layers).iter().zip(pixels(&picture.layers)) {
                    let finite = pixel.iter().enumerate().all(|(layer, value)| layer == 1 || value.is_finite());
                    assert!(finite && !pixel[1].is_nan(), "{name}: {pixel:?} instead of {clean:?}");
                    if clean[0] > 0.0 && pixel[1] > 100.0 {
                        assert!(pixel[0] == 0.0, "{name}: a far point hides {clean:?}");
                        freed += 1;
                    }
                }
                // Silhouettes depend on the noise level and on all points around them, and far points affect both.
                assert!(freed <= 10, "{name}: {freed} pixels come free");
                let dropped = picture.counts.dropped - clean.counts.dropped;
                let seen = 300 - dropped;
                assert!(seen < 50, "{name}: {seen} far points are in the picture");
                // Finite far points count as points: fewer than 64 points may become a surface.
                if seen == 0 && positions.len() >= 64 {
                    assert!(clean.image == picture.image, "{name}: the image changes");
                }
            }
        }
    }
}

#[test]
fn extreme_clouds_and_sizes() {
    let clouds = [
        ("none", vec![]),
        ("one point", vec![[0.1, 0.2, 0.3]]),
        ("two points", vec![[0.1, 0.2, 0.3], [0.2, 0.2, 0.3]]),
        ("equal points", vec![[0.1, 0.2, 0.3]; 10_000]),
        ("not a number", vec![[f32::NAN; 3]; 100]),
        ("behind", crate::test_clouds::behind(500)),
        ("fewer than k", crate::test_clouds::sphere(30)),
        ("sphere", crate::test_clouds::sphere(3000)),
    ];
    for camera in cameras() {
        for (name, positions) in &clouds {
            for size in [[1, 1], [1, 200], [200, 1], [16_384, 3], SIZE] {
                for (k, e0, lambda) in
                    [(10, Some(3), Some(4.0)), (64, None, None), (1, None, Some(1.5)), (64, Some(8), None)]
                {
                    for ellipses in [false, true] {
                        let reconstruction = Reconstruction {
                            k,
                            outlier_expansions: e0,
                            gap_factor: lambda,
                            ellipses,
                            splat_scale: 3.0,
                            ..Reconstruction::default()
                        };
                        let picture =
                            render(&cloud(positions), &camera, size, &Settings { reconstruction, ..settings() });
                        let Picture { image, layers, counts } = picture;
                        let label = format!("{name}, {size:?}, k = {k}");
                        assert_eq!(image.pixels.len(), (size[0] * size[1]) as usize, "{label}: size of the image");
                        assert_eq!(
                            counts.dropped,
                            counts.not_finite + counts.behind + counts.outside,
                            "{label}: dropped"
                        );
                        assert_eq!(counts.visible, counts.active + counts.passive, "{label}: visible");
                        assert!(counts.visible + counts.dropped <= counts.points, "{label}: {counts:?}");
                        let all = pixels(&layers);
                        assert!(all.iter().flatten().all(|value| !value.is_nan()), "{label}: a value is not a number");
                        if counts.visible == 0 || (counts.visible == counts.outliers) {
                            assert!(all.iter().all(|pixel| pixel[0] == 0.0), "{label}: nothing is drawn");
                        }
                        if e0.is_none() && counts.visible > 0 {
                            assert!(all.iter().any(|pixel| pixel[0] > 0.0), "{label}: points are kept as dots");
                        }
                    }
                }
            }
        }
    }
}

/// A surface that becomes sparse towards the picture's edges does not end there.
#[test]
fn what_becomes_sparse_does_not_end_at_the_edges() {
    let mut random = Random::new(51);
    // Three times as dense every 0.3 towards -x.
    let positions: Positions = (0..150_000)
        .map(|_| {
            let x = 1.2 + 0.27 * (1e-6 + 0.5 + 0.5 * random.signed()).max(1e-6).ln();
            [x, 1.2 * random.signed(), 0.3 * x]
        })
        .collect();
    let cloud = cloud(&crate::test_clouds::noisy(positions, 0.03));
    for up in [DVec3::Y, DVec3::X, DVec3::NEG_Y, DVec3::NEG_X] {
        let camera = Camera {
            eye: DVec3::new(0.1, 0.0, -4.0),
            look_at: DVec3::new(0.1, 0.0, 0.0),
            up,
            projection: Projection::PerspectiveFovDeg(17.0),
        };
        let picture = render(&cloud, &camera, [200, 200], &settings());
        let open = 1.0 - picture.counts.covered as f64 / 40_000.0;
        assert!(open < 5e-5, "{open} of the picture is open, upward is {up}");
    }
}

#[test]
fn edges_are_as_if_the_picture_were_larger() {
    const MORE: u32 = 60;
    const STRIP: usize = 8;
    let settings = settings();
    let cloud = cloud(&crate::test_clouds::noisy(crate::test_clouds::sphere(60_000), 0.01));
    let tangent = 15f64.to_radians().tan() / 2.0;
    let larger = SIZE.map(|side| side + 2 * MORE);
    let fov = |tangent: f64| Projection::PerspectiveFovDeg(2.0 * tangent.atan().to_degrees());
    let grown = tangent * f64::from(larger[1]) / f64::from(SIZE[1]);
    let [camera, larger_camera] = [tangent, grown].map(|tangent| Camera { projection: fov(tangent), ..cameras()[0] });
    let picture = render(&cloud, &camera, SIZE, &settings).layers;
    let larger = render(&cloud, &larger_camera, larger, &settings).layers;
    let [width, height] = SIZE.map(|side| side as usize);
    let (mut along, mut within) = (Vec::new(), Vec::new());
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let (a, b) = (picture.index(x, y), larger.index(x + MORE as usize, y + MORE as usize));
        let cosine: f32 = picture.normal[a].iter().zip(larger.normal[b]).map(|(a, b)| a * b).sum();
        let is_within = (STRIP..width - STRIP).contains(&x) && (STRIP..height - STRIP).contains(&y);
        // The cosine is 0 where only one of the pictures is covered.
        if is_within { &mut within } else { &mut along }.push(cosine.min(1.0).acos().to_degrees());
    }
    let [along, within] = [along, within].map(|angles| angles.iter().sum::<f32>() / angles.len() as f32);
    assert!(along < 1.5 * within + 0.1, "normals differ by {along}° along edges, and by {within}° elsewhere");
}

/// Impossible requests return an error that names the reason.
#[test]
fn settings_out_of_range_are_errors() {
    let cloud = cloud(&crate::test_clouds::plane(10));
    let [camera, _] = cameras();
    let mut renderer = Renderer::new();
    let mut with = |change: fn(&mut Reconstruction)| {
        let mut settings = Settings::default();
        change(&mut settings.reconstruction);
        matches!(renderer.render(&cloud, &camera, SIZE, &settings), Err(Error::Setting { .. }))
    };
    type Change = fn(&mut Reconstruction);
    let wrong: [(&str, Change); 7] = [
        ("no neighbours", |r| r.k = 0),
        ("too many neighbours", |r| r.k = 65),
        ("too many expansions", |r| r.outlier_expansions = Some(9)),
        ("a gap that shrinks", |r| r.gap_factor = Some(1.0)),
        ("a gap of NaN", |r| r.gap_factor = Some(f32::NAN)),
        ("no splats", |r| r.splat_scale = 0.0),
        ("splats of NaN", |r| r.splat_scale = f32::NAN),
    ];
    for (name, change) in wrong {
        assert!(with(change), "no error: {name}");
    }
    assert!(!with(|_| ()), "the defaults are within range");
    for size in [[0, 5], [5, 0], [100_000, 100_000]] {
        let outcome = renderer.render(&cloud, &camera, size, &Settings::default());
        assert!(matches!(outcome, Err(Error::ImageSize { .. })), "no error: {size:?}");
    }
    let shading = Shading { color: ColorMode::Field("no such".into()), ..Shading::default() };
    let outcome = renderer.render(&cloud, &camera, SIZE, &Settings { shading, ..Settings::default() });
    assert!(matches!(outcome, Err(Error::MissingAttribute { .. })), "no error: unknown field");
}

/// Grid culling saves work: postponed points that are not recovered are hidden anyway.
#[test]
fn grid_culling_changes_next_to_nothing() {
    let clouds = [
        ("sphere", crate::test_clouds::sphere(12_000)),
        ("two layers", crate::test_clouds::two_layers(16_000)),
        ("edge", crate::test_clouds::edge(8000)),
    ];
    for camera in cameras() {
        for (name, positions) in &clouds {
            let mut settings = settings();
            let culled = render(&cloud(positions), &camera, SIZE, &settings);
            settings.reconstruction.grid_culling = false;
            let all = render(&cloud(positions), &camera, SIZE, &settings);
            assert_eq!(all.counts.passive, 0, "{name}: nothing is culled");
            let difference = difference(&all.layers, &culled.layers, 1.0);
            // Splats of hidden points may lie within ε of the surface, at its rim and between its points. A passive
            // point that a wide splat hides by mistake is missing.
            assert!(difference < 0.02, "{name}: {difference} of the picture differs, {:?}", camera.projection);
        }
    }
}
