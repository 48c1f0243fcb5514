//! `autosplats demo`: renders every built-in scene.

use std::fs::create_dir_all;
use std::time::Instant;

use autosplats::{Renderer, Settings, still_supersample};
use autosplats_scenes::Scene;

use crate::args::DemoArgs;
use crate::exit::{Exit, Failure};
use crate::input::Inputs;
use crate::output::{ReadFiles, check_target, print_line, write_file, write_png};
use crate::progress::Bar;
use crate::render::{render_failure, scene_camera};
use crate::threads::start_threads;

/// Size of each picture in pixels, as in the paper.
const SIZE: [u32; 2] = [1760, 900];

/// Renders each scene into the folder and prints the path of its picture.
pub(crate) fn run(args: &DemoArgs) -> Result<(), Failure> {
    let DemoArgs { out, run } = args;
    start_threads(run)?;
    create_dir_all(out)
        .map_err(|error| Failure::new(Exit::Output, format!("{}: cannot create the folder: {error}", out.display())))?;
    let mut renderer = Renderer::new();
    for (name, about) in Scene::names() {
        let path = out.join(name).with_extension("png");
        check_target(&path, &ReadFiles::default())?;
        let input = format!("scene:{name}");
        let inputs = Inputs::scene(name)?;
        let Some(scene) = inputs.only_scene() else { continue };

        let cloud = inputs.read(run.quiet)?;
        let started = Instant::now();
        let bar = Bar::spinner(&format!("rendering {input}"), run.quiet);
        let camera = scene_camera(scene);
        let supersample = still_supersample(SIZE);
        let size = SIZE.map(|side| side * supersample);
        let frame = renderer.render(&cloud, &camera, size, &Settings::default()).map_err(render_failure)?;
        let picture = frame.image.averaged(supersample);
        drop(bar);
        let seconds = started.elapsed().as_secs_f64();
        write_file(&path, |writer| write_png(&picture, false, writer))?;

        print_line(&path.display().to_string())?;
        if !run.quiet {
            eprintln!("  {input}: {about}; {} points in {seconds:.2} s", cloud.len());
        }
    }
    Ok(())
}
