//! Sides of a surface, for clouds with the positions of their sensors.

use autosplats::cloud::glam::{DMat4, DVec3, Vec3};
use autosplats::cloud::{PointCloud, Scan};
use autosplats::{Backs, Camera, ColorMode, GBuffer, Image, Projection, Renderer, Settings, Shading};

const SIZE: [u32; 2] = [240, 180];
const ORIGIN: DVec3 = DVec3::new(5e5, 5e6, 200.0);
/// Half the side of the box.
const SIDE: f64 = 2.0;

/// Points on five faces of a box about the origin, seen from `sensor`. The face at -y is missing.
fn room(sensor: Option<DVec3>) -> PointCloud {
    const ROWS: u32 = 60;
    let step = |i: u32| SIDE * ((f64::from(i) + 0.5) / f64::from(ROWS) * 2.0 - 1.0);
    let mut positions = Vec::new();
    for face in [0, 1, 2, 3, 5] {
        let (axis, side) = (face % 3, if face < 3 { SIDE } else { -SIDE });
        for (a, b) in (0..ROWS * ROWS).map(|i| (step(i % ROWS), step(i / ROWS))) {
            let mut point = [0.0; 3];
            (point[axis], point[(axis + 1) % 3], point[(axis + 2) % 3]) = (side, a, b);
            positions.push(DVec3::from(point).as_vec3().to_array());
        }
    }
    let count = positions.len();
    let scan = |at| Scan { name: None, world_from_sensor: DMat4::from_translation(ORIGIN + at), points: 0..count };
    PointCloud::new(ORIGIN, positions).with_scans(sensor.map(scan).into_iter().collect())
}

fn camera(eye: DVec3) -> Camera {
    let projection = Projection::PerspectiveFovDeg(45.0);
    Camera { eye: ORIGIN + eye, look_at: ORIGIN, up: DVec3::Z, projection }
}

/// Eyes in front of the missing wall, and behind the opposite wall.
const BEFORE: DVec3 = DVec3::new(0.4, -8.0, 0.5);
const BEHIND: DVec3 = DVec3::new(0.4, 8.0, 0.5);

fn settings(backs: Backs) -> Settings {
    let shading = Shading { color: ColorMode::Plain, backs, ..Shading::default() };
    Settings { shading, all_layers: true, ..Settings::default() }
}

fn draw(renderer: &mut Renderer, cloud: &PointCloud, eye: DVec3, backs: Backs) -> (Image, GBuffer) {
    let frame = renderer.render(cloud, &camera(eye), SIZE, &settings(backs)).expect("a picture");
    (frame.image.clone(), frame.layers.clone())
}

fn backends() -> Vec<(&'static str, Renderer)> {
    ["CPU", "GPU"].into_iter().zip(crate::renderers()).collect()
}

/// Mean share of backs among the covered pixels.
fn share(layers: &GBuffer) -> f32 {
    let covered = layers.weight.iter().zip(&layers.back).filter(|(weight, _)| **weight > 0.0);
    let (sum, count) = covered.fold((0.0, 0.0_f32), |(sum, count), (_, back)| (sum + back, count + 1.0));
    sum / count
}

/// Mean of all channels.
fn brightness(image: &Image) -> f64 {
    let channels = image.pixels.iter().flat_map(|pixel| &pixel[..3]);
    channels.map(|&channel| f64::from(channel)).sum::<f64>() / (3 * image.pixels.len()) as f64
}

/// Fraction of the pixels that differ by more than two steps in any channel.
fn unlike(a: &Image, b: &Image) -> f64 {
    let differs = |(a, b): &(&[u8; 4], &[u8; 4])| (0..4).any(|i| a[i].abs_diff(b[i]) > 2);
    a.pixels.iter().zip(&b.pixels).filter(differs).count() as f64 / a.pixels.len() as f64
}

#[test]
fn a_room_shows_its_outside_from_behind() {
    let cloud = room(Some(DVec3::new(0.3, 0.0, 0.2)));
    for (name, mut renderer) in backends() {
        let mut both = |eye| [Backs::Toned, Backs::Same].map(|backs| draw(&mut renderer, &cloud, eye, backs));
        let [toned, same] = both(BEFORE);
        // At edges either side may show.
        let other = unlike(&toned.0, &same.0);
        assert!(other < 1e-3, "{name}: what the sensor saw looks as ever: {other}");
        assert!(share(&toned.1) < 1e-3, "{name}: nor has it a back: {}", share(&toned.1));
        let [toned, same] = both(BEHIND);
        assert!(share(&toned.1) > 0.95, "{name}: all backs from behind: {}", share(&toned.1));
        assert_eq!(toned.1.back, same.1.back, "{name}: known however it is shown");
        assert!(brightness(&toned.0) < 0.9 * brightness(&same.0), "{name}: backs are darker");
        for (normal, back) in toned.1.normal.iter().zip(&toned.1.back).filter(|(_, back)| **back > 0.5) {
            assert!(normal[2] < 0.0, "{name}: layers face the eye: {normal:?}, {back}");
        }
    }
}

