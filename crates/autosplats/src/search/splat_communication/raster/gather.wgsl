// The gathering pass [Paper, §4, §5.2]: every point draws its feedback radius. At each point whose delta region holds
// it, it counts for those of the four radii that reach it, by ADD blending. MAX blending in the alpha of the second
// texture keeps the distance to the furthest neighbour. The point itself hands its bounds on.
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
    @location(0) counts: vec4f,
    @location(1) radii: vec4f,
}

@vertex
fn gather_vertex(@builtin(vertex_index) vertex: u32) -> Splat {
    return answer_vertex(vertex, true);
}

@fragment
fn gather_fragment(splat: Splat) -> Answer {
    let at = vec2u(splat.position.xy);
    let search = asked_at(at);
    if is_own(splat) {
        return Answer(vec4f(0.0), vec4f(search.low, search.high, search.count, 0.0));
    }
    let distance = apart(splat.center, textureLoad(positions, at, 0).xyz);
    if has_ended(search) || !is_within(search, distance) {
        discard;
    }
    let counts = select(vec4f(0.0), vec4f(1.0), vec4f(distance) <= sample_radii(search));
    return Answer(counts, vec4f(0.0, 0.0, 0.0, distance));
}
