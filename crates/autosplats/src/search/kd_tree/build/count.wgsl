// Counts the points of each chunk that go left.
//
// Reads: state, large, points. Writes: chunk_sums. One workgroup per chunk of a large node.

#import groups
#import kd_build
#import kd_chunk

@group(0) @binding(0) var<storage, read> state: KdState;
@group(0) @binding(1) var<storage, read> large: array<KdLarge>;
@group(0) @binding(2) var<storage, read> points: array<vec4u>;
@group(0) @binding(3) var<storage, read_write> chunk_sums: array<u32>;

var<workgroup> left: atomic<u32>;

@compute @workgroup_size(SMALL_GROUP)
fn count(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let chunk = group_index(workgroup);
    if local == 0u {
        task = kd_task(chunk, state);
        atomicStore(&left, 0u);
    }
    workgroupBarrier();
    var own = 0u;
    for (var at = task.first + local; at < task.end; at += SMALL_GROUP) {
        own += select(0u, 1u, kd_goes_left(points[at], task.axis, task.plane));
    }
    atomicAdd(&left, own);
    workgroupBarrier();
    if local == 0u && task.first < task.end {
        chunk_sums[chunk] = atomicLoad(&left);
    }
}
