//! Subjects of pictures: an exact surface, and points on it with the defects of real scans.
//!
//! # How it works
//! Points are sampled evenly over the surface, or where the rays of a spinning lidar hit it. Uneven densities sample
//! more points and drop each with a probability that depends on its place. Then every other point is misregistered, all
//! get noise, and outliers are appended, in this order. Points without these three defects say where the surface counts
//! as sampled. For a lidar its steps say so.

use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, Result};
use autosplats::cloud::glam::{DQuat, DVec3};
use autosplats::cloud::{Axes, PointCloud, sample_surface};
use autosplats_scenes::Scene;

use crate::mesh::{Hit, Mesh};
use crate::neighbors::Neighbors;
use crate::random::{normal3, random};
use crate::rays::Rays;
use crate::surface::Surface;
use crate::sweep::Sweep;

/// Number of neighbours from which the spacing of points is computed.
const SPACING_K: NonZero<usize> = NonZero::new(10).expect("above 0");
/// Greatest noise expected, in standard deviations.
const MAX_NOISE_DEVIATIONS: f64 = 4.0;
/// Axis about which a misregistered scan is turned. It need not have length 1.
const TURN_AXIS: DVec3 = DVec3::new(0.48, 0.6, 0.64);
/// Direction in which a misregistered scan is shifted. It need not have length 1.
const SHIFT: DVec3 = DVec3::new(0.64, -0.48, 0.6);

/// The origin of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A built-in scene of this name.
    Scene(&'static str),
    /// A sphere with bumps. It has 20·4^n triangles.
    Bumpy(usize),
    /// A mesh in the folder of test data.
    Mesh {
        /// The mesh's name.
        name: &'static str,
        /// Path of the file in the folder.
        path: &'static str,
        /// Number of Loop subdivisions.
        levels: usize,
    },
}

/// The Stanford bunny. Its 1.1 million triangles are as many as points of its densest cloud, which hides the facets.
pub const BUNNY: Source = Source::Mesh { name: "bunny", path: "models/bunny.ply", levels: 2 };
/// A galloping horse, by Sumner and Popović.
pub const HORSE: Source = Source::Mesh { name: "horse", path: "animation/horse_gallop/frame_000.ply", levels: 2 };
/// A samba dancer, by Vlasic et al.
pub const DANCER: Source = Source::Mesh { name: "dancer", path: "animation/samba/frame_000.ply", levels: 2 };

/// The density of points, over the place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Density {
    /// The same density everywhere.
    #[default]
    Even,
    /// Dense and sparse patches, with densities of up to 12 to 1.
    Uneven,
    /// Stripes, six times as dense as the surface between them.
    Striped,
    /// Falling along x, to a twentieth.
    Gradient,
}

/// How to make a subject. Lengths are shares of the diagonal of the points' box, those of a lidar metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recipe {
    /// Origin of the surface.
    pub source: Source,
    /// Approximate number of points on the surface without outliers, or number of the lidar's rays.
    pub count: usize,
    /// Density of sampled points. A lidar has its own.
    pub density: Density,
    /// The lidar that scans the surface, with its own noise. `None` for sampled points.
    pub sweep: Option<Sweep>,
    /// Standard deviation of noise, the same in all directions.
    pub noise: f64,
    /// Number of outliers, as a share of the points. They are spread evenly over the box.
    pub outliers: f64,
    /// Shift of a second scan of every other point, which is also turned by 0.1°. 0 for one scan.
    pub misregistration: f64,
}

impl Recipe {
    /// Evenly sampled points without defects.
    pub const fn new(source: Source, count: usize) -> Self {
        Self { source, count, density: Density::Even, sweep: None, noise: 0.0, outliers: 0.0, misregistration: 0.0 }
    }

    /// The points of a spinning lidar.
    pub const fn swept(source: Source, sweep: Sweep) -> Self {
        Self { sweep: Some(sweep), ..Self::new(source, sweep.count()) }
    }

    /// The recipe with another density.
    pub const fn density(self, density: Density) -> Self {
        Self { density, ..self }
    }

    /// The recipe with noise.
    pub const fn noise(self, noise: f64) -> Self {
        Self { noise, ..self }
    }

    /// The recipe with outliers.
    pub const fn outliers(self, outliers: f64) -> Self {
        Self { outliers, ..self }
    }

    /// The recipe with a second scan that is shifted by this.
    pub const fn misregistration(self, misregistration: f64) -> Self {
        Self { misregistration, ..self }
    }

    /// Whether points lie beside the surface.
    pub fn is_noisy(&self) -> bool {
        let range_noise = self.sweep.map_or(0.0, |sweep| sweep.noise);
        self.noise > 0.0 || range_noise > 0.0 || self.outliers > 0.0 || self.misregistration > 0.0
    }

