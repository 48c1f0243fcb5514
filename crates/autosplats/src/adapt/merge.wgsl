// Fills the levels of cells that are too coarse for the tiles of the last dispatch: again a workgroup per tile, of the
// first of these levels. Resets the numbers of picked surfels and of measured sizes.
//
// Reads: levels, first. Reads and writes: clusters. Writes: picked.

#import frame
#import groups
#import levels
#import merging
#import scatters

@group(0) @binding(1) var<storage, read> levels: array<Level>;
@group(0) @binding(2) var<storage, read_write> clusters: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> picked: array<u32>;
// The first level to fill.
@group(0) @binding(4) var<uniform> first: u32;

@compute @workgroup_size(LARGE_GROUP)
fn merge(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let group = group_index(workgroup);
    if group == 0u && local == 0u {
        picked[MOST_SAMPLED] = 0u;
        picked[MEASURED] = 0u;
    }
    if local < MOST_LEVELS {
        all_levels[local] = levels[local];
    }
    workgroupBarrier();
    let tile = tile_of(all_levels[first], group);
    let place = TILE * tile + vec2u(local % TILE, local / TILE);
    if has_cell(all_levels[first], place) {
        merge_cell(first, place);
    }
    merge_tile(first, tile, local);
}
