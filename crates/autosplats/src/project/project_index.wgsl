// The second of two passes that do what `project` does where there are no 64-bit atomics: among the points at the nearest
// depth of their pixel, the lowest index.
//
// Reads: a chunk of the cloud. Writes: keys, as pairs of atomics.

#import frame
#import groups
#import project_point

@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> positions: array<f32>;
@group(0) @binding(3) var<storage, read_write> keys: array<atomic<u32>>;

@compute @workgroup_size(256)
fn project_index(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup) * 256u + local;
    if index >= chunk.len {
        return;
    }
    let at = 3u * index;
    let projected = project_point(vec3f(positions[at], positions[at + 1u], positions[at + 2u]));
    if projected.pixel < PIXEL_OUTSIDE
        && atomicLoad(&keys[2u * projected.pixel + 1u]) == bitcast<u32>(projected.depth) {
        atomicMin(&keys[2u * projected.pixel], chunk.first + index);
    }
}
