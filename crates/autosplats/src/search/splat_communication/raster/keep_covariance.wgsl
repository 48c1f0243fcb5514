// Stores each query's second moments from its pixel.
//
// Reads: points, queries, counters and both radius textures. Writes: neighborhoods.

#import frame
#import groups
#import neighborhood
#import screen

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read> queries: array<u32>;
@group(0) @binding(3) var<storage, read> counters: array<u32>;
@group(0) @binding(4) var<storage, read_write> neighborhoods: array<Neighborhood>;
@group(0) @binding(5) var first_products: texture_2d<f32>;
@group(0) @binding(6) var last_products: texture_2d<f32>;

@compute @workgroup_size(LARGE_GROUP)
fn keep_covariance(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let first = counters[ROUND_FIRST];
    let len = counters[ROUND_LEN];
    let index = group_index(workgroup) * LARGE_GROUP + local;
    if index >= len {
        return;
    }
    let pixel = pixel_xy(points[queries[first + index]].pixel);
    let xx_yy = textureLoad(first_products, pixel, 0);
    neighborhoods[first + index].second_x = xx_yy.xyz;
    neighborhoods[first + index].second_yz = vec3f(xx_yy.w, textureLoad(last_products, pixel, 0).xy);
}
