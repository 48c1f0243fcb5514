// Halves of pixels, two a pixel, row by row: they lie side by side and one below the other in turn. Imports: frame.

// The half at a place in sixteenths of pixels: column and row.
fn half_at(sixteenths: vec2u) -> u32 {
    let pixel = sixteenths / 4u;
    let along = select(sixteenths.y, sixteenths.x, ((pixel.x + pixel.y) & 1u) == 1u);
    return 2u * (pixel.y * frame.size.x + pixel.x) + (along / 2u & 1u);
}
