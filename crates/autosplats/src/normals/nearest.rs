//! The k nearest neighbours of one point, nearest nodes first, for points that cannot share their leaf's list.
//!
//! Such points are about one in a thousand of a scan. But all points are such if thousands coincide or leaves mix
//! distant clusters. Then the search costs as much as with a plain kd-tree.

use std::collections::BinaryHeap;

use super::boxes::Bounds;
use super::tree::{Node, Tree};
use crate::search::{LANES, NeighborhoodBlock};

/// Buffers of one thread.
#[derive(Default)]
pub(super) struct Nearest {
    /// Bits of the k + 1 least squared distances. Bits of non-negative floats sort as the floats do.
    heap: BinaryHeap<u32>,
    stack: Vec<(f32, Node)>,
}

impl Nearest {
    /// Writes the neighbourhood of `point`, a point of the tree, to a lane of `out`.
    pub(super) fn search(&mut self, tree: &Tree, point: [f32; 3], k: u32, lane: usize, out: &mut NeighborhoodBlock) {
        let threshold = self.kth_smallest(tree, point, k);
        let [mut count, mut offset, mut second] = [-1.0, 0.0, 0.0].map(|start| [start; 6]);
        // Points that coincide with this one add nothing and may be most of the cloud.
        if threshold > 0.0 {
            self.stack.push((0.0, tree.root()));
        } else {
            count[0] = k as f32;
        }
        while let Some((_, node)) = self.stack.pop() {
            if let Some((boxes, level, first)) = tree.children(node) {
                for child in (0..LANES).rev() {
                    if boxes.bounds(child).squared_distance(&Bounds::at(point)) <= threshold {
                        self.stack.push((0.0, (level, first + child)));
                    }
                }
                continue;
            }
            let leaf = &tree.leaves[node.1];
            for other in 0..tree.lanes(node.1) {
                let other = leaf.point(other);
                let [x, y, z] = [other[0] - point[0], other[1] - point[1], other[2] - point[2]];
                if x * x + y * y + z * z <= threshold {
                    count[0] += 1.0;
                    for (sum, term) in offset.iter_mut().zip([x, y, z]) {
                        *sum += term;
                    }
                    for (sum, term) in second.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
                        *sum += term;
                    }
                }
            }
        }
        out.count.0[lane] = count[0];
        out.k_radius.0[lane] = threshold.sqrt();
        for axis in 0..3 {
            out.offset[axis].0[lane] = offset[axis];
        }
        for term in 0..6 {
            out.second[term].0[lane] = second[term];
        }
    }

    /// Squared distance to the k-th neighbour.
    fn kth_smallest(&mut self, tree: &Tree, point: [f32; 3], k: u32) -> f32 {
        let at = Bounds::at(point);
        self.heap.clear();
        self.stack.clear();
        self.stack.push((0.0, tree.root()));
        let mut bound = f32::INFINITY;
        while let Some((squared, node)) = self.stack.pop() {
            if squared >= bound {
                continue;
            }
            if let Some((boxes, level, first)) = tree.children(node) {
                let waiting = self.stack.len();
                for child in 0..LANES {
                    let squared = boxes.bounds(child).squared_distance(&at);
                    if squared < bound {
                        self.stack.push((squared, (level, first + child)));
                    }
                }
                self.stack[waiting..].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
                continue;
            }
            let leaf = &tree.leaves[node.1];
            for other in 0..tree.lanes(node.1) {
                let other = leaf.point(other);
                let squared = Bounds::at(other).squared_distance(&at);
                if squared < bound {
                    self.heap.push(squared.to_bits());
                    if self.heap.len() > k as usize + 1 {
                        self.heap.pop();
                    }
                    if self.heap.len() > k as usize {
                        bound = self.heap.peek().map_or(bound, |&bits| f32::from_bits(bits));
                    }
                }
            }
        }
        bound
    }
}
