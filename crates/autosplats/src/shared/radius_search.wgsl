// The search for a point's k-radius, step by step [Paper, §5.2, §5.3]; the rules are stated in search/mod.rs. Imports: frame.

// Between which distances the k-th neighbour is being looked for: a and b of the paper.
struct Search {
    low: f32,
    // 0 before the first step. Once the search has ended, the radius of the neighbourhood.
    high: f32,
    // Neighbours up to `low`; or, below 0, how the search ended.
    count: f32,
}

const FOUND = -1.0;
// No neighbour is near enough.
const OUTLIER = -2.0;
// A gap, or the end of the points, follows the furthest neighbour.
const CLAMPED_AT_GAP = -3.0;
// Iterations ended before the k-th neighbour was met.
const OUT_OF_STEPS = -4.0;
// Not a query: the point only answers.
const NOT_ASKED = -5.0;

// A bracket so narrow, relative to its radius, separates no distances any more.
const NARROWEST = 0x1p-22;
// Points further apart have squared distances that do not round to 0.
const LEAST_DISTANCE = 2e-19;

// The roots, not the squares, are compared everywhere: bounds are distances that points have.
fn apart(p: vec3f, q: vec3f) -> f32 {
    let v = q - p;
    return sqrt(fma(v.z, v.z, fma(v.y, v.y, v.x * v.x)));
}

fn has_ended(search: Search) -> bool {
    return search.count < 0.0;
}

fn has_neighbors(search: Search) -> bool {
    return search.count == FOUND || search.count == CLAMPED_AT_GAP || search.count == OUT_OF_STEPS;
}

// Whether a point at this distance is among those that the search is to be told of: the delta region.
fn is_within(search: Search, distance: f32) -> bool {
    return distance <= search.high && (distance > search.low || search.count == 0.0);
}

// The m = 4 radii at which neighbours are counted. Fused, so that every pass gets the same bits.
fn sample_radii(search: Search) -> vec4f {
    let radii = fma(vec4f(search.high - search.low), vec4f(0.25, 0.5, 0.75, 1.0), vec4f(search.low));
    return vec4f(radii.xyz, search.high);
}

fn ended(radius: f32, how: f32) -> Search {
    return Search(radius, radius, how);
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
    return Known(asked, max(radii.x, radii.w), max(asked.count, 0.0) + counters);
}

// What to ask next. `others` is the number of all other screen points.
fn advance(known: Known, initial_radius: f32, others: f32) -> Search {
    let asked = known.asked;
    if has_ended(asked) {
        return asked;
    }
    if asked.high == 0.0 {
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
        return Search(0.0, min(min(radius * growth, limit), MOST), 0.0);
    }
    // Differs from the paper: no step is wider than the gap that would end the search, or it would step over the gap.
    let reach = frame.gap_growth * max(known.furthest, initial_radius);
    if is_all || radius >= reach {
        return ended(known.furthest, CLAMPED_AT_GAP);
    }
    let growth = sqrt(f32(frame.k) / count);
    // Differs from the paper: a is the furthest neighbour's distance, not the radius before. As many points lie within it, and
    // it is d_max, which needs no channel of its own then.
    return Search(known.furthest, min(min(radius * growth, reach), MOST), count);
}

fn bracket(known: Known) -> Search {
    let k = f32(frame.k);
    let radii = sample_radii(known.asked);
    let counts = known.counts;
    // The last sample below k neighbours and the first with them.
    var low = vec2f(known.asked.low, known.asked.count);
    var high = vec2f(radii.x, counts.x);
    for (var sample = 1u; sample < 4u; sample++) {
        if high.y < k {
            low = high;
            high = vec2f(radii[sample], counts[sample]);
        }
    }
    // Where several points share the k-th distance, no bracket comes between them, and all belong.
    if high.y == k || high.x - low.x <= NARROWEST * high.x {
        return ended(high.x, FOUND);
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
    return ended(known.furthest, select(OUT_OF_STEPS, OUTLIER, known.counts.w == 0.0));
}
