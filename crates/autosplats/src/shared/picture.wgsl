// The picture's part of the screen: the screen without the margin.

#import frame

// Width of the margin around the picture in pixels.
fn margin() -> u32 {
    return (frame.size.x - frame.picture.x) / 2u;
}

// Index of a pixel of the picture in screen-sized buffers.
fn screen_index(pixel: vec2u) -> u32 {
    return (pixel.y + margin()) * frame.size.x + pixel.x + margin();
}

// Distance in pixels of a screen pixel from the picture, along the axis where it is larger; 0 in the picture.
fn beside_picture(pixel: vec2u) -> u32 {
    let first = vec2u(margin());
    let end = frame.size - margin();
    let beside = max(first - min(pixel, first), max(pixel + 1u, end) - end);
    return max(beside.x, beside.y);
}
