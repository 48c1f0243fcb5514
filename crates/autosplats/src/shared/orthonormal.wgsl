// A unit vector at right angles to the unit vector `v`.
fn any_orthonormal(v: vec3f) -> vec3f {
    let side = select(1.0, -1.0, (bitcast<u32>(v.z) >> 31u) == 1u);
    let a = -1.0 / (side + v.z);
    return vec3f(v.x * v.y * a, side + v.y * v.y * a, -v.y);
}
