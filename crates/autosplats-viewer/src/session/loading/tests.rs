use std::time::Instant;

use autosplats::cloud::glam::DVec3;

use super::*;
use crate::session::TreeOptions;

/// Longer than any machine takes.
const PATIENCE: Duration = Duration::from_secs(60);

fn wait<T>(mut ask: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(answer) = ask() {
            return answer;
        }
        assert!(start.elapsed() < PATIENCE, "nothing has happened for a minute");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn last_news(loader: &mut Loader) -> JobNews {
    wait(|| loader.news().pop().map(|(_, _, news)| news).filter(|news| !matches!(news, JobNews::Preview(..))))
}

fn rows(count: usize) -> String {
    (0..count).map(|i| format!("{} {} {}\n", i % 100, i / 100, (i % 7) as f64 * 0.1)).collect()
}

#[test]
fn files_are_read_and_failures_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("points.xyz");
    std::fs::write(&path, rows(1000)).expect("written");
    let mut loader = Loader::start(&TreeOptions::default(), egui::Context::default());
    loader.read(Input::file(path));
    let JobNews::Read(cloud, ..) = last_news(&mut loader) else { panic!("it can be read") };
    assert_eq!(cloud.len(), 1000, "all points");
    assert!(loader.jobs().is_empty(), "the job is done");
    loader.read(Input::file(folder.path().join("none.ply")));
    let JobNews::Failed(why) = last_news(&mut loader) else { panic!("there is no such file") };
    assert!(why.contains("none.ply"), "names the file: {why}");
}

#[test]
fn what_waits_can_be_cancelled() {
    let mut loader = Loader::start(&TreeOptions::default(), egui::Context::default());
    let scene = Input::parse("scene:statue:50K").expect("a scene");
    loader.read(scene.clone());
    loader.read(scene);
    loader.cancel_all();
    let mut ended = Vec::new();
    wait(|| {
        ended.extend(loader.news().into_iter().map(|(_, _, news)| news));
        (ended.len() == 2).then_some(())
    });
    assert!(ended.iter().all(|news| matches!(news, JobNews::Cancelled)), "neither is wanted");
}

#[test]
fn previews_grow_and_stay_small() {
    let part = |points: usize| PointCloud::new(DVec3::ZERO, vec![[1.0, 2.0, 3.0]; points]);
    let mut preview = Preview::default();
    let mut shown = Vec::new();
    for _ in 0..40 {
        shown.extend(preview.add(part(500_000)).map(|cloud| cloud.len()));
    }
    assert_eq!(shown[0], 500_000, "the first part is shown at once");
    assert!(shown.iter().all(|&points| points <= PREVIEW_POINTS), "never too many: {shown:?}");
    assert!((4..16).contains(&shown.len()), "shown now and then: {shown:?}");
}

#[test]
fn changes_of_a_file_are_noticed_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("points.xyz");
    std::fs::write(&path, rows(10)).expect("written");
    let loader = Loader::start(&TreeOptions::default(), egui::Context::default());
    let watch = loader.watch(path.clone());
    // The first check records the state that changes are compared with.
    std::thread::sleep(WATCH_INTERVAL * 2);
    std::fs::write(&path, rows(20)).expect("written again");
    assert_eq!(wait(|| loader.changed().next()), path, "it has changed");
    std::thread::sleep(WATCH_INTERVAL * 3);
    assert!(loader.changed().next().is_none(), "once");
    drop(watch);
}
