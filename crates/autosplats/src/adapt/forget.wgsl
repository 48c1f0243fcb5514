// Forgets the sheets of the frame before: an invocation per cell.
//
// Reads: levels. Writes: asked, lens.

#import groups
#import levels
#import sheet

@group(0) @binding(0) var<storage, read> levels: array<Level>;
@group(0) @binding(1) var<storage, read_write> asked: array<vec2u>;
@group(0) @binding(2) var<storage, read_write> lens: array<u32>;

@compute @workgroup_size(64)
fn forget(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let level = levels[SHEET_LEVEL];
    let cell = group_index(workgroup) * 64u + local;
    if cell < level.columns * level.rows {
        asked[cell] = vec2u(0u);
        lens[cell] = UNKNOWN;
    }
}
