// The k nearest screen points of each query, summed up in moments [Paper, §4, §5]: an invocation per query. The rules
// are in search/mod.rs, the search is in `find`. Queries that read many points may be left to `search_together`.
//
// Reads: density, cell_start, points, queries, past. Reads and writes: left, counters. Writes: neighborhoods.

#import frame
#import density
#import find
#import groups
#import neighborhood
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

// Whether to search only the queries in `left`, whose searches `search_four` did not finish.
override LEFT_ONLY: bool;

var<workgroup> clamped: atomic<u32>;
var<workgroup> bounded: atomic<u32>;

// Lists the k nearest points of a window.
fn read_window(query: u32, center: vec3f, window: Window) -> Nearest {
    var list = nearest_none();
    let strips = window_strips(window, task.strip_px);
    rounds += strips.y - strips.x + 1u;
    for (var strip = strips.x; strip <= strips.y; strip++) {
        let run = window_run(window, strip);
        rounds += (run.y - run.x) / 2u;
        if rounds > MOST_ROUNDS {
            break;
        }
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
        if found.squared == LEFT_SQUARED {
            left[atomicAdd(&counters[left_counter()], 1u)] = index;
        } else {
            neighborhoods[task.first + index] = moments(point.position_view, found.squared, of_near);
        }
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
