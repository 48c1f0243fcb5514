//! Drawing splats into one tile.

use super::attributes::{Attributes, CHANNELS, TileSums};
use super::bins::Run;
use super::setup::{DOT_RADIUS_PX, Splat};
use super::{TILE, TILE_AREA};
use crate::camera::View;
use crate::fit::Surfel;

/// Pixels drawn at a time. Most splats are a few pixels wide: wider groups would mostly compute what lies beside them.
const GROUP: usize = 8;

/// Draws the depth, pushed back by ε, of the living splats of `run` that touch `tile` (its upper left pixel `origin`).
pub(super) fn draw_depth(run: &Run, tile: usize, origin: [usize; 2], view: &View, depth: &mut [f32]) {
    if run.tile(tile).is_empty() {
        return;
    }
    draw_depth_entries(&run.splats, &run.alive, run.tile(tile), origin, view.perspective, depth);
}

#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx2+bmi1+bmi2+lzcnt+popcnt",
    "x86_64+avx2+bmi1+bmi2+lzcnt+popcnt",
))]
fn draw_depth_entries(
    splats: &[Splat],
    alive: &[bool],
    entries: &[u32],
    origin: [usize; 2],
    perspective: bool,
    depth: &mut [f32],
) {
    for &entry in entries {
        if !alive[entry as usize] {
            continue;
        }
        let splat = &splats[entry as usize];
        for_each_group(splat, origin, |at, dx, dy| {
            let Fragments { squared, depth: fragment } = fragments(splat, dx, dy, perspective);
            let out: &mut [f32; GROUP] = (&mut depth[at..at + GROUP]).try_into().expect("a group");
            for i in 0..GROUP {
                let pushed = fragment[i] + splat.epsilon;
                let nearer = (squared[i] <= 1.0) & (pushed < out[i]);
                out[i] = if nearer { pushed } else { out[i] };
            }
        });
    }
}

/// Adds the attributes of the living splats of `run` that touch `tile`, wherever they lie within ε of the depth map.
pub(super) fn draw_attributes(
    run: &Run,
    surfels: &[Surfel],
    tile: usize,
    origin: [usize; 2],
    view: &View,
    depth: &[f32],
    attributes: &Attributes<'_>,
    sums: &mut TileSums,
) {
    if run.tile(tile).is_empty() {
        return;
    }
    let surfels = &surfels[run.first..run.first + run.splats.len()];
    draw_attribute_entries(run, surfels, run.tile(tile), origin, view.perspective, depth, attributes, sums);
}

#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx2+bmi1+bmi2+lzcnt+popcnt",
    "x86_64+avx2+bmi1+bmi2+lzcnt+popcnt",
))]
fn draw_attribute_entries(
    run: &Run,
    surfels: &[Surfel],
    entries: &[u32],
    origin: [usize; 2],
    perspective: bool,
    depth: &[f32],
    attributes: &Attributes<'_>,
    sums: &mut TileSums,
) {
    let mut values = [0f32; CHANNELS];
    for &entry in entries {
        if !run.alive[entry as usize] {
            continue;
        }
        let splat = &run.splats[entry as usize];
        let surfel = &surfels[entry as usize];
        let channels = attributes.values(surfel, &mut values);
        for_each_group(splat, origin, |at, dx, dy| {
            let Fragments { squared, depth: fragment } = fragments(splat, dx, dy, perspective);
            let limit: &[f32; GROUP] = (&depth[at..at + GROUP]).try_into().expect("a group");
            let mut weight = [0f32; GROUP];
            let mut any = false;
            for i in 0..GROUP {
                let visible = (squared[i] <= 1.0) & (fragment[i] <= limit[i]);
                weight[i] = if visible { kernel(squared[i]) } else { 0.0 };
                any |= visible;
            }
            if !any {
                return;
            }
            add(&mut sums.weight, at, &weight, 1.0);
            let depth_sum: &mut [f32; GROUP] = (&mut sums.depth[at..at + GROUP]).try_into().expect("a group");
            for i in 0..GROUP {
                depth_sum[i] += weight[i] * fragment[i];
            }
            for (channel, &value) in sums.channels.chunks_exact_mut(TILE_AREA).zip(&values[..channels]) {
                add(channel, at, &weight, value);
            }
            let heaviest: &mut [f32; GROUP] = (&mut sums.heaviest[at..at + GROUP]).try_into().expect("a group");
            let point: &mut [u32; GROUP] = (&mut sums.point[at..at + GROUP]).try_into().expect("a group");
            for i in 0..GROUP {
                let heavier = weight[i] > heaviest[i];
                heaviest[i] = if heavier { weight[i] } else { heaviest[i] };
                point[i] = if heavier { surfel.source } else { point[i] };
            }
        });
    }
}

