// Workgroups that draw splats: one for each LARGE_GROUP, and enough for a few splats of any size.

// Fewest workgroups.
override DRAWING_GROUPS: u32;

fn drawing_groups(len: u32) -> u32 {
    return select(max((len + LARGE_GROUP - 1u) / LARGE_GROUP, DRAWING_GROUPS), 0u, len == 0u);
}
