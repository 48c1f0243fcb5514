// Mean accumulation [Paper, §6]: every point adds its offset, and 1, at each point whose neighbourhood holds it. The
// largest distance is kept as the k-radius.
//
// Differs from the paper: offsets are about the point itself, so that nothing cancels, and the point is not counted.
//
// Reads: points, the position and the feedback texture. Writes: both radius textures.

#import frame
#import answer
#import radius_search
#import screen

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var positions: texture_2d<f32>;
@group(0) @binding(3) var feedback: texture_2d<f32>;

struct Answer {
    @location(0) offset: vec4f,
    @location(1) furthest: vec4f,
}

@vertex
fn mean_vertex(@builtin(vertex_index) vertex: u32) -> Splat {
    return answer_vertex(vertex, false);
}

@fragment
fn mean_fragment(splat: Splat) -> Answer {
    let at = vec2u(splat.position.xy);
    let search = asked_at(at);
    let center = textureLoad(positions, at, 0).xyz;
    let distance = apart(splat.center, center);
    if is_own(splat) || !has_neighbors(search) || !is_within(search, distance) {
        discard;
    }
    return Answer(vec4f(splat.center - center, 1.0), vec4f(0.0, 0.0, 0.0, distance));
}
