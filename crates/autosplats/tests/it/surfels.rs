//! Surfels of a frame on the host, and frames with precomputed normals.

use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use crate::test_clouds::EYE;
use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::{DVec3, Vec3};
use autosplats::{
    Camera, ColorMode, Error, NormalSettings, Normals, PointSurfel, Projection, Renderer, Settings, estimate_normals,
};

const SIZE: [u32; 2] = [300, 300];

fn camera() -> Camera {
    let projection = Projection::PerspectiveFovDeg(35.0);
    Camera { eye: EYE, look_at: DVec3::ZERO, up: DVec3::new(0.1, -1.0, 0.0), projection }
}

fn sphere() -> PointCloud {
    PointCloud::new(DVec3::ZERO, crate::test_clouds::sphere(20_000))
}

fn by_point(mut surfels: Vec<PointSurfel>) -> Vec<PointSurfel> {
    surfels.sort_by_key(|surfel| surfel.point);
    surfels
}

fn normals(cloud: &PointCloud) -> Normals {
    estimate_normals(cloud, &NormalSettings::default(), &()).expect("normals")
}

#[test]
fn surfels_of_a_close_up_are_those_of_the_picture() {
    let cloud = sphere();
    let camera = Camera { projection: Projection::PerspectiveFovDeg(12.0), ..camera() };
    let mut renderer = Renderer::new();
    let counts = renderer.render(&cloud, &camera, SIZE, &Settings::default()).expect("a picture").counts;
    let surfels = renderer.surfels().expect("surfels");
    let points = cloud.positions();
    let is_seen = |point: usize| {
        let position = DVec3::from(points[point].map(f64::from));
        let (pixel, _) = camera.to_pixel(position, SIZE).expect("a camera").expect("before the eye");
        (0..2).all(|axis| (-0.01..f64::from(SIZE[axis]) + 0.01).contains(&pixel[axis]))
    };
    assert!(surfels.iter().all(|surfel| is_seen(surfel.point as usize)), "all are in the picture");
    assert!(surfels.len() > 300 && surfels.len() < counts.active + counts.recovered, "some are beside it: {counts:?}");
}

#[test]
fn surfels_of_a_sphere_lie_on_it_and_face_the_eye() {
    let cloud = sphere();
    let mut renderer = Renderer::new();
    assert!(renderer.surfels().expect("none yet").is_empty(), "before the first frame");
    let counts = renderer.render(&cloud, &camera(), SIZE, &Settings::default()).expect("a picture").counts;
    let surfels = renderer.surfels().expect("surfels");
    assert_eq!(surfels.len(), counts.active + counts.recovered);
    let mut errors = Vec::new();
    for surfel in &surfels {
        let at = Vec3::from(cloud.positions()[surfel.point as usize]);
        let normal = Vec3::from(surfel.normal);
        assert!(normal.dot(EYE.as_vec3() - at) >= 0.0, "{surfel:?} looks away");
        assert!((normal.length() - 1.0).abs() < 1e-4, "{surfel:?}");
        errors.push(normal.dot(at.normalize()).abs().min(1.0).acos().to_degrees());
    }
    let mean = errors.iter().sum::<f32>() / errors.len() as f32;
    assert!(mean < 3.0, "normals are off by {mean} degrees in the mean");
}

#[test]
fn a_frame_that_fails_leaves_the_surfels_of_the_one_before() {
    for mut renderer in crate::renderers() {
        renderer.render(&sphere(), &camera(), SIZE, &Settings::default()).expect("a picture");
        let before = renderer.surfels().expect("surfels");
        let mut settings = Settings::default();
        settings.shading.color = ColorMode::Rgb;
        let other = Camera { eye: -EYE, ..camera() };
        let failed = renderer.render(&sphere(), &other, SIZE, &settings).err();
        assert!(matches!(failed, Some(Error::MissingAttribute { .. })), "{failed:?}");
        assert_eq!(renderer.surfels().expect("surfels"), before, "seen by the camera that they were found with");
    }
}

#[test]
fn a_frame_that_is_given_up_leaves_nothing_behind() {
    let cloud = sphere();
    let settings = Settings::default();
    let mut renderer = Renderer::new();
    // On several threads some may ask before they hear the answer.
    let threads = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("threads");
    // The picture unless given up, and how often the caller was asked.
    let mut asked_at_most = |most: usize| {
        let asked = AtomicUsize::new(0);
        let go_on = || asked.fetch_add(1, Relaxed) < most;
        let frame = threads.install(|| renderer.render_while(&cloud, &camera(), SIZE, &settings, &go_on));
        let image = frame.map(|frame| frame.image.clone());
        let surfels = renderer.surfels().expect("surfels");
        (image, asked.into_inner(), surfels)
    };
    let (whole, all, _) = asked_at_most(usize::MAX);
    assert!(all > 200, "asked once a task at least, not {all} times");
    // A no to the first question leaves the last frame as it is.
    for moment in 1..20 {
        let most = moment * all / 20;
        let (image, asked, surfels) = asked_at_most(most);
        assert!(matches!(image, Err(Error::Cancelled)), "given up after {most} of {all}");
        assert_eq!(asked, most + 1, "nothing is done after a no");
        assert!(surfels.is_empty(), "half a frame has no surfels");
    }
    let (again, ..) = asked_at_most(usize::MAX);
    assert!(again.expect("a picture") == whole.expect("a picture"), "the same picture after many that were given up");
}

