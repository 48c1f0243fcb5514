// Keys of values: unsigned numbers in the same order. Negative values have all bits inverted; the others have the sign
// bit set.

// Key of no value; the value would be NaN.
const NO_KEY = 0xffffffffu;

fn value_key(value: f32) -> u32 {
    let bits = bitcast<u32>(value);
    return bits ^ select(0x80000000u, 0xffffffffu, (bits >> 31u) == 1u);
}

// Bits of the value of a key.
fn key_bits(key: u32) -> u32 {
    return key ^ select(0xffffffffu, 0x80000000u, (key >> 31u) == 1u);
}
