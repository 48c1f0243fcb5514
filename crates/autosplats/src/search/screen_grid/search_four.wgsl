// The k nearest screen points of four queries at a time, summed up in moments [Paper, §4, §5], for larger k. The rules
// are stated in search/mod.rs.
//
// How it works: four consecutive queries lie side by side on the screen, so they share a window and are the components
// of vectors. The window is read several times. First, candidates are counted below eight thresholds, evenly spaced in
// squared distance, in which counts on a surface grow evenly. Counting repeats with eight thresholds between the two
// around the k-th, until few candidates lie in between. These are listed to find the k-th. The pass settles
// neighbourhoods that no rule can end early. All others are left to `search`, which applies all rules: gaps, outliers,
// crowds and coincident points.
//
// Reads: counters, density, cell_start, points, queries, past. Writes: neighborhoods, left, counters.

#import frame
#import density
#import groups
#import neighborhood
#import past
#import screen
#import search_task
#import window
#import window_points

@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read> density: array<DensityCell>;
@group(0) @binding(3) var<storage, read> cell_start: array<u32>;
@group(0) @binding(4) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(5) var<storage, read> queries: array<u32>;
@group(0) @binding(6) var<storage, read_write> neighborhoods: array<Neighborhood>;
@group(0) @binding(7) var<storage, read_write> left: array<u32>;
@group(0) @binding(8) var<storage, read> past: array<u32>;

override K: u32;

// Most windows per invocation, most screen points plus strips in a window, and most counting passes over a window. All
// passes together take less than half of the 65535 rounds after which software devices end an invocation.
const MAX_WINDOWS = 3u;
const MAX_WINDOW_READS = 1536u;
const MAX_COUNTING_PASSES = 3u;
// Most candidates in a bracket for which a list of eight finds the k-th, from below or from above.
const MAX_LISTED_CANDIDATES = 15u;

// Number of queries of the workgroup that are left to `search`.
var<workgroup> left_len: atomic<u32>;
var<workgroup> left_first: u32;

// Positions of four queries.
struct Four {
    x: vec4f,
    y: vec4f,
    z: vec4f,
}

alias Eight = array<vec4f, 8>;
alias EightCounts = array<vec4u, 8>;

// Squared distances on either side of the k-th, and the number of candidates up to each, the query itself included.
struct Bracket {
    low: vec4f,
    high: vec4f,
    low_count: vec4u,
    high_count: vec4u,
}

struct Listed {
    // Squared distance to the k-th neighbour.
    kth: vec4f,
    // Largest squared distance up to a limit.
    furthest: vec4f,
}

fn center(four: Four, lane: u32) -> vec3f {
    return vec3f(four.x[lane], four.y[lane], four.z[lane]);
}

// The same bits as `squared_length` in `search`.
fn squared_lengths(four: Four, at: u32) -> vec4f {
    let candidate = points[at].position_view;
    let x = candidate.x - four.x;
    let y = candidate.y - four.y;
    let z = candidate.z - four.z;
    return fma(z, z, fma(y, y, x * x));
}

// The window of the points within a radius of each `wanted` query.
fn window_of_four(four: Four, radius: vec4f, wanted: vec4<bool>) -> Window {
    var window = picture();
    var low = window.high;
    var high = window.low;
    for (var lane = 0u; lane < 4u; lane++) {
        if wanted[lane] {
            let own = window_of_sphere(center(four, lane), radius[lane]);
            low = min(low, own.low);
            high = max(high, own.high);
        }
    }
    return window_grown(Window(low, max(low, high)), f32(task.strip_px));
}

fn one_if(condition: vec4<bool>) -> vec4u {
    return select(vec4u(0u), vec4u(1u), condition);
}

fn raise(bracket: ptr<function, Bracket>, threshold: vec4f, count: vec4u) {
    let is_low = count <= vec4u(K);
    (*bracket).low = select((*bracket).low, threshold, is_low);
    (*bracket).low_count = select((*bracket).low_count, count, is_low);
}

fn lower(bracket: ptr<function, Bracket>, threshold: vec4f, count: vec4u) {
    let is_high = count > vec4u(K);
    (*bracket).high = select((*bracket).high, threshold, is_high);
    (*bracket).high_count = select((*bracket).high_count, count, is_high);
}

