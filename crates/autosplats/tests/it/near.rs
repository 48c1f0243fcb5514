//! Surfaces that the eye almost touches are closed down to the edge of the picture, with both backends.

use std::path::{Path, PathBuf};

use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::{DVec2, DVec3};
use autosplats::{Camera, Projection, Renderer, Settings};

use crate::test_clouds::Random;

/// Distance from the eye up to which the ground has to be closed, in distances between points.
const REACH: f64 = 6.0;

/// Takes a place to the height of the ground there.
type Height = fn([f32; 2]) -> f32;

/// Grounds with a point per square unit.
const GROUNDS: [(&str, Height); 3] = [
    ("level", |_| 0.0),
    ("slope", |[x, y]| 0.4 * x + 0.1 * y),
    ("hills", |[x, y]| 2.0 * (x / 20.0).sin() * (y / 25.0).cos()),
];

/// Ground with `noise` in its heights, of a point per square unit, on a grid or at random.
fn ground(height: Height, grid: bool, noise: f32, half: i16) -> PointCloud {
    let mut random = Random::new(301);
    let mut positions = Vec::new();
    for (x, y) in (-half..half).flat_map(|x| (-half..half).map(move |y| (f32::from(x), f32::from(y)))) {
        let place = if grid {
            [x + 0.3, y + 0.2]
        } else {
            let half = f32::from(half);
            [half * random.signed(), half * random.signed()]
        };
        positions.push([place[0], place[1], height(place) + noise * random.gaussian()]);
    }
    PointCloud::new(DVec3::ZERO, positions)
}

/// Distance along a line of sight to the ground, up to [`REACH`].
fn hit((from, direction): (DVec3, DVec3), height: &dyn Fn(DVec2) -> f64) -> Option<f64> {
    let steps = (0..).map(|step| 0.05 * f64::from(step)).take_while(|along| *along < REACH);
    let below = |at: DVec3| at.z <= height(at.truncate());
    steps.into_iter().find(|along| below(from + direction * *along))
}

/// Asserts that pixels whose line of sight meets the near ground are covered, at about that distance. One in
/// `per_open` may be open.
fn closed(
    renderer: &mut Renderer,
    cloud: &PointCloud,
    camera: &Camera,
    size: [u32; 2],
    height: &dyn Fn(DVec2) -> f64,
    per_open: usize,
    case: &str,
) {
    let settings = Settings { all_layers: true, ..Settings::default() };
    let layers = renderer.render(cloud, camera, size, &settings).expect("a picture").layers;
    let lens = camera.lens(size).expect("a camera");
    let ahead = (camera.look_at - camera.eye).normalize();
    let (mut all, mut open, mut off) = (0, 0, 0);
    for (x, y) in (0..size[1] as usize).flat_map(|y| (0..size[0] as usize).map(move |x| (x, y))) {
        let ray = lens.ray(DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
        let Some(distance) = hit(ray, height) else { continue };
        let at = layers.index(x, y);
        all += 1;
        open += usize::from(layers.weight[at] == 0.0);
        let shown = f64::from(layers.depth[at]) / ray.1.dot(ahead);
        off += usize::from((shown - distance).abs() > 0.4 + 0.15 * distance);
    }
    assert!(all > 0, "{case}: the ground is not in the picture");
    assert!(open.saturating_mul(per_open) <= all, "{case}: {open} of {all} pixels of the ground are open");
    assert!(off * 20 <= all, "{case}: {off} of {all} pixels show the ground elsewhere");
}

/// A walker's cameras at `eye`: level, down, steep and rolled.
fn cameras(eye: DVec3, fov_deg: f64) -> impl Iterator<Item = (String, Camera)> {
    [(5.0f64, 0.0f64), (20.0, 0.0), (60.0, 0.0), (20.0, 15.0)].into_iter().map(move |(down, roll)| {
        let [down, roll] = [down.to_radians(), roll.to_radians()];
        let ahead = DVec3::new(0.9 * down.cos(), 0.4 * down.cos(), -down.sin()).normalize();
        let right = ahead.cross(DVec3::Z).normalize();
        let up = right.cross(ahead) * roll.cos() + right * roll.sin();
        let projection = Projection::PerspectiveFovDeg(fov_deg);
        let camera = Camera { eye, look_at: eye + 10.0 * ahead, up, projection };
        (format!("down {down:.1}, rolled {roll:.1}, field of view {fov_deg}"), camera)
    })
}

#[test]
fn ground_under_the_eye_is_closed() {
    for (mut renderer, backend) in crate::renderers().into_iter().zip(["CPU", "GPU"]) {
        for (name, height) in GROUNDS {
            // Noise tilts discs, so that lines of sight along the ground pass between a few.
            for (kind, grid, noise, per_open) in [
                ("at random", false, 0.0, usize::MAX),
                ("on a grid", true, 0.0, usize::MAX),
                ("rough", false, 0.05, 500),
            ] {
                let cloud = ground(height, grid, noise, 60);
                let height = |at: DVec2| f64::from(height(at.as_vec2().to_array()));
                for above in [0.5, 1.0, 1.7, 3.0, 5.0] {
                    let place = DVec2::new(3.3, -7.1);
                    let eye = place.extend(height(place) + above);
                    // Wide and narrow.
                    for (fov_deg, size) in [(60.0, [160, 120]), (100.0, [120, 160])] {
                        for (view, camera) in cameras(eye, fov_deg) {
                            let case = format!("{name} {kind}, {above} above, {view}, {backend}");
                            if above < REACH * (0.5 * fov_deg).to_radians().sin() {
                                closed(&mut renderer, &cloud, &camera, size, &height, per_open, &case);
                            }
                        }
                    }
                }
            }
        }
    }
}

/// A cloud of a file beside the repository, in `../shared`; none outside of CI if the file is missing.
fn beside(path: &str) -> Option<PointCloud> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let data = std::env::var_os("AUTOSPLATS_DATA").map_or_else(beside, PathBuf::from);
    let path = data.join(path);
    if !path.exists() {
        assert!(std::env::var_os("CI").is_none(), "{} is missing", path.display());
        return None;
    }
    Some(autosplats_formats::read(&path, &()).expect("a cloud"))
}

