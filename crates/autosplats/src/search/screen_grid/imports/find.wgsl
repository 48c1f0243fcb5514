// The search of a query. It reads a window about its first search sphere and lists the k nearest points in order. The
// list is exact if the sphere up to the k-th point lies inside the window. Otherwise, unless a rule ends the
// neighbourhood, the window grows. Unlike on the CPU, queries share no window, and a window has no range of depths:
// skipping points already read saves nothing.
//
// The including pass binds `density`, `cell_start`, `points` and `past`. It has a function `read_window`, which lists
// the k nearest points of a window.

#import frame
#import density
#import gaps
#import nearest
#import past
#import search_task
#import window
#import window_points

// Rounds of loops (`rounds` of `window_points`) after which a query counts as bounded. The limit is far below
// a software device's: such a device runs several invocations together, each loop as long as the longest of them.
const MAX_LOOP_ROUNDS = 25000u;
// Rounds after which a query is left to another pass.
override MOST_ROUNDS: u32;
// Result of a query that is left.
const LEFT_SQUARED = -1.0;

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
        if rounds > MOST_ROUNDS {
            return SearchResult(LEFT_SQUARED, false, false);
        }
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