    /// The surface's name.
    pub fn surface_name(&self) -> &'static str {
        match self.source {
            Source::Scene(name) | Source::Mesh { name, .. } => name,
            Source::Bumpy(_) => "bumpy",
        }
    }

    /// The name: surface, number of points or rays, and defects.
    pub fn name(&self) -> String {
        let thousands = self.count / 1000;
        let count = match self.sweep {
            Some(Sweep { beams, azimuths, .. }) => format!("{beams}x{azimuths}"),
            None if thousands.is_multiple_of(1000) => format!("{}M", thousands / 1000),
            None => format!("{thousands}K"),
        };
        let mut name = format!("{}:{count}", self.surface_name());
        if let Some(Sweep { noise, .. }) = self.sweep
            && noise > 0.0
        {
            name += &format!("-noise{noise}m");
        }
        if self.density != Density::Even {
            name += &format!("-{:?}", self.density).to_lowercase();
        }
        let percent = |share: f64| (share * 1e4).round() / 100.0;
        for (what, share) in [("noise", self.noise), ("outliers", self.outliers), ("scans", self.misregistration)] {
            if share > 0.0 {
                name += &format!("-{what}{}%", percent(share));
            }
        }
        name
    }

    /// Whether the mesh is present. Meshes are not part of the repository.
    pub fn is_available(&self) -> bool {
        match self.source {
            Source::Mesh { path, .. } => data_folder().join(path).is_file(),
            Source::Scene(_) | Source::Bumpy(_) => true,
        }
    }
}

/// Folder of real scans and models: `AUTOSPLATS_DATA`, by default `shared/data` beside the repository.
pub fn data_folder() -> PathBuf {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    std::env::var_os("AUTOSPLATS_DATA").map_or_else(beside, PathBuf::from)
}

/// A surface with points on it.
#[derive(Debug)]
pub struct Subject {
    /// Recipe of the subject.
    pub recipe: Recipe,
    /// The exact surface.
    pub surface: Surface,
    /// The points to render.
    pub cloud: PointCloud,
    /// The points without noise, misregistration and outliers, in the same order, for neighbour searches.
    pub clean: Neighbors,
    /// The points without noise, misregistration and outliers, to render.
    pub clean_cloud: PointCloud,
    /// Greatest distance from the surface expected of a point that is no outlier, in world units.
    pub max_offset: f64,
    /// Diagonal of the box of [`clean`](Self::clean), in world units.
    pub diagonal: f64,
}

impl Subject {
    /// Makes the points. The same recipe gives the same points, bit by bit.
    ///
    /// # Errors
    /// The mesh cannot be read.
    pub fn new(recipe: Recipe) -> Result<Self> {
        let (surface, even) = sample_points(&recipe)?;
        let axes = even.axes();
        let (low, high) = bounds(even.positions());
        let diagonal = (high - low).length();
        let clean: Vec<DVec3> = even.positions().iter().map(|&p| DVec3::from(p.map(f64::from))).collect();
        let turn = DQuat::from_axis_angle(TURN_AXIS.normalize(), 0.1_f64.to_radians());
        let shift = SHIFT.normalize() * (recipe.misregistration * diagonal);
        let middle = 0.5 * (low + high);
        let place = |(i, &point): (usize, &DVec3)| {
            let is_second = recipe.misregistration > 0.0 && i % 2 == 1;
            let point = if is_second { middle + turn * (point - middle) + shift } else { point };
            let noise = if recipe.noise > 0.0 { normal3(&mut random(1, i)) } else { DVec3::ZERO };
            let along = recipe.sweep.filter(|sweep| sweep.noise > 0.0).map_or(DVec3::ZERO, |sweep| {
                (point - sweep.origin()).normalize() * (sweep.noise * random(4, i).normal())
            });
            (point + along + noise * (recipe.noise * diagonal)).as_vec3().to_array()
        };
        let mut positions: Vec<_> = clean.iter().enumerate().map(place).collect();
        let outliers = (recipe.outliers * clean.len() as f64) as usize;
        positions.extend((0..outliers).map(|i| {
            let mut random = random(2, i);
            (low + (high - low) * DVec3::from([(); 3].map(|()| random.unit()))).as_vec3().to_array()
        }));
        let with_axes = |cloud: PointCloud| if let Some(axes) = axes { cloud.with_axes(axes) } else { cloud };
        let misplaced = if recipe.misregistration > 0.0 {
            recipe.misregistration * diagonal + 0.5 * diagonal * 0.1_f64.to_radians()
        } else {
            0.0
        };
        Ok(Self {
            recipe,
            surface,
            cloud: with_axes(PointCloud::new(even.origin(), positions)),
            clean: Neighbors::new(&even, SPACING_K),
            clean_cloud: even,
            max_offset: MAX_NOISE_DEVIATIONS
                * (recipe.noise * diagonal + recipe.sweep.map_or(0.0, |sweep| sweep.noise))
                + misplaced,
            diagonal,
        })
    }

