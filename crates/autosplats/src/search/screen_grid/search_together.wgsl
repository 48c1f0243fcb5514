// The queries that `search` leaves because they read many points: a workgroup takes one after the other, and its
// invocations share out the points of a window. All invocations follow the same rules with the same numbers, so that
// they agree; the result has the bits that `search` would find.
//
// Reads: counters, density, cell_start, points, queries, left, past. Writes: neighborhoods, counters.

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
@group(0) @binding(7) var<storage, read> left: array<u32>;
@group(0) @binding(8) var<storage, read> past: array<u32>;

// Invocations that search together.
const LANES = 32u;
// Points that an invocation looks at between two barriers of `moments`.
const TURNS = 4u;

// Index of the invocation.
var<private> lane: u32;
// The next distance of each invocation's list.
var<workgroup> heads: array<f32, LANES>;
// Points in reach, a bit each, and where they are from the query.
var<workgroup> in_reach: array<atomic<u32>, TURNS>;
var<workgroup> aways: array<vec3f, TURNS * LANES>;

// Lists the k nearest points of a window: each invocation those of its share, then all together.
fn read_window(query: u32, center: vec3f, window: Window) -> Nearest {
    var own = nearest_none();
    let strips = window_strips(window, task.strip_px);
    rounds += strips.y - strips.x + 1u;
    for (var strip = strips.x; strip <= strips.y; strip++) {
        let run = window_run(window, strip);
        rounds += (run.y - run.x) / 2u;
        for (var at = run.x + lane; at < run.y; at += LANES) {
            let squared = squared_from(center, at, run.y, query);
            if squared < nearest_last(&own) {
                nearest_add(&own, squared);
            }
        }
    }
    for (var surplus = 0u; surplus < 4u * QUADS - K; surplus++) {
        nearest_take(&own);
    }
    var list = nearest_none();
    var head = nearest_take(&own);
    for (var place = 0u; place < K; place++) {
        heads[lane] = head;
        workgroupBarrier();
        var next = MAX_F32;
        // Of equal ones, the first is taken.
        var first = LANES;
        for (var other = 0u; other < LANES; other++) {
            let tried = heads[other];
            first = select(first, other, tried < next);
            next = min(next, tried);
        }
        workgroupBarrier();
        if next == MAX_F32 {
            break;
        }
        nearest_add(&list, next);
        if lane == first {
            head = nearest_take(&own);
        }
    }
    return list;
}

// Sums the points up to a squared distance, about the point itself, in their order.
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
        for (var first = run.x; first < run.y; first += TURNS * LANES) {
            if lane < TURNS {
                atomicStore(&in_reach[lane], 0u);
            }
            workgroupBarrier();
            for (var turn = 0u; turn < TURNS; turn++) {
                let at = first + turn * LANES + lane;
                let away = points[min(at, run.y - 1u)].position_view - center;
                if at < run.y && squared_length(away) <= squared {
                    aways[turn * LANES + lane] = away;
                    atomicOr(&in_reach[turn], 1u << lane);
                }
            }
            workgroupBarrier();
            for (var turn = 0u; turn < TURNS; turn++) {
                for (var bits = atomicLoad(&in_reach[turn]); bits != 0u; bits &= bits - 1u) {
                    let away = aways[turn * LANES + firstTrailingBit(bits)];
                    sums.count += 1.0;
                    // As in `search`.
                    sums.offset += away;
                    sums.second_x = fma(vec3f(away.x), away, sums.second_x);
                    sums.second_yz = fma(away.yyz, away.yzz, sums.second_yz);
                }
            }
            workgroupBarrier();
        }
    }
    return sums;
}

@compute @workgroup_size(LANES)
fn search_together(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    lane = local;
    if local == 0u {
        task_load();
    }
    workgroupBarrier();
    for (var place = group_index(workgroup); place < task.left; place += TOGETHER_GROUPS) {
        let index = left[place];
        let query = queries[task.first + index];
        let point = points[query];
        let cell = density_cell(pixel_xy(point.pixel), task.cell_px, task.cell_columns);
        let of_near = has_near_flag(point.pixel);
        var initial_radius = initial_radius_of(density[cell].count, task.cell_px, point.position_view.z);
        if of_near {
            initial_radius = infinity();
        }
        rounds = 0u;
        let found = find(query, point.position_view, initial_radius, of_near);
        let sums = moments(point.position_view, found.squared, of_near);
        if local == 0u {
            neighborhoods[task.first + index] = sums;
            if found.is_clamped {
                atomicAdd(&counters[CLAMPED], 1u);
            }
            if found.is_bounded {
                atomicAdd(&counters[BOUNDED], 1u);
            }
        }
    }
}
