// Fills a cell with points or clusters: see the CPU form. The including pass binds `clusters` for writing. See
// docs/decisions/0008-eight-slabs.md.

#import frame
#import clusters
#import divide
#import levels

// Partition of depth into slabs that are about as thick as a cell is wide.
struct Slabs {
    // Perspective: number of low bits of a depth that are ignored. Slabs thus get thicker with depth, like the width of
    // cells.
    shift: u32,
    // Orthographic: slabs per world unit.
    per_unit: f32,
}

fn slabs_of(side_px: u32) -> Slabs {
    let side = f32(side_px);
    // Between two powers of two there are 2²³ floats. The difference of the bits is the rounded-down logarithm, without
    // a division, which may be inexact.
    let doublings = (bitcast<u32>(max(frame.focal_px, side)) - bitcast<u32>(side)) >> 23u;
    return Slabs(23u - min(doublings, 23u), frame.focal_px / side);
}

// Slab of a depth above 0.
fn slab_of(slabs: Slabs, depth: f32) -> u32 {
    if frame.perspective == 1u {
        return bitcast<u32>(depth) >> slabs.shift;
    }
    return u32(depth * slabs.per_unit);
}

// Per cluster: sum of positions and number of points.
var<private> sums: array<vec4f, SLABS>;
var<private> slab_at: array<u32, SLABS>;
var<private> used: u32;
// How often the thickness of this cell's slabs was doubled.
var<private> doubled: u32;

// Adds a sum to its slab; returns false if the slab is new and there is no room for it.
fn put(sum: vec4f, slab: u32) -> bool {
    var at = 0u;
    while at < used && slab_at[at] != slab {
        at++;
    }
    if at == SLABS {
        return false;
    }
    used = max(used, at + 1u);
    slab_at[at] = slab;
    sums[at] += sum;
    return true;
}

// Doubles the thickness of all slabs.
fn double_thickness() {
    let full_sums = sums;
    let full_slabs = slab_at;
    let full = used;
    doubled++;
    used = 0u;
    sums = array<vec4f, SLABS>();
    for (var at = 0u; at < full; at++) {
        put(full_sums[at], full_slabs[at] >> 1u);
    }
}

// Begins another cell.
fn begin() {
    sums = array<vec4f, SLABS>();
    used = 0u;
    doubled = 0u;
}

// Adds `count` points with this mean.
fn add(mean: vec3f, count: f32, slab: u32) {
    let sum = vec4f(mean * count, count);
    while !put(sum, slab >> doubled) {
        double_thickness();
    }
}

fn finish(cell: u32) {
    for (var index = 0u; index < used; index++) {
        clusters[cluster_at(cell, index)] = vec4f(sums[index].xyz / sums[index].w, sums[index].w);
    }
    // Clusters of the last frame. Behind an empty one all are empty, so most cells are written little.
    for (var index = used; index < SLABS; index++) {
        if clusters[cluster_at(cell, index)].w == 0.0 {
            break;
        }
        clusters[cluster_at(cell, index)] = vec4f(0.0);
    }
}
