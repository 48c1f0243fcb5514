//! `autosplats demo`: renders every built-in scene.

use std::time::Instant;

use autosplats::{Renderer, Settings, still_supersample};
use autosplats_output::write_png;
use autosplats_scenes::{SCENE_PREFIX, Scene};

use crate::args::DemoArgs;
use crate::console::Console;
use crate::exit::Failure;
use crate::input::Inputs;
use crate::output::{ReadFiles, check_target, create_folder, write_file};
use crate::progress::Bar;
use crate::render::scene_camera;

/// Size of each picture in pixels, as in the paper.
const SIZE: [u32; 2] = [1760, 900];

/// Renders each scene into the folder and prints the path of its picture.
pub(crate) fn run(args: &DemoArgs, console: &Console) -> Result<(), Failure> {
    let DemoArgs { out, run: _ } = args;
    create_folder(out)?;
    let mut renderer = Renderer::new();
    for (name, about) in Scene::names() {
        let path = out.join(name).with_extension("png");
        check_target(&path, &ReadFiles::default())?;
        let input = format!("{SCENE_PREFIX}{name}");
        let inputs = Inputs::scene(name)?;
        let Some(scene) = inputs.only_scene() else { continue };

        let cloud = inputs.read(console)?;
        let started = Instant::now();
        let bar = Bar::spinner(&format!("rendering {input}"), console);
        let camera = scene_camera(scene);
        let supersample = still_supersample(SIZE);
        let size = SIZE.map(|side| side * supersample);
        let frame = renderer.render_while(&cloud, &camera, size, &Settings::default(), &console.goes_on())?;
        let picture = frame.image.averaged(supersample);
        drop(bar);
        let seconds = started.elapsed().as_secs_f64();
        write_file(&path, console, |writer| write_png(&picture, false, writer))?;

        console.print_line(path.display())?;
        console.tell(format_args!("  {input}: {about}; {} points in {seconds:.2} s", cloud.len()));
    }
    Ok(())
}
