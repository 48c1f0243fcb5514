// Data shared by all queries of a search's workgroup. The including pass binds `counters` as atomics.

#import window
#import window_points

struct SearchTask {
    // First query of the round among those of both rounds.
    first: u32,
    len: u32,
    // Number of queries that `search_four` leaves to `search`.
    left: u32,
    visible: u32,
    // First point of the sparse cells around the eye.
    near_first: u32,
    strip_px: u32,
    cell_px: u32,
    cell_columns: u32,
}

var<workgroup> task: SearchTask;

// Index of the counter of the queries left.
fn left_counter() -> u32 {
    return LEFT_ACTIVE + atomicLoad(&counters[ROUND]);
}

// To be called by one invocation; a barrier must follow.
fn task_load() {
    task.first = atomicLoad(&counters[ROUND_FIRST]);
    task.len = atomicLoad(&counters[ROUND_LEN]);
    task.left = atomicLoad(&counters[left_counter()]);
    task.visible = atomicLoad(&counters[VISIBLE]);
    task.near_first = atomicLoad(&counters[NEAR_FIRST]);
    task.strip_px = atomicLoad(&counters[STRIP_PX]);
    task.cell_px = atomicLoad(&counters[CELL_PX]);
    task.cell_columns = atomicLoad(&counters[CELL_COLUMNS]);
}

// Whether the bound on searches is larger than this radius. Possible bounds are a factor BOUND_STEP apart.
fn is_unbounded(center: vec3f, radius: f32) -> bool {
    let beyond = window_of_sphere(center, 1.01 * BOUND_STEP * radius);
    return window_len(beyond, task.strip_px, MAX_CANDIDATES) <= MAX_CANDIDATES;
}
