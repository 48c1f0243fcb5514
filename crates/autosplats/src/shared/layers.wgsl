// Layers as splatting leaves them, row by row.

// Beside a buffer of normals with their depth: what covers a pixel.
struct Cover {
    // Sum of kernel weights; 0 where no surface is.
    weight: f32,
    // What trimming knows: `EMPTY_RIM`, or how far the heaviest splat reaches in pixels, below 0 in a core.
    rim: f32,
    // Index in the cloud of the heaviest splat's point.
    point: u32,
    scalar: f32,
}

const EMPTY_RIM = 0.0;

fn not_a_number() -> f32 {
    // Kept from being folded: a constant expression must be finite.
    var bits = 0x7fc00000u;
    return bitcast<f32>(bits);
}
