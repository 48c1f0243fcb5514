// Finds the usual range of the listed values, their 1st and 99th percentile, as exactly as sorting would. One
// workgroup.
//
// Reads: keys. Writes: counters.
//
// Both keys are found byte by byte. Keys that begin like the one sought are counted by their next byte, and the counts
// show which byte follows.

#import frame
#import range_keys

// Keys, padded with `NO_KEY` to a multiple of `STRIDE_KEYS`.
@group(0) @binding(1) var<storage, read> keys: array<vec4u>;
@group(0) @binding(2) var<storage, read_write> counters: array<u32>;

// Counts of keys by their next byte: keys that begin like the lower end, then those like the upper end.
var<workgroup> bins: array<atomic<u32>, 512>;
// Cumulative counts for both ends, in two copies: one is written while the other is read.
var<workgroup> upto: array<vec2u, 512>;
// Known leading bytes of the two keys, and their ranks among the keys with the same beginning. Scalars, because
// invocations that write components of one vector may overwrite each other's.
var<workgroup> found: array<u32, 2>;
var<workgroup> ranks: array<u32, 2>;

// A run of successive keys that are equal in the bytes compared so far.
struct Run {
    key: u32,
    count: u32,
}

// A round: position of its byte, known bytes of the two keys, and whether these are the same.
struct Round {
    shift: u32,
    begins: vec2u,
    alike: bool,
}

fn count_run(run: Run, round: Round) {
    // Shifted twice, as a word cannot be shifted by its width.
    let begin = (run.key >> round.shift) >> 8u;
    let bin = (run.key >> round.shift) & 255u;
    if begin == round.begins.x {
        atomicAdd(&bins[bin], run.count);
    }
    if begin == round.begins.y && !round.alike {
        atomicAdd(&bins[256u + bin], run.count);
    }
}

fn extend(run: Run, key: u32, round: Round) -> Run {
    if key == NO_KEY {
        return run;
    }
    if run.count > 0u && (key >> round.shift) == (run.key >> round.shift) {
        return Run(run.key, run.count + 1u);
    }
    count_run(run, round);
    return Run(key, 1u);
}

fn extend_by_four(run: Run, four: vec4u, round: Round) -> Run {
    return extend(extend(extend(extend(run, four.x, round), four.y, round), four.z, round), four.w, round);
}

@compute @workgroup_size(256)
fn range(@builtin(local_invocation_index) local: u32) {
    let strides = arrayLength(&keys) / (STRIDE_KEYS / 4u);
    var begins = vec2u(0u);
    for (var byte = 0u; byte < 4u; byte++) {
        let round = Round(24u - 8u * byte, begins, begins.x == begins.y);
        atomicStore(&bins[local], 0u);
        atomicStore(&bins[256u + local], 0u);
        workgroupBarrier();
        // First bytes of neighbouring keys are mostly equal. Runs are counted at once, or all invocations would wait
        // for one bin.
        var run = Run(0u, 0u);
        for (var stride = 0u; stride < strides; stride++) {
            // Sixteen keys are in flight at a time.
            let first = stride * (STRIDE_KEYS / 4u) + local;
            let a = keys[first];
            let b = keys[first + 256u];
            let c = keys[first + 512u];
            let d = keys[first + 768u];
            run = extend_by_four(extend_by_four(run, a, round), b, round);
            run = extend_by_four(extend_by_four(run, c, round), d, round);
        }
        count_run(run, round);
        workgroupBarrier();

        let own = vec2u(atomicLoad(&bins[local]), atomicLoad(&bins[select(256u, 0u, round.alike) + local]));
        upto[local] = own;
        workgroupBarrier();
        var copy = 0u;
        for (var reach = 1u; reach < 256u; reach *= 2u) {
            var sum = upto[copy + local];
            if local >= reach {
                sum += upto[copy + local - reach];
            }
            copy = 256u - copy;
            upto[copy + local] = sum;
            workgroupBarrier();
        }
        if byte == 0u && local == 0u {
            // A hundredth of the values is excluded at each end.
            found = array(0u, 0u);
            let total = upto[copy + 255u].x;
            ranks = array(total / 100u, total - 1u - total / 100u);
        }
        workgroupBarrier();
        let rank = vec2u(ranks[0], ranks[1]);
        let end = upto[copy + local];
        let before = end - own;
        workgroupBarrier();
        if rank.x >= before.x && rank.x < end.x {
            found[0] = (begins.x << 8u) | local;
            ranks[0] = rank.x - before.x;
        }
        if rank.y >= before.y && rank.y < end.y {
            found[1] = (begins.y << 8u) | local;
            ranks[1] = rank.y - before.y;
        }
        workgroupBarrier();
        begins = vec2u(found[0], found[1]);
    }
    if local == 0u {
        let any = upto[255].x > 0u;
        counters[RANGE_LOW] = select(bitcast<u32>(0.0), key_bits(begins.x), any);
        counters[RANGE_HIGH] = select(bitcast<u32>(1.0), key_bits(begins.y), any);
    }
}
