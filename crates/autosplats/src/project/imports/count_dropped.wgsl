// Counts the points that cannot own a pixel, by reason: one atomic addition per workgroup and reason. The including
// pass binds `counters` as atomics.

#import project_point

var<workgroup> dropped: array<atomic<u32>, 3>;

// To be called by all invocations; ends with a barrier.
fn count_dropped_clear(local: u32) {
    if local < 3u {
        atomicStore(&dropped[local], 0u);
    }
    workgroupBarrier();
}

fn count_dropped(slot: u32) {
    // The counters NOT_FINITE, BEHIND and OUTSIDE are 0, 1 and 2; their slots count down from the largest number.
    atomicAdd(&dropped[SLOT_NOT_FINITE - slot], 1u);
}

// To be called by all invocations; begins with a barrier.
fn count_dropped_finish(local: u32) {
    workgroupBarrier();
    if local < 3u {
        let count = atomicLoad(&dropped[local]);
        if count > 0u {
            atomicAdd(&counters[NOT_FINITE + local], count);
        }
    }
}
