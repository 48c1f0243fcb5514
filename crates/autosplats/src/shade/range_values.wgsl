// Lists the values of sampled pixels as keys in the same order, from which the usual range is found.
//
// Reads: surface, cover, extras. Writes: keys.

#import frame
#import groups
#import layers
#import picture
#import range_keys
#import shading

@group(0) @binding(2) var<storage, read> surface: array<vec4f>;
@group(0) @binding(3) var<storage, read> cover: array<Cover>;
@group(0) @binding(4) var<storage, read> extras: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> keys: array<u32>;

@compute @workgroup_size(LARGE_GROUP)
fn range_values(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let sample = group_index(workgroup) * LARGE_GROUP + local;
    if sample >= arrayLength(&keys) {
        return;
    }
    var key = NO_KEY;
    if sample < shading.samples {
        let at = sample * shading.sample_step;
        let pixel = vec2u(at % frame.picture.x, at / frame.picture.x);
        let index = screen_index(pixel);
        let depth = surface[index].w;
        let value = shown_value(pixel, index, depth);
        if is_covered(depth) && is_finite(value) {
            key = value_key(value);
        }
    }
    keys[sample] = key;
}
