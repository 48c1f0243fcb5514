//! Films of playing inputs.

use autosplats::{Camera, Image, Projection, Renderer};
use autosplats_formats::ReadOptions;
use autosplats_output::Target;

use super::*;
use crate::session::Reel;
use crate::view::{Answer, Outcome, Recording};

/// Writes a film of some clock positions. Returns its pictures in order, or why there are none.
fn film(app: &mut App, context: &egui::Context, places: &[f64], folder: &Path) -> Result<Vec<Image>, String> {
    let target = Target::new(&folder.join("f.png")).expect("pictures");
    let wish = app.view.wish(&app.session, [48, 32], false);
    let cameras = vec![wish.camera; places.len()];
    let reel = Reel::start(app.session.playing.tracks(places), app.ui.messages.sender(), context.clone());
    let mut recording = Recording::start(wish, cameras, Some(reel), 25, target, context);
    let mut pictures = Vec::new();
    let begun = Instant::now();
    loop {
        assert!(begun.elapsed() < Duration::from_secs(60), "the film does not end");
        if let Some(wish) = recording.wanted()? {
            let goal = crate::view::Goal::Film(recording.number);
            app.view.render.task(crate::view::Task::Photograph { wish: Box::new(wish), goal });
        }
        for answer in app.view.render.answers().collect::<Vec<_>>() {
            match answer {
                Answer::Done(Outcome::Photographed { image, range, .. }) => {
                    pictures.push(Image::clone(&image));
                    recording.arrived(*image, range);
                }
                Answer::Failed(why) => return Err(why),
                _ => {}
            }
        }
        match recording.ended() {
            Some(Ok(_)) => return Ok(pictures),
            Some(Err(why)) => return Err(why),
            None => std::thread::sleep(Duration::from_millis(1)),
        }
    }
}

#[test]
fn each_picture_shows_the_frame_of_its_time() {
    let [folder, out] = [(); 2].map(|()| tempfile::tempdir().expect("a folder"));
    let context = egui::Context::default();
    let name = sequence(folder.path(), 5);
    let mut app = app(&name, &context);
    // In front of all five frames, whose points are 10 apart along x.
    let at = autosplats::cloud::glam::DVec3::new(24.0, 2.0, 0.0);
    let eye = at + autosplats::cloud::glam::DVec3::new(0.0, -60.0, 20.0);
    let up = autosplats::cloud::glam::DVec3::Z;
    let camera = Camera { eye, look_at: at, up, projection: Projection::PerspectiveFovDeg(60.0) };
    app.view.navigation.go_to(&camera, true);
    let places = [0.0, 0.1, 0.15, 0.3, 0.45, 0.2, 0.0];
    let pictures = film(&mut app, &context, &places, out.path()).expect("a film");
    assert_eq!(pictures.len(), places.len(), "one each");
    // The renders of the same player, for comparison.
    let source = Input::parse(&name).expect("a folder");
    let options = ReadOptions { exact: true, ..source.options.clone() };
    let mut player = source.source.play(&source.play, &options, &()).expect("it plays");
    let mut renderer = Renderer::with_backend(Backend::Cpu).expect("a processor");
    let mut settings = app.view.look.settings.clone();
    let axes = app.session.axes();
    for (number, (picture, frame)) in pictures.iter().zip([0, 1, 1, 3, 4, 2, 0]).enumerate() {
        let cloud = player.frame(frame, &()).expect("a frame");
        let cloud = autosplats::cloud::PointCloud::clone(&cloud).with_axes(axes);
        settings.reconstruction.k = settings.reconstruction.k.min(39);
        let rendered = renderer.render(&cloud, &app.view.navigation.camera(), [48, 32], &settings).expect("a picture");
        settings.shading.range = settings.shading.range.or_else(|| rendered.counts.range());
        assert_eq!(picture.pixels, rendered.image.pixels, "picture {number} is of frame {frame}");
    }
    assert_ne!(pictures[0].pixels, pictures[1].pixels, "the comparison can tell frames apart");
    assert_eq!(pictures[0].pixels, pictures[6].pixels, "the same frame is the same picture");
}

#[test]
fn a_film_of_what_cannot_be_read_any_more_says_why() {
    let [folder, out] = [(); 2].map(|()| tempfile::tempdir().expect("a folder"));
    let context = egui::Context::default();
    let mut app = app(&sequence(folder.path(), 5), &context);
    (0..5).for_each(|frame| {
        std::fs::remove_file(folder.path().join(format!("frame_{frame}.xyz"))).expect("removed");
    });
    let why = film(&mut app, &context, &[0.0, 0.1], out.path()).expect_err("nothing is there");
    assert!(why.contains(&folder.path().display().to_string()), "names the folder: {why}");
    assert_eq!(std::fs::read_dir(out.path()).expect("a folder").count(), 0, "nothing is left behind");
}
