// Counts how searches ended. The including pass binds `counters`.

#import radius_search

fn count_ending(how: f32) {
    if how == CLAMPED_AT_GAP || how == OUT_OF_STEPS {
        atomicAdd(&counters[CLAMPED], 1u);
    }
    if how == OUT_OF_STEPS {
        atomicAdd(&counters[BOUNDED], 1u);
    }
}
