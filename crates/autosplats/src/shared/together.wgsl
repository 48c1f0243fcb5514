// Balls that the invocations of a workgroup sum up together, for the few that take long: what one would do after the other they
// do side by side. All ask for the same ball, in uniform control flow, and get the same answer. Imports: quadric.

// How many they are, 8, 16 or 32.
override TOGETHER: u32;
// Rows of cells that they take at a time.
const ROWS = 8u;
// Vectors that the largest sums take.
const MOST_PARTS = 6u;

// To be set before the first ball.
var<private> own_place: u32;

// What each has, vector by vector. Rows are one place longer than any needs, so that not all begin in the same bank of memory.
const PART_ROW = 33u;
var<workgroup> parts: array<vec4f, MOST_PARTS * PART_ROW>;
var<workgroup> totals: array<vec4f, MOST_PARTS>;

fn own_start() -> vec2u {
    return vec2u(4u * (own_place / ROWS), own_place % ROWS);
}

fn own_step() -> vec2u {
    return vec2u(4u * (TOGETHER / ROWS), ROWS);
}

fn tell(part: u32, own: vec4f) {
    parts[part * PART_ROW + own_place] = own;
}

// The sums over all invocations of the first parts that each has told, in their order.
fn sum_up(count: u32) -> array<vec4f, MOST_PARTS> {
    workgroupBarrier();
    if own_place < MOST_PARTS {
        var sum = vec4f(0.0);
        for (var place = 0u; place < TOGETHER && own_place < count; place++) {
            sum += parts[own_place * PART_ROW + place];
        }
        totals[own_place] = sum;
    }
    return workgroupUniformLoad(&totals);
}

fn all_of_plane(own: PlaneSums) -> PlaneSums {
    tell(0u, own.first);
    tell(1u, vec4f(own.squares, own.len));
    tell(2u, vec4f(own.products, 0.0));
    let all = sum_up(3u);
    return PlaneSums(all[0], all[1].xyz, all[2].xyz, all[1].w);
}

fn all_of_quadric(own: QuadricSums) -> QuadricSums {
    tell(0u, vec4f(own.first, own.last));
    tell(1u, vec4f(own.second, own.len));
    tell(2u, own.third);
    tell(3u, own.fourth);
    tell(4u, own.heights);
    tell(5u, vec4f(own.curved, 0.0));
    let all = sum_up(6u);
    return QuadricSums(all[0].xyz, all[1].xyz, all[2], all[3], all[0].w, all[4], all[5].xyz, all[1].w);
}

fn all_of_seen(own: vec4f) -> vec4f {
    tell(0u, own);
    return sum_up(1u)[0];
}
