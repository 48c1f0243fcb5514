// Halves of pixels, two per pixel, row by row. Halves lie side by side and one above the other in alternate pixels.

#import frame

// Half at a position in sixteenths of pixels: column and row.
fn half_at(sixteenths: vec2u) -> u32 {
    let pixel = sixteenths / 4u;
    let along = select(sixteenths.y, sixteenths.x, ((pixel.x + pixel.y) & 1u) == 1u);
    return 2u * (pixel.y * frame.size.x + pixel.x) + (along / 2u & 1u);
}
