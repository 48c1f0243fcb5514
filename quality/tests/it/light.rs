//! Pictures lit from depths and normals equal the renderer's own.

use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::DVec3;
use autosplats::{Background, Camera, Projection, Renderer, Settings, Shading};
use autosplats_quality::light::{BACKGROUND, Lit};
use autosplats_quality::method::{paper, plain};
use autosplats_quality::picture::Picture;
use autosplats_quality::rays::Rays;

const SIZE: [u32; 2] = [200, 150];

/// Half a sphere in front of a plane: normals of all directions, and steps in depth.
fn cloud() -> PointCloud {
    let plane = (0..40_000).map(|i| [(i % 200) as f32 * 0.02 - 2.0, 1.0, (i / 200) as f32 * 0.02 - 2.0]);
    let sphere = (0..40_000).map(|i| {
        let height = 1.0 - (i as f32 + 0.5) / 20_000.0;
        let (sin, cos) = (2.399_963 * i as f32).sin_cos();
        let radius = (1.0 - height * height).sqrt();
        [radius * cos, height, radius * sin]
    });
    PointCloud::new(DVec3::ZERO, plane.chain(sphere).collect())
}

#[test]
fn light_is_the_renderers() {
    let cloud = cloud();
    for projection in [Projection::PerspectiveFovDeg(40.0), Projection::OrthographicHeight(3.5)] {
        let camera = Camera { eye: DVec3::new(1.0, -5.0, 1.5), look_at: DVec3::ZERO, up: DVec3::Z, projection };
        let rays = Rays::new(&camera, SIZE).expect("a camera that can see");
        let mut renderer = Renderer::new();
        // Greatest difference of a channel between the renderer's picture and its layers lit again.
        let mut compare = |occlusion: f32| {
            let settings = plain(paper());
            let shading = Shading { background: Background::Color(BACKGROUND), occlusion, ..settings.shading };
            let settings = Settings { shading, ..settings };
            let frame = renderer.render(&cloud, &camera, SIZE, &settings).expect("a frame");
            let lit = Lit::new(&Picture::new(frame.layers, &rays), &rays).flat();
            let pairs = frame.image.pixels.iter().zip(&lit);
            let differences =
                pairs.flat_map(|(theirs, ours)| (0..3).map(|i| (f64::from(theirs[i]) - 255.0 * ours[i]).abs()));
            differences.fold(0.0, f64::max)
        };
        // The tolerance is for normals, which are converted to double precision and back.
        assert!(compare(Shading::default().occlusion) < 1.5, "{projection:?}: the light differs from the renderer's");
        assert!(compare(0.0) > 5.0, "{projection:?}: the test misses the lack of occlusion");
    }
}
