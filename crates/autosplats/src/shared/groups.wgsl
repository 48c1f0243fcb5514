// Index of a workgroup in a dispatch of several rows, which more than 65535 workgroups need.

fn group_index(workgroup: vec3u) -> u32 {
    return workgroup.y * GROUPS_PER_ROW + workgroup.x;
}