// Counts candidates at eight thresholds, the last at the upper end of the bracket, and narrows the bracket to the two
// around the k-th. With fewer than k neighbours up to the last threshold the bracket shrinks to the last.
fn narrow(four: Four, window: Window, bracket: ptr<function, Bracket>) {
    let low = (*bracket).low;
    let step = 0.125 * ((*bracket).high - low);
    let t = Eight(
        low + step,
        low + 2.0 * step,
        low + 3.0 * step,
        low + 4.0 * step,
        low + 5.0 * step,
        low + 6.0 * step,
        low + 7.0 * step,
        (*bracket).high,
    );
    var n = EightCounts();
    let strips = window_strips(window, task.strip_px);
    for (var strip = strips.x; strip <= strips.y; strip++) {
        let run = window_run(window, strip);
        for (var at = run.x; at < run.y; at++) {
            let squared = squared_lengths(four, at);
            n[0] += one_if(squared <= t[0]);
            n[1] += one_if(squared <= t[1]);
            n[2] += one_if(squared <= t[2]);
            n[3] += one_if(squared <= t[3]);
            n[4] += one_if(squared <= t[4]);
            n[5] += one_if(squared <= t[5]);
            n[6] += one_if(squared <= t[6]);
            n[7] += one_if(squared <= t[7]);
        }
    }
    raise(bracket, t[0], n[0]);
    raise(bracket, t[1], n[1]);
    raise(bracket, t[2], n[2]);
    raise(bracket, t[3], n[3]);
    raise(bracket, t[4], n[4]);
    raise(bracket, t[5], n[5]);
    raise(bracket, t[6], n[6]);
    raise(bracket, t[7], n[7]);
    lower(bracket, t[7], n[7]);
    lower(bracket, t[6], n[6]);
    lower(bracket, t[5], n[5]);
    lower(bracket, t[4], n[4]);
    lower(bracket, t[3], n[3]);
    lower(bracket, t[2], n[2]);
    lower(bracket, t[1], n[1]);
    lower(bracket, t[0], n[0]);
}

// Lists the candidates in the brackets of at most MAX_LISTED_CANDIDATES candidates.
fn list(four: Four, window: Window, bracket: Bracket, limit: vec4f) -> Listed {
    // Count from the end of the bracket that is nearer to the k-th. Distances from above are listed as negatives.
    let from_low = vec4u(K) - bracket.low_count;
    let from_high = bracket.high_count - vec4u(K + 1u);
    let is_upward = from_low <= from_high;
    let sign = select(vec4f(-1.0), vec4f(1.0), is_upward);
    let m = vec4f(MAX_F32);
    var least = Eight(m, m, m, m, m, m, m, m);
    var furthest = vec4f(0.0);
    let strips = window_strips(window, task.strip_px);
    for (var strip = strips.x; strip <= strips.y; strip++) {
        let run = window_run(window, strip);
        for (var at = run.x; at < run.y; at++) {
            let squared = squared_lengths(four, at);
            furthest = max(furthest, select(vec4f(0.0), squared, squared <= limit));
            let key = select(m, sign * squared, (squared > bracket.low) & (squared <= bracket.high));
            // Each place takes the lesser of its own value and of the greater of its predecessor and the new value.
            least[7] = min(least[7], max(least[6], key));
            least[6] = min(least[6], max(least[5], key));
            least[5] = min(least[5], max(least[4], key));
            least[4] = min(least[4], max(least[3], key));
            least[3] = min(least[3], max(least[2], key));
            least[2] = min(least[2], max(least[1], key));
            least[1] = min(least[1], max(least[0], key));
            least[0] = min(least[0], key);
        }
    }
    let place = min(from_low, from_high);
    var kth = least[0];
    kth = select(kth, least[1], place == vec4u(1u));
    kth = select(kth, least[2], place == vec4u(2u));
    kth = select(kth, least[3], place == vec4u(3u));
    kth = select(kth, least[4], place == vec4u(4u));
    kth = select(kth, least[5], place == vec4u(5u));
    kth = select(kth, least[6], place == vec4u(6u));
    kth = select(kth, least[7], place == vec4u(7u));
    return Listed(sign * kth, furthest);
}

// Squared distances to the k-th neighbours; MAX_F32 for queries that are left to `search`.
fn find(four: Four, initial_radius: vec4f, valid: vec4<bool>) -> vec4f {
    var found = vec4f(MAX_F32);
    var open = valid;
    var radius = FIRST_WINDOW_SLACK * initial_radius;
    for (var lane = 0u; lane < 4u; lane++) {
        let likely = past_radius(center(four, lane), initial_radius[lane]);
        radius[lane] = select(radius[lane], PAST_RADIUS_SLACK * likely, likely > 0.0);
    }
    radius = max(radius, vec4f(MIN_POSITIVE));
    let outlier_radius = frame.outlier_growth * initial_radius;
    // A k-th neighbour up to this radius breaks no rule.
    let unruled = min(frame.gap_growth * initial_radius, outlier_radius);
    let is_gap_first = frame.gap_growth * initial_radius <= outlier_radius;
    for (var step = 0u; step < MAX_WINDOWS && any(open); step++) {
        let window = window_of_four(four, radius, open);
        let len = window_len(window, task.strip_px, MIN_CROWDED_CANDIDATES);
        let strips = window_strips(window, task.strip_px);
        if len + strips.y - strips.x > MAX_WINDOW_READS {
            break;
        }
        // The query itself is at distance 0 and counts.
        var bracket = Bracket(vec4f(-MIN_POSITIVE), min(radius * radius, vec4f(MAX_F32)), vec4u(0u), vec4u(0u));
        var is_enough = open;
        for (var count = 0u; count < MAX_COUNTING_PASSES; count++) {
            narrow(four, window, &bracket);
            is_enough = open & (bracket.high_count > vec4u(K));
            if !any(is_enough & (bracket.high_count - bracket.low_count > vec4u(MAX_LISTED_CANDIDATES))) {
                break;
            }
        }
        let is_listed = is_enough & (bracket.high_count - bracket.low_count <= vec4u(MAX_LISTED_CANDIDATES));
        if any(is_listed) {
            let listed = list(four, window, bracket, min(unruled * unruled, vec4f(MAX_F32)));
            let kth = sqrt(listed.kth);
            let furthest = sqrt(listed.furthest);
            // A gap would begin at the furthest point within reach of the first radius.
            let is_bridged = is_gap_first & (furthest > initial_radius) & (kth <= frame.gap_growth * furthest);
            var is_settled = is_listed & ((kth <= unruled) | is_bridged);
            for (var lane = 0u; lane < 4u; lane++) {
                is_settled[lane] = is_settled[lane] && is_unbounded(center(four, lane), kth[lane]);
            }
            found = select(found, listed.kth, is_settled);
        }
        open &= !is_enough;
        let known = vec4f(max(bracket.low_count, vec4u(1u)));
        radius *= clamp(sqrt(1.3 * f32(K) / known), vec4f(1.2), vec4f(2.5));
    }
    return found;
}

