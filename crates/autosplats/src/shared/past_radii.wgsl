// K-radii kept from frame to frame: `past` has the bits of one for each pixel of the last frame, then for each of this
// frame, or the other way round; 0 where there is none. It has a single element if no radii are kept. The including
// pass binds it.

#import frame

// Places of a pixel's radius of the last frame, and of this one.
fn past_at(pixel: u32) -> u32 {
    return frame.past_half * frame.size.x * frame.size.y + pixel;
}

fn kept_at(pixel: u32) -> u32 {
    return (1u - frame.past_half) * frame.size.x * frame.size.y + pixel;
}
