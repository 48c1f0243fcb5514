//! Attributes of splats: the channels that they carry, and their sums over a tile.

use autosplats_cloud::RelativeValues;

use super::TILE_AREA;
use super::layers::{Channels, TileLayers};
use crate::fit::Surfel;

/// Most channels a splat can carry: normal, colour, scalar with its weight, radius, k-radius, curvature, back.
pub(super) const CHANNELS: usize = 12;

/// Attributes that are averaged over the splats of a pixel, beside depth and normal.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Attributes<'a> {
    pub(crate) color: Option<PointColors<'a>>,
    pub(crate) scalar: Option<RelativeValues<'a>>,
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
    /// The optional ones of the layers.
    pub(super) fn optional(&self) -> Channels {
        let Self { color, scalar, measures, backs } = *self;
        Channels { color: color.is_some(), scalar: scalar.is_some(), measures, backs }
    }

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
            let value = field.get(surfel.source as usize);
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
