// Division of whole numbers. Software devices divide integers one by one, but floats side by side.

// Quotient and remainder of numbers up to 2³¹; the quotient must be below 2²⁰.
fn divide(number: u32, by: u32) -> vec2u {
    // At most one off, because the float is exact to about 2⁻²² of the quotient.
    let quotient = u32(f32(number) / f32(by));
    let rest = i32(number - quotient * by);
    let is_high = rest < 0;
    let is_low = rest >= i32(by);
    return vec2u(
        quotient + select(0u, 1u, is_low) - select(0u, 1u, is_high),
        u32(rest + select(0, i32(by), is_high) - select(0, i32(by), is_low)),
    );
}
