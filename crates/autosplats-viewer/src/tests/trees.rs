//! Octrees in the window: coarse at once, then as a render shows them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use autosplats::cloud::glam::{DMat4, DVec3};
use autosplats::cloud::{Key as NodeAt, Node, PointCloud, Wanted};
use autosplats::{Coarsest, ColorMode, Detail, PlacedTree, choose_loading};
use autosplats_formats::{Part, ReadOptions};
use autosplats_serve::Server;
use autosplats_sources::{Source, read_tree};

use super::*;
use crate::TreeOptions;
use crate::session::document::export;
use crate::session::{ClipBox, ExportScope, Layer, Replace, Sight};
use crate::ui::Command;

const LION: &str = "lion_takanawa.copc.laz";
const STAR: &str = "lone_star.copc.laz";

fn scans() -> Option<PathBuf> {
    Some(data()?.join("scans"))
}

fn path(scans: &Path, name: &str) -> String {
    scans.join(name).display().to_string()
}

/// A window that reads as much of octrees as pictures of this detail need.
fn window(detail: f64, names: &[&str]) -> Window {
    let trees = TreeOptions { detail: Some(detail), ..TreeOptions::default() };
    Window::of(Options { backend: Some(Backend::Cpu), trees, ..Options::default() }, names)
}

fn layer(window: &Window) -> &Layer {
    &window.app().session.document().layers[0]
}

/// The nodes that a layer shows.
fn nodes(layer: &Layer) -> BTreeSet<NodeAt> {
    layer.tree.as_ref().expect("an octree").nodes.iter().map(|node| node.key).collect()
}

/// The nodes with points that a render would show in place of the window's picture.
fn chosen(window: &Window, detail: f64) -> BTreeSet<NodeAt> {
    let shot = window.app().view.shot.as_ref().expect("a picture");
    let layer = layer(window);
    let tree = &layer.tree.as_ref().expect("an octree").open.tree;
    let placed = [PlacedTree { tree: Arc::clone(tree), world_from_tree: layer.pose }];
    let detail = Detail::of_points(detail, TreeOptions::default().max_points);
    let choice = choose_loading(&placed, &shot.camera, shot.size, &detail, &()).expect("a choice");
    choice.nodes.into_iter().map(|node| node.key).collect()
}

#[test]
fn an_octree_is_coarse_at_once_and_then_what_a_render_shows() {
    let Some(scans) = scans() else { return };
    let server = Server::start(scans.clone(), Duration::from_millis(400)).expect("a server");
    let near = path(&scans, STAR);
    for name in [&*near, &server.address(STAR)] {
        let mut window = window(0.2, &[name]);
        window.until("the first points", |window| !window.app().session.document().layers.is_empty());
        let first = layer(&window).cloud.len();
        if name != near {
            window.until("how much there is", |window| window.app().session.trees.status().is_some());
            window.step();
            assert!(window.says(" of 518,862 points"), "{:?}", window.words());
            let status = window.app().session.trees.status().expect("an octree is open");
            assert!(status.there < status.needed && !status.complete, "{status:?}");
        }
        window.settle();
        let status = window.app().session.trees.status().expect("an octree is open");
        assert!(status.complete && status.there == status.needed, "{name}: {status:?}");
        assert_eq!(nodes(layer(&window)), chosen(&window, 0.2), "{name}");
        assert_eq!(layer(&window).cloud.len() as u64, status.needed, "{name}");
        assert!(first > 1000 && first < layer(&window).cloud.len(), "{name}: coarser at first: {first}");
        let text = format!("{} points", crate::session::document::grouped(layer(&window).cloud.len()));
        assert!(window.says(&text), "{text}: {:?}", window.words());
    }
}

