//! Splatting on the CPU, tile by tile.

use rayon::prelude::*;

use super::attributes::{Attributes, TileSums};
use super::bins::Run;
use super::centers::add_centers;
use super::raster::{Tile, draw_attributes, draw_depth};
use super::setup::RECOVER_DISTANCE_RADII;
use super::trim::blurred::BlurredBorders;
use super::trim::{EMPTY, Outline, Rim, TrimRules, rim};
use super::{GBuffer, TILE, TILE_AREA, Tiles};
use crate::adapt::Noise;
use crate::camera::View;
use crate::cancel::Cancel;
use crate::fit::Surfel;
use crate::project::Sixteenths;
use crate::room::fit;

/// Surfels in a run.
const RUN: usize = 16 * 1024;

/// Draws surfels, and keeps its buffers from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Splatter {
    runs: Vec<Run>,
    /// Runs in use this frame.
    used: usize,
    tiles: Tiles,
    /// Depth per pixel, pushed back by ε, tile by tile.
    depth: Vec<f32>,
    /// State of pixels for trimming, tile by tile.
    rims: Vec<Rim>,
    centers: Vec<u32>,
    layers: GBuffer,
}

impl Splatter {
    /// Forgets the last frame's depth map.
    pub(crate) fn begin(&mut self, view: &View) {
        self.used = 0;
        self.tiles.clear([view.width as usize, view.height as usize]);
    }

    /// The layers: those of the last frame until the attributes of this frame are drawn.
    pub(crate) fn last(&self) -> &GBuffer {
        &self.layers
    }

    /// Visibility pass: draws the surfels from index `first` on into the depth map [Paper, §7].
    pub(crate) fn add(&mut self, surfels: &[Surfel], first: usize, view: &View, cancel: &Cancel<'_>) {
        let before = self.used;
        let added = surfels[first..].par_chunks(RUN);
        self.used += added.len();
        if self.runs.len() < self.used {
            self.runs.resize_with(self.used, Run::default);
        }
        let runs = &mut self.runs[before..self.used];
        added.zip(&mut *runs).enumerate().for_each(|(index, (surfels, run))| {
            if !cancel.is_given_up() {
                run.set_up(first + index * RUN, surfels, view);
            }
        });
        if cancel.is_given_up() {
            // Runs may be those of another frame.
            return;
        }
        let Self { tiles, depth, .. } = self;
        // Tiles that the round before has drawn stay.
        let fresh = if before > 0 { tiles.stored().len() } else { 0 };
        runs.iter().flat_map(|run| run.tiles()).for_each(|tile| tiles.store(tile));
        if before > 0 {
            depth.resize(tiles.area(), f32::INFINITY);
        } else {
            fit(depth, tiles.area());
        }
        draw_depth_map(runs, tiles, fresh, view, depth, cancel);
    }

    /// Whether the depth map hides a point at this pixel and depth, and will do so however silhouettes change.
    /// `initial_radius_px` is the point's first search radius.
    pub(crate) fn hides(&self, [x, y]: [usize; 2], depth: f32, initial_radius_px: f32, view: &View) -> bool {
        let [width, height] = [view.width as usize, view.height as usize];
        let hidden = |x: usize, y: usize| depth > self.depth[self.tiles.index([x, y])];
        let reach = (RECOVER_DISTANCE_RADII * initial_radius_px) as usize;
        hidden(x, y)
            && hidden(x.saturating_sub(reach), y)
            && hidden((x + reach).min(width - 1), y)
            && hidden(x, y.saturating_sub(reach))
            && hidden(x, (y + reach).min(height - 1))
    }

    /// Refinement: redraws the depth map with only those surfels whose point it does not hide [Paper, §7, Depth
    /// Refinement].
    pub(crate) fn refine(&mut self, surfels: &[Surfel], view: &View, cancel: &Cancel<'_>) {
        let Self { runs, used, tiles, depth, .. } = self;
        let runs = &mut runs[..*used];
        runs.par_iter_mut().for_each(|run| {
            let splats = run.splats.iter().zip(&surfels[run.first..]);
            for (alive, (splat, surfel)) in run.alive.iter_mut().zip(splats) {
                let [x, y] = surfel.pixel_xy();
                let hidden = surfel.center[2] > depth[tiles.index([x, y])];
                *alive = !splat.covers_nothing() & !hidden;
            }
        });
        draw_depth_map(runs, tiles, 0, view, depth, cancel);
    }

