//! Where the tiles of a screen are stored.

use std::ops::Range;

use super::{TILE, TILE_AREA, tile_columns};

/// Places of a screen's tiles in its layers. Tiles that no splat touches share the first place, so that memory and time
/// follow what is drawn.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tiles {
    /// Tiles in a row of the screen.
    columns: usize,
    /// Place of each tile, row by row.
    places: Vec<u32>,
    /// Tile at each place.
    stored: Vec<usize>,
}

impl Tiles {
    /// Place of the tiles that are not drawn.
    const EMPTY: u32 = 0;

    /// All tiles of a screen of this size in pixels, each at a place of its own, row by row.
    pub(crate) fn all([width, height]: [usize; 2]) -> Self {
        let columns = tile_columns(width);
        let stored: Vec<usize> = (0..columns * tile_columns(height)).collect();
        Self { columns, places: stored.iter().map(|&tile| tile as u32).collect(), stored }
    }

    /// Starts a screen of this size in pixels, of which nothing is drawn.
    pub(super) fn clear(&mut self, [width, height]: [usize; 2]) {
        self.columns = tile_columns(width);
        self.places.clear();
        self.places.resize(self.columns * tile_columns(height), Self::EMPTY);
        self.stored.clear();
        // A tile beyond the screen, which nothing touches.
        self.stored.push(self.places.len());
    }

    /// Gives a tile a place of its own, unless it has one.
    pub(super) fn store(&mut self, tile: usize) {
        let place = &mut self.places[tile];
        if *place == Self::EMPTY {
            *place = self.stored.len() as u32;
            self.stored.push(tile);
        }
    }

    /// The tile at each place.
    pub(super) fn stored(&self) -> &[usize] {
        &self.stored
    }

    /// Whether any tile in these columns and rows of pixels of the screen has a place of its own.
    pub(super) fn any_stored(&self, [columns, rows]: [Range<usize>; 2]) -> bool {
        let tiles = |range: Range<usize>| range.start / TILE..range.end.div_ceil(TILE);
        let is_stored = |tile: usize| self.stored[self.places[tile] as usize] == tile;
        tiles(rows).any(|y| tiles(columns.clone()).any(|x| is_stored(y * self.columns + x)))
    }

    /// Number of values in a layer.
    pub(crate) fn area(&self) -> usize {
        self.stored.len() * TILE_AREA
    }

    /// Upper left pixel of a tile.
    pub(super) fn origin(&self, tile: usize) -> [usize; 2] {
        [tile % self.columns * TILE, tile / self.columns * TILE]
    }

    /// Index of pixel (x, y) of the screen in a layer.
    #[inline(always)]
    pub(crate) fn index(&self, [x, y]: [usize; 2]) -> usize {
        let place = self.places[y / TILE * self.columns + x / TILE] as usize;
        place * TILE_AREA + (y % TILE) * TILE + x % TILE
    }
}
