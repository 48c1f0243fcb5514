// Sets all words of a buffer to 0: refinement begins with no cell marked, the trim with no centre in any pixel, a frame to
// be looked back at with no point in any half of a pixel.
//
// Writes: words.

#import frame
#import groups

@group(0) @binding(1) var<storage, read_write> words: array<u32>;

@compute @workgroup_size(256)
fn clear_words(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let at = group_index(workgroup) * 256u + local;
    if at < arrayLength(&words) {
        words[at] = 0u;
    }
}
