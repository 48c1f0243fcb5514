// Quantiles of scatter, a workgroup each: for every ball size of the sample's densest third, of its sparsest third, of
// all, and of all by steady shares.
//
// Reads: sampled, scatters, picked. Writes: quantiles. After them, for each of the first sizes, the steady share of the
// largest size up to it that has one; below 0 if none has.

#import frame
#import quantiles
#import scatters

@group(0) @binding(1) var<storage, read> sampled: array<u32>;
@group(0) @binding(2) var<storage, read> scatters: array<u32>;
@group(0) @binding(3) var<storage, read_write> quantiles: array<Quantile>;
@group(0) @binding(4) var<storage, read> picked: array<u32>;

// Number of ball sizes that are measured at first.
override FIRST_SCALES: u32;

// Balls that hold enough to fit, and thin balls: of the workgroup's size, then of the next.
var<workgroup> fitted: array<atomic<u32>, 2>;
var<workgroup> thin: array<atomic<u32>, 2>;
// For each of the first sizes: the whole sample's thin balls with a fitted next ball, and the steady ones of them.
var<workgroup> pairs: array<atomic<u32>, STEADY_SCALES>;
var<workgroup> steady: array<atomic<u32>, STEADY_SCALES>;
// Scatters of the part's balls of the workgroup's size, `TOO_FEW` for all others.
var<workgroup> values: array<u32, MOST_SAMPLED>;
// Rounds of three bits each in which the quantile is found, the first of a single bit, as values have 31.
const ROUNDS = 11u;
// For each round, the numbers of values below the candidates 1 to 8, two to a word.
var<workgroup> below: array<atomic<u32>, 4u * ROUNDS>;

// Steady share of a size; below 0 if too few balls are thin.
fn steady_share(size: u32) -> f32 {
    let count = atomicLoad(&pairs[size]);
    return select(-1.0, f32(atomicLoad(&steady[size])) / f32(max(count, 1u)), count >= LEAST_PAIRS);
}

