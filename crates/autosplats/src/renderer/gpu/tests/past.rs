//! K-radii that are kept from frame to frame.

use autosplats_scenes::Scene;

use crate::camera::{Camera, Projection, ViewDirection, guess_axes};
use crate::gpu::{read_back, test_gpu};
use crate::points::Points;
use crate::renderer::Settings;
use crate::renderer::gpu::GpuRenderer;
use crate::renderer::texture::Destination;

/// The k-radii of the last frame, and of the one before.
fn radii(renderer: &GpuRenderer) -> [Vec<u32>; 2] {
    let prepared = renderer.prepared.as_ref().expect("a frame was rendered");
    let pixels = prepared.screen.size.iter().map(|&side| side as usize).product::<usize>();
    let mut halves: Vec<u32> = read_back(&renderer.gpu, &prepared.screen.past, 2 * pixels).expect("k-radii");
    let second = halves.split_off(pixels);
    if prepared.past_half == 0 { [second, halves] } else { [halves, second] }
}

#[test]
fn frames_keep_their_radii_beside_those_of_the_last() {
    let Some(gpu) = test_gpu() else { return };
    let (scene, count) = Scene::parse("figure:4K").expect("a scene");
    let cloud = scene.sample(count, &()).expect("points");
    let projection = Projection::PerspectiveFovDeg(40.0);
    let [front, left] = [ViewDirection::Front, ViewDirection::Left]
        .map(|side| Camera::fit(&cloud, guess_axes(&cloud), side, 1.5, projection).expect("a view"));
    let mut renderer = GpuRenderer::new(gpu.clone()).expect("a renderer");
    let mut after = |camera: &Camera| {
        let to = Destination::Memory([96, 64]);
        renderer.render(Points::Cloud(&cloud), camera, to, &Settings::default(), 1.0, &|| true).expect("a picture");
        radii(&renderer)
    };
    let [of_front, none] = after(&front);
    assert!(of_front.iter().filter(|&&radius| radius > 0).count() > 100, "radii were found");
    assert!(none.iter().all(|&radius| radius == 0), "no frame before");
    let [of_left, before] = after(&left);
    assert!(of_left != of_front && before == of_front, "those of the last stay");
    let [again, before] = after(&front);
    assert!(again == of_front && before == of_left, "those before the last are gone");
}
