// Builds the upper levels of the tree: a workgroup per 4096 splats, an invocation per 16.
//
// Reads: counters. Reads and writes: tree.

#import frame
#import groups
#import splat

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read_write> tree: array<vec2u>;

// Bounds of the sixteen runs and, last, of the top: least column and row, greatest column and row.
var<workgroup> sides: array<atomic<u32>, 68>;

@compute @workgroup_size(LARGE_GROUP)
fn boxes(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let top = group_index(workgroup);
    let end = counters[ACTIVE] + counters[RECOVERED];
    if top == 0u && local == 0u {
        tree[0] = vec2u(end);
    }
    if local < 68u {
        atomicStore(&sides[local], select(0u, 0xffffu, local % 4u < 2u));
    }
    workgroupBarrier();
    let leaf = top * FAN * FAN + local;
    let start = level_start(SPLATS) + leaf * FAN;
    let children = min(max(end, leaf * FAN) - leaf * FAN, FAN);
    var low = vec2u(0xffffu);
    var high = vec2u(0u);
    for (var child = 0u; child < children; child++) {
        let bounds = tree[start + child];
        if !is_empty(bounds) {
            low = min(low, firsts(bounds));
            high = max(high, lasts(bounds));
        }
    }
    if children > 0u {
        tree[level_start(LEAVES) + leaf] = low | (high << vec2u(16u));
    }
    if low.x <= high.x {
        widen(local / FAN, low, high);
    }
    workgroupBarrier();
    if local < FAN {
        low = vec2u(atomicLoad(&sides[4u * local]), atomicLoad(&sides[4u * local + 1u]));
        high = vec2u(atomicLoad(&sides[4u * local + 2u]), atomicLoad(&sides[4u * local + 3u]));
        let run = top * FAN + local;
        if run * FAN * FAN < end {
            tree[level_start(RUNS) + run] = low | (high << vec2u(16u));
        }
        if low.x <= high.x {
            widen(FAN, low, high);
        }
    }
    workgroupBarrier();
    if local == 0u && top * FAN * FAN * FAN < end {
        low = vec2u(atomicLoad(&sides[64]), atomicLoad(&sides[65]));
        high = vec2u(atomicLoad(&sides[66]), atomicLoad(&sides[67]));
        tree[level_start(TOP) + top] = low | (high << vec2u(16u));
    }
}

fn widen(node: u32, low: vec2u, high: vec2u) {
    atomicMin(&sides[4u * node], low.x);
    atomicMin(&sides[4u * node + 1u], low.y);
    atomicMax(&sides[4u * node + 2u], high.x);
    atomicMax(&sides[4u * node + 3u], high.y);
}
