// Stores the position, the flags and the values of the screen points that come from one chunk of the cloud.
//
// Reads: a chunk of the cloud; source, pixels, near. Reads and writes: counters. Writes: points, values.

#import frame
#import cloud_points
#import groups
#import near_points
#import screen

@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> positions: array<f32>;
@group(0) @binding(3) var<storage, read> cloud_values: array<u32>;
@group(0) @binding(4) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> source: array<u32>;
@group(0) @binding(6) var<storage, read> pixels: array<u32>;
@group(0) @binding(7) var<storage, read_write> points: array<ScreenPoint>;
@group(0) @binding(8) var<storage, read_write> values: array<u32>;
@group(0) @binding(9) var<storage, read> near: array<u32>;

// The pixel of a listed point: its own, or the one at the screen's edge in its direction.
fn clamped_pixel(at: vec3f) -> u32 {
    let away = abs(at);
    let depth = max(max(at.z, 1e-3 * max(max(away.x, away.y), away.z)), MIN_POSITIVE);
    let place = clamp(to_pixel(vec3f(at.xy, depth)), vec2f(0.0), vec2f(frame.size - 1u));
    let pixel = vec2u(place);
    return (pixel.y << 16u) | pixel.x;
}

@compute @workgroup_size(LARGE_GROUP)
fn gather(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup) * LARGE_GROUP + local;
    let visible = atomicLoad(&counters[VISIBLE]);
    if index >= visible {
        return;
    }
    let at = source[index] - chunk.first;
    // The index of a point of an earlier chunk wraps around, and is far too large.
    if at >= chunk.len {
        return;
    }
    let position_view = turned_to_view(from_eye(at));
    let near_first = atomicLoad(&counters[NEAR_FIRST]);
    let is_listed = index >= near_first;
    var pixel = 0u;
    if is_listed {
        pixel = clamped_pixel(position_view) | NEAR;
    } else {
        pixel = pixels[index];
    }
    // Listed points speak if they are near; the same points on the screen are silent then.
    if near_first < visible && is_near_at(position_view, atomicLoad(&counters[LISTED_OCTAVES])) != is_listed {
        pixel |= SILENT;
        atomicAdd(&counters[SILENT_POINTS], 1u);
    }
    points[index] = ScreenPoint(position_view, pixel);
    for (var value = 0u; value < chunk.values; value++) {
        values[chunk.values * index + value] = cloud_values[chunk.values * at + value];
    }
}
