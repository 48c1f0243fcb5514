//! Cells of space with the solids that matter in each, and [rays](rays) through the cells.
//!
//! # How it works
//! A cell is empty if its centre is farther from the surface than from its corners. A ray crosses it in one step. Every
//! other cell is cut into eight, each with the shorter list of solids that matter in it. Cutting ends when the list is
//! short or the cell is small.

mod rays;

use glam::DVec3;
use rayon::prelude::*;

use super::body::Body;
use super::fold::Fold;

/// Cells with lists of at most this length are not cut, unless the cell is large.
const SHORT_LIST: usize = 4;

/// Level of the lookup table that replaces the upper levels of the tree.
const TABLE_LEVEL: u32 = 5;
const TABLE_MASK: u32 = (1 << TABLE_LEVEL) - 1;

#[derive(Clone, Copy, Debug)]
enum Cell {
    /// Index of the first of eight children, ordered by the bits z, y, x.
    Branch(u32),
    /// Distance bound at the centre, negative inside.
    Empty(f64),
    Surface {
        first: u32,
        len: u32,
    },
}

/// A cell that the surface may cross.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    pub(super) min: DVec3,
    pub(super) size: f64,
    first: u32,
    len: u32,
}

/// The cells of one body.
#[derive(Clone, Debug)]
pub(super) struct Octree {
    body: Body,
    fold: Fold,
    min: DVec3,
    size: f64,
    depth: u32,
    /// Smallest cells along an edge, per metre, and the size of one.
    steps: f64,
    steps_per_metre: f64,
    unit: f64,
    cells: Vec<Cell>,
    lists: Vec<u16>,
    /// Deepest cell that contains each cube of level [`TABLE_LEVEL`], ordered by z, y, x, and the level of that cell.
    top: Vec<(u32, u32)>,
}

/// Part of the cells during construction.
struct Builder<'a> {
    body: &'a Body,
    fold: Fold,
    depth: u32,
    cells: Vec<Cell>,
    lists: Vec<u16>,
}

impl Builder<'_> {
    /// Builds `cell` from the cube at `min`, in which only the solids of `list` matter.
    fn cut(&mut self, cell: usize, min: DVec3, size: f64, level: u32, list: &[u16]) {
        // Slightly more than half the diagonal, because normals are computed from slightly outside the cell.
        let radius = 0.8661 * size + 1e-5;
        let mut kept = Vec::with_capacity(list.len());
        let distance = self.body.prune(list, min + DVec3::splat(0.5 * size), radius, &mut kept);
        if distance.abs() > radius && level >= self.fold.least_level() {
            self.cells[cell] = Cell::Empty(distance);
        } else if level == self.depth || (kept.len() <= SHORT_LIST && level + 2 >= self.depth) {
            let first = self.lists.len() as u32;
            self.lists.extend_from_slice(&kept);
            self.cells[cell] = Cell::Surface { first, len: kept.len() as u32 };
        } else {
            let first = self.cells.len();
            self.cells[cell] = Cell::Branch(first as u32);
            self.cells.resize(first + 8, Cell::Empty(0.0));
            let half = 0.5 * size;
            for child in 0..8 {
                self.cut(first + child, min + half * corner(child), half, level + 1, &kept);
            }
        }
    }
}

