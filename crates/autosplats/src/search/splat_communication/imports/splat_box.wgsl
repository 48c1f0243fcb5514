// Boxes that points draw over pixels [Paper, §4], two triangles each.

#import frame
#import communication
#import window

// The f of [Paper, §4]: depth in the mask. The bits of positive numbers ascend with the numbers; the highest 24 fit an
// f32, exact to 1 part in 65536 in any unit.
//
// Differs from the paper: its planes at z_near and z_far would have to be found first. This f lets slightly more points
// through.
fn mask_depth(depth: f32) -> f32 {
    return f32(bitcast<u32>(depth) >> 7u) * 0x1p-24;
}

// Depth of the splat of a sphere. Points up to z + r pass; the margin covers the step that they may share with the
// border.
fn splat_depth(center: vec3f, radius: f32) -> f32 {
    return mask_depth(center.z + radius) + 0x1p-23;
}

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
