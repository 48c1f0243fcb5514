// The search for a point's k-radius, step by step [Paper, §5.2, §5.3]; `search/mod.rs` states the rules.

#import frame
#import gaps

// State of a search: the bounds of the k-radius, a and b in the paper.
struct Search {
    // Lower bound. While the radius expands, the negated distance to the furthest neighbour; see `first_sample`.
    low: f32,
    // Upper bound. Negative before the first step; 0 if the point is not a query and only answers. After the end of the
    // search, the radius of the neighbourhood.
    high: f32,
    // Number of neighbours up to `low`; if negative, how the search ended.
    count: f32,
}

const FOUND = -1.0;
// No neighbour is near enough.
const OUTLIER = -2.0;
// A gap, or the end of the points, follows the furthest neighbour.
const CLAMPED_AT_GAP = -3.0;
// The iterations ended before the k-th neighbour was found and before a rule ended the search.
const OUT_OF_STEPS = -4.0;

// Least expansion of a radius. Steps of √(k/σ) alone creep towards a single missing neighbour far away.
const MIN_EXPANSION = 1.15;
// Relative width below which a bracket cannot separate distances.
const MIN_BRACKET_WIDTH_RATIO = 0x1p-22;
// Least distance whose square does not round to 0.
const MIN_SQUARABLE_DISTANCE = 2e-19;

// Roots are compared everywhere, not squares: bounds are distances of points.
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

// Whether a point at this distance contributes to the search: it lies in the delta region. After the end of the search,
// it lies in the neighbourhood.
fn is_within(search: Search, distance: f32) -> bool {
    return distance <= search.high && (distance > abs(search.low) || search.count <= 0.0);
}

// Largest expansion of a radius with `count` neighbours: α of [Paper, §5.2].
//
// Differs from the paper: α aims at k + 1 neighbours, because any radius from the k-th neighbour to the next will do.
// Aiming at the k-th itself misses in every second case, which costs an iteration.
fn expansion(count: f32) -> f32 {
    return max(sqrt((f32(frame.k) + 1.0) / max(count, 1.0)), MIN_EXPANSION);
}

// Lower end of the samples: a. The textures have no channel for both a and d_max. An expanding radius stores d_max
// alone; its a is computed from b, rounded down.
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

// A radius that includes a point at this distance in every pass. WGSL does not guarantee equal bits between passes.
fn up_to(distance: f32) -> f32 {
    return distance * (1.0 + 0x1p-21);
}

// Data of a point after a gathering pass: its search, as handed on, the distance to the furthest neighbour that
// answered, and counts.
struct GatheredCounts {
    asked: Search,
    furthest: f32,
    // Number of neighbours up to each sample radius.
    counts: vec4f,
}

fn recall(radii: vec4f, counters: vec4f) -> GatheredCounts {
    let asked = Search(radii.x, radii.y, radii.z);
    return GatheredCounts(asked, max(abs(radii.x), radii.w), max(asked.count, 0.0) + counters);
}

// The next step of a search. `others` is the number of all other screen points.
fn advance(known: GatheredCounts, initial_radius: f32, others: f32) -> Search {
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

fn expand(known: GatheredCounts, initial_radius: f32, others: f32) -> Search {
    let count = known.counts.w;
    let radius = known.asked.high;
    let is_all = count >= others || radius >= MAX_F32;
    if count == 0.0 {
        let limit = frame.outlier_growth * initial_radius;
        if is_all || radius >= limit {
            return ended(0.0, OUTLIER);
        }
        // Limited by the gap rule below, so that two neighbours found at once have no gap between them.
        let growth = min(sqrt(max(f32(frame.k), 10.0)), frame.gap_growth);
        return Search(radius, min(min(radius * growth, limit), MAX_F32), 0.0);
    }
    let reach = max(frame.gap_growth * initial_radius, gap_growth_after(u32(count)) * known.furthest);
    if is_all || radius >= reach {
        return ended(up_to(known.furthest), CLAMPED_AT_GAP);
    }
    // Differs from the paper: no step is wider than a gap, so that none is stepped over.
    let step = min(radius * expansion(count), frame.gap_growth * max(radius, initial_radius));
    return Search(-known.furthest, min(min(step, reach), MAX_F32), count);
}

fn bracket(known: GatheredCounts) -> Search {
    let k = f32(frame.k);
    let radii = sample_radii(known.asked);
    let counts = known.counts;
    // The last sample with fewer than k neighbours, and the first with at least k.
    var low = vec2f(first_sample(known.asked), known.asked.count);
    var high = vec2f(radii.x, counts.x);
    for (var sample = 1u; sample < 4u; sample++) {
        if high.y < k {
            low = high;
            high = vec2f(radii[sample], counts[sample]);
        }
    }
    // If several points share the k-th distance, no bracket separates them, and all of them belong.
    if high.y == k {
        return ended(high.x, FOUND);
    }
    if high.x - low.x <= MIN_BRACKET_WIDTH_RATIO * high.x {
        return ended(up_to(high.x), FOUND);
    }
    return Search(low.x, high.x, low.y);
}

// The neighbourhood of a search after the last iteration, whether or not the search has ended.
fn settle(known: GatheredCounts, initial_radius: f32, others: f32) -> Search {
    let search = advance(known, initial_radius, others);
    if has_ended(search) {
        return search;
    }
    if known.counts.w >= f32(frame.k) {
        return ended(search.high, FOUND);
    }
    // Without neighbours `furthest` is the lower bound, and the neighbourhood is empty.
    return ended(select(up_to(known.furthest), 0.0, known.counts.w == 0.0), OUT_OF_STEPS);
}
