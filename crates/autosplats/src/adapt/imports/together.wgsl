// Balls that the invocations of a workgroup sum up together. All invocations ask for the same ball, in uniform control
// flow, and get the same sums. Alternative: `alone`.

#import quadric

// Rows of cells per step.
const ROWS = 8u;
// Vectors of the largest sums.
const MAX_SUM_VECTORS = 6u;

// Index of the invocation, to be set before the first ball.
var<private> own_place: u32;

// Sums of each invocation, vector by vector. Rows are one element longer than needed, so that they start in different
// memory banks.
const PART_ROW = TOGETHER + 1u;
var<workgroup> parts: array<vec4f, MAX_SUM_VECTORS * PART_ROW>;
var<workgroup> totals: array<vec4f, MAX_SUM_VECTORS>;

// Whether the invocation stores what all of them found.
fn tells() -> bool {
    return own_place == 0u;
}

fn own_start() -> vec2u {
    return vec2u(4u * (own_place / ROWS), own_place % ROWS);
}

fn own_step() -> vec2u {
    return vec2u(4u * (TOGETHER / ROWS), ROWS);
}

fn share_sum(part: u32, own: vec4f) {
    parts[part * PART_ROW + own_place] = own;
}

// Sums over all invocations of the first `count` vectors, in the order of the invocations.
fn sum_up(count: u32) -> array<vec4f, MAX_SUM_VECTORS> {
    workgroupBarrier();
    if own_place < MAX_SUM_VECTORS {
        var sum = vec4f(0.0);
        for (var place = 0u; place < TOGETHER && own_place < count; place++) {
            sum += parts[own_place * PART_ROW + place];
        }
        totals[own_place] = sum;
    }
    return workgroupUniformLoad(&totals);
}

fn all_of_plane(own: PlaneSums) -> PlaneSums {
    share_sum(0u, own.first);
    share_sum(1u, vec4f(own.squares, own.len));
    share_sum(2u, vec4f(own.products, 0.0));
    let all = sum_up(3u);
    return PlaneSums(all[0], all[1].xyz, all[2].xyz, all[1].w);
}

fn all_of_quadric(own: QuadricSums) -> QuadricSums {
    share_sum(0u, vec4f(own.first, own.last));
    share_sum(1u, vec4f(own.second, own.len));
    share_sum(2u, own.third);
    share_sum(3u, own.fourth);
    share_sum(4u, own.heights);
    share_sum(5u, vec4f(own.curved, 0.0));
    let all = sum_up(6u);
    return QuadricSums(all[0].xyz, all[1].xyz, all[2], all[3], all[0].w, all[4], all[5].xyz, all[1].w);
}

fn all_of_seen(own: vec4f) -> vec4f {
    share_sum(0u, own);
    return sum_up(1u)[0];
}
