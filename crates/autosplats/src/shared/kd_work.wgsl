// Numbers of workgroups of the passes that build the kd-tree and search it. The pass binds `arguments`. Imports: groups.

const WORK_LARGE = 0u;
const WORK_CHUNKS = 1u;
const WORK_SMALL = 2u;
const WORK_POINTS = 3u;

fn put_work(kind: u32, items: u32, per_group: u32) {
    let number = (items + per_group - 1u) / per_group;
    arguments[3u * kind] = min(number, GROUPS_PER_ROW);
    arguments[3u * kind + 1u] = (number + GROUPS_PER_ROW - 1u) / GROUPS_PER_ROW;
    arguments[3u * kind + 2u] = 1u;
}
