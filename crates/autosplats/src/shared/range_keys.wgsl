// Values as numbers that order as they do: negative ones with all bits turned, the others above them.

// Stands for no value: it would be one that is not a number.
const NO_KEY = 0xffffffffu;

fn value_key(value: f32) -> u32 {
    let bits = bitcast<u32>(value);
    return bits ^ select(0x80000000u, 0xffffffffu, (bits >> 31u) == 1u);
}

// The bits of the value of a key.
fn key_bits(key: u32) -> u32 {
    return key ^ select(0xffffffffu, 0x80000000u, (key >> 31u) == 1u);
}
