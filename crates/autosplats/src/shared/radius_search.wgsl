// The search for a point's k-radius, step by step [Paper, §5.2, §5.3]; the rules are stated in search/mod.rs. Imports: frame.

#import gaps

// Between which distances the k-th neighbour is being looked for: a and b of the paper.
struct Search {
    // While the radius expands, the distance to the furthest neighbour, below 0; see first_sample.
    low: f32,
    // Below 0 before the first step; 0 if the point is not a query and only answers. Once the search has ended, the radius
    // of the neighbourhood.
    high: f32,
    // Neighbours up to `low`; or, below 0, how the search ended.
    count: f32,
}

const FOUND = -1.0;
// No neighbour is near enough.
const OUTLIER = -2.0;
// A gap, or the end of the points, follows the furthest neighbour.
const CLAMPED_AT_GAP = -3.0;
// Iterations ended before the k-th neighbour was met, or any, and before a rule said that there is none.
const OUT_OF_STEPS = -4.0;

// Least expansion of a radius: steps of √(k/σ) creep when one neighbour is missing that is far away.
const LEAST_GROWTH = 1.15;
// A bracket so narrow, relative to its radius, separates no distances any more.
const NARROWEST = 0x1p-22;
// Points further apart have squared distances that do not round to 0.
const LEAST_DISTANCE = 2e-19;

// The roots, not the squares, are compared everywhere: bounds are distances that points have.
fn apart(p: vec3f, q: vec3f) -> f32 {
    let v = q - p;
    return sqrt(fma(v.z, v.z, fma(v.y, v.y, v.x * v.x)));
}

fn is_query(search: Search) -> bool {
    return search.high != 0.0 || search.count != 0.0;
}

fn has_ended(search: Search) -> bool {
    return search.count < 0.0 || search.high == 0.0;
}

fn has_neighbors(search: Search) -> bool {
    return search.count == FOUND || search.count == CLAMPED_AT_GAP || search.count == OUT_OF_STEPS;
}

// Whether a point at this distance is among those that the search is to be told of: the delta region; all of the
// neighbourhood once it has ended.
fn is_within(search: Search, distance: f32) -> bool {
    return distance <= search.high && (distance > abs(search.low) || search.count <= 0.0);
}

// How much a radius with so many neighbours expands at most: α of [Paper, §5.2].
//
// Differs from the paper: α aims at k + 1 neighbours, since any radius from the k-th to there will do. Aiming at the k-th itself
// misses it every second time, which costs an iteration.
fn expansion(count: f32) -> f32 {
    return max(sqrt((f32(frame.k) + 1.0) / max(count, 1.0)), LEAST_GROWTH);
}

// Where the samples begin: a. The textures have no channel for both a and d_max; as an expanding radius has d_max alone, its a
// is found again from b, rounded downwards.
fn first_sample(search: Search) -> f32 {
    return max(abs(search.low), search.high / expansion(search.count) * (1.0 - 0x1p-22) * f32(search.low < 0.0));
}

// The m = 4 radii at which neighbours are counted. Fused, so that every pass gets the same bits.
fn sample_radii(search: Search) -> vec4f {
    let low = first_sample(search);
    let radii = fma(vec4f(search.high - low), vec4f(0.25, 0.5, 0.75, 1.0), vec4f(low));
    return vec4f(radii.xyz, search.high);
}

fn ended(radius: f32, how: f32) -> Search {
    return Search(radius, radius, how);
}

// A radius that holds what one pass found at this distance for every other: WGSL owes no two of them the same bits.
fn up_to(distance: f32) -> f32 {
    return distance * (1.0 + 0x1p-21);
}

// What a point knows after a gathering pass: what it had asked, as it was passed along with the distance to the furthest
// neighbour that answered, and how many did by sample.
struct Known {
    asked: Search,
    furthest: f32,
    // Neighbours up to each sample radius.
    counts: vec4f,
}

fn recall(radii: vec4f, counters: vec4f) -> Known {
    let asked = Search(radii.x, radii.y, radii.z);
    return Known(asked, max(abs(radii.x), radii.w), max(asked.count, 0.0) + counters);
}

// What to ask next. `others` is the number of all other screen points.
fn advance(known: Known, initial_radius: f32, others: f32) -> Search {
    let asked = known.asked;
    if has_ended(asked) {
        return asked;
    }
    if asked.high < 0.0 {
        return Search(0.0, initial_radius, 0.0);
    }
    if known.counts.w < f32(frame.k) {
        return expand(known, initial_radius, others);
    }
    return bracket(known);
}

fn expand(known: Known, initial_radius: f32, others: f32) -> Search {
    let count = known.counts.w;
    let radius = known.asked.high;
    let is_all = count >= others || radius >= MOST;
    if count == 0.0 {
        let limit = frame.outlier_growth * initial_radius;
        if is_all || radius >= limit {
            return ended(0.0, OUTLIER);
        }
        // As the gap rule below has it, so that two neighbours met at once have no gap between them.
        let growth = min(sqrt(max(f32(frame.k), 10.0)), frame.gap_growth);
        return Search(radius, min(min(radius * growth, limit), MOST), 0.0);
    }
    let reach = max(frame.gap_growth * initial_radius, gap_growth_after(u32(count)) * known.furthest);
    if is_all || radius >= reach {
        return ended(up_to(known.furthest), CLAMPED_AT_GAP);
    }
    // Differs from the paper: no step is wider than a gap, or it would step over one.
    let step = min(radius * expansion(count), frame.gap_growth * max(radius, initial_radius));
    return Search(-known.furthest, min(min(step, reach), MOST), count);
}

fn bracket(known: Known) -> Search {
    let k = f32(frame.k);
    let radii = sample_radii(known.asked);
    let counts = known.counts;
    // The last sample below k neighbours and the first with them.
    var low = vec2f(first_sample(known.asked), known.asked.count);
    var high = vec2f(radii.x, counts.x);
    for (var sample = 1u; sample < 4u; sample++) {
        if high.y < k {
            low = high;
            high = vec2f(radii[sample], counts[sample]);
        }
    }
    // Where several points share the k-th distance, no bracket comes between them, and all belong.
    if high.y == k {
        return ended(high.x, FOUND);
    }
    if high.x - low.x <= NARROWEST * high.x {
        return ended(up_to(high.x), FOUND);
    }
    return Search(low.x, high.x, low.y);
}

// The neighbourhood that a search ends with, whether or not it has found what it looked for.
fn settle(known: Known, initial_radius: f32, others: f32) -> Search {
    let search = advance(known, initial_radius, others);
    if has_ended(search) {
        return search;
    }
    if known.counts.w >= f32(frame.k) {
        return ended(search.high, FOUND);
    }
    // Without neighbours the lower bound is what is furthest, and nothing lies within it.
    return ended(select(up_to(known.furthest), 0.0, known.counts.w == 0.0), OUT_OF_STEPS);
}
