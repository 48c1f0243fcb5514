// Discards the sheets of the last frame: an invocation per cell.
//
// Reads: levels. Writes: asked, sheets.

#import groups
#import levels
#import sheet

@group(0) @binding(0) var<storage, read> levels: array<Level>;
@group(0) @binding(1) var<storage, read_write> asked: array<Asked>;
@group(0) @binding(2) var<storage, read_write> sheets: array<Sheet>;

@compute @workgroup_size(SMALL_GROUP)
fn forget(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let level = levels[SHEET_LEVELS[0]];
    let cell = group_index(workgroup) * SMALL_GROUP + local;
    if cell < level.columns * level.rows {
        asked[cell] = Asked(0u, 0u, NO_POINT);
        for (var index = 0u; index < SHEETS; index++) {
            sheets[cell * SHEETS + index].radius = UNKNOWN;
        }
    }
}
