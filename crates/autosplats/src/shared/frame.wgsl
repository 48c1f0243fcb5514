// Uniform of all passes of a frame: camera and settings. In view space the eye is the origin, x points right, y down, z
// forward; distances are in world units.

struct Frame {
    view_from_world: mat3x3f,
    // Position of the eye relative to the cloud's origin.
    eye_local: vec3f,
    // Pixels per unit of y/z (perspective) or of y (orthographic). View space is stretched along x to have square
    // pixels.
    focal_px: f32,
    // Size of the screen in pixels: the picture and the margin around it.
    size: vec2u,
    // Points at this depth or nearer are dropped.
    near: f32,
    perspective: u32,
    k: u32,
    // 1 if each half of a pixel keeps its nearest point, 0 if each pixel does.
    halves: u32,
    grid_culling: u32,
    // 1 if the search is lenient towards gaps after one neighbour and towards outliers.
    lenient: u32,
    keep_outliers: u32,
    splat_scale: f32,
    // Radius within which a point must have a neighbour, in first search radii.
    outlier_growth: f32,
    // √λ; infinite if any gap is bridged.
    gap_growth: f32,
    // First radius of the kd-tree search, world units.
    first_radius: f32,
    // Largest ratio of an ellipse's semi-major to its semi-minor axis; 1 for circles.
    longest: f32,
    // Number of frames over which surfels are averaged; 1 if frames are independent.
    frames_averaged: f32,
    // 1 if the last frame had the same points.
    same_points: u32,
    // Size of the picture in pixels.
    picture: vec2u,
    // The half of the kept k-radii with those of the last frame: see `past_radii`.
    past_half: u32,
    // 1 if the last picture had the same points and settings and is to be averaged with.
    same_picture: u32,
    // The last frame, of the same size and kind of projection: transform from this view space into that one, and focal
    // length in pixels. The focal length is 0 if there is no last frame.
    past_rotation: mat3x3f,
    past_shift: vec3f,
    past_focal_px: f32,
    // Radius in pixels of the dots that all points are; 0 if they are drawn as a surface.
    dot_px: f32,
    // 1 if surfels on scan lines keep their full length.
    scan_lines: u32,
    // 1 if outliers are held against the density around them.
    compares_density: u32,
    // 1 if points near the eye are listed.
    near_cells: u32,
    // Where the optical axis meets the screen, and the last one, in pixels.
    middle: vec2f,
    past_middle: vec2f,
    // Factors on a view-space vector before the transposed rotation turns it into world axes; the fourth is 0.
    unstretched: vec4f,
    // The eye in world coordinates: the nearest numbers, and what they lack; the fourths are 0.
    eye_parts: array<vec4f, 2>,
}

@group(0) @binding(0) var<uniform> frame: Frame;


fn infinity() -> f32 {
    // A variable, because constant expressions must be finite.
    var bits = 0x7f800000u;
    return bitcast<f32>(bits);
}

fn is_finite(value: f32) -> bool {
    return (bitcast<u32>(value) & 0x7f800000u) != 0x7f800000u;
}

// Direction from a view-space position towards the eye, of any length.
fn to_eye(position: vec3f) -> vec3f {
    return select(vec3f(0.0, 0.0, -1.0), -position, frame.perspective == 1u);
}

// The normal of a surface at a view-space position, flipped if it faces away from the eye.
fn turned_to_eye(normal: vec3f, position: vec3f) -> vec3f {
    return select(normal, -normal, dot(normal, to_eye(position)) < 0.0);
}

fn to_view(position: vec3f) -> vec3f {
    return turned_to_view(position - frame.eye_local);
}

// What is this far from the eye, in world axes, in view space.
fn turned_to_view(from_eye: vec3f) -> vec3f {
    let m = frame.view_from_world;
    return m[0] * from_eye.x + m[1] * from_eye.y + m[2] * from_eye.z;
}

fn to_pixel(position_view: vec3f) -> vec2f {
    let scale = select(frame.focal_px, frame.focal_px / position_view.z, frame.perspective == 1u);
    return position_view.xy * scale + frame.middle;
}

// Size of a pixel in world units at a depth.
fn pixel_size(depth: f32) -> f32 {
    return select(1.0 / frame.focal_px, depth / frame.focal_px, frame.perspective == 1u);
}

fn unproject(pixel: vec2f, depth: f32) -> vec3f {
    return vec3f((pixel - frame.middle) * pixel_size(depth), depth);
}
