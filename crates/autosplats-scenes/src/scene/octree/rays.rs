//! Rays through the cells.
//!
//! # How it works
//! A ray goes from cell to cell. In a cell that the surface may cross, it advances by the distance bound until the sign
//! changes. Regula falsi then refines the root. Rays that are traced together take turns, a cell each: a step of a ray
//! waits for the one before, but not for those of other rays.

use std::ops::Range;

use glam::DVec3;

use super::{Cell, Leaf, Octree};

/// Rays that are traced together.
const RAYS_TOGETHER: usize = 8;

/// Intersection of a ray with the surface.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Crossing {
    pub(in crate::scene) distance: f64,
    /// Position before folding.
    pub(in crate::scene) world: DVec3,
    /// Position after folding. `signs` are the signs of the axes after folding.
    pub(in crate::scene) folded: DVec3,
    pub(in crate::scene) signs: DVec3,
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
}

impl Octree {
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
        Place { world, folded, signs, numbers: self.numbers(folded) }
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
    pub(in crate::scene) fn trace(&self, origin: DVec3, direction: DVec3, within: Range<f64>) -> Option<Crossing> {
        let mut ray = self.enter(origin, direction, within)?;
        while ray.goes_on() {
            let place = self.place(&ray);
            let hit = self.advance(&mut ray, &place, self.find(place.numbers));
            if hit.is_some() {
                return hit;
            }
        }
        None
    }

    /// First crossing of each ray, given by origin and direction, as [`trace`](Self::trace) finds it. Faster than one
    /// ray after another, since a step of a ray waits for the one before, but not for those of other rays.
    pub(in crate::scene) fn trace_each(&self, rays: &[(DVec3, DVec3)], hits: &mut [Option<Crossing>]) {
        hits.fill(None);
        let enter = |(number, &(origin, direction)): (usize, &(DVec3, DVec3))| {
            self.enter(origin, direction, 0.0..f64::INFINITY).map(|ray| (number, ray))
        };
        let mut waiting = rays.iter().enumerate().filter_map(enter);
        let mut under_way: Vec<(usize, Ray)> = waiting.by_ref().take(RAYS_TOGETHER).collect();
        let mut places = [Place::default(); RAYS_TOGETHER];
        let mut cells = [(DVec3::ZERO, 0.0, Cell::Empty(0.0)); RAYS_TOGETHER];
        while !under_way.is_empty() {
            for ((_, ray), place) in under_way.iter().zip(&mut places) {
                *place = self.place(ray);
            }
            for (place, cell) in places[..under_way.len()].iter().zip(&mut cells) {
                *cell = self.find(place.numbers);
            }
            for i in (0..under_way.len()).rev() {
                let (number, ray) = &mut under_way[i];
                let hit = self.advance(ray, &places[i], cells[i]);
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

    /// Calls `hit` with the distance of every crossing of the surface and a line through `leaf` from `origin` over `to`
    /// metres.
    pub(in crate::scene) fn crossings_in(
        &self,
        leaf: &Leaf,
        origin: DVec3,
        direction: DVec3,
        to: f64,
        hit: &mut dyn FnMut(f64),
    ) {
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

    /// Outward unit normal at a crossing.
    pub(in crate::scene) fn normal(&self, at: &Crossing) -> DVec3 {
        let list = &self.lists[at.first as usize..(at.first + at.len) as usize];
        self.gradient(at.folded, list) * at.signs
    }

    /// Colour at a crossing.
    pub(in crate::scene) fn rgb(&self, at: &Crossing) -> [f32; 3] {
        let list = &self.lists[at.first as usize..(at.first + at.len) as usize];
        self.body.paint(at.folded, at.world, list).0
    }
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
