// Fills a level of cells from the next finer one: an invocation per cell. Run once for each level but the finest.
//
// Reads: levels, which. Reads and writes: clusters.

#import frame
#import clusters
#import filling
#import groups
#import levels

@group(0) @binding(1) var<storage, read> levels: array<Level>;
@group(0) @binding(2) var<storage, read_write> clusters: array<vec4f>;
// The level to fill.
@group(0) @binding(3) var<uniform> which: u32;

@compute @workgroup_size(SMALL_GROUP)
fn merge(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let level = levels[which];
    let below = levels[which - 1u];
    let index = group_index(workgroup) * SMALL_GROUP + local;
    if index >= level.columns * level.rows {
        return;
    }
    let slabs = slabs_of(level.side_px);
    let low = 2u * place_in(level, index);
    let high = min(low + 2u, vec2u(below.columns, below.rows));
    for (var y = low.y; y < high.y; y++) {
        for (var x = low.x; x < high.x; x++) {
            let cell = below.first + y * below.columns + x;
            for (var slab = 0u; slab < SLABS; slab++) {
                let cluster = clusters[cluster_at(cell, slab)];
                if cluster.w == 0.0 {
                    break;
                }
                add(cluster.xyz, cluster.w, slab_of(slabs, cluster.z));
            }
        }
    }
    finish(level.first + index);
}
