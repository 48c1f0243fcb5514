// Notes which sixteenths of each pixel hold points. The CPU form, `sixteenths.rs`, says what for: here two pixels share a word.
// Imports: frame. Uses: the binding sixteenths.

// Adds a point at this column and row of sixteenths.
fn add_sixteenth(at: vec2u) {
    let pixel = at / 4u;
    let index = pixel.y * frame.size.x + pixel.x;
    let bit = 1u << (16u * (index % 2u) + 4u * (at.y % 4u) + at.x % 4u);
    // Most points find others there.
    if (atomicLoad(&sixteenths[index / 2u]) & bit) == 0u {
        atomicOr(&sixteenths[index / 2u], bit);
    }
}
