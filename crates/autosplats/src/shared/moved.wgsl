// Surfels that move. Imports: frame, surfel.

// A surfel with another centre, unless that is off the screen: it would have no pixel to be hidden at.
fn moved(surfel: Surfel, center: vec3f) -> Surfel {
    var out = surfel;
    let at = to_pixel(center);
    if center.z > frame.near && all(at >= vec2f(0.0)) && all(at < vec2f(frame.size)) {
        let pixel = vec2u(at);
        out.center = center;
        out.pixel = (pixel.y << 16u) | pixel.x;
    }
    return out;
}
