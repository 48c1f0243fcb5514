// Adapts the surfels that `adapt` leaves, those that need balls of their own, and turns those on scan lines to their
// areas or makes them thin. Such surfels are rare but take long, so a workgroup fits one after the other together. See
// the CPU form.
//
// Reads: density, levels, clusters, statistics, sheets, depth_noise, left. Reads and writes: counters, surfels.

#import frame
#import density
#import depth_noise
#import levels
#import noise
#import own_balls
#import sheet
#import surfel
#import together

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

// What all invocations need to know.
struct Task {
    // Number of surfels that are left.
    len: u32,
    cell_px: u32,
    cell_columns: u32,
}
var<workgroup> task: Task;
// The surfel being adapted.
var<workgroup> shared_surfel: Surfel;

@compute @workgroup_size(TOGETHER)
fn fit_balls(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    own_place = local;
    if local == 0u {
        task = Task(
            atomicLoad(&counters[BALLS_ACTIVE + atomicLoad(&counters[ROUND])]),
            atomicLoad(&counters[CELL_PX]),
            atomicLoad(&counters[CELL_COLUMNS]),
        );
    }
    let all = workgroupUniformLoad(&task);
    for (var item = workgroup.x; item < all.len; item += workgroups.x) {
        let place = left[item];
        if local == 0u {
            shared_surfel = surfels[place];
        }
        let surfel = workgroupUniformLoad(&shared_surfel);
        let out = adapted_by_balls(surfel, all.cell_px, all.cell_columns);
        if tells() {
            keep_adapted(place, surfel, out);
        }
    }
}
