// The k nearest screen points of each query, summed up in moments [Paper, §4, §5]. The rules are in search/mod.rs.
//
// A query reads a window about its first search sphere and lists the k nearest points in order. The list is exact if
// the sphere up to the k-th point lies inside the window. Otherwise, unless a rule ends the neighbourhood, the window
// grows. Unlike on the CPU, queries share no window, and a window has no range of depths: skipping points already read
// saves nothing.
//
// Reads: counters, density, cell_start, points, queries, left, past. Writes: neighborhoods, counters.

#import frame
#import density
#import gaps
#import groups
#import nearest
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
@group(0) @binding(7) var<storage, read> left: array<u32>;
@group(0) @binding(8) var<storage, read> past: array<u32>;

// Whether to search only the queries in `left`, whose searches `search_four` did not finish.
override LEFT_ONLY: bool;

// Rounds of loops (`rounds` of `window_points`) after which a query counts as bounded. The limit is far below
// a software device's: such a device runs several invocations together, each loop as long as the longest of them.
const MAX_LOOP_ROUNDS = 25000u;

var<workgroup> clamped: atomic<u32>;
var<workgroup> bounded: atomic<u32>;

// A window's points as seen by one query. `sure` names what the window certainly holds.
struct WindowNeighbors {
    // Distance to the nearest neighbour.
    nearest: f32,
    // Number of neighbours within the radius that the window certainly holds, and squared distance to the last.
    sure: u32,
    sure_squared: f32,
    // The first gap: squared distance to the neighbour before it (MAX_F32 if none), the length at which it counts, its
    // end.
    gap_squared: f32,
    gap_reach: f32,
    gap_end: f32,
}

struct SearchResult {
    // Squared distance up to which points are neighbours.
    squared: f32,
    is_clamped: bool,
    is_bounded: bool,
}

// Fused, so that both passes over a window get the same bits whatever the compiler does with sums and products.
fn squared_length(v: vec3f) -> f32 {
    return fma(v.z, v.z, fma(v.y, v.y, v.x * v.x));
}

// Squared distance of a candidate; MAX_F32 for the query itself and after the end of the run.
fn squared_from(center: vec3f, at: u32, end: u32, query: u32) -> f32 {
    let squared = squared_length(points[min(at, end - 1u)].position_view - center);
    return select(squared, MAX_F32, at == query || at >= end);
}

// Lists the k nearest points of a window.
fn read_window(query: u32, center: vec3f, window: Window) -> Nearest {
    var list = nearest_none();
    let strips = window_strips(window, task.strip_px);
    rounds += strips.y - strips.x + 1u;
    for (var strip = strips.x; strip <= strips.y; strip++) {
        let run = window_run(window, strip);
        rounds += (run.y - run.x) / 2u;
        // Four at a time, so that their loads overlap.
        for (var at = run.x; at < run.y; at += 4u) {
            let a = squared_from(center, at, run.y, query);
            let b = squared_from(center, at + 1u, run.y, query);
            let c = squared_from(center, at + 2u, run.y, query);
            let d = squared_from(center, at + 3u, run.y, query);
            // Few points of a long window enter the list; the others skip the insertion.
            if min(min(a, b), min(c, d)) < nearest_last(&list) {
                nearest_add(&list, a);
                nearest_add(&list, b);
                nearest_add(&list, c);
                nearest_add(&list, d);
            }
        }
    }
    return list;
}

// Goes through the k nearest in order. All points within the square root of `sure_squared` are known.
fn look_through(nearest: Nearest, initial_radius: f32, sure_squared: f32) -> WindowNeighbors {
    var list = nearest;
    var seen = WindowNeighbors(MAX_F32, 0u, 0.0, MAX_F32, 0.0, 0.0);
    var last_squared = 0.0;
    var last = 0.0;
    var neighbors = 0u;
    for (var place = 0u; place < 4u * QUADS; place++) {
        let squared = nearest_take(&list);
        // Coincident points say nothing about distances.
        if !(squared > 0.0) {
            continue;
        }
        let distance = sqrt(squared);
        var reach = frame.gap_growth * initial_radius;
        if last > 0.0 {
            reach = max(reach, gap_growth_after(neighbors) * last);
        }
        if last > 0.0 && seen.gap_squared == MAX_F32 && distance > reach {
            seen.gap_squared = last_squared;
            seen.gap_reach = reach;
            seen.gap_end = distance;
        }
        if squared == MAX_F32 {
            break;
        }
        seen.nearest = min(seen.nearest, distance);
        if squared <= sure_squared {
            seen.sure += 1u;
            seen.sure_squared = squared;
        }
        last_squared = squared;
        last = distance;
        neighbors++;
    }
    return seen;
}

