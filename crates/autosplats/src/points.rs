//! What a frame is made from: a cloud, or the chosen nodes of a pool.
//!
//! What the points *are* (axes, exposure, which columns there are) comes from a [scene](Points::scene), a cloud that
//! stays the same. What is *there* of them are runs of points, each about an origin of its own.

use std::ops::Range;
use std::sync::Arc;

use autosplats_cloud::{PointCloud, PointPool, PointRun, RelativeValues, SLOT_SHIFT};
use glam::DVec3;

use crate::camera::{PlacedView, View};

/// Shift of the indices of a whole cloud to its slot. A shift by all 32 bits is undefined.
pub(crate) const WHOLE_SHIFT: u32 = u32::BITS - 1;

/// Points to render: a whole cloud, or the chosen nodes of a pool.
///
/// # Examples
///
/// ```
/// use autosplats::cloud::{NodeKey, PointCloud, PointPool, glam::DVec3};
/// use autosplats::{Camera, Projection, Renderer, Settings, ViewDirection, guess_axes};
///
/// let grid = (0..40_000).map(|i| [(i % 200) as f32, (i / 200) as f32, (i % 7) as f32]);
/// let root = PointCloud::new(DVec3::ZERO, grid.collect());
/// let mut pool = PointPool::new(&root, 1_000_000)?;
/// pool.insert(NodeKey::default(), &root);
/// pool.choose(&[NodeKey::default()]);
/// let projection = Projection::PerspectiveFovDeg(40.0);
/// let camera = Camera::fit(pool.sample(), guess_axes(pool.sample()), ViewDirection::Iso, 1.0, projection)?;
/// let [mut of_pool, mut of_cloud] = [Renderer::new(), Renderer::new()];
/// let frame = of_pool.render(&pool, &camera, [64, 64], &Settings::default())?;
/// assert_eq!(frame.image, of_cloud.render(&root, &camera, [64, 64], &Settings::default())?.image);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub enum Points<'a> {
    /// All points of a cloud.
    Cloud(&'a PointCloud),
    /// The points of the [chosen](PointPool::choose) nodes of a pool. Indices of points are those of the pool.
    Pool(&'a PointPool),
}

impl<'a> From<&'a PointCloud> for Points<'a> {
    fn from(cloud: &'a PointCloud) -> Self {
        Self::Cloud(cloud)
    }
}

impl<'a> From<&'a Arc<PointCloud>> for Points<'a> {
    fn from(cloud: &'a Arc<PointCloud>) -> Self {
        Self::Cloud(cloud)
    }
}

impl<'a> From<&'a PointPool> for Points<'a> {
    fn from(pool: &'a PointPool) -> Self {
        Self::Pool(pool)
    }
}

impl<'a> Points<'a> {
    /// The cloud that tells what the points are: the cloud itself, or the sample of a pool.
    pub(crate) fn scene(self) -> &'a PointCloud {
        match self {
            Self::Cloud(cloud) => cloud,
            Self::Pool(pool) => pool.sample(),
        }
    }

    /// Identifies what the points are: constant for a pool.
    pub(crate) fn identity(self) -> u64 {
        match self {
            Self::Cloud(cloud) => cloud.identity(),
            Self::Pool(pool) => pool.identity(),
        }
    }

    /// Number of points to render.
    pub fn len(self) -> usize {
        match self {
            Self::Cloud(cloud) => cloud.len(),
            Self::Pool(pool) => pool.chosen_points(),
        }
    }

    /// Whether there are no points to render.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Largest number that an index of a point stays below.
    pub(crate) fn room(self) -> usize {
        match self {
            Self::Cloud(cloud) => cloud.len(),
            Self::Pool(pool) => pool.capacity(),
        }
    }

    /// Binary logarithm of the number of successive indices whose points have one origin.
    pub(crate) fn slot_shift(self) -> u32 {
        match self {
            Self::Cloud(_) => WHOLE_SHIFT,
            Self::Pool(_) => SLOT_SHIFT,
        }
    }

    /// The points to render, in an order that no history of a pool changes. No run crosses a slot.
    pub(crate) fn runs(self) -> Vec<PointRun> {
        match self {
            Self::Cloud(cloud) => {
                let most = 1 << self.slot_shift();
                let run = |first: usize| {
                    let len = (cloud.len() - first).min(most) as u32;
                    PointRun { first: first as u32, len, origin: cloud.origin() }
                };
                (0..cloud.len()).step_by(most).map(run).collect()
            }
            Self::Pool(pool) => pool.runs(),
        }
    }

    /// Positions by index, each about the origin of its run.
    pub(crate) fn positions(self) -> &'a [[f32; 3]] {
        match self {
            Self::Cloud(cloud) => cloud.positions(),
            Self::Pool(pool) => pool.positions(),
        }
    }

    /// Colours by index.
    pub(crate) fn colors(self) -> Option<&'a [[u8; 3]]> {
        match self {
            Self::Cloud(cloud) => cloud.colors(),
            Self::Pool(pool) => pool.colors(),
        }
    }

    /// Values of a field by index.
    pub(crate) fn field(self, name: &str) -> Option<RelativeValues<'a>> {
        match self {
            Self::Cloud(cloud) => cloud.field(name).map(|field| RelativeValues::new(&field.values)),
            Self::Pool(pool) => pool.field(name),
        }
    }

    /// Number that grows whenever points of the same identity change.
    pub(crate) fn generation(self) -> u64 {
        match self {
            Self::Cloud(_) => 0,
            Self::Pool(pool) => pool.generation(),
        }
    }

    /// Indices whose points have changed since a generation, ascending; all since `None`.
    pub(crate) fn written_since(self, generation: Option<u64>) -> Vec<Range<usize>> {
        match self {
            Self::Cloud(cloud) => generation.is_none().then_some(0..cloud.len()).into_iter().collect(),
            Self::Pool(pool) => pool.written_since(generation),
        }
    }

    /// A view of the points, for later frames to look back to.
    pub(crate) fn placed(self, view: View) -> PlacedView {
        match self {
            Self::Cloud(cloud) => PlacedView { view, origin: cloud.origin() },
            // Runs have the eye about near origins. About the scan's origin it would be less exact than they are.
            Self::Pool(_) => PlacedView { view: view.about(view.eye), origin: view.eye },
        }
    }

    /// Origin of the frame, in world coordinates.
    pub(crate) fn origin(self) -> DVec3 {
        self.scene().origin()
    }
}
