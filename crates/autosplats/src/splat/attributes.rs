//! Attributes of splats: the channels that they carry, their sums over a tile, and the layers that result.

use autosplats_cloud::FieldValues;

use super::trim::PixelSurface;
use super::{GBuffer, TILE_AREA};
use crate::camera::View;
use crate::fit::Surfel;

/// Most channels a splat can carry: normal, colour, scalar with its weight, radius, k-radius, curvature, back.
pub(super) const CHANNELS: usize = 12;

/// Attributes that are averaged over the splats of a pixel, beside depth and normal.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Attributes<'a> {
    pub(crate) color: Option<PointColors<'a>>,
    pub(crate) scalar: Option<&'a FieldValues>,
    /// Splat radius, k-radius and curvature.
    pub(crate) measures: bool,
    /// Share of the surface's back.
    pub(crate) backs: bool,
}

/// Colours by point, and the linear value of each 8-bit step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PointColors<'a> {
    pub(crate) srgb: &'a [[u8; 3]],
    pub(crate) linear: &'a [f32; 256],
}

impl Attributes<'_> {
    /// Number of channels that a splat carries.
    pub(super) fn channels(&self) -> usize {
        3 + if self.color.is_some() { 3 } else { 0 }
            + if self.scalar.is_some() { 2 } else { 0 }
            + if self.measures { 3 } else { 0 }
            + usize::from(self.backs)
    }

    /// Writes the channels of `surfel`: the normal, then those requested, in the order of [`CHANNELS`].
    #[inline(always)]
    pub(super) fn values(&self, surfel: &Surfel, values: &mut [f32; CHANNELS]) {
        values[..3].copy_from_slice(&surfel.normal);
        let mut next = 3;
        if let Some(PointColors { srgb, linear }) = self.color {
            for channel in srgb[surfel.source as usize] {
                values[next] = linear[channel as usize];
                next += 1;
            }
        }
        if let Some(field) = self.scalar {
            let value = field.get(surfel.source as usize) as f32;
            let known = value.is_finite();
            values[next] = if known { value } else { 0.0 };
            values[next + 1] = f32::from(known);
            next += 2;
        }
        if self.measures {
            values[next..next + 3].copy_from_slice(&[surfel.radius, surfel.k_radius, surfel.curvature]);
            next += 3;
        }
        if self.backs {
            values[next] = f32::from(surfel.shows_back());
        }
    }
}

/// Weighted sums over the pixels of one tile.
#[derive(Debug, Default)]
pub(super) struct TileSums {
    pub(super) weight: Vec<f32>,
    pub(super) depth: Vec<f32>,
    /// One plane per channel, in the order of [`Attributes::values`].
    pub(super) channels: Vec<f32>,
    /// Weight of the heaviest splat, the index of its point as bits, and its reach in pixels.
    pub(super) heaviest: Vec<f32>,
    pub(super) point: Vec<f32>,
    pub(super) reach: Vec<f32>,
}

impl TileSums {
    pub(super) fn clear(&mut self, attributes: &Attributes<'_>) {
        for sum in [&mut self.weight, &mut self.depth, &mut self.heaviest, &mut self.reach] {
            sum.clear();
            sum.resize(TILE_AREA, 0.0);
        }
        self.channels.clear();
        self.channels.resize(attributes.channels() * TILE_AREA, 0.0);
        self.point.clear();
        self.point.resize(TILE_AREA, f32::from_bits(u32::MAX));
    }

    /// Normalize pass: divides sums by weights into the layers of the tile [Paper, §7].
    pub(super) fn normalize(&self, attributes: &Attributes<'_>, layers: &mut TileLayers<'_>) {
        layers.weight.copy_from_slice(&self.weight);
        for (layer, point) in layers.point.iter_mut().zip(&self.point) {
            *layer = point.to_bits();
        }
        let mut channels = self.channels.chunks_exact(TILE_AREA);
        let mut channel = || channels.next().unwrap_or_default();
        let [nx, ny, nz] = [channel(), channel(), channel()];
        for i in 0..TILE_AREA {
            let covered = self.weight[i] > 0.0;
            layers.depth[i] = if covered { self.depth[i] / self.weight[i] } else { f32::INFINITY };
            let length = (nx[i] * nx[i] + ny[i] * ny[i] + nz[i] * nz[i]).sqrt();
            // Opposite normals may cancel. Then the surface counts as facing the eye.
            let cancelled = covered & !(length > 1e-6 * self.weight[i]);
            let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
            let normal = [nx[i] * scale, ny[i] * scale, nz[i] * scale];
            layers.normal[i] = if cancelled { [0.0, 0.0, -1.0] } else { normal };
        }
        let mean = |sum: &[f32], weight: &[f32], i: usize| if weight[i] > 0.0 { sum[i] / weight[i] } else { 0.0 };
        if attributes.color.is_some() {
            let [r, g, b] = [channel(), channel(), channel()];
            for (i, color) in layers.color.iter_mut().enumerate() {
                *color = [mean(r, &self.weight, i), mean(g, &self.weight, i), mean(b, &self.weight, i)];
            }
        }
        if attributes.scalar.is_some() {
            let [sum, weight] = [channel(), channel()];
            for (i, scalar) in layers.scalar.iter_mut().enumerate() {
                *scalar = if weight[i] > 0.0 { sum[i] / weight[i] } else { f32::NAN };
            }
        }
        if attributes.measures {
            for layer in [&mut layers.radius, &mut layers.k_radius, &mut layers.curvature] {
                let sum = channel();
                layer.iter_mut().enumerate().for_each(|(i, value)| *value = mean(sum, &self.weight, i));
            }
        }
        if attributes.backs {
            let sum = channel();
            layers.back.iter_mut().enumerate().for_each(|(i, back)| *back = mean(sum, &self.weight, i));
        }
    }
}

