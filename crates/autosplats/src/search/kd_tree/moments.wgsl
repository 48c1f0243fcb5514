// Sums the neighbours of each query within its k-radius [Paper, §4]: all points of the cloud there, visible or not.
//
// The radius is the upper end of a bin, which may hold one point more than the k-th. The furthest point is kept apart
// and left out if there are k without it. So the k-radius is exact unless the bin holds two more.
//
// Reads: counters, source, queries, positions, radii, nodes, points. Writes: neighborhoods, counters.

#import frame
#import groups
#import kd_tree
#import neighborhood

@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read> source: array<u32>;
@group(0) @binding(3) var<storage, read> queries: array<u32>;
@group(0) @binding(4) var<storage, read> positions: array<f32>;
@group(0) @binding(5) var<storage, read> radii: array<f32>;
@group(0) @binding(6) var<storage, read> nodes: array<KdNode>;
@group(0) @binding(7) var<storage, read> points: array<KdPoint>;
@group(0) @binding(8) var<storage, read_write> neighborhoods: array<Neighborhood>;

struct Task {
    first: u32,
    len: u32,
}

var<workgroup> task: Task;
var<workgroup> clamped: atomic<u32>;
var<workgroup> bounded: atomic<u32>;

struct Found {
    sums: Neighborhood,
    is_bounded: bool,
}

fn nothing(count: f32, k_radius: f32) -> Neighborhood {
    return Neighborhood(vec3f(0.0), count, vec3f(0.0), k_radius, vec3f(0.0), 0u);
}

fn add(sums: ptr<function, Neighborhood>, away: vec3f) {
    (*sums).count += 1.0;
    (*sums).offset += away;
    (*sums).second_x += away.x * away;
    (*sums).second_yz += vec3f(away.y * away.y, away.y * away.z, away.z * away.z);
}

fn find(own: u32) -> Found {
    let radius = radii[own];
    if !(radius >= 0.0) {
        return Found(nothing(0.0, 0.0), false);
    }
    if radius == 0.0 {
        // At least k coincident points, which add nothing to any sum.
        return Found(nothing(f32(frame.k), 0.0), false);
    }
    let center = vec3f(positions[3u * own], positions[3u * own + 1u], positions[3u * own + 2u]);
    var sums = nothing(0.0, 0.0);
    // The furthest neighbour, and the squared distance of its predecessor.
    var furthest = vec3f(0.0);
    var furthest_squared = -1.0;
    var next_squared = 0.0;
    var walk = kd_walk(center, radius);
    var leaf = kd_next_leaf(&walk);
    while leaf.y > 0u {
        for (var place = leaf.x; place < leaf.x + leaf.y && walk.seen < MAX_WALK_VISITS; place++) {
            walk.seen += 1u;
            let away = bitcast<vec3f>(points[place].xyz) - center;
            let squared = kd_squared_length(away);
            if squared > walk.squared || points[place].w == own {
                continue;
            }
            let replaces = squared > furthest_squared;
            if furthest_squared >= 0.0 {
                add(&sums, frame.view_from_world * select(away, furthest, replaces));
                next_squared = max(next_squared, select(squared, furthest_squared, replaces));
            }
            furthest = select(furthest, away, replaces);
            furthest_squared = max(squared, furthest_squared);
        }
        if walk.seen >= MAX_WALK_VISITS {
            break;
        }
        leaf = kd_next_leaf(&walk);
    }
    // All points at the k-th distance belong.
    if furthest_squared >= 0.0 && (sums.count < f32(frame.k) || furthest_squared == next_squared) {
        add(&sums, frame.view_from_world * furthest);
        next_squared = furthest_squared;
    }
    sums.k_radius = sqrt(next_squared);
    return Found(sums, walk.seen >= MAX_WALK_VISITS);
}

@compute @workgroup_size(SMALL_GROUP)
fn moments(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        task.first = atomicLoad(&counters[ROUND_FIRST]);
        task.len = atomicLoad(&counters[ROUND_LEN]);
        atomicStore(&clamped, 0u);
        atomicStore(&bounded, 0u);
    }
    workgroupBarrier();
    let index = group_index(workgroup) * SMALL_GROUP + local;
    if index < task.len {
        let found = find(source[queries[task.first + index]]);
        neighborhoods[task.first + index] = found.sums;
        if found.sums.count > 0.0 && found.sums.count < f32(frame.k) {
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
