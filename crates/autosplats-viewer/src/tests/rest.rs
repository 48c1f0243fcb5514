//! Pictures at rest.

use autosplats::{Image, Renderer, usual_exposure};

use super::on_device::read;
use super::*;
use crate::view::Pixels;

/// The picture in the window once no work is left.
pub(super) fn at_rest(window: &mut Window) -> Image {
    window.settle();
    window.until("all is done", |window| window.app().view.render.is_idle());
    window.steps(2);
    let pixels = window.app().view.shot.as_ref().expect("there is a picture").pixels.clone();
    match (pixels, &window.device) {
        (Pixels::Image(image), _) => Image::clone(&image),
        (Pixels::Texture { texture, supersample }, Some(device)) => read(device, &texture).averaged(supersample),
        (Pixels::Texture { .. }, None) => panic!("the window has no device"),
    }
}

/// The same picture rendered by the library, supersampled and averaged.
fn rendered(window: &Window, supersample: u32) -> Image {
    let app = window.app();
    let shot = app.view.shot.as_ref().expect("there is a picture");
    let mut settings = app.view.look.settings.clone();
    settings.shading.legend = false;
    settings.shading.exposure.get_or_insert(usual_exposure(&shot.shown.cloud));
    let size = shot.size.map(|side| side * supersample);
    let frame =
        Renderer::new().render(&shot.shown.cloud, &shot.camera, size, &settings).map(|frame| frame.image.clone());
    frame.expect("it can be rendered").averaged(supersample)
}

#[test]
fn a_picture_at_rest_becomes_finer() {
    let mut window = Window::with_statue();
    let shown = at_rest(&mut window);
    assert_eq!(
        [shown.width, shown.height],
        window.app().view.shot.as_ref().expect("a picture").size,
        "as large as the window's"
    );
    assert!(shown.pixels == rendered(&window, 2).pixels, "it is the one that was rendered larger");
    assert!(shown.pixels != rendered(&window, 1).pixels, "and no other");
}

#[test]
fn what_is_selected_is_tinted_in_the_finer_picture() {
    let mut window = Window::with_statue();
    let plain = at_rest(&mut window);
    window.key(CTRL, Key::A);
    let selected = at_rest(&mut window);
    let differ = plain.pixels.iter().zip(&selected.pixels).filter(|(one, other)| one != other).count();
    let covered = window.app().view.shot.as_ref().expect("a picture").counts.covered;
    // At the rim of the outermost splats, a pixel may be covered in one of the two sizes only.
    assert!(differ + covered / 50 > covered, "{differ} of {covered} pixels have another colour");
}
