// Every query draws its pixel, to begin its search. All other points keep the cleared 0 and only answer.
//
// Reads: points, queries, counters. Writes: the second radius texture.

#import frame
#import communication
#import screen
#import splat_box

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read> queries: array<u32>;
@group(0) @binding(3) var<storage, read> counters: array<u32>;

@vertex
fn ask_vertex(@builtin(vertex_index) vertex: u32) -> @builtin(position) vec4f {
    let first = counters[ROUND_FIRST];
    let point = points[queries[first + vertex / BOX_VERTICES]];
    return pixel_vertex(pixel_xy(point.pixel), vertex, splat_depth(point.position_view, 0.0));
}

@fragment
fn ask_fragment() -> @location(0) vec4f {
    return vec4f(0.0, -1.0, 0.0, 0.0);
}