#[test]
fn what_recordings_share_is_given_up_too() {
    let mut settings = Settings::default();
    settings.shading.color = ColorMode::Height;
    let failed = Renderer::new().settle(&mut settings, &sphere(), &camera(), SIZE, &|| false);
    assert!(matches!(failed, Err(Error::Cancelled)) && settings.shading.range.is_none(), "{failed:?}");
}

#[test]
fn both_backends_hand_out_the_same_surfels() {
    let Some(mut gpu) = crate::gpu() else { return };
    let cloud = sphere();
    let mut cpu = Renderer::new();
    assert!(gpu.surfels().expect("none yet").is_empty(), "before the first frame");
    cpu.render(&cloud, &camera(), SIZE, &Settings::default()).expect("a picture");
    gpu.render(&cloud, &camera(), SIZE, &Settings::default()).expect("a picture");
    let [host, device] = [&mut cpu, &mut gpu].map(|renderer| by_point(renderer.surfels().expect("surfels")));
    assert_eq!(host.len(), device.len());
    let alike = |(a, b): &(&PointSurfel, &PointSurfel)| {
        a.point == b.point
            && (a.k_radius - b.k_radius).abs() <= 1e-4 * a.k_radius
            && Vec3::from(a.normal).dot(b.normal.into()) > 0.9999
    };
    let unlike = host.iter().zip(&device).filter(|pair| !alike(pair)).count();
    assert!(unlike * 1000 <= host.len(), "{unlike} of {} differ", host.len());
}

#[test]
fn planes_found_beforehand_make_nearly_the_picture_of_those_found_on_the_fly() {
    let cloud = sphere();
    let normals = normals(&cloud);
    let mut renderer = Renderer::new();
    let on_the_fly = renderer.render(&cloud, &camera(), SIZE, &Settings::default()).expect("a picture").image.clone();
    let beforehand = renderer
        .render_with_normals(&cloud, &normals, &camera(), SIZE, &Settings::default())
        .expect("a picture")
        .image
        .clone();
    let apart = |(a, b): (&[u8; 4], &[u8; 4])| (0..3).map(|i| f64::from(a[i].abs_diff(b[i]))).sum::<f64>();
    let mean =
        on_the_fly.pixels.iter().zip(&beforehand.pixels).map(apart).sum::<f64>() / 3.0 / beforehand.pixels.len() as f64;
    assert!((0.01..4.0).contains(&mean), "pictures differ by {mean} steps in the mean");
    for surfel in renderer.surfels().expect("surfels") {
        let known = Vec3::from(normals.normals[surfel.point as usize]);
        assert!(known.dot(surfel.normal.into()).abs() > 0.9999, "{surfel:?} is not as given: {known}");
        assert!((surfel.radius - normals.radius[surfel.point as usize]).abs() <= 1e-6, "{surfel:?}");
    }
}

#[test]
fn planes_that_are_none_draw_nothing() {
    let cloud = sphere();
    let mut renderer = Renderer::new();
    for projection in [Projection::PerspectiveFovDeg(35.0), Projection::OrthographicHeight(2.5)] {
        let camera = Camera { projection, ..camera() };
        for radius in [f32::NAN, f32::INFINITY, 0.0, -1.0] {
            let mut planes = normals(&cloud);
            planes.radius.fill(radius);
            let frame = renderer.render_with_normals(&cloud, &planes, &camera, SIZE, &Settings::default());
            let counts = frame.expect("a picture").counts;
            assert_eq!(counts.covered, 0, "radius {radius}: {counts:?}");
            assert_eq!(counts.outliers, counts.active + counts.recovered, "radius {radius}: {counts:?}");
        }
        let mut planes = normals(&cloud);
        planes.normals.fill([0.0, f32::NAN, 1.0]);
        let frame = renderer.render_with_normals(&cloud, &planes, &camera, SIZE, &Settings::default());
        assert_eq!(frame.expect("a picture").counts.covered, 0, "normals that are none");
    }
}

#[test]
fn planes_of_another_cloud_are_refused() {
    let cloud = sphere();
    let whole = normals(&cloud);
    let refused = |normals: &Normals| {
        let mut renderer = Renderer::new();
        let refused = renderer.render_with_normals(&cloud, normals, &camera(), SIZE, &Settings::default());
        refused.expect_err("refused").to_string()
    };
    let mut one_less = [(); 3].map(|()| whole.clone());
    one_less[0].normals.pop();
    one_less[1].curvature.pop();
    one_less[2].radius.pop();
    for (normals, what) in one_less.iter().zip(["normals", "curvatures", "radii"]) {
        let message = refused(normals);
        assert!(message.contains(&format!("19999 {what} for 20000 points")), "{message}");
    }
}
