// Mean accumulation [Paper, §6]: every point adds its offset, and 1, at each point that has it in its neighbourhood; and the
// distance to the furthest is kept, which is the k-radius.
//
// Differs from the paper: offsets are taken about the point itself, so that nothing cancels, and it is not counted.
//
// Reads: points, the position and the feedback texture. Writes: both radius textures.

#import frame
#import screen
#import communication
#import window
#import splat_box
#import radius_search

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var positions: texture_2d<f32>;
@group(0) @binding(3) var feedback: texture_2d<f32>;

struct Splat {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) center: vec3f,
    @location(1) @interpolate(flat) pixel: u32,
}

struct Answer {
    @location(0) offset: vec4f,
    @location(1) furthest: vec4f,
}

@vertex
fn mean_vertex(@builtin(vertex_index) vertex: u32) -> Splat {
    let point = points[vertex / BOX_VERTICES];
    let pixel = pixel_xy(point.pixel);
    let radius = textureLoad(feedback, pixel, 0).w;
    var position = no_vertex();
    if radius > 0.0 {
        position = splat_vertex(point.position_view, radius, pixel, vertex);
    }
    return Splat(position, point.position_view, point.pixel);
}

@fragment
fn mean_fragment(splat: Splat) -> Answer {
    let at = vec2u(splat.position.xy);
    let told = textureLoad(feedback, at, 0);
    let search = Search(told.x, told.y, told.z);
    let center = textureLoad(positions, at, 0).xyz;
    let distance = apart(splat.center, center);
    let is_itself = all(at == pixel_xy(splat.pixel));
    if is_itself || !has_neighbors(search) || !is_within(search, distance) {
        discard;
    }
    return Answer(vec4f(splat.center - center, 1.0), vec4f(0.0, 0.0, 0.0, distance));
}
