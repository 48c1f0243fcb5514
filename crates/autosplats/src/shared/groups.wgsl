// Workgroups that were dispatched in rows, numbered again: more than 65535 need a second dimension.

const GROUPS_PER_ROW = 32768u;

fn group_index(workgroup: vec3u) -> u32 {
    return workgroup.y * GROUPS_PER_ROW + workgroup.x;
}
