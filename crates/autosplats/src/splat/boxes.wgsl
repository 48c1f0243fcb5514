// The upper levels of the tree: bounds of runs of splats, and of runs of runs. A workgroup per run of runs.
//
// Reads: counters. Reads and writes: tree.

#import frame
#import groups
#import counters
#import splat

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read_write> tree: array<vec2u>;

// Whether only the recovered ones are new.
override RECOVERED_ONLY: bool;

var<workgroup> low_x: atomic<u32>;
var<workgroup> low_y: atomic<u32>;
var<workgroup> high_x: atomic<u32>;
var<workgroup> high_y: atomic<u32>;

@compute @workgroup_size(64)
fn boxes(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let node = group_index(workgroup);
    let first = select(0u, counters[ACTIVE], RECOVERED_ONLY);
    let end = counters[ACTIVE] + counters[RECOVERED];
    if node == 0u && local == 0u {
        tree[0] = vec2u(first, end);
    }
    if local == 0u {
        atomicStore(&low_x, 0xffffu);
        atomicStore(&low_y, 0xffffu);
        atomicStore(&high_x, 0u);
        atomicStore(&high_y, 0u);
    }
    workgroupBarrier();
    let run = node * FAN + local;
    let start = level_start(SPLATS);
    var low = vec2u(0xffffu);
    var high = vec2u(0u);
    for (var index = run * FAN; index < min((run + 1u) * FAN, end); index++) {
        let bounds = tree[start + index];
        if !is_empty(bounds) {
            low = min(low, firsts(bounds));
            high = max(high, lasts(bounds));
        }
    }
    if run * FAN < end && (run + 1u) * FAN > first {
        tree[level_start(RUNS) + run] = low | high << vec2u(16u);
    }
    if low.x <= high.x {
        atomicMin(&low_x, low.x);
        atomicMin(&low_y, low.y);
        atomicMax(&high_x, high.x);
        atomicMax(&high_y, high.y);
    }
    workgroupBarrier();
    if local == 0u && node * FAN * FAN < end && (node + 1u) * FAN * FAN > first {
        let lows = vec2u(atomicLoad(&low_x), atomicLoad(&low_y));
        let highs = vec2u(atomicLoad(&high_x), atomicLoad(&high_y));
        tree[level_start(RUNS_OF_RUNS) + node] = lows | highs << vec2u(16u);
    }
}
