// Every screen point marks its pixel and forgets what it was told. No point is a query yet.
//
// Reads: points, density, counters. Writes: pixels, searches, told.

#import frame
#import first_radius
#import groups
#import pixel_words
#import screen
#import told

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read> density: array<DensityCell>;
@group(0) @binding(3) var<storage, read> counters: array<u32>;
@group(0) @binding(4) var<storage, read_write> pixels: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> searches: array<PointSearch>;
@group(0) @binding(6) var<storage, read_write> told: array<Told>;

@compute @workgroup_size(LARGE_GROUP)
fn place(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup) * LARGE_GROUP + local;
    if index >= counters[VISIBLE] {
        return;
    }
    let point = points[index];
    let pixel = pixel_xy(point.pixel);
    let starts = row_starts(pixel.y);
    let word = pixel.x / 32u;
    atomicStore(&pixels[pixel.y * frame.size.x + pixel.x], index);
    atomicOr(&pixels[starts.x + word], 1u << (pixel.x % 32u));
    atomicOr(&pixels[starts.y + word / 32u], 1u << (word % 32u));
    searches[index] = PointSearch(0.0, 0.0, 0.0, first_radius(point));
    atomicStore(&told[index].feedback, 0u);
    forget_answers(index);
}
