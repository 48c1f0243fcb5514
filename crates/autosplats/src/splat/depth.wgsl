// Visibility pass: the nearest depth, pushed back by ε, of the splats that cover each pixel [Paper, §7]. An invocation
// draws a splat, and a team of invocations a large one; a minimum does not depend on the order.
//
// Reads: counters, splats, tree, large. Reads and writes: depth_map.

#import frame
#import draw_depth
#import groups
#import large
#import splat

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var<storage, read> tree: array<vec2u>;
@group(0) @binding(4) var<storage, read> large: array<u32>;
@group(0) @binding(5) var<storage, read_write> depth_map: array<atomic<u32>>;

// Whether to draw only the recovered splats.
override RECOVERED_ONLY: bool;
override MAX_INVOCATION_PX: u32;

@compute @workgroup_size(LARGE_GROUP)
fn depth(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let group = group_index(workgroup);
    let first = select(0u, counters[ACTIVE], RECOVERED_ONLY);
    if group < LARGE_SPLAT_GROUPS {
        for (var place = first_large(group, local); place < counters[LARGE]; place += NEXT_LARGE) {
            let index = large[place];
            let bounds = tree[level_start(SPLATS) + index];
            if index >= first && !is_empty(bounds) {
                draw_together(splats[index], bounds, local);
            }
        }
        return;
    }
    let index = first + (group - LARGE_SPLAT_GROUPS) * LARGE_GROUP + local;
    if index >= counters[ACTIVE] + counters[RECOVERED] {
        return;
    }
    let bounds = tree[level_start(SPLATS) + index];
    if !is_empty(bounds) && bounds_area(bounds) <= MAX_INVOCATION_PX {
        draw_alone(splats[index], bounds);
    }
}
