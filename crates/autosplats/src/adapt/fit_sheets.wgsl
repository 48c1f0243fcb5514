// Fits the sheets that surfels ask for. A workgroup for a few cells fits those that are asked for one after the other.
//
// Reads: levels, clusters, statistics, asked, depth_noise. Reads and writes: sheets.

#import frame
#import cell_sheets
#import depth_noise
#import groups
#import levels
#import noise
#import sheet
#import together

@group(0) @binding(1) var<storage, read> levels: array<Level>;
@group(0) @binding(2) var<storage, read> clusters: array<vec4f>;
@group(0) @binding(3) var<storage, read> statistics: FrameStatistics;
@group(0) @binding(4) var<storage, read> asked: array<Asked>;
@group(0) @binding(5) var<storage, read> depth_noise: array<DepthRun>;
@group(0) @binding(6) var<storage, read_write> sheets: array<Sheet>;

// Cells of a workgroup, at most 32.
override CELLS_PER_GROUP: u32;

// Bit mask of the workgroup's cells that need sheets.
var<workgroup> found_wanted: atomic<u32>;
var<workgroup> shared_wanted: u32;

@compute @workgroup_size(TOGETHER)
fn fit_sheets(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    own_place = local;
    let level = levels[statistics.sheet_level];
    let first = group_index(workgroup) * CELLS_PER_GROUP;
    if local == 0u {
        atomicStore(&found_wanted, 0u);
    }
    workgroupBarrier();
    for (var index = local; index < CELLS_PER_GROUP; index += TOGETHER) {
        if is_wanted(level, first + index) {
            atomicOr(&found_wanted, 1u << index);
        }
    }
    workgroupBarrier();
    if local == 0u {
        shared_wanted = atomicLoad(&found_wanted);
    }
    for (var wanted = workgroupUniformLoad(&shared_wanted); wanted != 0u; wanted &= wanted - 1u) {
        fit_cell(level, first + firstTrailingBit(wanted));
    }
}
