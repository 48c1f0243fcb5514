// As `scatter`, an invocation per ball.
//
// Reads: counters, density, surfels, levels, clusters, picked. Writes: scatters, ball size by ball size; sampled.

#import frame
#import alone
#import ball_scatter
#import density
#import groups
#import levels
#import sorted_sample
#import surfel

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> density: array<DensityCell>;
@group(0) @binding(3) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(4) var<storage, read> levels: array<Level>;
@group(0) @binding(5) var<storage, read> clusters: array<vec4f>;
@group(0) @binding(6) var<storage, read> picked: array<u32>;
@group(0) @binding(7) var<storage, read_write> scatters: array<u32>;
@group(0) @binding(8) var<storage, read_write> sampled: array<u32>;

const SORTING_GROUPS = MOST_SAMPLED / SMALL_GROUP;

@compute @workgroup_size(SMALL_GROUP)
fn scatter_alone(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let group = group_index(workgroup);
    let measured = picked[MEASURED];
    if measured == 0u && group < SORTING_GROUPS {
        sort_sample(group * SMALL_GROUP + local, local, SMALL_GROUP);
        return;
    }
    let of_sizes = group - select(0u, SORTING_GROUPS, measured == 0u);
    let index = measured * MOST_SAMPLED + of_sizes * SMALL_GROUP + local;
    if is_picked(index) {
        scatters[index] = scatter_of(index);
    }
}
