// Stores the position and the values of the screen points that come from one chunk of the cloud.
//
// Reads: a chunk of the cloud; source, pixels, counters. Writes: points, values.

#import frame
#import cloud_points
#import groups
#import screen

@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> positions: array<f32>;
@group(0) @binding(3) var<storage, read> cloud_values: array<u32>;
@group(0) @binding(4) var<storage, read> counters: array<u32>;
@group(0) @binding(5) var<storage, read> source: array<u32>;
@group(0) @binding(6) var<storage, read> pixels: array<u32>;
@group(0) @binding(7) var<storage, read_write> points: array<ScreenPoint>;
@group(0) @binding(8) var<storage, read_write> values: array<u32>;

@compute @workgroup_size(LARGE_GROUP)
fn gather(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup) * LARGE_GROUP + local;
    if index >= counters[VISIBLE] {
        return;
    }
    let at = source[index] - chunk.first;
    // The index of a point of an earlier chunk wraps around, and is far too large.
    if at >= chunk.len {
        return;
    }
    let position_view = turned_to_view(from_eye(at));
    points[index] = ScreenPoint(position_view, pixels[index]);
    for (var value = 0u; value < chunk.values; value++) {
        values[chunk.values * index + value] = cloud_values[chunk.values * at + value];
    }
}