#[test]
fn a_walk_over_an_aerial_scan() {
    let Some(cloud) = beside("../field/W04_aerial_1pt_m2.ply") else { return };
    for (mut renderer, backend) in crate::renderers().into_iter().zip(["CPU", "GPU"]) {
        for size in [[160, 120], [960, 540]] {
            for (view, camera) in cameras(cloud.origin() + DVec3::new(0.0, 0.0, 1.7), 60.0) {
                let settings = Settings { all_layers: true, ..Settings::default() };
                let layers = renderer.render(&cloud, &camera, size, &settings).expect("a picture").layers;
                let lower =
                    (size[1] * 4 / 5..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x as usize, y as usize)));
                let open = lower.filter(|&(x, y)| layers.weight[layers.index(x, y)] == 0.0).count();
                assert_eq!(open, 0, "{size:?}, {view}, {backend}: open pixels");
            }
        }
    }
}

/// A dense thing behind the eye takes no near ground away.
#[test]
fn ground_before_a_pillar_is_closed() {
    let mut random = Random::new(302);
    let mut positions = ground(|_| 0.0, false, 0.0, 60).positions().to_vec();
    positions.extend((0..20_000).map(|_| {
        let turn = std::f32::consts::PI * random.signed();
        [0.3 * turn.cos() - 0.35, 0.3 * turn.sin() - 2.6, 3.0 * random.unit()]
    }));
    let cloud = PointCloud::new(DVec3::ZERO, positions);
    for (mut renderer, backend) in crate::renderers().into_iter().zip(["CPU", "GPU"]) {
        for (view, camera) in cameras(DVec3::new(1.0, -2.0, 1.7), 60.0) {
            let case = format!("{view}, {backend}");
            closed(&mut renderer, &cloud, &camera, [480, 360], &|_| 0.0, usize::MAX, &case);
        }
    }
}

/// From where its sensor stood, a scan of a street shows what the sensor saw. A few points of it lie close to the
/// eye, with nothing around.
#[test]
fn a_street_from_its_sensor() {
    let Some(cloud) = beside("sequences/kitti_drive_pcd/000000.pcd") else { return };
    let size = [320, 180];
    for (mut renderer, backend) in crate::renderers().into_iter().zip(["CPU", "GPU"]) {
        for ahead in [[10.0, 0.0, -1.0], [7.0, -7.0, -3.0], [0.0, 10.0, -1.0], [-10.0, 0.0, -2.0]] {
            let look_at = DVec3::from(ahead);
            let projection = Projection::PerspectiveFovDeg(60.0);
            let camera = Camera { eye: DVec3::ZERO, look_at, up: DVec3::Z, projection };
            let settings = Settings { all_layers: true, ..Settings::default() };
            let layers = renderer.render(&cloud, &camera, size, &settings).expect("a picture").layers;
            let lens = camera.lens(size).expect("a camera");
            let (mut seen, mut hidden) = (0, 0);
            for (pixel, depth) in (0..cloud.len()).filter_map(|index| lens.to_pixel(cloud.world_position(index))) {
                if pixel.cmpge(DVec2::ZERO).all() && pixel.cmplt(DVec2::from(size.map(f64::from))).all() {
                    let shown = layers.depth[layers.index(pixel.x as usize, pixel.y as usize)];
                    seen += 1;
                    hidden += usize::from(f64::from(shown) < 0.7 * depth);
                }
            }
            assert!(seen > 1000, "{seen} points in the picture");
            assert!(hidden * 10 < seen, "{ahead:?}, {backend}: {hidden} of {seen} points are hidden");
        }
    }
}
