//! `autosplats bench paper`: repeats the paper's evaluation [Paper, §8] on this machine and writes a page about it.
//!
//! # How it works
//! Each measurement is a [`Task`] with a key. A journal keeps results by key, so that an interrupted run can be
//! resumed, and other scenes or devices can be added later. The page is written from the journal alone.

mod chart;
mod figures;
mod journal;
mod measure;
mod numbers;
mod report;
mod scenes;

use std::io::Write as _;
use std::path::Path;

use autosplats_cloud::Progress as _;

use self::figures::{NormalError, Radii};
use self::journal::Journal;
use self::measure::{
    Accuracy, ExactRadii, FirstRadius, K, KiddoTimes, LoadedScene, Method, Outcome, Renderers, Timing, accuracy,
    culling_difference, kiddo, settings, time,
};
use self::report::Report;
use self::scenes::{NAMES, PaperScene};
use crate::args::PaperArgs;
use crate::console::Console;
use crate::exit::{Exit, Failure, suggest};
use crate::output::{ReadFiles, check_target, create_folder, write_file};
use crate::progress::Bar;

/// Values of k in Figure 10.
const KS: [u32; 10] = [5, 10, 15, 20, 25, 30, 35, 40, 45, 50];
/// Values of k for splat communication on a software renderer, where a frame takes very long.
const FEW_KS: [u32; 4] = [5, 10, 25, 50];
/// Values of k of a quick run.
const QUICK_KS: [u32; 3] = [5, 10, 20];
/// Frames per median.
const FRAMES: usize = 5;
/// Number of points and side in pixels of the pictures of Figures 6, 7 and 9: [full run, quick run].
const TWO_SCALES: [usize; 2] = [72_000, 10_000];
const SIDE: [u32; 2] = [600, 150];

/// File names of the figures in the folder of results.
const FIGURE_6: &str = "figure-6.png";
const FIGURE_7: &str = "figure-7.png";
const FIGURE_9: &str = "figure-9.png";

/// A measurement of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Task {
    /// A picture of the scene.
    Picture,
    /// A line of Table 1; the flag turns on grid culling.
    Table(Method, bool),
    /// kiddo's times, a column of Table 1.
    Kiddo,
    /// The best first radius of the kd-tree.
    FirstRadius,
    /// A bar of Figure 10, for a k.
    Stages(Method, u32),
    /// A line of the table of accuracies.
    Accuracy(Method),
    /// Difference that grid culling makes in the picture.
    Culling,
    /// Figure 6.
    Normals,
    /// Figure 9.
    Curvature,
}

impl Task {
    /// Key of the measurement in the journal.
    fn key(self, scene: &PaperScene, renderers: &Renderers) -> String {
        let scene = scene.key();
        match self {
            Self::Table(method, culled) => {
                let culled = if culled { "culled" } else { "all" };
                format!("{scene} | {} | {} | table {culled}", renderers.device(method), method.name())
            }
            Self::Picture => format!("{scene} | picture"),
            Self::Kiddo => format!("{scene} | {} | kiddo", renderers.device(Method::GridCpu)),
            Self::FirstRadius => format!("{scene} | {} | first radius", renderers.device(Method::KdTree)),
            Self::Stages(method, k) => {
                format!("{scene} | {} | {} | stages k={k}", renderers.device(method), method.name())
            }
            Self::Accuracy(method) => {
                format!("{scene} | {} | {} | accuracy", renderers.device(method), method.name())
            }
            Self::Culling => format!("{scene} | culling"),
            Self::Normals => format!("{scene} | figure 6"),
            Self::Curvature => format!("{scene} | figure 9"),
        }
    }

    /// Name of the measurement in progress messages.
    fn describe(self) -> String {
        match self {
            Self::Table(method, _) => format!("Table 1, {}", method.name()),
            Self::Picture => "picture".into(),
            Self::Kiddo => "Table 1, kiddo".into(),
            Self::FirstRadius => "Table 1, the kd-tree's first radius".into(),
            Self::Stages(method, k) => format!("Figure 10, {}, k = {k}", method.name()),
            Self::Accuracy(method) => format!("accuracy, {}", method.name()),
            Self::Culling => "grid culling".into(),
            Self::Normals => "Figure 6".into(),
            Self::Curvature => "Figure 9".into(),
        }
    }

