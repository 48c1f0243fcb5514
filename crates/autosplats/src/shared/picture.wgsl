// The picture's part of the screen: all but the margin. Imports: frame.

// Where a pixel of the picture lies in what there is one of for each pixel of the screen.
fn screen_index(pixel: vec2u) -> u32 {
    return (pixel.y + frame.margin) * frame.size.x + pixel.x + frame.margin;
}

// How many pixels a pixel of the screen is away from the picture, along the axis where it is more; 0 in the picture.
fn beside_picture(pixel: vec2u) -> u32 {
    let first = vec2u(frame.margin);
    let end = frame.size - frame.margin;
    let beside = max(first - min(pixel, first), max(pixel + 1u, end) - end);
    return max(beside.x, beside.y);
}