@compute @workgroup_size(SMALL_GROUP)
fn quantile(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let part = workgroup.x / SCALES;
    let scale = workgroup.x % SCALES;
    let kept = sampled[MOST_SAMPLED];
    let len = select(kept / 3u, kept, part >= ALL);
    let begin = select(0u, kept - len, part == SPARSEST);
    let measured = select(FIRST_SCALES, SCALES, picked[MEASURED] > 0u);
    let scales = vec2u(scale, min(scale + 1u, SCALES - 1u));
    let firsts = scales * MOST_SAMPLED;
    if local < 2u {
        atomicStore(&fitted[local], 0u);
        atomicStore(&thin[local], 0u);
    }
    if local < 4u * ROUNDS {
        atomicStore(&below[local], 0u);
    }
    if local < STEADY_SCALES {
        atomicStore(&pairs[local], 0u);
        atomicStore(&steady[local], 0u);
    }
    workgroupBarrier();
    var own_fitted = vec2u(0u);
    var own_thin = vec2u(0u);
    for (var index = local; index < kept; index += SMALL_GROUP) {
        // Ranks before the part wrap around, and are far too large.
        let is_of_part = sampled[RANKS + index] - begin < len;
        let is_known = vec2<bool>(is_of_part) & (scales < vec2u(measured));
        let bits = select(vec2u(TOO_FEW), vec2u(scatters[firsts.x + index], scatters[firsts.y + index]), is_known);
        values[index] = bits.x;
        own_fitted += select(vec2u(0u), vec2u(1u), bits != vec2u(TOO_FEW));
        own_thin += select(vec2u(0u), vec2u(1u), bits < vec2u(THICK));
    }
    for (var size = 0u; size < STEADY_SCALES && size + 1u < measured && scale < STEADY_SCALES; size++) {
        var own_pairs = 0u;
        var own_steady = 0u;
        for (var index = local; index < kept; index += SMALL_GROUP) {
            let bits = vec2u(scatters[size * MOST_SAMPLED + index], scatters[(size + 1u) * MOST_SAMPLED + index]);
            if bits.x > 0u && bits.x < THICK && bits.y != TOO_FEW {
                own_pairs += 1u;
                let distance = bitcast<vec2f>(bits & vec2u(~THICK));
                own_steady += select(0u, 1u, distance.y < MAX_STEADY_RATIO * distance.x);
            }
        }
        atomicAdd(&pairs[size], own_pairs);
        atomicAdd(&steady[size], own_steady);
    }
    for (var size = 0u; size < 2u; size++) {
        atomicAdd(&fitted[size], own_fitted[size]);
        atomicAdd(&thin[size], own_thin[size]);
    }
    workgroupBarrier();
    let least = max(LEAST_SAMPLE, len / MIN_BALL_SHARE_DIVISOR);
    let all_fitted = atomicLoad(&fitted[0]);
    let all_thin = atomicLoad(&thin[0]);
    let next_fitted = atomicLoad(&fitted[1]);
    let share = f32(all_thin) / f32(max(all_fitted, 1u));
    let next_share = f32(atomicLoad(&thin[1])) / f32(max(next_fitted, 1u));
    let rises = scale + 1u < SCALES && !(next_fitted >= least && next_share <= share + MAX_THIN_SHARE_RISE);
    let is_thin = share >= THIN_SHARE && (share >= 1.0 - MAX_THIN_SHARE_RISE || !rises);
    let first_steady = steady_share(0u);
    var most_steady = first_steady;
    for (var size = 1u; size < STEADY_SCALES && size <= scale; size++) {
        most_steady = max(most_steady, steady_share(size));
    }
    let is_asked = is_thin && part == STEADY_ALL;
    let differs = saturate((first_steady - UNEVEN_NOISE_SHARES[0]) * (1.0 / (UNEVEN_NOISE_SHARES[1] - UNEVEN_NOISE_SHARES[0])));
    let raised = select(0.0, differs * (UNEVEN_NOISE_QUANTILE - NOISE_QUANTILE), is_asked && scale == 0u);
    let at = u32((NOISE_QUANTILE + raised) * f32(select(all_fitted, all_thin, is_thin)));
    // The largest value with at most `at` values below it, found three bits at a time.
    var found = 0u;
    for (var round = 0u; round < ROUNDS; round++) {
        let shift = 3u * (ROUNDS - 1u - round);
        var own = vec4u(0u);
        for (var index = local; index < kept; index += SMALL_GROUP) {
            let bits = values[index];
            if bits != TOO_FEW && (bits < THICK || !is_thin) {
                let value = bits & ~THICK;
                // The value lies below all greater candidates.
                let candidate = select(0u, min((value - found) >> shift, 8u), value >= found);
                own += select(vec4u(0u), vec4u(1u), vec4u(candidate) < vec4u(1u, 3u, 5u, 7u));
                own += select(vec4u(0u), vec4u(0x10000u), vec4u(candidate) < vec4u(2u, 4u, 6u, 8u));
            }
        }
        for (var word = 0u; word < 4u; word++) {
            atomicAdd(&below[4u * round + word], own[word]);
        }
        workgroupBarrier();
        var next = 0u;
        for (var candidate = 1u; candidate <= min(7u, (THICK - 1u - found) >> shift); candidate++) {
            let word = atomicLoad(&below[4u * round + (candidate - 1u) / 2u]);
            next = select(next, candidate, ((word >> (16u * ((candidate - 1u) % 2u))) & 0xffffu) <= at);
        }
        found |= next << shift;
    }
    let is_noise = saturate((most_steady - NOISE_SHARES[0]) * (1.0 / (NOISE_SHARES[1] - NOISE_SHARES[0])));
    if is_asked && scale < STEADY_SCALES && most_steady >= 0.0 {
        found = bitcast<u32>(is_noise * bitcast<f32>(found));
    }
    if local == 0u && part == STEADY_ALL && scale < STEADY_SCALES {
        var of_largest = first_steady;
        for (var size = 1u; size <= scale; size++) {
            of_largest = select(of_largest, steady_share(size), steady_share(size) >= 0.0);
        }
        quantiles[SAMPLE_PARTS * SCALES + scale] = Quantile(TOO_FEW_BALLS, of_largest);
    }
    if local == 0u {
        let tells = select(OF_ALL_BALLS, OF_THIN_BALLS, is_thin);
        quantiles[workgroup.x] = Quantile(select(TOO_FEW_BALLS, tells, all_fitted >= least), bitcast<f32>(found));
    }
}
