//! Generated scenes with an exact ground truth, of any number of points: for demonstrations, measurements and tests.
//!
//! # How it works
//! A scene is a body of solids (`shape`, `body`) with a distance bound, subdivided into cells (`octree`). The bound
//! yields the points, sampled evenly (`sample`) or scanned from inside (`scan`), and the true surface for
//! [`Scene::trace`]. Everything is a function of name, time and count: the same input gives the same bytes, whatever
//! the number of threads.

mod body;
mod cathedral;
mod figure;
mod fold;
mod head;
mod herd;
mod horse;
mod limb;
mod model;
mod name;
mod octree;
mod paint;
mod pedestal;
mod sample;
mod scan;
mod shape;
mod statue;
#[cfg(test)]
mod tests;

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use autosplats_cloud::{Axes, Error, PointCloud, Progress, check_memory, reserving};
use glam::DVec3;

use self::model::{Model, Points};
use self::name::Kind;
pub use self::name::{SCENE_PREFIX, View, parse_count};

/// A generated scene: a closed surface, known exactly, at one moment of its animation. In metres, z up.
///
/// Animations repeat every [`Scene::PERIOD`] seconds.
///
/// ```
/// use autosplats_scenes::Scene;
///
/// let (scene, count) = Scene::parse("figure:2K@0.5")?;
/// let cloud = scene.sample(count, &())?;
/// assert_eq!((scene.name(), cloud.len()), ("figure", 2000));
/// assert!(scene.distance(cloud.world_position(0)).abs() < 1e-3);
/// let view = scene.view();
/// let hit = scene.trace(view.eye, view.look_at - view.eye);
/// assert!(hit.is_some_and(|hit| hit.distance > 1.0));
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Scene {
    kind: Kind,
    seconds: f64,
    model: OnceLock<Arc<Model>>,
}

/// Intersection of a ray with the true surface of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance from the origin of the ray, in metres.
    pub distance: f64,
    /// Unit normal, pointing out of the solid.
    pub normal: DVec3,
    /// Colour of the points there, sRGB, 0 to 1.
    pub rgb: [f32; 3],
}

/// Makes the points of a [`Scene`], in parts.
pub struct Sampler<'a> {
    count: usize,
    way: Way<'a>,
}

/// How points are taken from a surface.
enum Way<'a> {
    Sampled(sample::Zones<'a>),
    Scanned(&'a octree::Octree, &'a [DVec3]),
}

impl Sampler<'_> {
    /// The points of a range, which begins at a multiple of [`Scene::BLOCK`] and ends at another or at the last point.
    /// `progress` is told from any thread.
    ///
    /// # Panics
    /// If the range is another.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`], and [`Error::Cancelled`] if `progress` says so.
    pub fn part(&self, range: Range<usize>, progress: &dyn Progress) -> Result<PointCloud, Error> {
        let Range { start, end } = range;
        let whole = start.is_multiple_of(Scene::BLOCK) && (end.is_multiple_of(Scene::BLOCK) || end == self.count);
        assert!(whole && start <= end && end <= self.count, "points {range:?} of {}", self.count);
        let count = range.len();
        // A failed reservation becomes an error. The zeroed vectors below would abort the process instead.
        let (what, bytes) = ("the points of a generated scene", count.saturating_mul(15));
        check_memory(what, bytes as u64)?;
        if reserving(|| Vec::<[u8; 15]>::new().try_reserve_exact(count)).is_err() {
            return Err(Error::OutOfMemory { what: what.into(), bytes });
        }
        let (mut positions, mut colors) = (vec![[0.0; 3]; count], vec![[0; 3]; count]);
        let finished = match &self.way {
            Way::Sampled(zones) => zones.sample(start, &mut positions, &mut colors, progress),
            Way::Scanned(tree, stations) => {
                scan::scan(tree, stations, self.count, start, &mut positions, &mut colors, progress)
            }
        };
        if !finished {
            return Err(Error::Cancelled);
        }
        PointCloud::new(DVec3::ZERO, positions).with_axes(Axes::ZUp).with_colors(colors)
    }
}

impl Scene {
    /// Points that are generated together, with random numbers of their own.
    pub const BLOCK: usize = sample::BLOCK;

    /// Period of all animations, in seconds.
    pub const PERIOD: f64 = 2.0;

    /// Maximum number of points of a scene.
    pub const MAX_COUNT: usize = name::MAX_COUNT;

    /// All scenes: name and one-line description.
    pub fn names() -> impl Iterator<Item = (&'static str, &'static str)> {
        Kind::ALL.into_iter().map(|kind| (kind.name(), kind.about()))
    }

    /// Parses `NAME[:COUNT][@SECONDS]`, with or without the prefix `scene:`. Returns the scene and the number of
    /// points, by default the scene's own. COUNT is a number with an optional k, m or g for thousands, millions or
    /// billions: `546K`, `1.5M`.
    ///
    /// # Errors
    /// [`Error::UnknownScene`] and [`Error::BadScene`].
    pub fn parse(text: &str) -> Result<(Self, usize), Error> {
        let (kind, count, seconds) = name::parse(text)?;
        Ok((Self { kind, seconds, model: OnceLock::new() }, count))
    }

