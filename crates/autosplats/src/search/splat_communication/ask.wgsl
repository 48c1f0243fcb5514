// Every query draws its pixel: its search begins, with what the last frame tells of its radius. All others keep the 0 that the
// texture was cleared to, and only answer.
//
// Reads: points, queries, counters, density, past. Writes: the second radius texture.

#import frame
#import counters
#import density
#import screen
#import communication
#import window
#import splat_box
#import past

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read> queries: array<u32>;
@group(0) @binding(3) var<storage, read> counters: array<u32>;
@group(0) @binding(4) var<storage, read> density: array<vec2u>;
@group(0) @binding(5) var<storage, read> past: array<u32>;

// 0: the active points; 1: the recovered ones, which follow them.
override ROUND: u32;

struct Splat {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) likely: f32,
}

@vertex
fn ask_vertex(@builtin(vertex_index) vertex: u32) -> Splat {
    let first = select(0u, counters[ACTIVE], ROUND == 1u);
    let point = points[queries[first + vertex / BOX_VERTICES]];
    let pixel = pixel_xy(point.pixel);
    let cell_px = counters[CELL_PX];
    let cell = density_cell(pixel, cell_px, counters[CELL_COLUMNS]);
    let initial_radius = first_radius(density[cell].x, cell_px, point.position_view.z);
    let position = pixel_vertex(pixel, vertex, splat_depth(point.position_view, 0.0));
    return Splat(position, past_radius(point.position_view, initial_radius));
}

@fragment
fn ask_fragment(splat: Splat) -> @location(0) vec4f {
    return vec4f(splat.likely, -1.0, 0.0, 0.0);
}
