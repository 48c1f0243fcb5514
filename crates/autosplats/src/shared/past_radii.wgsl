// K-radii kept from frame to frame. The halves of `past` have the bits of one for each pixel, 0 where there is none:
// one half of the last frame, one of this frame. Without kept radii it has a single element. What that holds does not
// matter, as the past changes the work of a search, never its result. The including pass binds it.

#import frame

// Place of a pixel's radius of the last frame.
fn past_at(pixel: u32) -> u32 {
    return frame.past_half * frame.size.x * frame.size.y + pixel;
}

// Place of a pixel's radius of this frame.
fn kept_at(pixel: u32) -> u32 {
    return (1u - frame.past_half) * frame.size.x * frame.size.y + pixel;
}
