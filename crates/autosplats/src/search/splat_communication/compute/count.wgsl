// Counts the queries that have not converged, one invocation each, as the raster form does.
//
// Reads: queries, counters, arguments, searches, told. Writes: convergence.

#import frame
#import counting
#import groups
#import radius_search
#import told

@group(0) @binding(1) var<storage, read> queries: array<u32>;
@group(0) @binding(2) var<storage, read> counters: array<u32>;
@group(0) @binding(3) var<storage, read> arguments: Arguments;
@group(0) @binding(4) var<storage, read_write> convergence: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> searches: array<PointSearch>;
@group(0) @binding(6) var<storage, read_write> told: array<Told>;

@compute @workgroup_size(LARGE_GROUP)
fn count(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let first = counters[ROUND_FIRST];
    let len = counters[ROUND_LEN];
    let index = group_index(workgroup) * LARGE_GROUP + local;
    var is_unconverged = false;
    if index < len {
        let own = queries[first + index];
        let others = f32(counters[VISIBLE] - 1u);
        is_unconverged = !has_ended(advance(known_of(own), searches[own].initial_radius, others));
    }
    count_unconverged(is_unconverged, local);
}
