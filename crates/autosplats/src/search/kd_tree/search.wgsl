// The k-radius of every point of the tree, narrowed by range searches with histograms of distances [ZHWG08, §5].
//
// Each of N_ITER searches counts the neighbours between two radii in N_HIST bins. The next search is between the ends
// of the bin that holds the k-th. With fewer than k neighbours the first radius stays.
//
// Reads: state, points, nodes. Writes: radii. One invocation per point, in the order of the tree, so that neighbouring
// invocations walk alike.

#import frame
#import groups
#import kd_build
#import kd_tree

@group(0) @binding(1) var<storage, read> state: KdState;
@group(0) @binding(2) var<storage, read> points: array<KdPoint>;
@group(0) @binding(3) var<storage, read> nodes: array<KdNode>;
@group(0) @binding(4) var<storage, read_write> radii: array<f32>;

const N_HIST = 32u;
const N_ITER = 2u;
// For the rounding of a distance and of its bin.
const ROUNDING = 1.000001;

@compute @workgroup_size(SMALL_GROUP)
fn search(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let at = group_index(workgroup) * SMALL_GROUP + local;
    if at >= state.finite {
        return;
    }
    let own = points[at].w;
    let center = kd_position(points[at]);
    // Bounds of the k-radius, and the number of points nearer than the lower bound.
    var low = 0.0;
    var high = frame.first_radius;
    var nearer = 0u;
    // Number of coincident points; with k of them the k-radius is 0.
    var coincident = 0u;
    for (var iteration = 0u; iteration < N_ITER && coincident < frame.k; iteration++) {
        var bins = array<u32, N_HIST>();
        let per_bin = (high - low) / f32(N_HIST);
        coincident = 0u;
        var walk = kd_walk(center, high);
        var leaf = kd_next_leaf(&walk);
        while leaf.y > 0u {
            for (var place = leaf.x; place < leaf.x + leaf.y; place++) {
                let squared = kd_squared_length(kd_position(points[place]) - center);
                let is_other = points[place].w != own;
                coincident += select(0u, 1u, is_other && squared == 0.0);
                let distance = sqrt(squared);
                if is_other && squared <= walk.squared && distance >= low {
                    bins[u32(min((distance - low) / per_bin, f32(N_HIST - 1u)))] += 1u;
                }
                walk.seen += 1u;
                if walk.seen >= MAX_WALK_VISITS || coincident >= frame.k {
                    break;
                }
            }
            if walk.seen >= MAX_WALK_VISITS || coincident >= frame.k {
                break;
            }
            leaf = kd_next_leaf(&walk);
        }
        // Differs from [ZHWG08]: a search that visits too much ends. The points visited still bound the radius.
        let is_whole = walk.seen < MAX_WALK_VISITS;
        var so_far = nearer;
        var bin = 0u;
        while bin < N_HIST && so_far + bins[bin] < frame.k {
            so_far += bins[bin];
            bin += 1u;
        }
        if bin == N_HIST {
            break;
        }
        high = low + f32(bin + 1u) * per_bin;
        low = select(0.0, low + f32(bin) * per_bin, is_whole);
        nearer = select(0u, so_far, is_whole);
    }
    radii[own] = select(high * ROUNDING, 0.0, coincident >= frame.k);
}
