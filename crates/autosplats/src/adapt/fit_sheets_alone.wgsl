// As `fit_sheets`, an invocation per cell.
//
// Reads: levels, clusters, statistics, asked, depth_noise. Reads and writes: sheets.

#import frame
#import alone
#import cell_sheets
#import depth_noise
#import groups
#import levels
#import noise
#import sheet

@group(0) @binding(1) var<storage, read> levels: array<Level>;
@group(0) @binding(2) var<storage, read> clusters: array<vec4f>;
@group(0) @binding(3) var<storage, read> statistics: FrameStatistics;
@group(0) @binding(4) var<storage, read> asked: array<Asked>;
@group(0) @binding(5) var<storage, read> depth_noise: array<DepthRun>;
@group(0) @binding(6) var<storage, read_write> sheets: array<Sheet>;

@compute @workgroup_size(SMALL_GROUP)
fn fit_sheets_alone(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let level = levels[statistics.sheet_level];
    let cell = group_index(workgroup) * SMALL_GROUP + local;
    if is_wanted(level, cell) {
        fit_cell(level, cell);
    }
}
