//! Pictures of octrees, of which what a picture needs is read.

use std::time::Instant;

use autosplats::{BYTES_PER_PIXEL, ColorMode, Detail, PlacedTree, Renderer, Shown, TreeScene};
use autosplats_cloud::{Progress as _, Traffic, Unit, Wanted, usual_memory};

use super::job::Job;
use super::report::TreeReport;
use super::{Placed, milliseconds_since};
use crate::device::Device;
use crate::exit::{Exit, Failure};
use crate::progress::{Bar, Notes};

/// Memory of what is on its way from the file to the renderer, in bytes.
const QUEUES: u64 = 64 << 20;
/// Least memory for points, in bytes.
const LEAST: u64 = 64 << 20;

/// The trees of the inputs, unless these are to be read whole.
pub(super) fn trees(job: &Job) -> Result<Option<Vec<PlacedTree>>, Failure> {
    match job.tree.detail() {
        Some(0.0) => Ok(None),
        detail => job.inputs.trees(detail.is_some(), &job.console),
    }
}

/// Renders one picture.
pub(super) fn run(
    mut job: Job,
    trees: Vec<PlacedTree>,
    renderer: &mut Renderer,
    device: &Device,
) -> Result<(), Failure> {
    let started = Instant::now();
    let bar = Bar::new(&format!("reading {}", job.inputs.names()), &job.console);
    let names = job.inputs.names();
    let notes = Notes::new(&bar, &names);
    if job.supersample_is_default && job.tree.memory.is_some_and(|memory| memory < memory_beside_points(&job) + LEAST) {
        job.supersample = 1;
    }
    let scene = open(&job, trees, &bar)?;
    let (camera, axes) = job.camera.place(scene.sample(), None, job.size)?;
    let mut scene = scene.with_axes(axes);
    job.settle_exposure(scene.sample());
    job.settle_first_radius(renderer, scene.sample(), &camera)?;
    let shown = scene.show(&camera, job.size, &detail(&job), &notes)?;
    check(&scene, &shown, &notes)?;
    if let Some(filter) = job.inputs.kept().filter(|_| scene.points().chosen_points() == 0 && shown.points > 0) {
        let points = shown.points;
        return Err(Failure::new(Exit::Input, format!("{names}: --keep {filter} leaves none of its {points} points")));
    }
    tell(&job, &scene, &shown, &notes);
    let read = milliseconds_since(started);
    let tree = Some(report(&scene, &shown, read));
    drop(bar);
    Placed { camera, axes, read, notes: Vec::new(), tree }.picture(job, renderer, device, scene.points().into())
}

/// How fine the points shall be.
pub(super) fn detail(job: &Job) -> Detail {
    Detail { spacing_px: job.tree.detail().unwrap_or(1.0), max_points: job.tree.max_points(), ..Detail::default() }
}

/// Opens the trees and reads the coarsest points, with the attributes that the picture shows.
pub(super) fn open(job: &Job, trees: Vec<PlacedTree>, bar: &Bar) -> Result<TreeScene, Failure> {
    for placed in &trees {
        let info = placed.tree.info();
        let notes = Notes::new(bar, &placed.tree.name().display().to_string());
        info.notes.iter().for_each(|note| notes.note(note));
        if info.crs.unit == Some(Unit::Degree) {
            let why =
                "its coordinates are degrees, which only points that are read whole can be shown in; add --detail 0";
            return Err(Failure::new(Exit::Input, format!("{}: {why}", placed.tree.name().display())));
        }
    }
    let color = &job.settings.shading.color;
    let field = match color {
        ColorMode::Classification => Some("Classification"),
        ColorMode::Field(name) => Some(&**name),
        _ => None,
    };
    let has = |name: &str| {
        let fields = trees.iter().flat_map(|placed| &placed.tree.info().fields);
        fields.into_iter().any(|field| field.eq_ignore_ascii_case(name))
    };
    let wanted = Wanted {
        colors: matches!(color, ColorMode::Auto | ColorMode::Rgb) || field.is_some_and(|name| !has(name)),
        // All fields, if only to tell which ones there are.
        fields: field.is_none_or(has).then(|| field.into_iter().map(str::to_owned).collect()),
        keep: job.inputs.kept(),
        ..Wanted::default()
    };
    let scene = TreeScene::open(trees, wanted, memory(job)?, job.tree.max_points(), bar)?;
    job.check_color(scene.sample())?;
    Ok(scene)
}

/// Memory in bytes of all but points.
fn memory_beside_points(job: &Job) -> u64 {
    let [width, height] = job.rendered_size().map(u64::from);
    width * height * BYTES_PER_PIXEL + QUEUES
}

/// Memory for points, in bytes.
fn memory(job: &Job) -> Result<u64, Failure> {
    let others = memory_beside_points(job);
    let asked = job.tree.memory.unwrap_or_else(|| usual_memory().max(others + LEAST));
    if asked < others + LEAST {
        let least = (others + LEAST).div_ceil(1 << 20);
        return Err(Failure::usage(format!(
            "--memory: this picture needs at least {least}M; allow more, or make it smaller"
        )));
    }
    Ok(asked - others)
}

/// Tells what is odd or damaged in the nodes that were loaded.
///
/// # Errors
/// If all nodes of the picture are damaged.
pub(super) fn check(scene: &TreeScene, shown: &Shown, notes: &Notes<'_>) -> Result<(), Failure> {
    scene.take_notes().iter().for_each(|note| notes.note(note));
    let [nodes, points] = shown.damaged;
    if let Some(damage) = &shown.damage {
        if nodes == shown.nodes as u64 {
            return Err(Failure::new(Exit::Input, damage));
        }
        notes.note(&format!("{points} points in {nodes} nodes are damaged and missing; the first: {damage}"));
    }
    Ok(())
}

/// Tells what a picture lacks on purpose.
pub(super) fn tell(job: &Job, scene: &TreeScene, shown: &Shown, notes: &Notes<'_>) {
    let left = (shown.points - shown.damaged[1]).saturating_sub(scene.points().chosen_points() as u64);
    if let Some(filter) = job.inputs.kept().filter(|_| left > 0) {
        notes.note(&filter.left_out_note(left, shown.points));
    }
    if shown.spacing_px > detail(job).spacing_px {
        notes.note(&format!(
            "neighbouring points are up to {:.1} pixels apart; a larger --points-budget or --memory shows finer ones",
            shown.spacing_px
        ));
    }
}

/// What was read for a picture.
pub(super) fn report(scene: &TreeScene, shown: &Shown, complete_ms: f64) -> TreeReport {
    let Traffic { requests, bytes } = scene.traffic();
    TreeReport {
        stored_points: scene.trees().iter().map(|placed| placed.tree.info().points).sum(),
        nodes: shown.nodes,
        points: shown.points,
        read_nodes: shown.loaded,
        read_points: shown.loaded_points,
        bytes,
        requests,
        spacing_px: shown.spacing_px,
        complete_ms,
    }
}
