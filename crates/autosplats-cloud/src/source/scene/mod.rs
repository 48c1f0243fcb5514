//! Made-up scenes with an exact ground truth: clouds to show, to measure and to test with, at any size.
//!
//! # How it works
//! A scene is a body of solids (`shape`, `body`) whose distance bound is cut into cells (`octree`). From the same bound
//! come the points, evenly strewn (`sample`) or scanned from within (`scan`), and the true surface that
//! [`Scene::trace`] reports. Everything is a function of name, time and count: the same input gives the same bytes,
//! whatever the number of threads.

mod body;
mod cathedral;
mod figure;
mod fold;
mod head;
mod herd;
mod horse;
mod limb;
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

use std::sync::{Arc, OnceLock};

use glam::DVec3;

use self::name::Kind;
pub use self::name::parse_count;
use self::octree::Octree;
use crate::{Axes, Error, PointCloud};

/// A made-up scene: a closed surface known exactly, at one moment of its animation. Metres, z up.
///
/// Every animation repeats after [`Scene::PERIOD`].
#[derive(Clone, Debug)]
pub struct Scene {
    kind: Kind,
    seconds: f64,
    model: OnceLock<Arc<Model>>,
}

/// The surface and how points are to be taken from it.
#[derive(Debug)]
struct Model {
    tree: Octree,
    points: Points,
}

/// Where a scene's points come from.
#[derive(Debug)]
enum Points {
    /// Strewn evenly over each zone, which gets this share of the points.
    Strewn(Vec<f64>),
    /// Scanned from these places.
    Scanned(Vec<DVec3>),
}

/// Where a ray meets the true surface of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Metres from the ray's origin.
    pub distance: f64,
    /// Unit normal, pointing out of the solid.
    pub normal: DVec3,
    /// Colour, sRGB 0 to 1, as the points there have it.
    pub rgb: [f32; 3],
}

/// Where to look at a scene from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The eye.
    pub eye: DVec3,
    /// What is in the middle of the picture.
    pub look_at: DVec3,
    /// What is up in the picture.
    pub up: DVec3,
    /// Vertical angle of view, degrees.
    pub fov_degrees: f64,
}

impl Scene {
    /// Every animation repeats after this many seconds.
    pub const PERIOD: f64 = 2.0;

    /// The most points a scene can be asked for.
    pub const MAX_COUNT: usize = 1_000_000_000;

    /// The scenes there are, each with a line that describes it.
    pub fn names() -> impl Iterator<Item = (&'static str, &'static str)> {
        Kind::ALL.into_iter().map(|kind| (kind.name(), kind.about()))
    }

    /// Reads `NAME[:COUNT][@SECONDS]`, with or without `scene:` before it, and returns the scene and the count, or the
    /// scene's own default. COUNT is a number with an optional k, m or g for thousands, millions or billions: `546K`,
    /// `1.5M`.
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

    /// Seconds into the animation.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Whether the scene looks different at different times.
    pub fn is_animated(&self) -> bool {
        self.kind.is_animated()
    }

    /// The same scene at another time.
    #[must_use]
    pub fn at(&self, seconds: f64) -> Self {
        let model = if self.is_animated() { OnceLock::new() } else { self.model.clone() };
        Self { kind: self.kind, seconds, model }
    }

    /// Makes the surface now, for this scene and all its clones.
    pub(crate) fn prepare(&self) {
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

    /// `count` coloured points on the surface. `progress` is told how much is done, 0 to 1, from any thread, and ends
    /// the work by returning false.
    ///
    /// # Errors
    /// [`Error::BadScene`] if `count` is above [`Self::MAX_COUNT`] or memory does not suffice, and
    /// [`Error::Cancelled`] if `progress` returned false.
    pub fn sample(&self, count: usize, progress: &(dyn Fn(f32) -> bool + Sync)) -> Result<PointCloud, Error> {
        let refuse = |why: &str| Error::BadScene { given: format!("{}:{count}", self.name()), why: why.into() };
        if count > Self::MAX_COUNT {
            return Err(refuse("a scene has at most 1G points"));
        }
        // Asking first turns a lack of memory into an error; the zeroed vectors below would abort instead.
        if Vec::<[u8; 15]>::new().try_reserve_exact(count).is_err() {
            return Err(refuse("not enough memory for so many points"));
        }
        let (mut positions, mut colors) = (vec![[0.0; 3]; count], vec![[0; 3]; count]);
        let Model { tree, points } = self.model();
        let finished = match points {
            Points::Strewn(shares) => sample::strew(tree, shares, &mut positions, &mut colors, progress),
            Points::Scanned(stations) => scan::scan(tree, stations, &mut positions, &mut colors, progress),
        };
        if !finished {
            return Err(Error::Cancelled);
        }
        PointCloud::new(DVec3::ZERO, positions).with_axes(Axes::ZUp).with_colors(colors)
    }

    /// First place where a ray meets the surface, from outside or from within a solid.
    pub fn trace(&self, origin: DVec3, direction: DVec3) -> Option<Hit> {
        let tree = &self.model().tree;
        let crossing = tree.trace(origin, direction, 0.0..f64::INFINITY)?;
        Some(Hit { distance: crossing.distance, normal: tree.normal(&crossing), rgb: tree.rgb(&crossing) })
    }

    /// The same from some distance to another, in which all lies that the ray meets; distance and colour alone.
    pub(crate) fn trace_within(
        &self,
        origin: DVec3,
        direction: DVec3,
        within: std::ops::Range<f64>,
    ) -> Option<(f64, [f32; 3])> {
        let tree = &self.model().tree;
        let crossing = tree.trace(origin, direction, within)?;
        Some((crossing.distance, tree.rgb(&crossing)))
    }

    /// Cubes that together hold all the surface, from large to small: `visit` gets the middle, half a side, and whether there are
    /// no smaller ones within, and says whether to go on with these. Returns whether there are such cubes.
    pub(crate) fn cubes(&self, visit: &mut dyn FnMut(DVec3, f64, bool) -> bool) -> bool {
        self.model().tree.cubes(visit)
    }

    /// Signed distance bound: zero on the surface, negative inside, never farther than the surface is.
    pub fn distance(&self, position: DVec3) -> f64 {
        self.model().tree.distance(position)
    }

    /// A good place to look from.
    pub fn view(&self) -> View {
        self.kind.view()
    }
}
