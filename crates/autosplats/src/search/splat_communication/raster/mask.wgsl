// Every screen point draws its pixel: its position, and its depth into the mask. With the mask, empty pixels and
// points too far away start no fragment [Paper, §4].
//
// Reads: points, density, counters. Writes: the position texture (view space, and the first search radius), and the
// depth mask.

#import frame
#import communication
#import first_radius
#import screen
#import splat_box

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read> density: array<DensityCell>;
@group(0) @binding(3) var<storage, read> counters: array<u32>;

struct Splat {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat) place: vec4f,
}

@vertex
fn mask_vertex(@builtin(vertex_index) vertex: u32) -> Splat {
    let point = points[vertex / BOX_VERTICES];
    let pixel = pixel_xy(point.pixel);
    let position = pixel_vertex(pixel, vertex, mask_depth(point.position_view.z));
    return Splat(position, vec4f(point.position_view, first_radius(point)));
}

@fragment
fn mask_fragment(splat: Splat) -> @location(0) vec4f {
    return splat.place;
}
