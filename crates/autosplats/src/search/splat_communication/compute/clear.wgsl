// Clears the bits of pixels, a word an invocation.
//
// Writes: pixels.

#import frame
#import groups
#import pixel_words

@group(0) @binding(1) var<storage, read_write> pixels: array<u32>;

@compute @workgroup_size(LARGE_GROUP)
fn clear(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let word = bits_start() + group_index(workgroup) * LARGE_GROUP + local;
    if word < arrayLength(&pixels) {
        pixels[word] = 0u;
    }
}
