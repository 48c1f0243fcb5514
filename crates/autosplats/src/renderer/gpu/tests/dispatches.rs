//! How many commands a frame is made of.

use autosplats_scenes::Scene;

use crate::camera::{Camera, Projection, ViewDirection, guess_axes};
use crate::gpu::{Clock, Groups, Recorder, StageWork, Step, test_gpu};
use crate::points::Points;
use crate::renderer::gpu::GpuRenderer;
use crate::renderer::texture::Destination;
use crate::renderer::{Reconstruction, Settings};

/// Numbers of one frame.
#[derive(Debug, PartialEq, Eq)]
struct Commands {
    dispatches: usize,
    /// Dispatches of one workgroup.
    single: usize,
    /// Dispatches whose number of workgroups the device counts.
    indirect: usize,
    /// Compute passes begun.
    passes: usize,
    /// Length of the longest chain of dispatches in which each needs the one before it to be done. The device can run
    /// dispatches beside each other only where this is below their number.
    chain: usize,
    /// Bytes bound, as [`StageWork::bytes`] says.
    bytes: u64,
}

impl Commands {
    fn of(renderer: &GpuRenderer) -> Self {
        let work = renderer.stage_work().expect("a frame was rendered");
        let stages: Vec<_> = work.iter().map(|work| work.stage).collect();
        assert!(
            ["project", "search", "fit", "splat", "shade"].iter().all(|stage| stages.contains(stage)),
            "{stages:?}"
        );
        let sum = |count: fn(&StageWork) -> usize| work.iter().map(count).sum();
        let steps = &renderer.prepared.as_ref().expect("a frame was rendered").steps;
        let mut recorder = Recorder::new(&renderer.gpu, &Clock::Off);
        steps.iter().for_each(|step| recorder.run(step));
        let passes = recorder.begun;
        recorder.finish();
        let groups: Vec<&Groups> = steps.iter().filter_map(Step::groups).collect();
        assert_eq!(groups.len(), steps.len(), "no step draws");
        Self {
            dispatches: sum(|work| work.dispatches),
            single: groups.iter().filter(|groups| matches!(groups, Groups::Number(1))).count(),
            indirect: groups.iter().filter(|groups| matches!(groups, Groups::Counted(..))).count(),
            passes,
            chain: sum(|work| work.chain),
            bytes: work.iter().map(|work| work.bytes).sum(),
        }
    }
}

#[test]
fn dispatches_of_a_frame() {
    let Some(gpu) = test_gpu() else { return };
    let (scene, count) = Scene::parse("figure:4K").expect("a scene");
    let cloud = scene.sample(count, &()).expect("points");
    let projection = Projection::PerspectiveFovDeg(40.0);
    let camera = Camera::fit(&cloud, guess_axes(&cloud), ViewDirection::Front, 4.0 / 3.0, projection).expect("a view");
    let commands = |reconstruction| {
        let settings = Settings { reconstruction, ..Settings::default() };
        let mut renderer = GpuRenderer::new(gpu.clone()).expect("a renderer");
        let size = Destination::Memory([64, 48]);
        renderer.render(Points::Cloud(&cloud), &camera, size, &settings, 1.0, &|| true).expect("a picture");
        Commands::of(&renderer)
    };
    let usual = commands(Reconstruction::default());
    let of_the_paper =
        commands(Reconstruction { adaptive: false, points_per_pixel: 1, trim: false, ..Reconstruction::default() });
    // Hardware has ten dispatches less, as it fills several levels of cells by one and measures all sizes of balls by
    // one, and two more for long searches.
    assert_eq!(usual, Commands { dispatches: 52, single: 9, indirect: 30, passes: 1, chain: 50, bytes: 54_423_180 });
    assert_eq!(
        of_the_paper,
        Commands { dispatches: 28, single: 0, indirect: 19, passes: 1, chain: 28, bytes: 38_736_508 }
    );
}
