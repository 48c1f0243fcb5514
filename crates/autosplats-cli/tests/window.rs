//! A session in a real window, on a screen in memory and with Vulkan on the processor.
//!
//! Its screenshots stay in `target/window-session`.

#![cfg(all(target_os = "linux", feature = "viewer"))]
#![allow(missing_docs, reason = "a test")]

#[path = "it/common/mod.rs"]
mod common;
mod screen;

use std::path::PathBuf;
use std::time::Duration;

use autosplats_serve::Server;
use screen::{Picture, Screen, keys};

/// Largest difference of equal pictures, of 1: half a level.
const MAX_DIFFERENCE: f64 = 0.002;

/// Input of the session: the bunny if the data is present, else a sphere.
fn input(folder: &common::Folder) -> PathBuf {
    let bunny = common::data().map(|data| data.join("models/bunny.ply")).filter(|path| path.is_file());
    bunny.unwrap_or_else(|| {
        folder.write("sphere.ply", &common::sphere_ply());
        folder.path("sphere.ply")
    })
}

/// Fraction of pixels in the orange of the selection: much more red than blue.
fn orange(picture: &Picture) -> f64 {
    picture.share(|[r, g, b]| r > 130 && r > g + 30 && g > b + 20)
}

#[test]
fn a_session_in_a_window() {
    let folder = common::Folder::new();
    let Some(mut screen) = Screen::start([1280, 800]) else { return };
    let mut command = folder.command(&["view"]);
    let input = input(&folder);
    command.arg(&input).args(["--backend", "cpu"]);
    screen.run(command, &folder.path("home"));

    // The picture's part of the window: right of the list, below the menu, above the status line.
    let view = [330, 120, 1180, 700];
    let [left, top, right, bottom] = view;
    let middle = [(left + right) / 2, (top + bottom) / 2];
    let [x, y] = middle;

    let opened = screen.settled("1-opened", |picture| picture.crop(view).spread() > 20.0);
    let surface = opened.crop([x - 60, y - 60, x + 60, y + 60]);
    let edge = opened.crop([left, top, left + 60, top + 60]);
    assert!(surface.mean() > edge.mean() + 15.0, "the surface is in the middle: {} {}", surface.mean(), edge.mean());

    screen.drag(1, [x, y + 40], [x + 160, y + 70]);
    let turned = screen.settled("2-turned", |picture| picture.crop(view).difference(&opened.crop(view)) > 0.02);

    screen.key(keys::TAB);
    let dots = screen.settled("3-dots", |picture| picture.crop(view).difference(&turned.crop(view)) > 0.02);
    let rough = |picture: &Picture| picture.crop([x - 100, y - 100, x + 100, y + 100]).roughness();
    assert!(rough(&dots) > 2.0 * rough(&turned), "dots are rough: {} {}", rough(&dots), rough(&turned));
    screen.key(keys::TAB);
    let back =
        screen.settled("4-surface", |picture| picture.crop(view).difference(&turned.crop(view)) < MAX_DIFFERENCE);
    assert!(back.crop(view).difference(&dots.crop(view)) > MAX_DIFFERENCE, "the comparison can tell");

    screen.key(keys::X);
    screen.click(middle);
    // The panel about the inspected point is in the upper right corner.
    let corner = [970, 80, 1270, 300];
    screen.settled("5-inspected", |picture| picture.crop(corner).difference(&back.crop(corner)) > 0.05);
    screen.key(keys::ESCAPE);

    screen.key(keys::M);
    screen.click([x, y - 10]);
    screen.settled("6-first-corner", |picture| picture.crop(view).difference(&back.crop(view)) > 1e-6);
    screen.click([x, y + 80]);
    let line = [x - 60, y - 20, x + 60, y + 90];
    let measured =
        screen.settled("7-measured", |picture| picture.crop(line).share(|pixel| pixel == [255, 160, 40]) > 0.003);
    assert!(back.crop(line).share(|pixel| pixel == [255, 160, 40]) < 1e-4, "the line is drawn by measuring");
    let dark = |picture: &Picture| picture.crop(line).share(|[r, g, b]| r.max(g).max(b) < 80);
    assert!(dark(&measured) > dark(&back) + 0.01, "with a dark label: {} {}", dark(&measured), dark(&back));
    screen.key(keys::ESCAPE);
    screen.key(keys::ESCAPE);

    screen.key(keys::B);
    screen.drag(1, [x - 90, y - 90], [x + 90, y + 60]);
    let inside = [x - 80, y - 80, x + 80, y + 50];
    let selected = screen.settled("8-selected", |picture| orange(&picture.crop(inside)) > 0.3);
    assert!(orange(&back.crop(inside)) < 0.01, "nothing was orange before");
    assert!(orange(&selected.crop([left, top, x - 100, bottom])) < 0.05, "nothing beside is");
    screen.key(keys::DELETE);
    let deleted = screen.settled("9-deleted", |picture| {
        orange(&picture.crop(inside)) < 0.01 && picture.crop(inside).difference(&back.crop(inside)) > 0.05
    });
    screen.keys_with(keys::CTRL, keys::Z);
    // Undo also restores the selection.
    screen.key(keys::ESCAPE);
    screen.key(keys::ESCAPE);
    let rest = [left, top, right, bottom - 130];
    let undone =
        screen.settled("10-undone", |picture| picture.crop(rest).difference(&back.crop(rest)) < MAX_DIFFERENCE);
    assert!(undone.crop(rest).difference(&deleted.crop(rest)) > MAX_DIFFERENCE, "the comparison can tell");

    screen.keys_with(keys::CTRL, keys::C);
    let copied = screen.clipboard().expect("a view is on the clipboard");
    folder.write("view.json", &copied);
    screen.keys_with(keys::CTRL, keys::S);
    screen.settled("11-dialog", |picture| picture.crop(view).difference(&undone.crop(view)) > 0.02);
    // The name field has the keyboard focus; Enter confirms the dialog.
    screen.key(keys::ENTER);
    let saved = folder.path("picture.png");
    // The file appears complete.
    screen.wait("12-saved", Duration::from_secs(120), |_| saved.is_file()).expect("the picture is written");
    screen.keys_with(keys::CTRL, keys::Q);
    let code = screen.finish();
    assert_eq!(code, Some(0), "the window closes as it should: {}", screen.words());

    let path = input.to_str().expect("the path is text");
    let view = ["--camera", "view.json", "--size", "1920x1080", "--backend", "cpu", "-o", "rendered.png"];
    folder.succeed(&[&["render", path][..], &view].concat());
    let [seen, rendered] = ["picture.png", "rendered.png"].map(|name| Picture::read(&folder.path(name)));
    // Both cameras are bit-identical; the pictures differ only in default settings.
    assert!(seen.spread() > 20.0, "something is seen");
    assert!(
        seen.difference(&rendered) < MAX_DIFFERENCE,
        "render makes the same picture: {}",
        seen.difference(&rendered)
    );
}

