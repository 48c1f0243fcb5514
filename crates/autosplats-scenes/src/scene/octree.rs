//! Cells of space with the solids that matter in each, and rays through the cells.
//!
//! # How it works
//! A cell is empty if its centre is farther from the surface than from its corners. A ray crosses it in one step. Every
//! other cell is cut into eight, each with the shorter list of solids that matter in it. Cutting ends when the list is
//! short or the cell is small. There a ray advances by the distance bound until the sign changes. Regula falsi then
//! refines the root.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::body::Body;
use super::fold::Fold;

/// Cells with lists of at most this length are not cut, unless the cell is large.
const SHORT_LIST: usize = 4;

/// Level of the lookup table that replaces the upper levels of the tree.
const TABLE_LEVEL: u32 = 5;
const TABLE_MASK: u32 = (1 << TABLE_LEVEL) - 1;

/// Rays that are traced together.
const RAYS_TOGETHER: usize = 8;

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

/// Intersection of a ray with the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    pub(super) distance: f64,
    /// Position before folding.
    pub(super) world: DVec3,
    /// Position after folding. `signs` are the signs of the axes after folding.
    pub(super) folded: DVec3,
    pub(super) signs: DVec3,
    first: u32,
    len: u32,
}

/// A ray on its way.
#[derive(Clone, Copy, Debug)]
struct Ray {
    origin: DVec3,
    direction: DVec3,
    inverse: DVec3,
    /// Distance so far, and at the end.
    t: f64,
    end: f64,
    least_step: f64,
    /// Whether it was in a solid, once that is known.
    was_inside: Option<bool>,
}

impl Ray {
    #[inline]
    fn goes_on(&self) -> bool {
        self.t < self.end
    }
}

