// Boxes that points draw over pixels [Paper, §4], two triangles each.

#import frame
#import communication
#import depth_mask
#import window

// Corner of a box of whole pixels.
fn box_vertex(window: Window, vertex: u32, depth: f32) -> vec4f {
    let corner = vertex % BOX_VERTICES;
    let is_high = vec2<bool>(corner == 1u || corner >= 4u, corner == 2u || corner == 3u || corner == 5u);
    let pixel = select(window.low, window.high + 1.0, is_high);
    let clip = 2.0 * pixel / vec2f(frame.size) - 1.0;
    return vec4f(clip.x, -clip.y, depth, 1.0);
}

// A splat of one pixel.
fn pixel_vertex(pixel: vec2u, vertex: u32, depth: f32) -> vec4f {
    return box_vertex(Window(vec2f(pixel), vec2f(pixel)), vertex, depth);
}

// The neighbourhood box: tight about the projected sphere. A radius of 0 covers the point's own pixel.
fn splat_vertex(center: vec3f, radius: f32, pixel: vec2u, vertex: u32) -> vec4f {
    let depth = splat_depth(center, radius);
    if radius > 0.0 {
        return box_vertex(window_of_sphere(center, radius), vertex, depth);
    }
    return pixel_vertex(pixel, vertex, depth);
}

// A splat that covers no pixel.
fn no_vertex() -> vec4f {
    return vec4f(2.0, 2.0, 1.0, 1.0);
}
