// K-radii kept from frame to frame: `past` has the bits of one for each pixel of the last frame, then for each of this
// frame, or the other way round; 0 where there is none. If no radii are kept it has a single element, whatever that
// holds: the past changes the work of a search, never its result. The including pass binds it.

#import frame

// Place of a pixel's radius of the last frame.
fn past_at(pixel: u32) -> u32 {
    return frame.past_half * frame.size.x * frame.size.y + pixel;
}

// Place of a pixel's radius of this frame.
fn kept_at(pixel: u32) -> u32 {
    return (1u - frame.past_half) * frame.size.x * frame.size.y + pixel;
}