    /// Attribute pass: the weighted mean of all living surfels within ε of the depth map [Paper, §7].
    pub(crate) fn attributes(
        &mut self,
        surfels: &[Surfel],
        view: &View,
        attributes: &Attributes<'_>,
        cancel: &Cancel<'_>,
    ) -> &GBuffer {
        let Self { runs, used, tiles, depth, rims, centers, layers } = self;
        layers.resize(view, tiles, attributes.optional());
        layers.scalar_about = attributes.scalar.map(|values| values.about()).unwrap_or_default();
        fit(rims, depth.len());
        fit(centers, depth.len());
        let states = rims.par_chunks_mut(TILE_AREA).zip(centers.par_chunks_mut(TILE_AREA));
        let stored = layers.cut().into_par_iter().zip(depth.par_chunks(TILE_AREA)).zip(states).zip(tiles.stored());
        stored.for_each_init(TileSums::default, |sums, (((mut layers, depth), (rims, centers)), &index)| {
            let tile = Tile { index, origin: tiles.origin(index) };
            sums.clear(attributes);
            add_centers(&runs[..*used], surfels, tile, centers);
            for run in runs[..*used].iter().filter(|run| !run.tile(index).is_empty()) {
                if cancel.is_given_up() {
                    return;
                }
                draw_attributes(run, surfels, tile, view, depth, attributes, sums);
            }
            sums.normalize(attributes, &mut layers);
            let TileSums { weight, heaviest, reach, .. } = sums;
            for (at, out) in rims.iter_mut().enumerate() {
                *out = rim(weight[at], heaviest[at], reach[at]);
            }
        });
        layers
    }

    /// Trims the attributes just drawn, by the points in `sixteenths` and, where they have `noise`, by their density.
    /// Returns the number of covered pixels of the picture.
    pub(crate) fn trim(
        &mut self,
        view: &View,
        sixteenths: &Sixteenths,
        noise: Noise,
        &TrimRules { k_radius_per_radius }: &TrimRules,
        cancel: &Cancel<'_>,
    ) -> usize {
        if cancel.is_given_up() {
            return 0;
        }
        let Self { tiles, rims, centers, layers, .. } = self;
        let blurred = BlurredBorders::new(noise, k_radius_per_radius, (rims, tiles), sixteenths, view);
        let outline = Outline { rims, centers, sixteenths, tiles, view, blurred: blurred.as_ref() };
        let drawn = layers.cut().into_par_iter().zip(tiles.stored()).zip(rims.par_chunks(TILE_AREA));
        let covered = drawn.map(|((mut layers, &tile), own)| {
            if own.iter().all(|&rim| rim == EMPTY) || cancel.is_given_up() {
                return 0;
            }
            let [x0, y0] = tiles.origin(tile);
            let edges = outline.edges([x0, y0]);
            let mut covered = 0;
            for y in y0..(y0 + TILE).min(view.height as usize) {
                for x in x0..(x0 + TILE).min(view.width as usize) {
                    let at = (y - y0) * TILE + x - x0;
                    if outline.sticks_out(x, y, layers.shown(at), edges.near([x - x0, y - y0])) {
                        layers.clear(at);
                    }
                    covered += usize::from(layers.covers(at) && view.beside_picture([x, y]) == 0);
                }
            }
            covered
        });
        covered.sum()
    }

    /// Number of covered pixels of the picture, untrimmed.
    pub(crate) fn covered(&self) -> usize {
        let layers = &self.layers;
        let covers = |x: usize, y: usize| layers.weight[layers.index(x, y)] > 0.0;
        let row = |y: u32| (0..layers.width as usize).filter(|&x| covers(x, y as usize)).count();
        (0..layers.height).into_par_iter().map(row).sum()
    }
}

/// Draws the depth of all living splats of `runs`, tile by tile. Tiles are cleared first from the place `fresh` on.
fn draw_depth_map(runs: &[Run], tiles: &Tiles, fresh: usize, view: &View, depth: &mut [f32], cancel: &Cancel<'_>) {
    depth.par_chunks_mut(TILE_AREA).zip(tiles.stored()).enumerate().for_each(|(place, (depth, &index))| {
        if place >= fresh {
            depth.fill(f32::INFINITY);
        }
        for run in runs.iter().filter(|run| !run.tile(index).is_empty()) {
            if cancel.is_given_up() {
                return;
            }
            draw_depth(run, Tile { index, origin: tiles.origin(index) }, view, depth);
        }
    });
}