// Searches the neighbourhood of one query. `task`, the counts of the frame, is defined in `search_task`.
// A near point has an infinite first radius, to which no rule applies.
fn find(query: u32, center: vec3f, initial_radius: f32, of_near: bool) -> SearchResult {
    let strip_px = f32(task.strip_px);
    let outlier_radius = frame.outlier_growth * initial_radius;
    let farthest_first = select(1.0, OUTLIER_RADIUS_SLACK, frame.lenient == 1u) * outlier_radius;
    let likely = past_radius(center, initial_radius);
    // A radius that rounds to 0 would never grow.
    var radius = max(select(FIRST_WINDOW_SLACK * initial_radius, PAST_RADIUS_SLACK * likely, likely > 0.0), MIN_POSITIVE);
    var window = window_grown(window_of_sphere(center, radius), strip_px);
    var len = window_len(window, task.strip_px, MIN_CROWDED_CANDIDATES);
    if of_near {
        window = near_window();
        len = 1u;
    }
    // A point alone in its cell may look into a crowd, where a smaller window suffices.
    for (var halving = 0u; halving < 40u && len > MAX_CANDIDATES; halving++) {
        radius *= 0.5;
        window = window_grown(window_of_sphere(center, radius), strip_px);
        len = window_len(window, task.strip_px, MIN_CROWDED_CANDIDATES);
    }
    var seen: WindowNeighbors;
    // Largest radius that the search may reach; 0 until computed.
    var farthest = 0.0;
    for (var step = 0u; step < 256u; step++) {
        var nearest = read_window(query, center, window);
        let kth_squared = nearest_last(&nearest);
        let kth_radius = sqrt(kth_squared);
        let is_all = of_near || window_contains(window, picture());
        // The bound applies where few points were read too, if there are many a little further out. The result then
        // does not depend on what was read.
        let may_crowd = !of_near && kth_squared < MAX_F32;
        let is_crowded = len > MIN_CROWDED_CANDIDATES || (may_crowd && !is_unbounded(center, kth_radius));
        if is_crowded && farthest == 0.0 {
            farthest = bound_radius(center, initial_radius);
        }
        let bound = select(MAX_F32, farthest, is_crowded);
        let is_exact = kth_squared < MAX_F32 && kth_radius <= bound
            && (is_all || window_contains(window, window_of_sphere(center, kth_radius)));
        // No gap begins within the first search radius.
        if is_exact && kth_radius <= min(frame.gap_growth * initial_radius, outlier_radius) {
            return SearchResult(kth_squared, false, false);
        }

        // Distance up to which the window certainly holds all neighbours.
        let sure = min(select(radius, MAX_F32, is_all), bound);
        seen = look_through(nearest, initial_radius, min(sure * sure, MAX_F32));
        let known = select(sure, kth_radius, is_exact);
        if min(seen.nearest, known) > farthest_first {
            return SearchResult(0.0, false, false);
        }
        let is_gap_sure = is_exact || seen.gap_squared <= sure * sure;
        if seen.gap_squared < MAX_F32 && is_gap_sure && min(seen.gap_end, known) > seen.gap_reach {
            let is_lone = seen.nearest > outlier_radius;
            return SearchResult(select(seen.gap_squared, 0.0, is_lone), !is_lone, false);
        }
        if is_exact {
            return SearchResult(kth_squared, false, false);
        }
        if sure == MAX_F32 {
            // The end of the points.
            return SearchResult(seen.sure_squared, seen.sure > 0u, false);
        }

        let growth = max(sqrt(f32(K) / f32(max(seen.sure, 1u))), MIN_RADIUS_GROWTH);
        // The points read bound the k-radius, but only loosely across a depth step.
        let upper = select(MAX_F32, kth_radius, kth_squared < MAX_F32);
        radius = min(upper, 2.0 * sure * growth);
        if is_crowded || window_len(window_of_sphere(center, radius), task.strip_px, MIN_CROWDED_CANDIDATES) > MIN_CROWDED_CANDIDATES {
            if farthest == 0.0 {
                farthest = bound_radius(center, initial_radius);
            }
            if !(farthest > sure) {
                seen = look_through(nearest, initial_radius, farthest * farthest);
                break;
            }
            radius = min(radius, farthest);
        }
        window = window_grown(window_of_sphere(center, radius), strip_px);
        len = window_len(window, task.strip_px, MIN_CROWDED_CANDIDATES);
        let strips = window_strips(window, task.strip_px);
        if rounds + len / 2u + strips.y - strips.x > MAX_LOOP_ROUNDS {
            break;
        }
    }
    return SearchResult(seen.sure_squared, seen.sure > 0u, true);
}

