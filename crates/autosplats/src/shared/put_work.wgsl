// Number of workgroups of an indirect dispatch. The including pass binds `arguments`.

struct Dispatch {
    columns: u32,
    rows: u32,
    layers: u32,
}

// Sets the arguments of dispatch number `kind` to this many workgroups.
fn put_groups(kind: u32, number: u32) {
    arguments[kind] = Dispatch(min(number, GROUPS_PER_ROW), (number + GROUPS_PER_ROW - 1u) / GROUPS_PER_ROW, 1u);
}

// Sets the arguments of dispatch number `kind`; each workgroup takes `per_group` of the `items`.
fn put_work(kind: u32, items: u32, per_group: u32) {
    put_groups(kind, (items + per_group - 1u) / per_group);
}