    /// Whether the journal has a usable result. A refused measurement is repeated, since another build or more free
    /// memory may allow it.
    fn is_done(self, key: &str, scene: &PaperScene, journal: &Journal, pictures: &Path) -> bool {
        fn measured<T: serde::de::DeserializeOwned>(journal: &Journal, key: &str) -> bool {
            journal.get::<Outcome<T>>(key).is_some_and(|outcome| outcome.is_ok())
        }
        let there = |name: &str| pictures.join(name).is_file();
        match self {
            Self::Picture => journal.get(key) == Some(true) && there(&picture_name(scene)),
            Self::Table(..) | Self::Stages(..) => measured::<Timing>(journal, key),
            Self::Kiddo => journal.get::<KiddoTimes>(key).is_some(),
            Self::FirstRadius => measured::<FirstRadius>(journal, key),
            Self::Accuracy(_) => measured::<Accuracy>(journal, key),
            Self::Culling => journal.get::<f64>(key).is_some(),
            Self::Normals => journal.get::<NormalError>(key).is_some() && there(FIGURE_6),
            Self::Curvature => journal.get(key) == Some(true) && there(FIGURE_9),
        }
    }
}

/// Measurements of a scene, in the order of the page.
fn tasks(scene: &PaperScene, ks: &[u32], few_ks: &[u32]) -> Vec<Task> {
    let methods = || Method::ALL.into_iter();
    let mut tasks = vec![Task::Picture, Task::FirstRadius];
    tasks.extend(methods().flat_map(|method| [false, true].map(|culled| Task::Table(method, culled))));
    tasks.push(Task::Kiddo);
    tasks.extend(methods().map(Task::Accuracy));
    tasks.push(Task::Culling);
    tasks.extend(Method::BY_STAGE.into_iter().flat_map(|method| {
        let ks = if method.communicates() { few_ks } else { ks };
        ks.iter().map(move |&k| Task::Stages(method, k))
    }));
    match scene.name {
        "bunny" => tasks.push(Task::Normals),
        "imperia" => tasks.push(Task::Curvature),
        _ => {}
    }
    tasks
}

