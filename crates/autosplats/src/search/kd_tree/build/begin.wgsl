// Begins a tree with one large node of all points.
//
// Reads: the cloud, which is one chunk. Writes: points, radii, large, state, arguments. One invocation per point.

#import frame
#import cloud_points
#import groups
#import kd_build
#import put_work

@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> positions: array<f32>;
@group(0) @binding(3) var<storage, read_write> points: array<vec4u>;
@group(0) @binding(4) var<storage, read_write> radii: array<f32>;
@group(0) @binding(5) var<storage, read_write> large: array<KdLarge>;
@group(0) @binding(6) var<storage, read_write> state: KdState;
@group(0) @binding(7) var<storage, read_write> arguments: array<Dispatch>;

@compute @workgroup_size(LARGE_GROUP)
fn begin(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let at = group_index(workgroup) * LARGE_GROUP + local;
    if at < chunk.len {
        let position = vec3f(positions[3u * at], positions[3u * at + 1u], positions[3u * at + 2u]);
        points[at] = vec4u(bitcast<vec3u>(position), at);
        // Initial radius, kept by points that are not in the tree: they have no neighbours.
        radii[at] = -1.0;
    }
    if at == 0u {
        let chunks = (chunk.len + CHUNK_POINTS - 1u) / CHUNK_POINTS;
        large[0] = KdLarge(0u, 0u, chunk.len, 0u, vec3u(0u), KD_UNSPLIT, vec3u(0u), 0.0, chunk.len, 0u, KD_NONE, KD_NONE);
        state = KdState(0u, 1u, 1u, chunks, 0u, 0u);
        put_work(WORK_LARGE, 1u, SMALL_GROUP);
        put_work(WORK_CHUNKS, chunks, 1u);
        put_work(WORK_SMALL, 0u, 1u);
        put_work(WORK_POINTS, 0u, SMALL_GROUP);
    }
}
