// Splats by which points answer: as large as the feedback radius [Paper, §4]. The including pass binds `points` and
// `feedback`.

#import communication
#import radius_search
#import screen
#import splat_box

struct Splat {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) center: vec3f,
    @location(1) @interpolate(flat) pixel: u32,
}

// Search that the point of a pixel asked for.
fn asked_at(pixel: vec2u) -> Search {
    let told = textureLoad(feedback, pixel, 0);
    return Search(told.x, told.y, told.z);
}

// A vertex of a splat. A point that no search reaches draws nothing, or only its own pixel if it passes along its own
// search.
fn answer_vertex(vertex: u32, passes_along: bool) -> Splat {
    let point = points[vertex / BOX_VERTICES];
    let pixel = pixel_xy(point.pixel);
    let radius = textureLoad(feedback, pixel, 0).w;
    var position = no_vertex();
    if radius > 0.0 || (passes_along && is_query(asked_at(pixel))) {
        position = splat_vertex(point.position_view, radius, pixel, vertex);
    }
    return Splat(position, point.position_view, point.pixel);
}

// Whether a fragment lies on the splat's own point: a pixel holds one point.
fn is_own(splat: Splat) -> bool {
    return all(vec2u(splat.position.xy) == pixel_xy(splat.pixel));
}
