// Patches of pixels, each drawn by a workgroup. Behind the pixels, `cover` has an element for each patch. Its `point`
// is `LEFT_EMPTY` if no splat meets the patch and all its pixels are written as empty.

#import frame

const LEFT_EMPTY = 1u;

// Columns and rows of patches.
fn patches() -> vec2u {
    return (frame.size + PATCH - 1u) / PATCH;
}

// Place in `cover` of what is told of a pixel's patch.
fn patch_mark(pixel: vec2u) -> u32 {
    let patch_at = pixel / PATCH;
    return frame.size.x * frame.size.y + patch_at.y * patches().x + patch_at.x;
}
