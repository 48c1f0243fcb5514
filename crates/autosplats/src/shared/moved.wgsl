// Moving surfels.

#import frame
#import screen
#import surfel

// The surfel with another centre. Unchanged if that centre is off the screen, because depth refinement needs its pixel.
fn moved(surfel: Surfel, center: vec3f) -> Surfel {
    var out = surfel;
    let at = to_pixel(center);
    if center.z > frame.near && all(at >= vec2f(0.0)) && all(at < vec2f(frame.size)) {
        let pixel = vec2u(at);
        out.center = center;
        out.pixel = (surfel.pixel & NEAR) | (pixel.y << 16u) | pixel.x;
    }
    return out;
}