#[test]
fn a_view_that_moves_has_what_it_needs_when_it_rests() {
    let Some(scans) = scans() else { return };
    let mut window = window(1.0, &[&path(&scans, STAR)]);
    window.settle();
    let far = nodes(layer(&window));
    assert_eq!(far, chosen(&window, 1.0));
    let place = window.place(0.5, 0.5);
    window.event(Event::PointerMoved(place));
    window.wheel(12, 5.0);
    window.settle();
    let close = nodes(layer(&window));
    assert_eq!(close, chosen(&window, 1.0), "as if it had always been there");
    assert_ne!(close, far, "closer, finer nodes and fewer of them are needed");
    let context = window.harness.ctx.clone();
    window.harness.state_mut().run(Command::FitAll, &context);
    window.settle();
    assert_eq!(nodes(layer(&window)), chosen(&window, 1.0), "and back");

    // A picture in haste has the nodes that show most.
    let shown = &window.app().view.shot.as_ref().expect("a picture").shown;
    let tree = layer(&window).tree.as_ref().expect("an octree");
    let rank = |point: u32| {
        let (key, _) = tree.place_of(point as usize).expect("of a node");
        tree.nodes.iter().find(|node| node.key == key).expect("loaded").rank
    };
    let mut more = shown.len();
    for halvings in 1..4 {
        let part = shown.thinned(halvings);
        let last = part.iter().map(|&point| rank(point)).max().expect("some points");
        assert!(part.is_sorted() && part.len() < more, "{} of {more}", part.len());
        let all = (0..shown.len() as u32).filter(|&point| rank(point) <= last).count();
        assert!(
            part.len() == all && (last == 0 || all <= shown.len() >> halvings),
            "whole nodes: {} {all}",
            part.len()
        );
        more = part.len() + 1;
    }
}

#[test]
fn few_points_are_read_whole_unless_a_detail_is_asked_for() {
    let Some(scans) = scans() else { return };
    for (detail, is_tree) in [(None, false), (Some(0.0), false), (Some(1.0), true)] {
        let trees = TreeOptions { detail, ..TreeOptions::default() };
        let options = Options { backend: Some(Backend::Cpu), trees, ..Options::default() };
        let mut window = Window::of(options, &[&path(&scans, LION)]);
        window.settle();
        assert_eq!(layer(&window).tree.is_some(), is_tree, "{detail:?}");
    }
}

/// The picked point in the middle of the picture, with its attributes.
fn inspected(window: &mut Window) -> crate::session::PickedPoint {
    window.press(Key::X);
    window.click(window.place(0.5, 0.5));
    window.until("attributes", |window| {
        window.app().ui.tools.inspected.as_ref().is_some_and(|point| !point.fields.is_empty())
    });
    window.app().ui.tools.inspected.clone().expect("a point")
}

#[test]
fn a_picked_point_has_all_attributes() {
    let Some(scans) = scans() else { return };
    let mut window = window(0.5, &[&path(&scans, LION)]);
    window.settle();
    let point = inspected(&mut window);
    let (key, index) = point.node.expect("of a node");
    let tree = Arc::clone(&layer(&window).tree.as_ref().expect("an octree").open.tree);
    let stored = tree.fetch(&[key], &()).expect("a node").concat();
    let cloud = tree.decode(key, &stored, &Wanted { colors: true, exact: true, ..Wanted::default() }).expect("points");
    let off = point.position.distance(cloud.world_position(index));
    assert!(off < 1e-12, "with all digits: off by {off}");
    assert_eq!(point.color, cloud.colors().map(|colors| colors[index]));
    let names: Vec<&str> = point.fields.iter().map(|(name, _)| &**name).collect();
    assert_eq!(names, cloud.fields().iter().map(|field| &*field.name).collect::<Vec<_>>());
    assert!(names.contains(&"Intensity") && names.len() > 3, "{names:?}");
    let shown = window.app().view.shot.as_ref().expect("a picture").shown.clone();
    assert!(shown.cloud.fields().is_empty(), "the picture does without them");
    window.steps(2);
    assert!(window.says("Intensity") && window.says(&format!("{key} {index}")), "{:?}", window.words());
}

