//! `autosplats bench paper`: the paper's evaluation [Paper, §8], repeated on this machine and written up as a page.
//!
//! # How it works
//! Everything to be measured is a [`Task`] with a key. What has been measured is kept in a journal under its key, so that a
//! run that was stopped goes on where it was, and other scenes or devices can be added later. In the end the page is written
//! from the journal alone.

mod chart;
mod figures;
mod journal;
mod measure;
mod report;
mod scenes;

use std::fs::create_dir_all;
use std::path::Path;

use autosplats_cloud::Progress as _;

use self::journal::Journal;
use self::measure::{
    Exact, FirstRadius, K, Loaded, Method, Outcome, Renderers, accuracy, culling_difference, kiddo, settings, time,
};
use self::report::Report;
use self::scenes::{NAMES, PaperScene};
use crate::args::PaperArgs;
use crate::exit::{Exit, Failure, suggest};
use crate::output::{check_target, print_line, write_file};
use crate::progress::Bar;
use crate::threads::start_threads;

/// The ks of Figure 10.
const KS: [u32; 10] = [5, 10, 15, 20, 25, 30, 35, 40, 45, 50];
/// Those of a quick run.
const QUICK_KS: [u32; 3] = [5, 10, 20];
/// Frames that medians are taken of.
const FRAMES: usize = 5;
/// Points and side of the pictures of Figures 6, 7 and 9, and those of a quick run.
const TWO_SCALES: [usize; 2] = [72_000, 10_000];
const SIDE: [u32; 2] = [600, 150];

/// What is to be measured of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Task {
    /// What it looks like.
    Picture,
    /// A line of Table 1, with grid culling or without.
    Table(Method, bool),
    /// kiddo's times beside it.
    Kiddo,
    /// What the kd-tree is to be searched with.
    FirstRadius,
    /// A bar of Figure 10.
    Stages(Method, u32),
    /// A line of the table of accuracies.
    Accuracy(Method),
    /// What grid culling changes in the picture.
    Culling,
    /// Figure 6.
    Normals,
    /// Figure 9.
    Curvature,
}

impl Task {
    /// What its measurement is kept under.
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

    /// What it is called while it runs.
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
}

/// What belongs to a scene, in the order of the page.
fn tasks(scene: &PaperScene, ks: &[u32]) -> Vec<Task> {
    let methods = || Method::ALL.into_iter();
    let mut tasks = vec![Task::Picture, Task::FirstRadius];
    tasks.extend(methods().flat_map(|method| [false, true].map(|culled| Task::Table(method, culled))));
    tasks.push(Task::Kiddo);
    tasks.extend(methods().map(Task::Accuracy));
    tasks.push(Task::Culling);
    tasks.extend(Method::BY_STAGE.into_iter().flat_map(|method| ks.iter().map(move |&k| Task::Stages(method, k))));
    match scene.name {
        "bunny" => tasks.push(Task::Normals),
        "imperia" => tasks.push(Task::Curvature),
        _ => {}
    }
    tasks
}