    /// Normal of the surface at a point without noise and misregistration, of either sign. The point must be no
    /// outlier. If no surface is near, the normal is that of a plane fit.
    pub fn normal(&self, point: u32) -> DVec3 {
        let place = self.clean.position(point);
        let fitted = self.clean.normal(point);
        let height = self.height(place);
        // Rays from above and below. The hit nearer to the point counts, as other surfaces may be close.
        let hits = [fitted, -fitted].map(|up| self.surface.trace(place + up * height, -up));
        let off = |hit: &Hit| (hit.distance - height).abs();
        let nearest = hits.into_iter().flatten().min_by(|one, other| off(one).total_cmp(&off(other)));
        nearest.filter(|hit| off(hit) < height).map_or(fitted, |hit| hit.normal)
    }

    /// Whether a point lies just beyond a border: the surface that hides it is nearer to it than its farthest
    /// neighbour. Most such points face away from the eye. Points hidden at a distance may be all that is scanned of a
    /// thing.
    pub fn is_beyond_border(&self, point: u32, rays: &Rays) -> bool {
        let place = self.clean.position(point);
        let Some((at, _)) = rays.project(place) else { return false };
        let (origin, direction) = rays.through(at);
        let reach = self.clean.around(place).last().map_or(0.0, |farthest| farthest.length());
        let behind = |hit: Hit| (place - origin).dot(direction) - hit.distance;
        self.surface.trace(origin, direction).is_some_and(|hit| (self.height(place)..reach).contains(&behind(hit)))
    }

    /// A quarter of the distance to the nearest other point: much more than rounding errors.
    fn height(&self, place: DVec3) -> f64 {
        0.25 * self.clean.around(place)[1].length()
    }

    /// Whether a point is an outlier.
    pub fn is_outlier(&self, point: u32) -> bool {
        point as usize >= self.clean.len()
    }
}

/// The surface, and points on it without defects.
fn sample_points(recipe: &Recipe) -> Result<(Surface, PointCloud)> {
    let mesh = match recipe.source {
        Source::Scene(name) => {
            let (scene, _) = Scene::parse(name)?;
            if let Some(sweep) = recipe.sweep {
                return Ok(swept(Surface::Scene(scene), sweep, Axes::ZUp));
            }
            let cloud = scene.sample(recipe.count, &())?;
            // Colours are dropped, so that light alone shows the shape.
            let plain = PointCloud::new(cloud.origin(), cloud.positions().to_vec()).with_axes(Axes::ZUp);
            return Ok((Surface::Scene(scene), plain));
        }
        Source::Bumpy(levels) => Mesh::bumpy_sphere(levels),
        Source::Mesh { path, levels, .. } => Mesh::read(&data_folder().join(path), levels)?,
    };
    let axes = if matches!(recipe.source, Source::Bumpy(_)) { Axes::ZUp } else { Axes::YUp };
    if let Some(sweep) = recipe.sweep {
        return Ok(swept(Surface::Mesh(Arc::new(mesh)), sweep, axes));
    }
    let contents = mesh.contents();
    let (low, high) = bounds(contents.cloud.positions());
    let keep = |p: &[f32; 3]| keep_probability(recipe.density, (DVec3::from(p.map(f64::from)) - low) / (high - low));
    let sample = |count, seed| sample_surface(&contents, count, seed, &()).context("cannot sample points");
    let cloud = if recipe.density == Density::Even {
        sample(recipe.count, 1)?
    } else {
        let few = sample(20_000, 2)?;
        let share = few.positions().iter().map(keep).sum::<f64>() / few.len() as f64;
        let many = sample((recipe.count as f64 / share) as usize, 1)?;
        let lots = many.positions().iter().enumerate();
        let left = lots.filter(|&(i, p)| random(3, i).unit() < keep(p)).map(|(_, &p)| p);
        PointCloud::new(many.origin(), left.collect())
    };
    Ok((Surface::Mesh(Arc::new(mesh)), cloud.with_axes(axes)))
}

/// The surface, and the points that a lidar scans of it.
fn swept(surface: Surface, sweep: Sweep, axes: Axes) -> (Surface, PointCloud) {
    let points = sweep.points(&surface).iter().map(|point| point.as_vec3().to_array()).collect();
    (surface, PointCloud::new(DVec3::ZERO, points).with_axes(axes))
}

/// Probability of keeping a point. `at` is its place, 0 to 1 along each side of the box.
fn keep_probability(density: Density, at: DVec3) -> f64 {
    match density {
        Density::Even => 1.0,
        Density::Uneven => {
            let waves = (9.0 * at.x + 1.0).sin() + (11.0 * at.y + 2.0).sin() + (10.0 * at.z).sin();
            (0.5 + waves / 3.0).clamp(1.0 / 12.0, 1.0)
        }
        Density::Striped => {
            if (30.0 * (at.y + 0.3 * at.x)).rem_euclid(1.0) < 0.4 {
                1.0
            } else {
                1.0 / 6.0
            }
        }
        Density::Gradient => 0.05 + 0.95 * at.x.clamp(0.0, 1.0),
    }
}

fn bounds(positions: &[[f32; 3]]) -> (DVec3, DVec3) {
    let points = positions.iter().map(|point| DVec3::from(point.map(f64::from)));
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), point| (low.min(point), high.max(point)))
}
