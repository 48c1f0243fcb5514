// Every query begins its search. All other points only answer.
//
// Reads: queries, counters. Writes: searches.

#import frame
#import groups
#import point_search

@group(0) @binding(1) var<storage, read> queries: array<u32>;
@group(0) @binding(2) var<storage, read> counters: array<u32>;
@group(0) @binding(3) var<storage, read_write> searches: array<PointSearch>;

@compute @workgroup_size(LARGE_GROUP)
fn ask(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let first = counters[ROUND_FIRST];
    let len = counters[ROUND_LEN];
    let index = group_index(workgroup) * LARGE_GROUP + local;
    if index < len {
        searches[queries[first + index]].high = -1.0;
    }
}