/// Where a ray is: in the world, after folding, and in which smallest cell.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    world: DVec3,
    folded: DVec3,
    signs: DVec3,
    numbers: [u32; 3],
    upper: u32,
    bit: u32,
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

    /// The cell of the upper levels that contains a smallest cell, and the number of levels below it.
    #[inline]
    fn upper(&self, [x, y, z]: [u32; 3]) -> (u32, u32) {
        let shift = self.depth - TABLE_LEVEL;
        let (cell, level) =
            self.top[((((z >> shift) << TABLE_LEVEL | (y >> shift)) << TABLE_LEVEL) | (x >> shift)) as usize];
        (cell, self.depth - level)
    }

    /// The cell that contains a smallest cell: low corner, size and content. Starts at a cell `bit` levels above it.
    #[inline]
    fn find(&self, [x, y, z]: [u32; 3], mut cell: Cell, mut bit: u32) -> (DVec3, f64, Cell) {
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
        let numbers = self.numbers(p);
        let (cell, bit) = self.upper(numbers);
        match self.find(numbers, self.cells[cell as usize], bit) {
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

    /// Calls `more` with every distance, in increasing order, where the bound changes sign within `to` metres along the
    /// ray. Stops when `more` returns false. `start` is the bound at the origin. Returns the last crossing and true if
    /// stopped, or else a bound with the sign at the end, and false.
    fn crossings(
        &self,
        leaf: Leaf,
        start: f64,
        origin: DVec3,
        direction: DVec3,
        to: f64,
        more: &mut dyn FnMut(f64) -> bool,
    ) -> (f64, bool) {
        let list = self.list(&leaf);
        // A minimum step keeps grazing rays moving. Only chords shorter than the step are missed.
        let least = 5e-3 * leaf.size;
        let (mut t, mut f) = (0.0, start);
        // A surface farther away than the remaining distance cannot be hit.
        while f.abs() < to - t {
            let next = (t + f.abs() + least).min(to);
            let g = self.body.distance(origin + direction * next, list);
            if (g < 0.0) != (f < 0.0) {
                let root = polish(|t| self.body.distance(origin + direction * t, list), (t, f), (next, g));
                if !more(root) {
                    return (root, true);
                }
            }
            (t, f) = (next, g);
        }
        (f, false)
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

    /// Calls `hit` with the distance of every crossing of the surface and a line through `leaf` from `origin` over `to`
    /// metres.
    pub(super) fn crossings_in(&self, leaf: &Leaf, origin: DVec3, direction: DVec3, to: f64, hit: &mut dyn FnMut(f64)) {
        // Most lines meet nothing, and the bound at their middle shows that at once.
        let list = self.list(leaf);
        if self.body.distance(origin + direction * (0.5 * to), list).abs() > 0.5 * to {
            return;
        }
        self.crossings(*leaf, self.body.distance(origin, list), origin, direction, to, &mut |t| {
            hit(t);
            true
        });
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

    /// A ray at its first cell, unless it misses the scene or the distances `within`.
    fn enter(&self, origin: DVec3, direction: DVec3, within: Range<f64>) -> Option<Ray> {
        let direction = direction.try_normalize()?;
        let (low, high) = self.fold.unfolded(self.min, self.min + self.size);
        let (start, end) = clip(low, high, origin, direction)?;
        let least_step = self.nudge();
        let (t, end) = (start.max(within.start) + least_step, end.min(within.end));
        let ray = Ray { origin, direction, inverse: direction.recip(), t, end, least_step, was_inside: None };
        ray.goes_on().then_some(ray)
    }

    /// Step beyond the border of a cell, in metres.
    fn nudge(&self) -> f64 {
        1e-10 * self.size
    }

    #[inline]
    fn place(&self, ray: &Ray) -> Place {
        let world = ray.origin + ray.direction * ray.t;
        let (folded, signs) = self.fold.apply(world);
        let numbers = self.numbers(folded);
        let (upper, bit) = self.upper(numbers);
        Place { world, folded, signs, numbers, upper, bit }
    }

    /// Takes a ray through one cell. Returns the first crossing in it.
    #[inline]
    fn advance(&self, ray: &mut Ray, place: &Place, (min, size, cell): (DVec3, f64, Cell)) -> Option<Crossing> {
        let &Place { world, folded: p, signs, .. } = place;
        let mut to = leave(min, size, p, ray.inverse * signs);
        match cell {
            Cell::Surface { first, len } => {
                let leaf = Leaf { min, size, first, len };
                let along = ray.direction * signs;
                let (t, direction) = (ray.t, ray.direction);
                let crossing = |s: f64| Crossing {
                    distance: t + s,
                    world: world + direction * s,
                    folded: p + along * s,
                    signs,
                    first,
                    len,
                };
                let start = self.body.distance(p, self.list(&leaf));
                let inside = start < 0.0;
                if ray.was_inside.is_some_and(|was: bool| was != inside) {
                    return Some(crossing(0.0));
                }
                let (value, found) = self.crossings(leaf, start, p, along, to, &mut |_| false);
                if found {
                    return Some(crossing(value));
                }
                ray.was_inside = Some(value < 0.0);
                // Cells nearer than the surface can be skipped.
                to = to.max(start.abs());
            }
            Cell::Empty(distance) => {
                ray.was_inside = Some(distance < 0.0);
                // Skips the cell, or the ball around its centre that contains no surface.
                let away = (p - min - DVec3::splat(0.5 * size)).length();
                to = to.max(distance.abs() - away);
            }
            Cell::Branch(_) => unreachable!("find ends at a leaf"),
        }
        let nudge = self.nudge();
        // A ray in a plane of the fold leaves each cell at once, so steps grow until they lead out of the plane.
        ray.least_step = if to > nudge { nudge } else { (2.0 * ray.least_step).min(1e-4 * self.size) };
        ray.t += to + ray.least_step;
        None
    }

    /// First crossing of the ray with the surface, from either side. Searches only the distances `within`.
    pub(super) fn trace(&self, origin: DVec3, direction: DVec3, within: Range<f64>) -> Option<Crossing> {
        let mut ray = self.enter(origin, direction, within)?;
        while ray.goes_on() {
            let place = self.place(&ray);
            let cell = self.find(place.numbers, self.cells[place.upper as usize], place.bit);
            let hit = self.advance(&mut ray, &place, cell);
            if hit.is_some() {
                return hit;
            }
        }
        None
    }

    /// First crossing of each ray, given by origin and direction, as [`trace`](Self::trace) finds it. Faster than one
    /// ray after another, since a step of a ray waits for the one before, but not for those of other rays.
    pub(super) fn trace_each(&self, rays: &[(DVec3, DVec3)], hits: &mut [Option<Crossing>]) {
        hits.fill(None);
        let enter = |(number, &(origin, direction)): (usize, &(DVec3, DVec3))| {
            self.enter(origin, direction, 0.0..f64::INFINITY).map(|ray| (number, ray))
        };
        let mut waiting = rays.iter().enumerate().filter_map(enter);
        let mut under_way: Vec<(usize, Ray)> = waiting.by_ref().take(RAYS_TOGETHER).collect();
        let mut places = [Place::default(); RAYS_TOGETHER];
        let mut uppers = [Cell::Empty(0.0); RAYS_TOGETHER];
        while !under_way.is_empty() {
            for ((_, ray), place) in under_way.iter().zip(&mut places) {
                *place = self.place(ray);
            }
            for (place, cell) in places[..under_way.len()].iter().zip(&mut uppers) {
                *cell = self.cells[place.upper as usize];
            }
            for i in (0..under_way.len()).rev() {
                let (number, ray) = &mut under_way[i];
                let cell = self.find(places[i].numbers, uppers[i], places[i].bit);
                let hit = self.advance(ray, &places[i], cell);
                if hit.is_some() || !ray.goes_on() {
                    hits[*number] = hit;
                    match waiting.next() {
                        Some(next) => under_way[i] = next,
                        None => drop(under_way.swap_remove(i)),
                    }
                }
            }
        }
    }

    /// Outward unit normal at a crossing.
    pub(super) fn normal(&self, at: &Crossing) -> DVec3 {
        let list = &self.lists[at.first as usize..(at.first + at.len) as usize];
        self.gradient(at.folded, list) * at.signs
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

    /// Colour at a crossing.
    pub(super) fn rgb(&self, at: &Crossing) -> [f32; 3] {
        let list = &self.lists[at.first as usize..(at.first + at.len) as usize];
        self.body.paint(at.folded, at.world, list).0
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

/// Distances at which a ray enters and leaves a box; the first is at least zero.
fn clip(low: DVec3, high: DVec3, origin: DVec3, direction: DVec3) -> Option<(f64, f64)> {
    let inverse = direction.recip();
    let (a, b) = ((low - origin) * inverse, (high - origin) * inverse);
    // A ray in the plane of a face makes 0/0 here; `min` and `max` of `f64` then return the other operand.
    let start = a.x.min(b.x).max(a.y.min(b.y)).max(a.z.min(b.z)).max(0.0);
    let end = a.x.max(b.x).min(a.y.max(b.y)).min(a.z.max(b.z));
    (start < end).then_some((start, end))
}

/// Distance at which a ray from inside a cube leaves it. `inverse` is the reciprocal of the direction.
#[inline]
fn leave(min: DVec3, size: f64, p: DVec3, inverse: DVec3) -> f64 {
    let p = p - min;
    let side = |p: f64, inverse: f64| {
        // For a ray parallel to this side: infinite, or 0/0 in its plane, which `min` below ignores.
        if inverse > 0.0 { (size - p) * inverse } else { -p * inverse }
    };
    f64::INFINITY.min(side(p.x, inverse.x)).min(side(p.y, inverse.y)).min(side(p.z, inverse.z)).max(0.0)
}

/// Root between two places of opposite sign, by regula falsi with the Illinois rule.
fn polish(f: impl Fn(f64) -> f64, (mut a, mut fa): (f64, f64), (mut b, mut fb): (f64, f64)) -> f64 {
    for _ in 0..60 {
        if fb.abs() < 1e-11 || (b - a).abs() < 1e-12 {
            break;
        }
        let mut t = b - fb * (b - a) / (fb - fa);
        if !t.is_finite() {
            t = 0.5 * (a + b);
        }
        let ft = f(t);
        if (ft < 0.0) == (fb < 0.0) {
            // The same end is kept twice in a row: halve its weight, because convergence would be linear otherwise.
            fa *= 0.5;
        } else {
            (a, fa) = (b, fb);
        }
        (b, fb) = (t, ft);
    }
    b
}
