// Keys of the depth map, whose depths are pushed back by ε. Keys are integers in the order of the depths, negative ones
// included, so that an atomic minimum keeps the nearest.

fn depth_key(depth: f32) -> u32 {
    let bits = bitcast<u32>(depth);
    return bits ^ select(0x80000000u, 0xffffffffu, bits >= 0x80000000u);
}

fn key_depth(key: u32) -> f32 {
    return bitcast<f32>(key ^ select(0xffffffffu, 0x80000000u, key >= 0x80000000u));
}
