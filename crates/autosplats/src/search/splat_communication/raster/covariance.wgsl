// Covariance accumulation [Paper, §6]: every point adds its offset's products at each point whose neighbourhood holds
// it.
//
// Differs from the paper: taken about the point itself instead of the mean; the fit corrects for the mean.
//
// Reads: points, the position and the feedback texture. Writes: both radius textures.

#import frame
#import answer
#import radius_search
#import screen

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var positions: texture_2d<f32>;
@group(0) @binding(3) var feedback: texture_2d<f32>;

// xx, xy, xz, yy; yz, zz.
struct Answer {
    @location(0) first: vec4f,
    @location(1) last: vec4f,
}

@vertex
fn covariance_vertex(@builtin(vertex_index) vertex: u32) -> Splat {
    return answer_vertex(vertex, false);
}

@fragment
fn covariance_fragment(splat: Splat) -> Answer {
    let at = vec2u(splat.position.xy);
    let search = asked_at(at);
    let center = textureLoad(positions, at, 0).xyz;
    if is_own(splat) || !has_neighbors(search) || !is_within(search, apart(splat.center, center)) {
        discard;
    }
    let away = splat.center - center;
    return Answer(vec4f(away.x * away, away.y * away.y), vec4f(away.y * away.z, away.z * away.z, 0.0, 0.0));
}
