// The noise level: how far points scatter about the surface. See the CPU form. One invocation.
//
// Reads: surfels, sampled, quantiles. Writes: measured: noise level, power of the k-radius, median k-radius, level of
// the cells with sheets, largest k-radius of growth, and certainty.

#import frame
#import quantiles
#import surfel

@group(0) @binding(1) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(2) var<storage, read> sampled: array<u32>;
@group(0) @binding(3) var<storage, read> quantiles: array<vec2u>;
@group(0) @binding(4) var<storage, read_write> measured: array<f32>;

// Noise level of a part of the sample with about the same density; 0 if the part is too small.
fn scatter_level(part: u32) -> f32 {
    // Below 0: none.
    var before = -1.0;
    var least_growth = infinity();
    var plateau = 0.0;
    for (var scale = 0u; scale < SCALES; scale++) {
        let found = quantiles[part * SCALES + scale];
        let now = bitcast<f32>(found.y);
        if found.x == OF_THIN_BALLS {
            return now;
        }
        // No scale is thin. Where scatter grows least to the next scale it is noise; elsewhere points fill the ball or
        // are structure.
        if found.x == OF_ALL_BALLS && before >= 0.0 && now < least_growth * before {
            least_growth = now / before;
            plateau = before;
        }
        before = select(-1.0, now, found.x == OF_ALL_BALLS);
    }
    return plateau;
}

// Certainty that the noise of the whole sample is noise, 0 to 1.
fn noise_certainty() -> f32 {
    for (var scale = 0u; scale < SCALES; scale++) {
        if quantiles[ALL * SCALES + scale].x == OF_THIN_BALLS {
            let share = bitcast<f32>(quantiles[SAMPLE_PARTS * SCALES + min(scale, STEADY_SCALES - 1u)].y);
            return saturate((share - CERTAIN_NOISE_SHARES[0]) * (1.0 / (CERTAIN_NOISE_SHARES[1] - CERTAIN_NOISE_SHARES[0])));
        }
    }
    return 0.0;
}

// K-radius of a sampled surfel, densest first.
fn k_radius(rank: u32) -> f32 {
    return surfels[sampled[rank]].k_radius;
}

// Level, power and largest k-radius of growth.
fn noise_of_sample() -> vec3f {
    let len = sampled[MOST_SAMPLED];
    let all = scatter_level(ALL);
    // Of the whole sample, as the thirds may take their levels from different scales.
    let by_steady = select(1.0, scatter_level(STEADY_ALL) / all, all > 0.0);
    let third = len / 3u;
    if third == 0u {
        return vec3f(by_steady * all, 0.0, 0.0);
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
                return vec3f(level, power, beyond);
            }
        }
    }
    return vec3f(by_steady * all, 0.0, 0.0);
}

@compute @workgroup_size(1)
fn noise() {
    let found = noise_of_sample();
    measured[0] = found.x;
    measured[1] = found.y;
    measured[4] = found.z;
    measured[5] = noise_certainty();
    let len = sampled[MOST_SAMPLED];
    var middle = 0.0;
    if len > 0u {
        middle = k_radius(len / 2u);
    }
    measured[2] = select(0.0, middle, len >= LEAST_SAMPLE);
    let usual = found.x * select(pow(min(middle / found.z, 1.0), found.y), 1.0, found.y == 0.0);
    measured[3] = f32(select(SHEET_LEVELS[0], SHEET_LEVELS[1], usual > THICK_NOISE * measured[2]));
}