#[test]
fn an_octree_in_a_window_is_what_a_render_shows() {
    let Some(scans) = common::data().map(|data| data.join("scans")) else { return };
    let folder = common::Folder::new();
    let Some(mut screen) = Screen::start([1280, 800]) else { return };
    let server = Server::start(&scans, Duration::from_millis(100)).expect("a server");
    let address = server.address("lone_star.copc.laz");
    let mut command = folder.command(&["view", &address, "--backend", "cpu", "--points-budget", "300K"]);
    command.args(["--header", "X-Test: 1"]);
    screen.run(command, &folder.path("home"));
    let view = [330, 120, 1180, 700];
    let opened = screen.settled("tree-1-opened", |picture| picture.crop(view).spread() > 20.0);
    screen.keys_with(keys::CTRL, keys::C);
    folder.write("view.json", &screen.clipboard().expect("a view is on the clipboard"));
    screen.key(keys::X);
    screen.click([735, 620]);
    // The panel has a row for each attribute, which is read from the server.
    let panel = [970, 80, 1270, 400];
    screen.settled("tree-2-inspected", |picture| picture.crop(panel).difference(&opened.crop(panel)) > 0.05);
    screen.key(keys::ESCAPE);
    screen.key(keys::ESCAPE);
    screen.keys_with(keys::CTRL, keys::S);
    screen.settled("tree-3-dialog", |_| true);
    screen.key(keys::ENTER);
    let saved = folder.path("picture.png");
    screen.wait("tree-4-saved", Duration::from_secs(120), |_| saved.is_file()).expect("the picture is written");
    screen.keys_with(keys::CTRL, keys::Q);
    assert_eq!(screen.finish(), Some(0), "the window closes as it should: {}", screen.words());
    let near = scans.join("lone_star.copc.laz").display().to_string();
    let camera = ["--camera", "view.json", "--size", "1920x1080", "--backend", "cpu"];
    let limits = ["--detail", "1", "--points-budget", "300K", "-o", "rendered.png"];
    folder.succeed(&[&["render", &*near][..], &camera, &limits].concat());
    let [seen, rendered] = ["picture.png", "rendered.png"].map(|name| Picture::read(&folder.path(name)));
    let off = seen.difference(&rendered);
    assert!(off < MAX_DIFFERENCE, "render makes the same picture: {off}");
    let refused = ["view", &near, "--memory", "100M"];
    folder.fail(&refused, 2, &["--memory", "at least"]);
}

/// An empty screen has one colour.
#[test]
fn an_empty_screen_shows_nothing() {
    let Some(mut screen) = Screen::start([320, 200]) else { return };
    let empty = screen.settled("0-empty", |_| true);
    assert!(empty.spread() < 1.0, "one colour: {}", empty.spread());
    let never = screen.wait("nothing", Duration::from_secs(1), |picture| picture.spread() > 20.0);
    assert!(never.is_none(), "what is not shown is not found");
}