impl Octree {
    /// Subdivides the cube at `min` with side `size`, which must contain the whole body, down to `size / 2^depth`.
    pub(super) fn new(body: Body, fold: Fold, min: DVec3, size: f64, depth: u32) -> Self {
        let all = body.all();
        // The first two levels are always cut. The contents of their 64 cells are built in parallel.
        let parts = (0..64_usize).into_par_iter().map(|i| {
            let mut part = Builder { body: &body, fold, depth, cells: vec![Cell::Empty(0.0)], lists: Vec::new() };
            let low = min + 0.5 * size * corner(i / 8) + 0.25 * size * corner(i % 8);
            part.cut(0, low, 0.25 * size, 2, &all);
            (part.cells, part.lists)
        });
        let parts: Vec<_> = parts.collect();
        let mut cells = vec![Cell::Branch(1)];
        cells.extend((0..8).map(|i| Cell::Branch(9 + 8 * i)));
        cells.resize(9 + 64, Cell::Empty(0.0));
        let mut lists = Vec::new();
        for (i, (part, part_lists)) in parts.into_iter().enumerate() {
            // Cell 0 of a part already has its place; the other cells are appended.
            let (cells_before, lists_before) = (cells.len() as u32 - 1, lists.len() as u32);
            let mut moved = part.into_iter().map(|cell| match cell {
                Cell::Branch(children) => Cell::Branch(children + cells_before),
                Cell::Surface { first, len } => Cell::Surface { first: first + lists_before, len },
                empty => empty,
            });
            if let Some(root) = moved.next() {
                cells[9 + i] = root;
            }
            cells.extend(moved);
            lists.extend(part_lists);
        }
        let steps = f64::from(1_u32 << depth);
        let (steps_per_metre, unit) = (steps / size, size / steps);
        let mut tree =
            Self { body, fold, min, size, depth, steps, steps_per_metre, unit, cells, lists, top: Vec::new() };
        tree.top = (0..1_u32 << (3 * TABLE_LEVEL))
            .map(|i| tree.descend(i & TABLE_MASK, (i >> TABLE_LEVEL) & TABLE_MASK, i >> (2 * TABLE_LEVEL)))
            .collect();
        tree
    }

    /// The cell at a cube of level [`TABLE_LEVEL`], and its level.
    fn descend(&self, x: u32, y: u32, z: u32) -> (u32, u32) {
        let (mut cell, mut level) = (0, 0);
        while let (Cell::Branch(children), true) = (self.cells[cell as usize], level < TABLE_LEVEL) {
            level += 1;
            let bit = TABLE_LEVEL - level;
            cell = children + child_at(x, y, z, bit);
        }
        (cell, level)
    }

    pub(super) fn body(&self) -> &Body {
        &self.body
    }

    /// The cells that the surface may cross, in folded space.
    pub(super) fn leaves(&self) -> Vec<Leaf> {
        let mut leaves = Vec::new();
        let mut stack = vec![(0_usize, self.min, self.size)];
        while let Some((cell, min, size)) = stack.pop() {
            match self.cells[cell] {
                Cell::Empty(_) => {}
                Cell::Surface { first, len } => leaves.push(Leaf { min, size, first, len }),
                Cell::Branch(children) => {
                    let half = 0.5 * size;
                    // Reversed, so that the stack returns them in order.
                    stack.extend((0..8).rev().map(|i| (children as usize + i, min + half * corner(i), half)));
                }
            }
        }
        leaves
    }

    /// Corners of a box in the world around the surface.
    pub(super) fn bounds(&self) -> [DVec3; 2] {
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let join = |(low, high): (DVec3, DVec3), leaf: &Leaf| (low.min(leaf.min), high.max(leaf.min + leaf.size));
        let (low, high) = self.leaves().iter().fold(none, join);
        let (low, high) = self.fold.unfolded(low, high);
        // Positions are rounded to `f32`.
        let room = DVec3::splat(1e-5);
        [low - room, high + room]
    }

    /// The solids that matter in `leaf`.
    pub(super) fn list(&self, leaf: &Leaf) -> &[u16] {
        &self.lists[leaf.first as usize..(leaf.first + leaf.len) as usize]
    }

    /// Numbers of the smallest cell around the folded position `p`.
    #[inline]
    fn numbers(&self, p: DVec3) -> [u32; 3] {
        let q = ((p - self.min) * self.steps_per_metre).clamp(DVec3::ZERO, DVec3::splat(self.steps - 1.0));
        [q.x as u32, q.y as u32, q.z as u32]
    }