    /// The scene's name.
    pub fn name(&self) -> &'static str {
        self.kind.name()
    }

    /// Time of the animation, in seconds.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Whether the scene changes with time.
    pub fn is_animated(&self) -> bool {
        self.kind.is_animated()
    }

    /// The same scene at another time.
    #[must_use]
    pub fn at(&self, seconds: f64) -> Self {
        let model = if self.is_animated() { OnceLock::new() } else { self.model.clone() };
        Self { kind: self.kind, seconds, model }
    }

    /// Builds the surface now, and shares it with all clones made afterwards.
    pub fn prepare(&self) {
        self.model();
    }

    fn model(&self) -> &Model {
        self.model.get_or_init(|| {
            let phase = if self.seconds.is_finite() { (self.seconds / Self::PERIOD).rem_euclid(1.0) } else { 0.0 };
            Arc::new(match self.kind {
                Kind::Figure => figure::scene(phase),
                Kind::TwoScales => figure::two_scales(),
                Kind::Statue => statue::scene(),
                Kind::Herd => herd::scene(phase),
                Kind::Cathedral => cathedral::scene(),
            })
        })
    }

    /// Samples `count` coloured points on the surface. `progress` is told from any thread.
    ///
    /// # Errors
    /// [`Error::BadScene`] if `count` is above [`Self::MAX_COUNT`] or memory does not suffice, and
    /// [`Error::Cancelled`] if `progress` says so.
    pub fn sample(&self, count: usize, progress: &dyn Progress) -> Result<PointCloud, Error> {
        self.sampler(count)?.part(0..count, progress)
    }

    /// Prepares sampling of `count` points, of which parts can be made one by one.
    ///
    /// # Errors
    /// [`Error::BadScene`] if `count` is above [`Self::MAX_COUNT`].
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats_scenes::Scene;
    ///
    /// let (scene, count) = Scene::parse("statue:40K")?;
    /// let sampler = scene.sampler(count)?;
    /// let part = sampler.part(2 * Scene::BLOCK..count, &())?;
    /// assert_eq!(part.positions(), &scene.sample(count, &())?.positions()[2 * Scene::BLOCK..]);
    /// # Ok::<(), autosplats_cloud::Error>(())
    /// ```
    pub fn sampler(&self, count: usize) -> Result<Sampler<'_>, Error> {
        if count > Self::MAX_COUNT {
            return Err(self.refuse(count, "a scene has at most 1G points"));
        }
        let Model { tree, points } = self.model();
        let way = match points {
            Points::Sampled(shares) => Way::Sampled(sample::Zones::new(tree, shares)),
            Points::Scanned(stations) => Way::Scanned(tree, stations),
        };
        Ok(Sampler { count, way })
    }

    fn refuse(&self, count: usize, why: &str) -> Error {
        Error::BadScene { given: format!("{}:{count}", self.name()), why: why.into() }
    }

    /// First intersection of a ray with the surface, from outside or from within a solid.
    pub fn trace(&self, origin: DVec3, direction: DVec3) -> Option<Hit> {
        let tree = &self.model().tree;
        let crossing = tree.trace(origin, direction, 0.0..f64::INFINITY)?;
        Some(Hit { distance: crossing.distance, normal: tree.normal(&crossing), rgb: tree.rgb(&crossing) })
    }

    /// Like [`trace`](Self::trace), but searches only the distances `within`, and returns only distance and colour.
    pub(crate) fn trace_within(&self, origin: DVec3, direction: DVec3, within: Range<f64>) -> Option<(f64, [f32; 3])> {
        let tree = &self.model().tree;
        let crossing = tree.trace(origin, direction, within)?;
        Some((crossing.distance, tree.rgb(&crossing)))
    }

    /// Corners of a box around the whole surface, in metres. It is larger than the points by less than a tenth, or,
    /// where these are inside a building, by its walls.
    pub fn bounds(&self) -> [DVec3; 2] {
        self.model().tree.bounds()
    }

    /// Visits cubes that together contain the whole surface, from large to small. `visit` gets the centre, half the
    /// side, and whether the cube has no smaller cubes inside, and returns whether to visit those. Returns whether the
    /// scene has such cubes.
    pub(crate) fn cubes(&self, visit: &mut dyn FnMut(DVec3, f64, bool) -> bool) -> bool {
        self.model().tree.cubes(visit)
    }

    /// Signed distance bound: zero on the surface, negative inside, and never larger than the true distance.
    pub fn distance(&self, position: DVec3) -> f64 {
        self.model().tree.distance(position)
    }

    /// A view that shows the scene well.
    pub fn view(&self) -> View {
        self.kind.view()
    }
}