#[test]
fn colours_show_any_field() {
    let Some(scans) = scans() else { return };
    let mut window = window(0.5, &[&path(&scans, LION)]);
    window.settle();
    let names = window.app().view.shot.as_ref().expect("a picture").shown.field_names();
    assert!(names.iter().any(|name| name == "Intensity"), "it can be chosen: {names:?}");
    let before = layer(&window).cloud.len();
    window.harness.state_mut().view.look.settings.shading.color = ColorMode::Field("Intensity".into());
    window.until("intensities", |window| layer(window).cloud.field("Intensity").is_some());
    window.settle();
    let shot = window.app().view.shot.as_ref().expect("a picture");
    assert_eq!((shot.remark.as_deref(), layer(&window).cloud.len()), (None, before), "of all points");
    assert!(shot.counts.value_range.is_some_and(|[low, high]| low < high), "{:?}", shot.counts.value_range);
    assert!(layer(&window).cloud.colors().is_some(), "the colours stay");
}

#[test]
fn points_of_octrees_cannot_be_edited() {
    let Some(scans) = scans() else { return };
    let mut window = window(1.0, &[&path(&scans, LION), STATUE]);
    window.settle();
    let [tree, statue] = [0, 1].map(|index| window.app().session.document().layers[index].id);
    assert!(!window.says("cannot be selected"));
    window.key(CTRL, Key::A);
    window.settle();
    assert!(window.says("cannot be selected or edited"), "{:?}", window.words());
    let counts = |window: &Window, id| window.app().session.counts().layers[&id].selected;
    assert_eq!((counts(&window, tree), counts(&window, statue)), (0, 20_000), "only those of the scene");
    window.press(Key::Delete);
    window.settle();
    assert_eq!(nodes(layer(&window)), chosen(&window, 1.0), "nothing of the octree is gone");
}

#[test]
fn an_export_has_the_full_detail_of_the_box() {
    let Some(scans) = scans() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let mut window = window(8.0, &[&path(&scans, LION)]);
    window.settle();
    let tree = Arc::clone(&layer(&window).tree.as_ref().expect("an octree").open.tree);
    assert!(layer(&window).cloud.len() < 341_989, "the picture is coarse");
    let context = window.harness.ctx.clone();
    window.harness.state_mut().run(Command::Clip, &context);
    let [low, high] = tree.info().bounds;
    let around = window.app().session.document().clip.expect("a box");
    assert_eq!([around.min, around.max], [low, high], "around all points, whatever is loaded");
    let bounds = [low, low.lerp(high, 0.6)];
    let turned = ClipBox { rotation: autosplats::cloud::glam::DQuat::from_rotation_z(0.4), ..ClipBox::new(low, high) };
    let options = ReadOptions { exact: true, ..ReadOptions::default() };
    let read = |part: &Part| read_tree(&*tree, part, &options, &()).expect("points");
    let part = read(&Part { bounds: Some(bounds), ..Part::default() });
    let mut inside = read(&Part::default());
    let kept: Vec<bool> = (0..inside.len()).map(|i| turned.contains(inside.world_position(i))).collect();
    inside.retain(|index| kept[index]);
    for (name, clip, wanted) in [("part", ClipBox::new(bounds[0], bounds[1]), part), ("turned", turned, inside)] {
        window.harness.state_mut().session.change(|document| document.clip = Some(clip));
        let written = folder.path().join(format!("{name}.ply"));
        let document = window.app().session.document();
        let exported = export(document, ExportScope::Shown, &written, Replace::Nothing, &()).expect("written");
        assert_eq!(exported.points, wanted.len(), "{name}");
        // In millionths, since files have origins of their own.
        let places = |cloud: &PointCloud| {
            let millionths = |i: usize| (cloud.world_position(i) * 1e6).round().to_array().map(|place| place as i64);
            let mut places: Vec<_> = (0..cloud.len()).map(millionths).collect();
            places.sort_unstable();
            places
        };
        let read = autosplats_formats::read_with(&written, &options, &()).expect("read");
        assert_eq!(read.fields().len(), wanted.fields().len(), "{name}: all attributes");
        assert!(places(&read) == places(&wanted), "{name}: other places");
    }
    let all = folder.path().join("all.ply");
    let document = window.app().session.document();
    let exported = export(document, ExportScope::All, &all, Replace::Nothing, &()).expect("written");
    assert_eq!(exported.points, 341_989, "without the box");
}

