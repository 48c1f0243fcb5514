// A quantile of the scatter in balls of one size: a workgroup for each size of the densest third of the sample, then of the
// sparsest, then of all of it.
//
// Reads: sampled, scatters. Writes: quantiles, each as what it tells and its bits.

#import frame
#import scatters
#import quantiles

@group(0) @binding(1) var<storage, read> sampled: array<u32>;
@group(0) @binding(2) var<storage, read> scatters: array<u32>;
@group(0) @binding(3) var<storage, read_write> quantiles: array<vec2u>;

override SCALES: u32;
override SAMPLE: u32;
override LEAST_SAMPLE: u32;
override LEAST_SHARE: u32;
override THIN_SHARE: f32;
override QUANTILE: f32;

// Balls that hold enough to fit, and those that are thin.
var<workgroup> fitted: atomic<u32>;
var<workgroup> thin: atomic<u32>;
// Values below the one tried for each bit.
var<workgroup> below: array<atomic<u32>, 32>;

@compute @workgroup_size(64)
fn quantile(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let part = workgroup.x / SCALES;
    let scale = workgroup.x % SCALES;
    let kept = sampled[SAMPLE];
    let len = select(kept / 3u, kept, part == ALL);
    let begin = select(0u, kept - len, part == SPARSEST);
    let first = scale * SAMPLE + begin;
    if local < 32u {
        atomicStore(&below[local], 0u);
    }
    if local == 0u {
        atomicStore(&fitted, 0u);
        atomicStore(&thin, 0u);
    }
    workgroupBarrier();
    var own_fitted = 0u;
    var own_thin = 0u;
    for (var index = local; index < len; index += 64u) {
        let bits = scatters[first + index];
        own_fitted += select(0u, 1u, bits != TOO_FEW);
        own_thin += select(0u, 1u, bits < THICK);
    }
    atomicAdd(&fitted, own_fitted);
    atomicAdd(&thin, own_thin);
    workgroupBarrier();
    let all_fitted = atomicLoad(&fitted);
    let all_thin = atomicLoad(&thin);
    let is_thin = f32(all_thin) >= THIN_SHARE * f32(all_fitted);
    let at = u32(QUANTILE * f32(select(all_fitted, all_thin, is_thin)));
    // The largest value that at most `at` are below, bit by bit.
    var found = 0u;
    for (var bit = 31u; bit > 0u; bit--) {
        let tried = found | (1u << (bit - 1u));
        var own = 0u;
        for (var index = local; index < len; index += 64u) {
            let bits = scatters[first + index];
            let counts = bits != TOO_FEW && (bits < THICK || !is_thin);
            own += select(0u, 1u, counts && (bits & ~THICK) < tried);
        }
        atomicAdd(&below[bit], own);
        workgroupBarrier();
        found = select(found, tried, atomicLoad(&below[bit]) <= at);
    }
    if local == 0u {
        let tells = select(ALL_TELL, THIN_TELL, is_thin);
        let enough = all_fitted >= max(LEAST_SAMPLE, len / LEAST_SHARE);
        quantiles[workgroup.x] = vec2u(select(NONE_TELL, tells, enough), found);
    }
}
