// Counts a round's queries that have not converged. The including pass binds `arguments`, `convergence`, and `counters`
// for reading.

#import communication

var<workgroup> unconverged: atomic<u32>;

// To be called by all invocations of a workgroup, with whether the invocation's query has not converged.
fn count_unconverged(is_unconverged: bool, local: u32) {
    if local == 0u {
        atomicStore(&unconverged, 0u);
    }
    workgroupBarrier();
    if is_unconverged {
        atomicAdd(&unconverged, 1u);
    }
    workgroupBarrier();
    if local == 0u && atomicLoad(&unconverged) > 0u {
        let curve = arrayLength(&convergence) / 2u;
        atomicAdd(&convergence[counters[ROUND] * curve + arguments.iterations + 1u], atomicLoad(&unconverged));
    }
}
