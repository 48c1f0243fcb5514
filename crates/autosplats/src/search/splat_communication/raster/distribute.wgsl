// The distribution pass [Paper, §4, §5.2]: every searching point draws its search radius. A point within keeps the
// distance to the furthest searching point, its feedback radius, by MAX blending in alpha. Colours hand the bounds on.
//
// Reads: points, counters, the position texture and both radius textures. Writes: the feedback texture.

#import frame
#import communication
#import radius_search
#import screen
#import splat_box

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read> counters: array<u32>;
@group(0) @binding(3) var positions: texture_2d<f32>;
@group(0) @binding(4) var counts: texture_2d<f32>;
@group(0) @binding(5) var radii: texture_2d<f32>;

// Whether searches end here: points then draw the radius found.
override IS_LAST: bool;

struct Splat {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) center: vec3f,
    @location(1) @interpolate(flat) pixel: u32,
    @location(2) @interpolate(flat) search: vec3f,
}

@vertex
fn distribute_vertex(@builtin(vertex_index) vertex: u32) -> Splat {
    let point = points[vertex / BOX_VERTICES];
    let pixel = pixel_xy(point.pixel);
    let others = f32(counters[VISIBLE] - 1u);
    let initial_radius = textureLoad(positions, pixel, 0).w;
    let known = recall(textureLoad(radii, pixel, 0), textureLoad(counts, pixel, 0));
    var search: Search;
    var radius = 0.0;
    if IS_LAST {
        search = settle(known, initial_radius, others);
        radius = select(0.0, max(search.high, MIN_SQUARABLE_DISTANCE), has_neighbors(search));
    } else {
        search = advance(known, initial_radius, others);
        // A converged point covers its own pixel and hands on the radius found.
        radius = select(search.high, 0.0, has_ended(search));
    }
    var position = no_vertex();
    if is_query(search) {
        position = splat_vertex(point.position_view, radius, pixel, vertex);
    }
    return Splat(position, point.position_view, point.pixel, vec3f(search.low, search.high, search.count));
}

@fragment
fn distribute_fragment(splat: Splat) -> @location(0) vec4f {
    let at = vec2u(splat.position.xy);
    // A pixel holds one point, so the pixel identifies the point itself.
    if all(at == pixel_xy(splat.pixel)) {
        return vec4f(splat.search, 0.0);
    }
    let distance = apart(splat.center, textureLoad(positions, at, 0).xyz);
    if !is_within(Search(splat.search.x, splat.search.y, splat.search.z), distance) {
        discard;
    }
    return vec4f(0.0, 0.0, 0.0, max(distance, MIN_SQUARABLE_DISTANCE));
}
