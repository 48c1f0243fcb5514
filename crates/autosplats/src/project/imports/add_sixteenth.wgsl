// Marks the sixteenths of each pixel that hold points: see the CPU form, `sixteenths.rs`. Two pixels share a word.
// Uses: the binding `sixteenths`.

#import frame

// Marks the sixteenth at this column and row.
fn add_sixteenth(at: vec2u) {
    let pixel = at / 4u;
    let index = pixel.y * frame.size.x + pixel.x;
    let bit = 1u << (16u * (index % 2u) + 4u * (at.y % 4u) + at.x % 4u);
    // Most bits are set already: a load is cheaper.
    if (atomicLoad(&sixteenths[index / 2u]) & bit) == 0u {
        atomicOr(&sixteenths[index / 2u], bit);
    }
}