/// Runs the measurements that the journal lacks, and writes the page.
pub(crate) fn run(args: &PaperArgs, console: &Console) -> Result<(), Failure> {
    let PaperArgs { scenes, bunny, gallop, out, quick, fresh, run: _ } = args;
    let quick_index = usize::from(*quick);
    let scenes = scenes.iter().map(|name| scene(name, bunny.as_deref(), gallop.as_deref(), *quick));
    let scenes = scenes.collect::<Result<Vec<_>, _>>()?;
    // A quick run has files of its own, so that the results of a full run stay.
    let suffix = if *quick { "-quick" } else { "" };
    let pictures = out.join(format!("results{suffix}"));
    create_folder(&pictures)?;
    let page = out.join(format!("RESULTS{suffix}.md"));
    check_target(&page, &ReadFiles::default())?;

    let mut journal = Journal::open(&pictures.join("measurements.json"), *fresh, console)?;
    let mut renderers = Renderers::new();
    let ks: &[u32] = if *quick { &QUICK_KS } else { &KS };
    let few_ks: &[u32] = if !*quick && renderers.is_software() { &FEW_KS } else { ks };
    let side = SIDE[quick_index];
    let scales = format!("two-scales:{} | figure 7", TWO_SCALES[quick_index]);
    let missing = |scene: &PaperScene, journal: &Journal, renderers: &Renderers| -> Vec<Task> {
        let mut tasks = tasks(scene, ks, few_ks);
        tasks.retain(|task| !task.is_done(&task.key(scene, renderers), scene, journal, &pictures));
        tasks
    };
    let mut left: usize = scenes.iter().map(|scene| missing(scene, &journal, &renderers).len()).sum();
    let all = left.max(1);

    for scene in &scenes {
        let tasks = missing(scene, &journal, &renderers);
        if tasks.is_empty() {
            continue;
        }
        let (cloud, camera) = scene.load(console)?;
        let loaded = LoadedScene { scene, cloud, camera, console };
        let mut exact = None;
        for task in tasks {
            let bar = Bar::new(&format!("{}: {}", scene.name, task.describe()), console);
            bar.report((all - left) as f32 / all as f32);
            let key = task.key(scene, &renderers);
            let radius: Outcome<FirstRadius> = journal
                .get(&Task::FirstRadius.key(scene, &renderers))
                .unwrap_or_else(|| Err("no first radius was found".into()));
            let needs_radius = matches!(task, Task::Table(Method::KdTree, _) | Task::Accuracy(Method::KdTree));
            if let (true, Err(why)) = (needs_radius, &radius) {
                journal.note(&key, &Outcome::<()>::Err(why.clone()))?;
                left -= 1;
                continue;
            }
            let first_radius = radius.map_or(f32::NAN, |found| found.radius);
            let mut exact_radii = |renderers: &mut Renderers| match exact.take() {
                Some(exact) => Ok(exact),
                None => ExactRadii::new(renderers, &loaded),
            };
            match task {
                Task::FirstRadius => {
                    journal.note(&key, &measure::first_radius(&mut renderers, &loaded)?)?;
                }
                Task::Picture => {
                    figures::picture(&loaded, &pictures.join(picture_name(scene)), console)?;
                    journal.note(&key, &true)?;
                }
                Task::Table(method, culled) => {
                    let settings = settings(method, first_radius, K, culled);
                    journal.note(&key, &time(&mut renderers, &loaded, method, &settings, FRAMES)?)?;
                }
                Task::Stages(method, k) => {
                    let settings = settings(method, first_radius, k, true);
                    journal.note(&key, &time(&mut renderers, &loaded, method, &settings, FRAMES)?)?;
                }
                Task::Kiddo => {
                    let found = exact_radii(&mut renderers)?;
                    journal.note(&key, &kiddo(&loaded, &found))?;
                    exact = Some(found);
                }
                Task::Accuracy(method) => {
                    let found = exact_radii(&mut renderers)?;
                    journal.note(&key, &accuracy(&mut renderers, &loaded, method, first_radius, &found)?)?;
                    exact = Some(found);
                }
                Task::Culling => journal.note(&key, &culling_difference(&mut renderers, &loaded)?)?,
                Task::Normals => {
                    journal.note(&key, &figures::normals(&loaded, side, &pictures.join(FIGURE_6), console)?)?;
                }
                Task::Curvature => {
                    figures::curvature(&loaded, side / 3 * 2, &pictures.join(FIGURE_9), console)?;
                    journal.note(&key, &true)?;
                }
            }
            left -= 1;
        }
    }
    if journal.get::<Radii>(&scales).is_none() || !pictures.join(FIGURE_7).is_file() {
        let radii = figures::scales(TWO_SCALES[quick_index], side / 3 * 2, &pictures.join(FIGURE_7), console)?;
        journal.note(&scales, &radii)?;
    }

    let report = Report {
        journal: &journal,
        renderers: &renderers,
        scenes: &scenes,
        ks,
        scales: &scales,
        folder: &format!("results{suffix}"),
        quick: *quick,
    };
    report.write_charts(&pictures, console)?;
    write_file(&page, console, |writer| writer.write_all(report.page().as_bytes()))?;
    console.print_line(page.display())
}

/// File name of a scene's picture.
fn picture_name(scene: &PaperScene) -> String {
    format!("scene-{}.png", scene.name)
}

fn scene(name: &str, bunny: Option<&Path>, gallop: Option<&Path>, quick: bool) -> Result<PaperScene, Failure> {
    let known = NAMES
        .into_iter()
        .find(|known| *known == name)
        .ok_or_else(|| Failure::usage(format!("the paper has no scene '{name}'; {}", suggest(name, NAMES))))?;
    let scene = PaperScene::new(known, bunny, gallop, quick);
    match scene.file() {
        Some(path) if !path.exists() => {
            Err(Failure::new(Exit::Input, format!("{}: no such file or folder", path.display())))
        }
        _ => Ok(scene),
    }
}
