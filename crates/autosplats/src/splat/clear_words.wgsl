// Sets all words of a buffer to 0: the halves of pixels before a frame is kept.
//
// Writes: words.

#import frame
#import groups

@group(0) @binding(1) var<storage, read_write> words: array<u32>;

@compute @workgroup_size(LARGE_GROUP)
fn clear_words(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let at = group_index(workgroup) * LARGE_GROUP + local;
    if at < arrayLength(&words) {
        words[at] = 0u;
    }
}