// Sums the points up to the squared distances, about the queries themselves.
fn sum_moments(four: Four, found: vec4f, first: u32) {
    let is_found = found < vec4f(MAX_F32);
    if !any(is_found) {
        return;
    }
    let radius = sqrt(found);
    let window = window_of_four(four, radius, is_found);
    let strips = window_strips(window, task.strip_px);
    // The query itself adds to the count only.
    var count = vec4f(-1.0);
    var x = vec4f(0.0);
    var y = x;
    var z = x;
    var xx = x;
    var xy = x;
    var xz = x;
    var yy = x;
    var yz = x;
    var zz = x;
    for (var strip = strips.x; strip <= strips.y; strip++) {
        let run = window_run(window, strip);
        for (var at = run.x; at < run.y; at++) {
            let candidate = points[at].position_view;
            var dx = candidate.x - four.x;
            var dy = candidate.y - four.y;
            var dz = candidate.z - four.z;
            let is_near = fma(dz, dz, fma(dy, dy, dx * dx)) <= found;
            dx = select(vec4f(0.0), dx, is_near);
            dy = select(vec4f(0.0), dy, is_near);
            dz = select(vec4f(0.0), dz, is_near);
            count += select(vec4f(0.0), vec4f(1.0), is_near);
            x += dx;
            y += dy;
            z += dz;
            xx = fma(dx, dx, xx);
            xy = fma(dx, dy, xy);
            xz = fma(dx, dz, xz);
            yy = fma(dy, dy, yy);
            yz = fma(dy, dz, yz);
            zz = fma(dz, dz, zz);
        }
    }
    for (var lane = 0u; lane < 4u; lane++) {
        if is_found[lane] {
            let offset = vec3f(x[lane], y[lane], z[lane]);
            let second_x = vec3f(xx[lane], xy[lane], xz[lane]);
            let second_yz = vec3f(yy[lane], yz[lane], zz[lane]);
            neighborhoods[task.first + first + lane] =
                Neighborhood(offset, count[lane], second_x, radius[lane], second_yz, 0u);
        }
    }
}

@compute @workgroup_size(SMALL_GROUP)
fn search_four(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        task_load();
        atomicStore(&left_len, 0u);
    }
    workgroupBarrier();
    let first = 4u * (group_index(workgroup) * SMALL_GROUP + local);
    let indices = vec4u(first, first + 1u, first + 2u, first + 3u);
    let valid = indices < vec4u(task.len);
    var found = vec4f(MAX_F32);
    if first < task.len {
        var four: Four;
        var initial_radius: vec4f;
        // Near points are left to `search`.
        var of_screen: vec4<bool>;
        for (var lane = 0u; lane < 4u; lane++) {
            let point = points[queries[task.first + min(first + lane, task.len - 1u)]];
            let cell = density_cell(pixel_xy(point.pixel), task.cell_px, task.cell_columns);
            of_screen[lane] = !has_near_flag(point.pixel);
            four.x[lane] = point.position_view.x;
            four.y[lane] = point.position_view.y;
            four.z[lane] = point.position_view.z;
            initial_radius[lane] = initial_radius_of(density[cell].count, task.cell_px, point.position_view.z);
        }
        found = find(four, initial_radius, valid & of_screen);
        sum_moments(four, found, first);
    }
    // The other queries go to a list, whose order does not matter.
    let is_left = one_if(valid & (found == vec4f(MAX_F32)));
    let own = is_left.x + is_left.y + is_left.z + is_left.w;
    var place = atomicAdd(&left_len, own);
    workgroupBarrier();
    if local == 0u {
        left_first = atomicAdd(&counters[left_counter()], atomicLoad(&left_len));
    }
    workgroupBarrier();
    place += left_first;
    for (var lane = 0u; lane < 4u; lane++) {
        if is_left[lane] == 1u {
            left[place] = first + lane;
            place += 1u;
        }
    }
}
