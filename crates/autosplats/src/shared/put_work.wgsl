// Number of workgroups of an indirect dispatch. The including pass binds `arguments`.

// Sets the arguments of dispatch number `kind`; each workgroup takes `per_group` of the `items`.
fn put_work(kind: u32, items: u32, per_group: u32) {
    let number = (items + per_group - 1u) / per_group;
    arguments[3u * kind] = min(number, GROUPS_PER_ROW);
    arguments[3u * kind + 1u] = (number + GROUPS_PER_ROW - 1u) / GROUPS_PER_ROW;
    arguments[3u * kind + 2u] = 1u;
}
