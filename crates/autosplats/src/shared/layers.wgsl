// Layers of the visible surface, as the splat stage leaves them, row by row.

// Cover of a pixel. Normal and depth are in another buffer.
struct Cover {
    // Sum of kernel weights; 0 without a surface.
    weight: f32,
    // Input of trimming: `EMPTY_RIM`, or the reach of the heaviest splat in pixels, negative in a core.
    rim: f32,
    // Index in the cloud of the heaviest splat's point.
    point: u32,
    scalar: f32,
}

const EMPTY_RIM = 0.0;

fn not_a_number() -> f32 {
    // A variable, because constant expressions must be finite.
    var bits = 0x7fc00000u;
    return bitcast<f32>(bits);
}
