// As `fit_balls`, an invocation per surfel.
//
// Reads: density, levels, clusters, statistics, sheets, depth_noise, left. Reads and writes: counters, surfels.

#import frame
#import alone
#import density
#import depth_noise
#import levels
#import noise
#import own_balls
#import sheet
#import surfel

@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read> density: array<DensityCell>;
// A uniform, because many devices bind no more than eight storage buffers.
@group(0) @binding(3) var<uniform> levels: array<Level, MOST_LEVELS>;
@group(0) @binding(4) var<storage, read> clusters: array<vec4f>;
@group(0) @binding(5) var<storage, read> statistics: FrameStatistics;
@group(0) @binding(6) var<storage, read> sheets: array<Sheet>;
@group(0) @binding(7) var<storage, read> depth_noise: array<DepthRun>;
@group(0) @binding(8) var<storage, read_write> surfels: array<Surfel>;
@group(0) @binding(9) var<storage, read> left: array<u32>;

@compute @workgroup_size(SMALL_GROUP)
fn fit_balls_alone(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let len = atomicLoad(&counters[BALLS_ACTIVE + atomicLoad(&counters[ROUND])]);
    let step = workgroups.x * SMALL_GROUP;
    for (var item = workgroup.x * SMALL_GROUP + local; item < len; item += step) {
        let place = left[item];
        let surfel = surfels[place];
        let out = adapted_by_balls(surfel, atomicLoad(&counters[CELL_PX]), atomicLoad(&counters[CELL_COLUMNS]));
        keep_adapted(place, surfel, out);
    }
}
