// The noise level: how far points scatter about the surface. See the CPU form. Counts the workgroups that fit sheets:
// none where nothing is noisy. Those that fit balls are counted by `adapt`. Where the ball sizes that are measured at
// first do not tell the noise, it counts those that measure the others instead; its second run then tells the noise.
// One invocation.
//
// Reads: surfels, sampled, quantiles, levels, depth_noise. Reads and writes: picked. Writes: statistics, arguments.

#import frame
#import depth_noise
#import levels
#import noise
#import put_work
#import quantiles
#import scatters
#import surfel

@group(0) @binding(1) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(2) var<storage, read> sampled: array<u32>;
@group(0) @binding(3) var<storage, read> quantiles: array<Quantile>;
@group(0) @binding(4) var<storage, read_write> statistics: FrameStatistics;
@group(0) @binding(5) var<storage, read> levels: array<Level>;
@group(0) @binding(6) var<storage, read> depth_noise: array<DepthRun>;
@group(0) @binding(7) var<storage, read_write> arguments: array<Dispatch>;
@group(0) @binding(8) var<storage, read_write> picked: array<u32>;

// Cells of a workgroup that fits sheets.
override CELLS_PER_GROUP: u32;
// Number of ball sizes that are measured at first, and balls of a workgroup that measures.
override FIRST_SCALES: u32;
override BALLS_PER_GROUP: u32;

// Whether a part's balls tell the noise. The last size that is measured cannot, as a size is judged by the next.
fn tells_noise(part: u32, measured: u32) -> bool {
    for (var scale = 0u; scale + 1u < measured; scale++) {
        if quantiles[part * SCALES + scale].kind == OF_THIN_BALLS {
            return true;
        }
    }
    return false;
}

// Noise level of a part of the sample with about the same density; 0 if the part is too small.
fn scatter_level(part: u32) -> f32 {
    // Below 0: none.
    var before = -1.0;
    var least_growth = infinity();
    var plateau = 0.0;
    for (var scale = 0u; scale < SCALES; scale++) {
        let found = quantiles[part * SCALES + scale];
        let now = found.value;
        if found.kind == OF_THIN_BALLS {
            return now;
        }
        // No scale is thin. Where scatter grows least to the next scale it is noise; elsewhere points fill the ball or
        // are structure.
        if found.kind == OF_ALL_BALLS && before >= 0.0 && now < least_growth * before {
            least_growth = now / before;
            plateau = before;
        }
        before = select(-1.0, now, found.kind == OF_ALL_BALLS);
    }
    return plateau;
}

// Certainty that the noise of the whole sample is noise, 0 to 1.
fn noise_certainty() -> f32 {
    for (var scale = 0u; scale < SCALES; scale++) {
        if quantiles[ALL * SCALES + scale].kind == OF_THIN_BALLS {
            let share = quantiles[SAMPLE_PARTS * SCALES + min(scale, STEADY_SCALES - 1u)].value;
            return saturate((share - CERTAIN_NOISE_SHARES[0]) * (1.0 / (CERTAIN_NOISE_SHARES[1] - CERTAIN_NOISE_SHARES[0])));
        }
    }
    return 0.0;
}

// K-radius of a sampled surfel, densest first.
fn k_radius(rank: u32) -> f32 {
    return surfels[sampled[rank]].k_radius;
}

fn noise_of_sample() -> Noise {
    let sure = noise_certainty();
    let len = sampled[MOST_SAMPLED];
    let all = scatter_level(ALL);
    // Of the whole sample, as the thirds may take their levels from different scales.
    let by_steady = select(1.0, scatter_level(STEADY_ALL) / all, all > 0.0);
    let third = len / 3u;
    if third == 0u {
        return Noise(by_steady * all, 0.0, 0.0, sure);
    }
    let small = k_radius(third / 2u);
    let large = k_radius(len - third + third / 2u);
    if large > MIN_K_RADIUS_CONTRAST * small {
        let least = scatter_level(DENSEST);
        let most = scatter_level(SPARSEST);
        if least > 0.0 && most > least {
            let growth = log(most / least) / log(large / small);
            // Little growth is chance, or a different kind of object where points are sparse.
            let much = clamp((growth - STRUCTURE_GROWTH_POWER) * (1.0 / GROWTH_POWER_RAMP), 0.0, 1.0);
            let apart = min((large / (MIN_K_RADIUS_CONTRAST * small) - 1.0) * (1.0 / (FULL_K_RADIUS_CONTRAST - 1.0)), 1.0);
            let grows = much * apart;
            if grows > 0.0 {
                let power = grows * min(growth, 2.0);
                // Through the geometric mean of both thirds, blended with the level of all where growth is uncertain.
                let both = sqrt(least) * sqrt(most);
                let middle = select(both, pow(all, 1.0 - grows) * pow(both, grows), all > 0.0);
                let beyond = 2.0 * k_radius(len - 1u - len / GROWTH_END_DIVISOR);
                let level = by_steady * middle * pow(beyond / (sqrt(small) * sqrt(large)), power);
                return Noise(level, power, beyond, sure);
            }
        }
    }
    return Noise(by_steady * all, 0.0, 0.0, sure);
}

// Whether the noise of any depths is known.
fn any_known() -> bool {
    return arrayLength(&depth_noise) > 1u || depth_noise[0].factor > 0.0;
}

@compute @workgroup_size(1)
fn noise() {
    let measured = select(FIRST_SCALES, SCALES, picked[MEASURED] > 0u);
    let goes_on = measured < SCALES
        && !(tells_noise(DENSEST, measured) && tells_noise(SPARSEST, measured) && tells_noise(ALL, measured));
    put_work(SCATTER_ARGUMENTS, select(0u, (SCALES - measured) * MOST_SAMPLED, goes_on), BALLS_PER_GROUP);
    put_groups(QUANTILE_ARGUMENTS, select(0u, SAMPLE_PARTS * SCALES, goes_on));
    if goes_on {
        picked[MEASURED] = measured;
        return;
    }
    let found = noise_of_sample();
    let len = sampled[MOST_SAMPLED];
    var middle = 0.0;
    if len > 0u {
        middle = k_radius(len / 2u);
    }
    let usual = select(0.0, middle, len >= LEAST_SAMPLE);
    let is_thick = noise_at(found, middle) > THICK_NOISE * usual;
    let sheet_level = select(SHEET_LEVELS[0], SHEET_LEVELS[1], is_thick);
    statistics = FrameStatistics(found, usual, sheet_level);
    let level = levels[sheet_level];
    // Without a level no surfel asks for sheets.
    let is_noisy = (found.level > 0.0 || any_known()) && level.side_px > 0u;
    put_work(0u, select(0u, level.columns * level.rows, is_noisy), CELLS_PER_GROUP);
    arguments[1] = Dispatch(0u, 1u, 1u);
    arguments[2] = Dispatch(0u, 1u, 1u);
}