#[test]
fn octrees_and_clouds_share_a_window() {
    let Some(scans) = scans() else { return };
    let mut window = window(1.0, &[&path(&scans, LION), &path(&scans, STAR)]);
    window.settle();
    let layers = |window: &Window| window.app().session.document().layers.clone();
    let bounds = |layer: &Layer| layer.bounds().expect("points");
    let [lion, star] = [0, 1].map(|index| bounds(&layers(&window)[index]));
    // The star stands beside the lion, and a statue of as many points as any.
    let way = DMat4::from_translation(DVec3::new(lion[1].x - star[0].x, lion[0].y - star[0].y, lion[0].z - star[0].z));
    let id = layers(&window)[1].id;
    window.harness.state_mut().session.edit("Place", |document| document.set_pose(id, way));
    window.harness.state_mut().session.open(Input::parse(STATUE).expect("a scene"));
    window.until("the statue", |window| window.app().session.document().layers.len() == 3);
    window.settle();
    let context = window.harness.ctx.clone();
    window.harness.state_mut().run(Command::FitAll, &context);
    window.settle();
    let placed: Vec<PlacedTree> = layers(&window)
        .iter()
        .filter_map(|layer| {
            let tree = Arc::clone(&layer.tree.as_ref()?.open.tree);
            Some(PlacedTree { tree, world_from_tree: layer.pose })
        })
        .collect();
    let shot = window.app().view.shot.as_ref().expect("a picture");
    let detail = Detail::of_points(1.0, TreeOptions::default().max_points);
    let choice = choose_loading(&placed, &shot.camera, shot.size, &detail, &()).expect("a choice");
    for (index, layer) in layers(&window)[..2].iter().enumerate() {
        let own = choice.nodes.iter().filter(|node| node.tree as usize == index).map(|node| node.key);
        assert_eq!(nodes(layer), own.collect(), "{index}");
    }
    assert_eq!(shot.shown.len(), layers(&window).iter().map(|layer| layer.cloud.len()).sum::<usize>());
    window.harness.state_mut().session.settle(|document| document.set_visible(id, false));
    window.settle();
    let status = window.app().session.trees.status().expect("an octree is open");
    assert_eq!(status.stored, 341_989, "the lion alone");
}

#[test]
fn a_server_that_goes_away_is_told_and_the_window_stays() {
    let Some(scans) = scans() else { return };
    let server = Server::start(scans, Duration::ZERO).expect("a server");
    let source = Source::parse(&server.address(STAR)).expect("an address");
    let tree = source.open_tree(&ReadOptions::default(), &()).expect("it answers").expect("an octree");
    let placed = [PlacedTree { tree, world_from_tree: DMat4::IDENTITY }];
    let wanted = Wanted { colors: true, fields: Some(Vec::new()), ..Wanted::default() };
    Coarsest::load(&placed, wanted, &()).expect("points");
    let first = server.counts().requests;
    let mut window = window(0.2, &[&server.address(&format!("~404:{first}-100000/{STAR}"))]);
    window.until("the first points", |window| !window.app().session.document().layers.is_empty());
    window.until("an error", |window| window.says("404"));
    assert!(window.says("tried again") && window.says(STAR), "{:?}", window.words());
    window.settle();
    let status = window.app().session.trees.status().expect("an octree is open");
    assert!(!status.complete && status.there < status.needed && status.there > 1000, "{status:?}");
    assert!(window.says(" of 518,862 points"), "{:?}", window.words());
    assert!(window.app().view.shot.is_some(), "what is there is shown");
    let handle = window.app().session.trees.handle();
    let shot = window.app().view.shot.as_ref().expect("a picture");
    let sight = Sight::new(shot.camera, shot.size, &ColorMode::Auto);
    let told = handle.completed(window.app().session.document(), sight).expect_err("no picture without its points");
    assert!(told.contains("404"), "{told}");
    window.drag(PointerButton::Primary, Modifiers::NONE, window.place(0.4, 0.5), window.place(0.6, 0.5));
    window.settle();
    drop(server);
    window.drag(PointerButton::Primary, Modifiers::NONE, window.place(0.4, 0.5), window.place(0.6, 0.5));
    window.settle();
}

