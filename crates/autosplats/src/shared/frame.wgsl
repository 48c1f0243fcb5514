// What all passes of a frame are told: the camera and the settings. View space has the eye at the origin, x right, y down,
// z forward; distances are world distances.

struct Frame {
    view_from_world: mat3x3f,
    // The eye relative to the cloud's origin.
    eye_local: vec3f,
    // Pixels per unit of x/z (perspective) or of x (orthographic).
    focal_px: f32,
    // Of the screen in pixels: the picture, and a margin around it.
    size: vec2u,
    // Points at this depth or nearer are dropped.
    near: f32,
    perspective: u32,
    k: u32,
    // 1 if each half of a pixel keeps its nearest point, 0 if each pixel does.
    halves: u32,
    grid_culling: u32,
    // 1 if what the fit leaves is adapted.
    adaptive: u32,
    keep_outliers: u32,
    splat_scale: f32,
    // A point must have a neighbour within this many first search radii.
    outlier_growth: f32,
    // √λ.
    gap_growth: f32,
    // Of the kd-tree search, world units.
    first_radius: f32,
    // Longest ellipse, semi-major over semi-minor axis; 1 for circles.
    longest: f32,
    // Over how many frames surfels are averaged; 1 if each frame is taken by itself.
    frames_averaged: f32,
    // 1 if the last frame was one of the same points.
    same_points: u32,
    // Size of the picture in pixels, and the pixels of the screen on every side of it.
    picture: vec2u,
    margin: u32,
    // 1 if the last picture was one of the same points, made in the same way, and is to be averaged with.
    same_picture: u32,
    // Of the last frame, which had the same size and kind of projection: how its view space comes from this one, and its focal
    // length, 0 if nothing is known of it.
    past_rotation: mat3x3f,
    past_shift: vec3f,
    past_focal_px: f32,
    // Radius in pixels of the dots that all points are; 0 if they are surface.
    dot_px: f32,
}

@group(0) @binding(0) var<uniform> frame: Frame;

// Greatest finite f32; WGSL has no literal for infinity.
const MOST = 3.4028234663852886e38;
const NO_POINT = 0xffffffffu;

fn infinity() -> f32 {
    // Kept from being folded: a constant expression must be finite.
    var bits = 0x7f800000u;
    return bitcast<f32>(bits);
}

fn is_finite(value: f32) -> bool {
    return (bitcast<u32>(value) & 0x7f800000u) != 0x7f800000u;
}

// From a view-space position towards the eye; not of unit length.
fn to_eye(position: vec3f) -> vec3f {
    return select(vec3f(0.0, 0.0, -1.0), -position, frame.perspective == 1u);
}

// A normal of a surface at a view-space position, on the side of the eye.
fn turned_to_eye(normal: vec3f, position: vec3f) -> vec3f {
    return select(normal, -normal, dot(normal, to_eye(position)) < 0.0);
}

fn to_view(position: vec3f) -> vec3f {
    let p = position - frame.eye_local;
    let m = frame.view_from_world;
    return m[0] * p.x + m[1] * p.y + m[2] * p.z;
}

fn to_pixel(position_view: vec3f) -> vec2f {
    let scale = select(frame.focal_px, frame.focal_px / position_view.z, frame.perspective == 1u);
    return position_view.xy * scale + 0.5 * vec2f(frame.size);
}

// Size of a pixel in world units at a depth.
fn pixel_size(depth: f32) -> f32 {
    return select(1.0 / frame.focal_px, depth / frame.focal_px, frame.perspective == 1u);
}

fn unproject(pixel: vec2f, depth: f32) -> vec3f {
    return vec3f((pixel - 0.5 * vec2f(frame.size)) * pixel_size(depth), depth);
}
