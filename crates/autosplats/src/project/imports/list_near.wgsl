// Lists the points of the sparse cells around the eye after the screen points, if any is near: see `near.rs`. The list
// has their ordinals, for which `compact` puts indices. Each invocation takes a run of cells. The including pass binds
// `near` for reading, and `counters`, `source` and `arguments`.

#import frame
#import near_cells
#import near_points
#import put_work

const CELLS_EACH = NEAR_CELLS / LARGE_GROUP;

var<workgroup> before: array<u32, LARGE_GROUP + 1u>;
// Points in the sparse cells of each octave.
var<workgroup> in_octave: array<atomic<u32>, OCTAVES>;
// 1 if any point is near.
var<workgroup> any_near: atomic<u32>;

// Number of points of a cell if it is sparse, else 0.
fn sparse_len(cell: u32) -> u32 {
    return select(0u, near[cell], near[cell] <= SPARSE_POINTS);
}

// Whether an entry comes before another: by the bits of positions, then by ordinal.
fn is_before(a: u32, b: u32) -> bool {
    for (var word = 1u; word < ENTRY_WORDS; word++) {
        if near[a + word] != near[b + word] {
            return near[a + word] < near[b + word];
        }
    }
    return near[a] < near[b];
}

// To be called by all invocations of one workgroup of LARGE_GROUP.
fn list_near(local: u32) {
    if local == 0u {
        atomicStore(&any_near, 0u);
    }
    if local < OCTAVES {
        atomicStore(&in_octave[local], 0u);
    }
    workgroupBarrier();
    // Cells side by side go to different invocations, as points lie together.
    for (var cell = local; cell < NEAR_CELLS; cell += LARGE_GROUP) {
        atomicAdd(&in_octave[octave_of(cell)], sparse_len(cell));
    }
    workgroupBarrier();
    var octaves = 0u;
    var total = 0u;
    while octaves < OCTAVES && total + atomicLoad(&in_octave[octaves]) <= MOST_NEAR {
        total += atomicLoad(&in_octave[octaves]);
        octaves += 1u;
    }
    let end = octaves * OCTAVE_CELLS;
    for (var cell = local; cell < end; cell += LARGE_GROUP) {
        let len = select(0u, near[cell], near[cell] <= NEAR_POINTS);
        for (var entry = 0u; entry < len && atomicLoad(&any_near) == 0u; entry++) {
            let at = near_entries(cell) + entry * ENTRY_WORDS;
            let place = bitcast<vec3f>(vec3u(near[at + 1u], near[at + 2u], near[at + 3u]));
            if is_near_at(place, octaves) {
                atomicStore(&any_near, 1u);
            }
        }
    }
    let first = local * CELLS_EACH;
    let last = min(first + CELLS_EACH, end);
    var own = 0u;
    for (var cell = first; cell < last; cell++) {
        own += sparse_len(cell);
    }
    before[local + 1u] = own;
    workgroupBarrier();
    if local == 0u {
        before[0] = 0u;
        for (var run = 1u; run <= LARGE_GROUP; run++) {
            before[run] += before[run - 1u];
        }
    }
    workgroupBarrier();
    let is_listed = frame.near_cells == 1u && atomicLoad(&any_near) == 1u && total > frame.k;
    let near_first = counters[NEAR_FIRST];
    if local == 0u {
        let visible = near_first + select(0u, total, is_listed);
        counters[LISTED_OCTAVES] = octaves;
        counters[VISIBLE] = visible;
        put_work(VISIBLE256, visible, LARGE_GROUP);
        // One block at least: the last tells how many points are active.
        put_work(VISIBLE_BLOCKS, max(visible, 1u), RANK_BLOCK_FLAGS);
    }
    if !is_listed {
        return;
    }
    var place = near_first + before[local];
    for (var cell = first; cell < last; cell++) {
        let len = sparse_len(cell);
        let first_entry = near_entries(cell);
        // Entries are in any order: each counts those before it.
        for (var entry = 0u; entry < len; entry++) {
            let own_entry = first_entry + entry * ENTRY_WORDS;
            var rank = 0u;
            for (var other = 0u; other < len; other++) {
                rank += u32(is_before(first_entry + other * ENTRY_WORDS, own_entry));
            }
            source[place + rank] = near[own_entry];
        }
        place += len;
    }
}
