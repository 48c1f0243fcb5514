//! Comparison with the fastest kd-tree: `cargo bench -p autosplats --bench kd_tree [-- quick]`.
//!
//! # How it works
//! Search and fit are timed against kiddo's `ImmutableKdTree`. kiddo builds a tree of the same visible points and finds
//! the ten nearest neighbours of each, without a fit. The whole frame is timed against the same for all points. Both
//! run on the same threads and alternate, so that other load affects both. The table shows medians, and for ratios also
//! the extremes of all rounds.
//!
//! kiddo is queried in each possible way; the fastest way for the case counts.

mod common;

use std::{hint::black_box, num::NonZero, time::Instant};

use autosplats::cloud::{
    PointCloud, Random,
    glam::{DVec3, Vec3},
};
use autosplats::{Camera, Projection, Reconstruction, Renderer, Settings};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use common::{SIZE, args, frame, machine, median, scene, short};

/// Ten neighbours and the point itself.
const NEAREST: NonZero<usize> = NonZero::new(11).expect("not zero");

fn main() {
    let quick = args().iter().any(|arg| arg == "quick");
    println!("{}\n", machine());
    println!(
        "Times in ms. `search+fit` reconstructs every visible point (grid culling off), `culled` only those that grid \
         culling leaves.\n"
    );
    println!(
        "| scene | points | order | visible | search+fit | kiddo, visible | ratio | culled | ratio | frame \
         | kiddo, all | ratio | kiddo asked |"
    );
    println!("|---|--:|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|---|");
    let cases: &[(&str, usize, usize)] = if quick {
        &[("statue", 36_000, 2), ("sheet", 100_000, 2)]
    } else {
        &[
            ("statue", 36_000, 7),
            ("statue", 291_000, 7),
            ("statue", 690_000, 7),
            ("statue", 1_000_000, 7),
            ("sheet", 1_000_000, 5),
            ("cathedral", 1_000_000, 5),
            ("cathedral", 10_000_000, 3),
        ]
    };
    for &(name, points, rounds) in cases {
        let (cloud, camera) = if name == "sheet" { sheet(points) } else { scene(name, points) };
        let cloud = reordered(&cloud, |index, _| scrambled(index));
        compare(name, "random", &cloud, &camera, rounds);
        let bounds = Bounds::of(cloud.positions());
        let cloud = reordered(&cloud, |_, position| bounds.morton(position));
        compare(name, "spatial", &cloud, &camera, rounds);
    }
}

/// Times one cloud and prints a line of the table.
fn compare(name: &str, order: &str, cloud: &PointCloud, camera: &Camera, rounds: usize) {
    // The same task as the kd-tree's: k neighbours, and nothing more.
    let reconstruction = Reconstruction::paper();
    let settings = Settings { reconstruction, ..Settings::default() };
    let mut unculled = settings.clone();
    unculled.reconstruction.grid_culling = false;
    let mut renderer = Renderer::new();
    let visible = visible_points(&mut renderer, cloud, camera, &unculled);
    // The first frame makes the buffers.
    let (_, count) = frame(&mut renderer, cloud, camera, &settings);
    assert_eq!(visible.len(), count, "the kd-tree must get the points that the search gets");
    let (query, _) = Query::ALL
        .map(|query| (query, (0..2).map(|_| query.time(&visible)).fold(f64::INFINITY, f64::min)))
        .into_iter()
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .expect("there are several ways");

    let rounds: Vec<Round> = (0..rounds)
        .map(|_| {
            let (exhaustive, _) = frame(&mut renderer, cloud, camera, &unculled);
            let kiddo_visible = query.time(&visible);
            let (culled, _) = frame(&mut renderer, cloud, camera, &settings);
            let kiddo_all = query.time(cloud.positions());
            Round {
                search: exhaustive.search + exhaustive.fit,
                culled: culled.search + culled.fit,
                frame: culled.frame,
                kiddo_visible,
                kiddo_all,
            }
        })
        .collect();
    let middle = |value: fn(&Round) -> f64| median(rounds.iter().map(value));
    let ratio = |value: fn(&Round) -> f64| {
        let [least, greatest] =
            [f64::min, f64::max].map(|of| rounds.iter().map(value).reduce(of).expect("some rounds"));
        format!("{:.1} ({least:.1} to {greatest:.1})", middle(value))
    };
    println!(
        "| {name} | {} | {order} | {} | {:.1} | {:.1} | {} | {:.1} | {} | {:.1} | {:.0} | {} | {} |",
        short(cloud.len()),
        short(visible.len()),
        middle(|round| round.search),
        middle(|round| round.kiddo_visible),
        ratio(|round| round.kiddo_visible / round.search),
        middle(|round| round.culled),
        ratio(|round| round.kiddo_visible / round.culled),
        middle(|round| round.frame),
        middle(|round| round.kiddo_all),
        ratio(|round| round.kiddo_all / round.frame),
        query.name(),
    );
}

/// Milliseconds of one round.
struct Round {
    search: f64,
    culled: f64,
    frame: f64,
    kiddo_visible: f64,
    kiddo_all: f64,
}

