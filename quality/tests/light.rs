//! The formula for light, which stands in this crate once more, against the renderer's pictures.

use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::DVec3;
use autosplats::{Camera, Projection, Renderer};
use autosplats_quality::light::linear;
use autosplats_quality::method::{paper, plain};
use autosplats_quality::picture::Picture;
use autosplats_quality::view::Rays;

const SIZE: [u32; 2] = [200, 150];

/// Half a sphere before a plane: all normals there are, and steps in depth.
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
        let mut renderer = Renderer::new();
        let frame = renderer.render(&cloud, &camera, SIZE, &plain(paper())).expect("a frame");
        let rays = Rays::new(&camera, SIZE).expect("a camera that can see");
        let picture = Picture::new(frame.layers, &rays);
        let mut covered = 0;
        for (pixel, theirs) in frame.image.linear.iter().enumerate() {
            let ours = linear(&picture, &rays, pixel).unwrap_or_default();
            covered += usize::from(picture.shown[pixel].is_some());
            for i in 0..3 {
                // Theirs is computed in single precision, and so is the slope of a step, from depths.
                assert!((ours[i] - f64::from(theirs[i])).abs() < 2e-3, "pixel {pixel}: {ours:?} and {theirs:?}");
            }
        }
        assert!(covered > 10_000, "{covered} pixels show something");
        // The test would not see eye-dome lighting if there were none.
        let flat = plain(paper());
        let flat = autosplats::Settings { shading: autosplats::Shading { eye_dome: 0.0, ..flat.shading }, ..flat };
        let lit = frame.image.linear.clone();
        let frame = renderer.render(&cloud, &camera, SIZE, &flat).expect("a frame");
        let darker = lit.iter().zip(&frame.image.linear).filter(|(with, without)| without[0] - with[0] > 0.05).count();
        assert!(darker > 50, "steps are darkened in {darker} pixels");
    }
}