#[test]
fn damaged_nodes_are_told_and_missing() {
    let Some(scans) = scans() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let damaged = folder.path().join("damaged.copc.laz");
    let mut bytes = std::fs::read(scans.join(LION)).expect("a file");
    // At least one node begins there.
    let middle = bytes.len() / 3..bytes.len() * 2 / 3;
    bytes[middle].fill(0x5a);
    std::fs::write(&damaged, bytes).expect("written");
    let mut window = window(0.5, &[&damaged.display().to_string()]);
    window.settle();
    assert!(window.says("damaged and missing"), "{:?}", window.words());
    let count = layer(&window).cloud.len();
    assert!(count > 30_000 && count < 341_989, "{count} points");
}

#[test]
fn pictures_for_files_are_complete() {
    let Some(scans) = scans() else { return };
    let mut window = window(8.0, &[&path(&scans, LION)]);
    window.settle();
    let shot = window.app().view.shot.as_ref().expect("a picture");
    let document = window.app().session.document();
    let sight = Sight::new(shot.camera, shot.size.map(|side| 4 * side), &ColorMode::Auto);
    let complete = window.app().session.trees.handle().completed(document, sight).expect("all nodes");
    let more = complete.layers[0].cloud.len();
    assert!(more > document.layers[0].cloud.len(), "a larger picture has more points: {more}");
    assert_eq!(nodes(layer(&window)), chosen(&window, 8.0), "the window keeps its own");
}

#[test]
fn limits_hold_and_are_told() {
    let Some(scans) = scans() else { return };
    let trees = TreeOptions { detail: Some(0.2), max_points: 200_000, memory: None };
    let options = Options { backend: Some(Backend::Cpu), trees, ..Options::default() };
    let mut window = Window::of(options, &[&path(&scans, STAR)]);
    window.settle();
    let status = window.app().session.trees.status().expect("an octree is open");
    assert!(status.complete && status.is_limited && status.needed <= 200_000, "{status:?}");
    assert!(window.says(&format!("{:.1} px", status.spacing_px)), "{:?}", window.words());
}

#[test]
fn which_points_are_kept_can_change() {
    let Some(scans) = scans() else { return };
    let mut window = window(1.0, &[&path(&scans, LION)]);
    window.settle();
    let id = layer(&window).id;
    let tree = Arc::clone(&layer(&window).tree.as_ref().expect("an octree").open);
    window.harness.state_mut().session.keep(id, "all".parse().expect("a filter"));
    window.until("another octree", |window| {
        layer(window).tree.as_ref().is_some_and(|other| !Arc::ptr_eq(&other.open, &tree))
    });
    window.settle();
    assert_eq!(nodes(layer(&window)), chosen(&window, 1.0));
    let all = layer(&window).cloud.len();
    window.harness.state_mut().session.keep(id, "first".parse().expect("a filter"));
    window.until("the first returns", |window| window.app().session.loader.jobs().is_empty());
    window.settle();
    let stated = |key: &NodeAt| match tree.tree.node(*key) {
        Node::Known { points, .. } => points as usize,
        _ => 0,
    };
    assert_eq!(all, nodes(layer(&window)).iter().map(stated).sum::<usize>(), "all points");
    assert!(matches!(window.app().session.inputs[&id].source, Source::File(_)));
}