impl TileLayers<'_> {
    /// Whether there is a surface at pixel `at` of the tile.
    pub(super) fn covers(&self, at: usize) -> bool {
        self.weight[at] > 0.0
    }

    /// The surface at pixel `at` of the tile.
    pub(super) fn shown(&self, at: usize) -> PixelSurface {
        PixelSurface { depth: self.depth[at], normal: self.normal[at] }
    }

    /// Empties the tile.
    pub(super) fn clear_all(&mut self) {
        self.weight.fill(0.0);
        self.depth.fill(f32::INFINITY);
        self.normal.fill([0.0; 3]);
        self.point.fill(u32::MAX);
        self.color.fill([0.0; 3]);
        self.scalar.fill(f32::NAN);
        for measure in [&mut self.radius, &mut self.k_radius, &mut self.curvature, &mut self.back] {
            measure.fill(0.0);
        }
    }

    /// Empties pixel `at` of the tile.
    pub(super) fn clear(&mut self, at: usize) {
        self.weight[at] = 0.0;
        self.depth[at] = f32::INFINITY;
        self.normal[at] = [0.0; 3];
        self.point[at] = u32::MAX;
        if let Some(color) = self.color.get_mut(at) {
            *color = [0.0; 3];
        }
        if let Some(scalar) = self.scalar.get_mut(at) {
            *scalar = f32::NAN;
        }
        for measure in [&mut self.radius, &mut self.k_radius, &mut self.curvature, &mut self.back] {
            if let Some(value) = measure.get_mut(at) {
                *value = 0.0;
            }
        }
    }
}

/// The part of each layer that belongs to one tile; empty for a layer that is empty.
#[derive(Debug)]
pub(super) struct TileLayers<'a> {
    weight: &'a mut [f32],
    depth: &'a mut [f32],
    normal: &'a mut [[f32; 3]],
    point: &'a mut [u32],
    color: &'a mut [[f32; 3]],
    scalar: &'a mut [f32],
    radius: &'a mut [f32],
    k_radius: &'a mut [f32],
    curvature: &'a mut [f32],
    back: &'a mut [f32],
}

impl GBuffer {
    /// Sizes the layers for a frame. Returns whether all lengths are unchanged, so that the layers still hold the last
    /// frame.
    pub(super) fn resize(&mut self, view: &View, area: usize, attributes: &Attributes<'_>) -> bool {
        fn fit<T: Copy + Default>(layer: &mut Vec<T>, len: usize) -> bool {
            let fits = layer.len() == len;
            layer.resize(len, T::default());
            fits
        }
        let wanted = |wanted: bool| if wanted { area } else { 0 };
        [self.width, self.height] = view.picture_size();
        self.margin = view.margin;
        let fits = [
            fit(&mut self.weight, area),
            fit(&mut self.depth, area),
            fit(&mut self.normal, area),
            fit(&mut self.point, area),
            fit(&mut self.color, wanted(attributes.color.is_some())),
            fit(&mut self.scalar, wanted(attributes.scalar.is_some())),
            fit(&mut self.radius, wanted(attributes.measures)),
            fit(&mut self.k_radius, wanted(attributes.measures)),
            fit(&mut self.curvature, wanted(attributes.measures)),
            fit(&mut self.back, wanted(attributes.backs)),
        ];
        fits == [true; 10]
    }

    /// Cuts all layers into tiles.
    pub(super) fn tiles(&mut self) -> Vec<TileLayers<'_>> {
        fn cut<'a, T>(rest: &mut &'a mut [T]) -> &'a mut [T] {
            rest.split_off_mut(..TILE_AREA).unwrap_or_default()
        }
        let tiles = self.weight.len() / TILE_AREA;
        let mut weight = self.weight.as_mut_slice();
        let mut depth = self.depth.as_mut_slice();
        let mut normal = self.normal.as_mut_slice();
        let mut point = self.point.as_mut_slice();
        let mut color = self.color.as_mut_slice();
        let mut scalar = self.scalar.as_mut_slice();
        let mut radius = self.radius.as_mut_slice();
        let mut k_radius = self.k_radius.as_mut_slice();
        let mut curvature = self.curvature.as_mut_slice();
        let mut back = self.back.as_mut_slice();
        let tile = |_| TileLayers {
            weight: cut(&mut weight),
            depth: cut(&mut depth),
            normal: cut(&mut normal),
            point: cut(&mut point),
            color: cut(&mut color),
            scalar: cut(&mut scalar),
            radius: cut(&mut radius),
            k_radius: cut(&mut k_radius),
            curvature: cut(&mut curvature),
            back: cut(&mut back),
        };
        (0..tiles).map(tile).collect()
    }
}
