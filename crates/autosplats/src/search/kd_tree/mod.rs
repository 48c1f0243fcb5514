//! The kd-tree engine, the paper's baseline [Paper, §8]: Zhou, Hou, Wang, Guo, *Real-Time KD-Tree Construction on
//! Graphics Hardware*, 2008 [ZHWG08]. The engine builds a tree of all points of the cloud in each frame. A search from
//! a first radius, which the user sets, finds the k-radius of each point, visible or not.
//!
//! # How it works
//! *Large nodes* of more than 64 points are split breadth-first, one level at a time. `split` splits each at the
//! spatial median of the longest axis of its box. `count` counts the points of each chunk of 256 that go left. `place`
//! sums over the chunks and makes the children and the lists of the next level. `scatter` moves the points to the
//! halves of their node's run, in order, and finds the boxes of the children. The first level separates the finite
//! points from the others. The number of levels is recorded in advance; each pass of a level is dispatched for the
//! nodes there are.
//!
//! *Small nodes* become trees of their own, one workgroup each (`small_tree`), by the voxel volume heuristic over the
//! planes through their points. Sets of points are masks of 64 bits.
//!
//! `search` processes the points in the order of the tree. A range search of the first radius counts the neighbours in
//! 32 bins of distance, and a second search splits the bin of the k-th (n_hist = 32, n_iter = 2, [Paper, §8.2]). The
//! upper end of the last bin is the k-radius or a little more. `moments` sums the neighbours within that radius for
//! the visible points. All walks visit the nearer child first.
//!
//! # What is from [ZHWG08]
//! Recalled from [ZHWG08], without the text at hand: the two phases, chunks of 256, large nodes of more than 64
//! points, spatial medians and empty space. Masks and bit counts in small nodes and the histogram search are from
//! there too, as is `VVH(x) = C_L·V(L ± R) + C_R·V(R ± R)`. Chosen here: R is the first radius, and leaves have at
//! least eight points. A step down the tree costs as much as 16 points, as with VVH alone each split pays.
//!
//! # Where the engine differs from [ZHWG08]
//! - Every node keeps the tight box of its points. This cuts off all empty space, not only large parts, and leaves no
//!   empty nodes. A node takes 32 bytes instead of 8.
//! - Boxes of children are found by atomic minima as the points move, whose order does not matter. This saves the pass
//!   of a segmented reduction at each level.
//! - A node with more than three quarters of its parent's points is split at the median of 15 of them. The number of
//!   levels is thus bounded by the number of points, not by the space between clusters. A node still large after the
//!   last level is a leaf of any size, and so are coincident points.
//! - A small node's tree is made by one workgroup in its own memory, not one level at a time. Trees stay as made,
//!   siblings side by side; no pass rewrites them in preorder.
//! - A range search visits at most 12,000 nodes and points, the nearest first. The points visited bound the k-radius
//!   from above, so a much too large first radius costs a bounded time. The neighbourhoods are then too large, as a
//!   bin is a thousandth of that radius.
//! - If the last bin holds one neighbour more than k, the furthest is left out, which makes more k-radii exact. Other
//!   points have a few neighbours more than k. See docs/decisions/0015-search-engines.md.
//!
//! # Where the engine differs from the other engines
//! - Neighbours come from the whole cloud: hidden points behind the silhouette, and other points in the same pixel.
//! - A point with fewer than k neighbours in the first radius keeps these; a point with none is an outlier. The
//!   outlier and gap rules of [`search`](super) need a radius from the density on the screen, which is unknown for
//!   invisible points.
//! - A point whose k nearest are all coincident has no surface, where the other engines see just one of these points.
//! - Points beyond ±1e18 are left out, as for [normals](crate::estimate_normals).
//!
//! The engine takes 52 bytes a point. A binding must hold 16 of these: 128 MiB allow 8.4 million points.

pub(crate) mod gpu;