/// Ways to query kiddo for the neighbours of many points.
#[derive(Clone, Copy)]
enum Query {
    /// One query after the other on rayon's threads.
    Single,
    SingleUnsorted,
    /// kiddo's own parallel batch; each answer is read and dropped.
    Batch,
    BatchUnsorted,
}

impl Query {
    const ALL: [Self; 4] = [Self::Single, Self::SingleUnsorted, Self::Batch, Self::BatchUnsorted];

    fn name(self) -> &'static str {
        match self {
            Self::Single => "singly",
            Self::SingleUnsorted => "singly, unsorted",
            Self::Batch => "in a batch",
            Self::BatchUnsorted => "in a batch, unsorted",
        }
    }

    /// Milliseconds to build a tree of `points` and to find the nearest neighbours of each.
    fn time(self, points: &[[f32; 3]]) -> f64 {
        type Metric = SquaredEuclidean<f32>;
        let start = Instant::now();
        let tree = ImmutableKdTree::<f32, 3>::new_from_slice(points).expect("a tree");
        match self {
            Self::Single => points.par_iter().for_each(|point| {
                black_box(tree.query(point).nearest_n::<Metric>(NEAREST).execute());
            }),
            Self::SingleUnsorted => points.par_iter().for_each(|point| {
                black_box(tree.query(point).nearest_n::<Metric>(NEAREST).unsorted().execute());
            }),
            Self::Batch => tree.query_batch(points).nearest_n::<Metric>(NEAREST).for_each(|_, found| {
                black_box(found);
            }),
            Self::BatchUnsorted => {
                tree.query_batch(points).nearest_n::<Metric>(NEAREST).unsorted().for_each(|_, found| {
                    black_box(found);
                });
            }
        }
        start.elapsed().as_secs_f64() * 1e3
    }
}

/// Points that own a pixel, in the cloud's order.
fn visible_points(renderer: &mut Renderer, cloud: &PointCloud, camera: &Camera, unculled: &Settings) -> Vec<[f32; 3]> {
    frame(renderer, cloud, camera, unculled);
    let mut indices: Vec<u32> =
        renderer.surfels().expect("a frame was rendered").iter().map(|surfel| surfel.point).collect();
    indices.sort_unstable();
    indices.into_iter().map(|index| cloud.positions()[index as usize]).collect()
}

/// A wavy sheet of random points that fills the picture; nearly all of the points are visible.
fn sheet(points: usize) -> (PointCloud, Camera) {
    let [width, height] = SIZE.map(f64::from);
    let columns = (points as f64 * width / height).sqrt().ceil() as usize;
    let rows = points.div_ceil(columns);
    let positions = (0..points).map(|index| {
        let jitter = |seed: u64| (scrambled(index as u64 * 2 + seed) >> 11) as f64 / (1u64 << 53) as f64;
        let x = ((index % columns) as f64 + jitter(0)) / columns as f64 - 0.5;
        let z = ((index / columns) as f64 + jitter(1)) / rows as f64 - 0.5;
        let y = 0.01 * ((40.0 * x).sin() + (30.0 * z).cos());
        [x * width / height, y, z].map(|coordinate| coordinate as f32)
    });
    let camera = Camera {
        eye: DVec3::new(0.0, -2.1, 0.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        projection: Projection::PerspectiveFovDeg(28.0),
    };
    (PointCloud::new(DVec3::ZERO, positions.collect()), camera)
}

/// A pseudo-random number for each number, all different.
fn scrambled(number: u64) -> u64 {
    Random::from_state(number).bits()
}

/// The cloud with its points sorted by a key of their index and position.
fn reordered(cloud: &PointCloud, key: impl Fn(u64, [f32; 3]) -> u64 + Sync) -> PointCloud {
    let positions = cloud.positions();
    let mut order: Vec<(u64, u32)> =
        positions.par_iter().enumerate().map(|(index, &p)| (key(index as u64, p), index as u32)).collect();
    order.par_sort_unstable();
    let moved = PointCloud::new(cloud.origin(), order.iter().map(|&(_, index)| positions[index as usize]).collect());
    let Some(colors) = cloud.colors() else { return moved };
    moved.with_colors(order.iter().map(|&(_, index)| colors[index as usize]).collect()).expect("as many as before")
}

/// A box around all points.
struct Bounds {
    low: Vec3,
    extent: Vec3,
}

impl Bounds {
    fn of(positions: &[[f32; 3]]) -> Self {
        let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (low, high) = positions.iter().fold(empty, |(low, high), &p| (low.min(p.into()), high.max(p.into())));
        Self { low, extent: (high - low).max(Vec3::splat(f32::MIN_POSITIVE)) }
    }

    /// Position on a Z curve through the box, 20 bits per axis.
    fn morton(&self, position: [f32; 3]) -> u64 {
        let cell = ((Vec3::from(position) - self.low) / self.extent * 1_048_575.0).to_array();
        let spread = |cell: f32| (0..20).fold(0u64, |bits, bit| bits | (cell as u64 >> bit & 1) << (3 * bit));
        spread(cell[0]) | spread(cell[1]) << 1 | spread(cell[2]) << 2
    }
}
