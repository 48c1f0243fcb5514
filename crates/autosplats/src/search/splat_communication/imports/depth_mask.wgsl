// The depth mask: which pixels have no point near enough for a splat [Paper, §4].

// The f of [Paper, §4]: depth in the mask. The bits of positive numbers ascend with the numbers; the highest 24 fit an
// f32, exact to 1 part in 65536 in any unit.
//
// Differs from the paper: its planes at z_near and z_far would have to be found first. This f lets slightly more points
// through.
fn mask_depth(depth: f32) -> f32 {
    return f32(bitcast<u32>(depth) >> 7u) * 0x1p-24;
}

// Depth of the splat of a sphere, which passes where it is GREATER than the mask. Points up to z + r pass; the margin
// covers the step that they may share with the border.
fn splat_depth(center: vec3f, radius: f32) -> f32 {
    return mask_depth(center.z + radius) + 0x1p-23;
}
