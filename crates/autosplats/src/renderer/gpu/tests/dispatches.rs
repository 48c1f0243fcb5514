//! How many commands a frame is made of.

use std::collections::HashMap;

use autosplats_scenes::Scene;

use crate::camera::{Camera, Projection, ViewDirection, guess_axes};
use crate::gpu::{Clock, Groups, Recorder, Step, test_gpu};
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
}

impl Commands {
    fn of(renderer: &GpuRenderer) -> Self {
        let steps = &renderer.prepared.as_ref().expect("a frame was rendered").steps;
        let mut recorder = Recorder::new(&renderer.gpu, &Clock::Off);
        steps.iter().for_each(|step| recorder.run(step));
        let passes = recorder.begun;
        recorder.finish();
        let groups: Vec<&Groups> = steps.iter().filter_map(Step::groups).collect();
        assert_eq!(groups.len(), steps.len(), "no step draws");
        Self {
            dispatches: steps.len(),
            single: groups.iter().filter(|groups| matches!(groups, Groups::Number(1))).count(),
            indirect: groups.iter().filter(|groups| matches!(groups, Groups::Counted(..))).count(),
            passes,
            chain: longest_chain(steps),
        }
    }
}

/// Two dispatches depend on each other if they share a buffer that one of them writes.
#[allow(clippy::mutable_key_type, reason = "buffers are compared by what they are, not by what they hold")]
fn longest_chain(steps: &[Step]) -> usize {
    // For each buffer, the lengths of the chains that end with its last write, and with the longest read since.
    let mut ends: HashMap<wgpu::Buffer, [usize; 2]> = HashMap::new();
    let mut longest = 0;
    for step in steps {
        let counted = step.groups().and_then(|groups| match groups {
            Groups::Counted(arguments, _) => Some((arguments.clone(), false)),
            Groups::Number(_) => None,
        });
        let uses: Vec<_> = step.uses.iter().cloned().chain(counted).collect();
        let before = |(buffer, writes): &(wgpu::Buffer, bool)| {
            let [written, read] = ends.get(buffer).copied().unwrap_or_default();
            if *writes { written.max(read) } else { written }
        };
        let length = 1 + uses.iter().map(before).max().unwrap_or(0);
        longest = longest.max(length);
        for (buffer, writes) in uses {
            let end = ends.entry(buffer).or_default();
            let place = usize::from(!writes);
            end[place] = end[place].max(length);
        }
    }
    longest
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
    // Hardware has seven dispatches less, as it fills several levels of cells by one, and two more for long searches.
    assert_eq!(usual, Commands { dispatches: 53, single: 8, indirect: 29, passes: 1, chain: 49 });
    assert_eq!(of_the_paper, Commands { dispatches: 30, single: 0, indirect: 20, passes: 1, chain: 28 });
}