#[inline(always)]
fn add(sum: &mut [f32], at: usize, weight: &[f32; GROUP], value: f32) {
    let sum: &mut [f32; GROUP] = (&mut sum[at..at + GROUP]).try_into().expect("a group");
    for i in 0..GROUP {
        sum[i] += weight[i] * value;
    }
}

/// The weight of a fragment at a squared distance 0..=1 from the centre, in radii: exp(-2·d²) but for a few percent,
/// without the exponential.
#[inline(always)]
fn kernel(squared: f32) -> f32 {
    let w = 1.0 - 0.25 * squared;
    let w = w * w;
    let w = w * w;
    w * w
}

/// Calls `draw` with each group of pixels of the tile that the splat may cover: where it lies in the tile, and the offsets
/// of its first pixel's centre from the splat's.
#[inline(always)]
fn for_each_group(splat: &Splat, [x_tile, y_tile]: [usize; 2], mut draw: impl FnMut(usize, f32, f32)) {
    let clip = |[first, last]: [u16; 2], tile: usize| {
        let first = (first as usize).max(tile) - tile;
        let last = (last as usize).min(tile + TILE - 1) - tile;
        (first, last)
    };
    let (x0, x1) = clip(splat.x, x_tile);
    let (y0, y1) = clip(splat.y, y_tile);
    for y in y0..=y1 {
        let dy = (y_tile + y) as f32 + 0.5 - splat.center_px[1];
        for x in (x0 / GROUP * GROUP..=x1).step_by(GROUP) {
            let dx = (x_tile + x) as f32 + 0.5 - splat.center_px[0];
            draw(y * TILE + x, dx, dy);
        }
    }
}

/// A group of pixels of a splat.
struct Fragments {
    /// Squared distance from the centre, in radii; the splat covers up to 1.
    squared: [f32; GROUP],
    /// Depth along the viewing axis.
    depth: [f32; GROUP],
}

#[inline(always)]
fn fragments(splat: &Splat, dx: f32, dy: f32, perspective: bool) -> Fragments {
    let mut out = Fragments { squared: [0.0; GROUP], depth: [0.0; GROUP] };
    let Splat { depth, depth_reach, plane, u, v, .. } = *splat;
    let center = if perspective { 1.0 / depth } else { depth };
    for i in 0..GROUP {
        let dx = dx + i as f32;
        let plane = center + (plane[0] * dx + plane[1] * dy);
        let hit = if perspective { 1.0 / plane } else { plane };
        let scale = if perspective { hit } else { 1.0 };
        let [u, v] = [(u[0] * dx + u[1] * dy) * scale, (v[0] * dx + v[1] * dy) * scale];
        let dot = (dx * dx + dy * dy) * (1.0 / (DOT_RADIUS_PX * DOT_RADIUS_PX));
        let disc = u * u + v * v;
        out.squared[i] = if disc < dot { disc } else { dot };
        // The dot reaches beyond the disc, where its plane is of no use.
        let low = depth - depth_reach;
        let high = depth + depth_reach;
        let hit = if hit > low { hit } else { low };
        out.depth[i] = if hit < high { hit } else { high };
    }
    out
}
