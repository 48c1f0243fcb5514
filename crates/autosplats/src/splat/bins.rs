//! Bins: the splats that touch each tile.

use pulp::Simd;

use super::setup::Splat;
use super::{TILE, tile_columns};
use crate::camera::View;
use crate::fit::Surfel;

/// A run of surfels, set up and sorted into the tiles they may touch.
///
/// Each run has its own bins. Screen points are listed in screen order, so a tile meets few runs. No two threads ever
/// write to one list.
#[derive(Debug, Default)]
pub(super) struct Run {
    /// Index of the run's first surfel among the frame's.
    pub(super) first: usize,
    pub(super) splats: Vec<Splat>,
    /// Whether each splat is drawn: it has an extent, and its point is not hidden.
    pub(super) alive: Vec<bool>,
    /// First tile that any splat touches; bins begin there.
    first_tile: usize,
    /// Start of each tile in `entries`, then the end.
    start: Vec<u32>,
    /// Indices into `splats`, tile by tile, ascending.
    entries: Vec<u32>,
}

impl Run {
    /// Sets up the frame's surfels from index `first` on.
    pub(super) fn set_up(&mut self, first: usize, surfels: &[Surfel], view: &View) {
        self.first = first;
        let splats = &mut self.splats;
        set_up_all(surfels, view, splats);
        self.alive.clear();
        self.alive.extend(self.splats.iter().map(|splat| !splat.covers_nothing()));
        self.bin(tile_columns(view.width as usize));
    }

    fn bin(&mut self, columns: usize) {
        let tiles = |splat: &Splat| {
            let [x0, x1, y0, y1] = [splat.x[0], splat.x[1], splat.y[0], splat.y[1]].map(|px| px as usize / TILE);
            (y0..=y1).flat_map(move |y| (x0..=x1).map(move |x| y * columns + x))
        };
        let living = || (0..).zip(&self.splats).zip(&self.alive).filter(|&(_, &alive)| alive).map(|(splat, _)| splat);
        // The first and last tile are those of the extreme corners, whichever splats have them.
        let corner =
            |end: usize| move |(_, s): (u32, &Splat)| s.y[end] as usize / TILE * columns + s.x[end] as usize / TILE;
        self.first_tile = living().map(corner(0)).min().unwrap_or(0);
        let end_tile = living().map(corner(1)).max().map_or(self.first_tile, |last| last + 1);
        self.start.clear();
        self.start.resize(end_tile - self.first_tile + 1, 0);
        for (_, splat) in living() {
            tiles(splat).for_each(|tile| self.start[tile - self.first_tile] += 1);
        }
        let mut sum = 0;
        for start in &mut self.start {
            sum += std::mem::replace(start, sum);
        }
        // Filling moves each start to its tile's end, which is the next tile's start.
        self.entries.resize(sum as usize, 0);
        for (index, splat) in living() {
            for tile in tiles(splat) {
                let next = &mut self.start[tile - self.first_tile];
                self.entries[*next as usize] = index;
                *next += 1;
            }
        }
        self.start.rotate_right(1);
        self.start[0] = 0;
    }

    /// The splats that may touch `tile`, ascending.
    pub(super) fn tile(&self, tile: usize) -> &[u32] {
        let Some(bin) = tile.checked_sub(self.first_tile).filter(|bin| bin + 1 < self.start.len()) else { return &[] };
        &self.entries[self.start[bin] as usize..self.start[bin + 1] as usize]
    }

    /// The tiles that splats may touch, ascending.
    pub(super) fn tiles(&self) -> impl Iterator<Item = usize> {
        let is_touched = |&tile: &usize| !self.tile(tile).is_empty();
        (self.first_tile..self.first_tile + self.start.len().saturating_sub(1)).filter(is_touched)
    }

    /// The splats to draw into `tile`, ascending.
    pub(super) fn living(&self, tile: usize) -> impl Iterator<Item = usize> {
        self.tile(tile).iter().map(|&index| index as usize).filter(|&index| self.alive[index])
    }
}

#[pulp::with_simd(set_up_all = pulp::Arch::new())]
#[inline(always)]
fn set_up_all_with<'a, S: Simd>(_: S, surfels: &'a [Surfel], view: &'a View, splats: &'a mut Vec<Splat>) {
    // Every splat is overwritten below. A collecting iterator would not be compiled for the processor's vectors.
    splats.resize(surfels.len(), Splat::default());
    for (splat, surfel) in splats.iter_mut().zip(surfels) {
        *splat = Splat::new(surfel, view);
    }
}