/// Measures what is not yet in the journal, and writes the page.
pub(crate) fn run(args: &PaperArgs) -> Result<(), Failure> {
    let PaperArgs { scenes, bunny, gallop, out, quick, fresh, run } = args;
    start_threads(run)?;
    let quick_index = usize::from(*quick);
    let scenes = scenes.iter().map(|name| scene(name, bunny.as_deref(), gallop.as_deref(), *quick));
    let scenes = scenes.collect::<Result<Vec<_>, _>>()?;
    let pictures = out.join("results");
    create_dir_all(&pictures).map_err(|error| {
        Failure::new(Exit::Output, format!("{}: cannot make the folder: {error}", pictures.display()))
    })?;
    let page = out.join("RESULTS.md");
    check_target(&page, [])?;

    let mut journal = Journal::open(&pictures.join("measurements.json"), *fresh)?;
    let mut renderers = Renderers::new();
    let ks: &[u32] = if *quick { &QUICK_KS } else { &KS };
    let side = SIDE[quick_index];
    let scales = format!("two-scales:{} | figure 7", TWO_SCALES[quick_index]);
    let missing = |scene: &PaperScene, journal: &Journal, renderers: &Renderers| -> Vec<Task> {
        let mut tasks = tasks(scene, ks);
        tasks.retain(|task| !journal.has(&task.key(scene, renderers)));
        tasks
    };
    let mut left: usize = scenes.iter().map(|scene| missing(scene, &journal, &renderers).len()).sum();
    let all = left.max(1);

    for scene in &scenes {
        let tasks = missing(scene, &journal, &renderers);
        if tasks.is_empty() {
            continue;
        }
        let (cloud, camera) = scene.load(run.quiet)?;
        let loaded = Loaded { scene, cloud, camera };
        let mut exact = None;
        for task in tasks {
            let bar = Bar::new(&format!("{}: {}", scene.name, task.describe()), run.quiet);
            bar.report((all - left) as f32 / all as f32);
            let key = task.key(scene, &renderers);
            if matches!(task, Task::Kiddo | Task::Accuracy(_)) && exact.is_none() {
                exact = Some(Exact::new(&mut renderers, &loaded)?);
            }
            // A radius that was refused is refused again, with the reason.
            let first_radius = match journal.get(&Task::FirstRadius.key(scene, &renderers)) {
                Some(Outcome::Measured(FirstRadius { radius, .. })) => radius,
                _ => 1.0,
            };
            match (task, &exact) {
                (Task::FirstRadius, _) => {
                    journal.note(&key, &measure::first_radius(&mut renderers, &loaded)?)?;
                }
                (Task::Picture, _) => {
                    figures::picture(&loaded, &pictures.join(picture_name(scene)))?;
                    journal.note(&key, &true)?;
                }
                (Task::Table(method, culled), _) => {
                    let settings = settings(method, first_radius, K, culled);
                    journal.note(&key, &time(&mut renderers, &loaded, method, &settings, FRAMES)?)?;
                }
                (Task::Stages(method, k), _) => {
                    let settings = settings(method, first_radius, k, true);
                    journal.note(&key, &time(&mut renderers, &loaded, method, &settings, FRAMES)?)?;
                }
                (Task::Kiddo, Some(exact)) => journal.note(&key, &kiddo(&loaded, exact))?,
                (Task::Accuracy(method), Some(exact)) => {
                    journal.note(&key, &accuracy(&mut renderers, &loaded, method, first_radius, exact)?)?;
                }
                (Task::Kiddo | Task::Accuracy(_), None) => {}
                (Task::Culling, _) => journal.note(&key, &culling_difference(&mut renderers, &loaded)?)?,
                (Task::Normals, _) => {
                    journal.note(&key, &figures::normals(&loaded, side, &pictures.join("figure-6.png"))?)?;
                }
                (Task::Curvature, _) => {
                    figures::curvature(&loaded, side / 3 * 2, &pictures.join("figure-9.png"))?;
                    journal.note(&key, &true)?;
                }
            }
            left -= 1;
        }
    }
    if !journal.has(&scales) {
        let radii = figures::scales(TWO_SCALES[quick_index], side / 3 * 2, run.quiet, &pictures.join("figure-7.png"))?;
        journal.note(&scales, &radii)?;
    }

    let report = Report { journal: &journal, renderers: &renderers, scenes: &scenes, ks, scales: &scales };
    report.write_charts(&pictures)?;
    write_file(&page, |writer| std::io::Write::write_all(writer, report.page().as_bytes()))?;
    print_line(&page.display().to_string())
}

/// The file with a scene's picture.
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
            Err(Failure::new(Exit::Input, format!("{}: there is no such file or folder", path.display())))
        }
        _ => Ok(scene),
    }
}
