// Counts points that own no pixel because they cannot, by reason: one atomic addition per workgroup and reason.
// Imports: project_point, counters. The including pass binds `counters` as atomics.

var<workgroup> dropped: array<atomic<u32>, 3>;

// Call from all; a barrier follows.
fn count_dropped_clear(local: u32) {
    if local < 3u {
        atomicStore(&dropped[local], 0u);
    }
    workgroupBarrier();
}

fn count_dropped(slot: u32) {
    // NOT_FINITE, BEHIND and OUTSIDE are 0, 1, 2, and so count the slots that stand for them down from the greatest.
    atomicAdd(&dropped[SLOT_NOT_FINITE - slot], 1u);
}

// Call from all; a barrier goes before.
fn count_dropped_finish(local: u32) {
    workgroupBarrier();
    if local < 3u {
        let count = atomicLoad(&dropped[local]);
        if count > 0u {
            atomicAdd(&counters[NOT_FINITE + local], count);
        }
    }
}