    /// The cell that contains a smallest cell: low corner, size and content.
    #[inline]
    fn find(&self, [x, y, z]: [u32; 3]) -> (DVec3, f64, Cell) {
        let shift = self.depth - TABLE_LEVEL;
        let (cell, level) =
            self.top[((((z >> shift) << TABLE_LEVEL | (y >> shift)) << TABLE_LEVEL) | (x >> shift)) as usize];
        let (mut cell, mut bit) = (self.cells[cell as usize], self.depth - level);
        while let Cell::Branch(children) = cell {
            bit -= 1;
            cell = self.cells[(children + child_at(x, y, z, bit)) as usize];
        }
        let corner = DVec3::new(f64::from(x >> bit << bit), f64::from(y >> bit << bit), f64::from(z >> bit << bit));
        (self.min + corner * self.unit, self.unit * f64::from(1_u32 << bit), cell)
    }

    /// Signed distance bound at `p`. In cells without a list, computed from the whole body.
    pub(super) fn distance(&self, p: DVec3) -> f64 {
        let (p, _) = self.fold.apply(p);
        match self.find(self.numbers(p)) {
            (_, _, Cell::Surface { first, len }) => {
                self.body.distance(p, &self.lists[first as usize..(first + len) as usize])
            }
            _ => self.body.distance(p, &self.body.all()),
        }
    }

    /// Position of `p` in the folded space of the body.
    #[cfg(test)]
    pub(super) fn folded(&self, p: DVec3) -> DVec3 {
        self.fold.apply(p).0
    }

    /// Bits of the octants of `leaf`, ordered as in [`corner`], that the surface may cross.
    pub(super) fn octants(&self, leaf: &Leaf) -> u8 {
        let quarter = 0.25 * leaf.size;
        let near = |i: &usize| {
            let middle = leaf.min + DVec3::splat(quarter) + 2.0 * quarter * corner(*i);
            self.body.distance(middle, self.list(leaf)).abs() <= 1.7321 * quarter
        };
        (0..8).filter(near).fold(0, |bits, i| bits | 1 << i)
    }

    /// Visits cubes around the surface; see [`Scene::cubes`](super::Scene::cubes). Returns false in folded space.
    pub(super) fn cubes(&self, visit: &mut dyn FnMut(DVec3, f64, bool) -> bool) -> bool {
        let mut stack = vec![(0_usize, self.min, 0.5 * self.size)];
        while let Some((cell, min, half)) = stack.pop().filter(|_| self.fold == Fold::None) {
            match self.cells[cell] {
                Cell::Empty(_) => {}
                Cell::Surface { .. } => {
                    visit(min + DVec3::splat(half), half, true);
                }
                Cell::Branch(children) => {
                    if visit(min + DVec3::splat(half), half, false) {
                        stack.extend((0..8).map(|i| (children as usize + i, min + half * corner(i), 0.5 * half)));
                    }
                }
            }
        }
        self.fold == Fold::None
    }

    /// Gradient direction of the bound, by central differences.
    pub(super) fn gradient(&self, p: DVec3, list: &[u16]) -> DVec3 {
        const STEP: f64 = 2e-6;
        let slope = |axis: DVec3| self.body.distance(p + axis * STEP, list) - self.body.distance(p - axis * STEP, list);
        DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z)).normalize_or(DVec3::Z)
    }

    /// `|n.x| + |n.y| + |n.z|` of the normal `n` at a surface point. One-sided differences are accurate enough here.
    pub(super) fn slant(&self, p: DVec3, list: &[u16]) -> f64 {
        const STEP: f64 = 1e-6;
        let here = self.body.distance(p, list);
        let slope = |axis: DVec3| self.body.distance(p + axis * STEP, list) - here;
        DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z)).normalize_or(DVec3::Z).abs().element_sum()
    }
}

/// Index of a cell among its siblings, from this bit of the coordinates.
#[inline]
fn child_at(x: u32, y: u32, z: u32, bit: u32) -> u32 {
    (((z >> bit) & 1) << 2) | (((y >> bit) & 1) << 1) | ((x >> bit) & 1)
}

fn corner(child: usize) -> DVec3 {
    DVec3::new((child & 1) as f64, (child >> 1 & 1) as f64, (child >> 2 & 1) as f64)
}