// Largest radius that the search of a point may reach, as defined in search/mod.rs.
fn bound_radius(center: vec3f, initial_radius: f32) -> f32 {
    if task.near_first <= MAX_CANDIDATES {
        return MAX_F32;
    }
    var radius = max(initial_radius, MIN_POSITIVE);
    while window_len(window_of_sphere(center, radius), task.strip_px, MAX_CANDIDATES) > MAX_CANDIDATES && radius > MIN_POSITIVE {
        radius /= BOUND_STEP;
    }
    // Ends at the whole picture at the latest, which holds too many points.
    while window_len(window_of_sphere(center, radius * BOUND_STEP), task.strip_px, MAX_CANDIDATES) <= MAX_CANDIDATES {
        radius *= BOUND_STEP;
    }
    return radius;
}

// Sums the points up to a squared distance, about the point itself.
fn moments(center: vec3f, squared: f32, of_near: bool) -> Neighborhood {
    let radius = sqrt(squared);
    var window = near_window();
    if !of_near {
        window = window_of_sphere(center, radius);
    }
    let strips = window_strips(window, task.strip_px);
    // The point itself adds to the count only.
    var sums = Neighborhood(vec3f(0.0), -1.0, vec3f(0.0), radius, vec3f(0.0), 0u);
    for (var strip = strips.x; strip <= strips.y; strip++) {
        let run = window_run(window, strip);
        for (var at = run.x; at < run.y; at++) {
            let away = points[at].position_view - center;
            if squared_length(away) <= squared {
                sums.count += 1.0;
                // Fused, so that both forms of the search get the same bits.
                sums.offset += away;
                sums.second_x = fma(vec3f(away.x), away, sums.second_x);
                sums.second_yz = fma(away.yyz, away.yzz, sums.second_yz);
            }
        }
    }
    return sums;
}

@compute @workgroup_size(SMALL_GROUP)
fn search(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        task_load();
        atomicStore(&clamped, 0u);
        atomicStore(&bounded, 0u);
    }
    workgroupBarrier();
    let place = group_index(workgroup) * SMALL_GROUP + local;
    if place < select(task.len, task.left, LEFT_ONLY) {
        var index = place;
        if LEFT_ONLY {
            index = left[place];
        }
        let query = queries[task.first + index];
        let point = points[query];
        let cell = density_cell(pixel_xy(point.pixel), task.cell_px, task.cell_columns);
        let of_near = has_near_flag(point.pixel);
        var initial_radius = initial_radius_of(density[cell].count, task.cell_px, point.position_view.z);
        if of_near {
            initial_radius = infinity();
        }
        let found = find(query, point.position_view, initial_radius, of_near);
        neighborhoods[task.first + index] = moments(point.position_view, found.squared, of_near);
        if found.is_clamped {
            atomicAdd(&clamped, 1u);
        }
        if found.is_bounded {
            atomicAdd(&bounded, 1u);
        }
    }
    workgroupBarrier();
    if local == 0u {
        if atomicLoad(&clamped) > 0u {
            atomicAdd(&counters[CLAMPED], atomicLoad(&clamped));
        }
        if atomicLoad(&bounded) > 0u {
            atomicAdd(&counters[BOUNDED], atomicLoad(&bounded));
        }
    }
}
