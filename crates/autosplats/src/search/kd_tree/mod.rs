//! The kd-tree engine: the paper's rival, Zhou, Hou, Wang, Guo, *Real-Time KD-Tree Construction on Graphics Hardware*, 2008
//! [ZHWG08], as [Paper, §8] uses it. It finds the k-radius of every point of the cloud, seen or not, in a tree that each
//! frame builds anew, from a first radius that the user sets.
//!
//! # How it works
//! *Large nodes*, of more than 64 points, are split breadth-first, a level at a time: each at the spatial median of the
//! longest axis of its box (`split`); chunks of 256 points count what goes left (`count`); sums over the chunks make the
//! children and the lists of the next level (`place`); then points move to the halves of their node's run, in order, and
//! the boxes of the children are found on the way (`scatter`). The first level parts the finite points from the others.
//! The number of levels is recorded in advance, each of its passes dispatched for as many nodes as there are.
//!
//! *Small nodes* become trees by themselves, a workgroup each (`small_tree`), by the voxel volume heuristic over the planes
//! through their points, sets of points being masks of 64 bits.
//!
//! `search` takes the points in the order of the tree. A range search of the first radius counts the neighbours in 32 bins
//! of distance, another does so within the bin in which the k-th falls (n_hist = 32, n_iter = 2, [Paper, §8.1]); the upper
//! end of the bin found then is the k-radius, or a little more. `moments` sums up what lies within it for the points that
//! are seen. Nearer children come first in all walks.
//!
//! # What is remembered, and what is not
//! From [ZHWG08] as remembered: the two phases, chunks of 256, large nodes of more than 64 points, spatial medians and empty
//! space, masks and bit counts in small nodes, `VVH(x) = C_L·V(L ± R) + C_R·V(R ± R)`, and the histogram search. Chosen
//! here: R is the first radius; a step down the tree costs as much as 16 points (with VVH alone each split pays);
//! leaves have eight points at least.
//!
//! # Where it differs from [ZHWG08], and what that costs
//! - Every node keeps the tight box of its points, which cuts off all empty space, not only parts above a share of it, and
//!   leaves no empty nodes. A node takes 32 bytes for it instead of 8.
//! - Boxes of children are found by atomic minima as the points move, not by a segmented reduction of its own: the order
//!   does not matter to minima. A pass less for each level.
//! - A node that got more than three quarters of its parent's points is split at the median of 15 of them, so that the
//!   number of levels is bounded by the number of points, not by the space between clusters. What is large after the last
//!   level is a leaf of any size, as are points in one place.
//! - A small node's tree is made by one workgroup in its own memory, not by a level at a time. Trees stay as they are made,
//!   siblings side by side: no pass rewrites them in preorder.
//! - A range search sees 12,000 nodes and points at most, the nearest first. What it saw bounds the k-radius from above: a
//!   first radius far too large costs a bounded time, not the whole cloud for each point. The neighbourhoods are then too
//!   large, for a bin is a thousandth of that radius.
//! - Of one neighbour more than k in the last bin the furthest is left out: 99.8 % of the k-radii are exact at k = 10 with a
//!   first radius of two to four k-radii, not 97 %; at k = 64, with more points in each bin, 97 %, not 84 %. Other points
//!   have a few neighbours more than k.
//!
//! # Where it differs from the other engines
//! - Neighbours are those in the whole cloud: hidden ones behind the silhouette, and others in the same pixel.
//! - A point with fewer than k neighbours in the first radius keeps those; one with none is an outlier. The outlier and gap
//!   rules of [`search`](super) need a radius from the density on the screen, which is not known of points not seen.
//! - Points whose k nearest are all in the same place have no surface, where the screen shows one of them.
//! - Points beyond ±1e18 are left out, as for [normals](crate::estimate_normals).
//!
//! It takes 52 bytes a point; a binding must hold 16 of them, so 128 MiB bindings end at 8.4 million points.

pub(crate) mod gpu;
