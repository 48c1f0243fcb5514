// Turns surfels on scan lines to their areas or makes them thin, and shrinks those that are no surface. A workgroup for
// a few surfels fits those on scan lines together, one after the other. Such surfels are rare but need several balls
// each; with an invocation per surfel, neighbours would wait. See the CPU form.
//
// Reads: density, levels, clusters, statistics, depth_noise. Reads and writes: counters, surfels.

#import frame
#import base_radius
#import calls
#import density
#import depth_noise
#import groups
#import levels
#import noise
#import round
#import rows
#import screen
#import shrink
#import surfel
#import together

@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read> density: array<DensityCell>;
@group(0) @binding(3) var<storage, read> levels: array<Level>;
@group(0) @binding(4) var<storage, read> clusters: array<vec4f>;
@group(0) @binding(5) var<storage, read> statistics: FrameStatistics;
@group(0) @binding(6) var<storage, read> depth_noise: array<DepthRun>;
@group(0) @binding(7) var<storage, read_write> surfels: array<Surfel>;

// Surfels of a workgroup.
override ITEMS_PER_GROUP: u32;

// Bit mask of the workgroup's surfels on scan lines, and what all invocations need to know.
var<workgroup> found_rows: atomic<u32>;
struct Task {
    rows: u32,
    first: u32,
    cell_px: u32,
    cell_columns: u32,
}
var<workgroup> task: Task;
// The surfel being turned.
var<workgroup> shared_surfel: Surfel;

@compute @workgroup_size(TOGETHER)
fn turn_rows(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    own_place = local;
    let active_points = atomicLoad(&counters[ACTIVE]);
    let first_of_round = select(0u, active_points, ROUND == 1u);
    let len = select(active_points, atomicLoad(&counters[RECOVERED]), ROUND == 1u);
    let first = group_index(workgroup) * ITEMS_PER_GROUP;
    if local == 0u {
        atomicStore(&found_rows, 0u);
    }
    workgroupBarrier();
    for (var index = local; index < ITEMS_PER_GROUP && first + index < len; index += TOGETHER) {
        let surfel = surfels[first_of_round + first + index];
        if is_row(surfel, known_beyond(noise_at(statistics.noise, surfel.k_radius), surfel.center, surfel.source).noise) {
            atomicOr(&found_rows, 1u << index);
        }
    }
    workgroupBarrier();
    if local == 0u {
        task.rows = atomicLoad(&found_rows);
        task.first = first_of_round + first;
        task.cell_px = atomicLoad(&counters[CELL_PX]);
        task.cell_columns = atomicLoad(&counters[CELL_COLUMNS]);
    }
    let all = workgroupUniformLoad(&task);
    for (var rows = all.rows; rows != 0u; rows &= rows - 1u) {
        let place = all.first + firstTrailingBit(rows);
        if local == 0u {
            shared_surfel = surfels[place];
        }
        let surfel = workgroupUniformLoad(&shared_surfel);
        let cell = density[density_cell(pixel_xy(surfel.pixel), all.cell_px, all.cell_columns)];
        let own_radius = initial_radius_of(cell.count, all.cell_px, surfel.center.z);
        let area = area(surfel, base_radius(surfel, own_radius));
        var out = turned(surfel, area);
        if area.radius == 0.0 {
            out.radius = shrunk(out, own_radius, statistics.k_radius);
        }
        let is_out = is_dropped(out);
        if surfel.k_radius > MIN_TESTED_FIRST_RADII * own_radius {
            out.radius = opened(out, 0.0);
        }
        if local == 0u {
            surfels[place] = out;
            if is_out {
                atomicAdd(&counters[OUTLIERS], 1u);
            }
        }
    }
}