#[test]
fn surfels_face_their_sensor() {
    let sensor = DVec3::new(0.3, 0.0, 0.2);
    let clouds = [Some(sensor), None].map(room);
    for (name, mut renderer) in backends() {
        // The setting affects the image only.
        for backs in [Backs::Toned, Backs::Same] {
            let settings = Settings { all_layers: false, ..settings(backs) };
            for (cloud, towards) in clouds.iter().zip([sensor, BEHIND]) {
                renderer.render(cloud, &camera(BEHIND), SIZE, &settings).expect("a picture");
                let surfels = renderer.surfels().expect("surfels");
                assert!(surfels.len() > 1000, "{name}: something is seen");
                let away = surfels.iter().filter(|surfel| {
                    let at = Vec3::from(cloud.positions()[surfel.point as usize]);
                    Vec3::from(surfel.normal).dot(towards.as_vec3() - at) < 0.0
                });
                // One point in fifteen lies at edges between faces, where the side is uncertain. From behind more of
                // these are seen, because a pixel keeps two points.
                let away = away.count();
                assert!(away * 20 < surfels.len(), "{name}: {away} of {} look away from {towards}", surfels.len());
            }
        }
    }
}

#[test]
fn a_cloud_without_sensors_looks_as_ever() {
    for (name, mut renderer) in backends() {
        let unknown = [room(None), room(Some(DVec3::NAN)), room(Some(DVec3::splat(1e300)))];
        let pictures = unknown.map(|cloud| draw(&mut renderer, &cloud, BEHIND, Backs::Toned));
        for (image, layers) in &pictures {
            assert!(layers.back.is_empty(), "{name}: no layer");
            assert!(*image == pictures[0].0, "{name}: nor another picture");
        }
        let known = room(Some(DVec3::ZERO));
        let [toned, same] = [Backs::Toned, Backs::Same].map(|backs| draw(&mut renderer, &known, BEHIND, backs).0);
        assert!(same == pictures[0].0 && toned != same, "{name}: only what is asked for");
    }
}

#[test]
fn another_sensor_of_the_same_points_is_noticed() {
    for (name, mut renderer) in backends() {
        let cloud = room(Some(DVec3::ZERO));
        let count = cloud.len();
        let outside = DMat4::from_translation(ORIGIN + 2.0 * BEHIND);
        let scan = |points| Scan { name: None, world_from_sensor: outside, points };
        // A different number of runs needs another buffer on the device.
        let other = [vec![scan(0..count)], vec![scan(0..count / 5), scan(count / 5 + 1..count / 5 + 2)], vec![]];
        let clouds = other.map(|scans| cloud.clone().with_scans(scans));
        let mut share_of = |cloud: &PointCloud| share(&draw(&mut renderer, cloud, BEHIND, Backs::Toned).1);
        for (number, moved) in clouds.iter().enumerate() {
            let inside = share_of(&cloud);
            assert!(inside > 0.95, "{name}: {inside}");
            let found = share_of(moved);
            assert!(found < 0.05 || found.is_nan() && number == 2, "{name}, {number}: {found}");
        }
    }
}

#[test]
fn both_backends_make_one_picture() {
    let mut backends = backends();
    if backends.len() < 2 {
        return;
    }
    let cloud = room(Some(DVec3::new(0.3, 0.0, 0.2)));
    for eye in [BEFORE, BEHIND, DVec3::new(5.0, -5.0, 4.0), DVec3::new(1.0, -0.5, 0.5)] {
        let [a, b] = [0, 1].map(|at| draw(&mut backends[at].1, &cloud, eye, Backs::Toned));
        let unlike = unlike(&a.0, &b.0);
        assert!(unlike <= 1e-3, "{eye}: {unlike} of the pixels differ");
        let [width, height] = [a.1.width, a.1.height].map(|side| side as usize);
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
        let differs = |[x, y]: &[usize; 2]| {
            let [a, b] = [&a.1, &b.1].map(|layers| layers.back[layers.index(*x, *y)]);
            (a - b).abs() > 1e-2
        };
        let backs = pixels.filter(differs).count();
        assert!(backs * 500 <= width * height, "{eye}: {backs} shares differ");
    }
    let [a, b] = [Backs::Toned, Backs::Same].map(|backs| draw(&mut backends[0].1, &cloud, BEHIND, backs).0);
    assert!(unlike(&a, &b) > 0.1, "the comparison sees toned backs");
}
