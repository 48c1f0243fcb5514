// Draws splats into a patch of pixels, one workgroup and one pixel per invocation. Imports: frame, splat.
//
// The including pass binds `tree` and `splats`, and has two functions: `load(slot, index)` reads what it needs of a splat
// beside its geometry, and `draw(slot)` draws a splat that may cover the invocation's own pixel. A pixel draws its splats
// in the order of their list.
//
// How it works: the workgroup descends the tree, testing the children of up to eight nodes at a time, an invocation per
// child. Hits become bits in workgroup memory and from there a list in order. Once 64 splats are listed, or none are left
// to find, they are drawn: each invocation loads one splat; the splats that meet each column and each row of the patch
// become bits, and a pixel's splats are those of its column and its row.

// Side of a patch in pixels; a patch has as many pixels as a node children, and a workgroup invocations.
const PATCH = 8u;
// Nodes whose children are tested at a time.
const MOST_PARENTS = 8u;
// Lists of runs of runs and of runs, then a ring of splats: 63 may be left when those of eight runs are added.
const LIST = 512u;
const RING = 1024u;
// What to do next, if not to find nodes of a level.
const DRAW = 3u;
const FINISH = 4u;

// A splat's geometry.
struct Brush {
    center_px: vec2f,
    plane: vec2f,
    u: vec2f,
    v: vec2f,
    // Of the plane at the centre.
    start: f32,
    epsilon: f32,
    // Nearest and furthest depth of the disc.
    low: f32,
    high: f32,
}

struct Fragment {
    // Squared distance from the centre, in supports; the splat covers up to 1.
    squared: f32,
    // Depth along the viewing axis.
    depth: f32,
}

override DOT_RADIUS_PX: f32;

var<workgroup> todo: u32;
// Two words for each parent; twice, so that one can be cleared while the other is in use.
var<workgroup> hits: array<atomic<u32>, 32>;
var<workgroup> listed: array<u32, 2u * LIST + RING>;
var<workgroup> brushes: array<Brush, FAN>;
// The patch's columns in the low, its rows in the high 8 bits that each splat meets.
var<workgroup> met: array<u32, FAN>;
// The same the other way around: the splats that meet each column, then each row, sixteen to a word.
var<workgroup> meeting: array<u32, FAN>;

// Number of workgroups that have a patch.
fn patches() -> vec2u {
    return (frame.size + PATCH - 1u) / PATCH;
}

// Draws all living splats from `first` on into the patch whose first pixel is `corner`.
fn draw_patch(corner: vec2u, local: u32, first: u32) {
    let last = corner + PATCH - 1u;
    let end = tree[0].y;
    // Next and end of the nodes that wait in each list, and of those above the tree.
    var above = vec2u(first / (FAN * FAN * FAN), (end + FAN * FAN * FAN - 1u) / (FAN * FAN * FAN));
    var runs_of_runs = vec2u(0u);
    var runs = vec2u(0u);
    var waiting = vec2u(0u);
    var half = 0u;
    if local < 32u {
        atomicStore(&hits[local], 0u);
    }
    loop {
        if local == 0u {
            var next = FINISH;
            if waiting.y - waiting.x >= FAN {
                next = DRAW;
            } else if runs.x < runs.y {
                next = SPLATS;
            } else if runs_of_runs.x < runs_of_runs.y {
                next = RUNS;
            } else if above.x < above.y {
                next = RUNS_OF_RUNS;
            } else if waiting.x < waiting.y {
                next = DRAW;
            }
            todo = next;
        }
        let level = workgroupUniformLoad(&todo);
        if level == FINISH {
            break;
        }
        if level == DRAW {
            let count = min(waiting.y - waiting.x, FAN);
            prepare(corner, local, count, waiting.x);
            draw_prepared(local);
            waiting.x += count;
            continue;
        }

        // Find: which children of the next parents meet the patch.
        var parents = above;
        var at = 0u;
        var nodes = (end + FAN * FAN - 1u) / (FAN * FAN);
        if level == RUNS {
            parents = runs_of_runs;
            nodes = (end + FAN - 1u) / FAN;
        } else if level == SPLATS {
            parents = runs;
            at = LIST;
            nodes = end;
        }
        let count = min(parents.y - parents.x, MOST_PARENTS);
        let start = level_start(level);
        if local < 16u {
            atomicStore(&hits[16u - half + local], 0u);
        }
        for (var i = 0u; i < count; i++) {
            let parent = select(listed[at + parents.x + i], parents.x + i, level == RUNS_OF_RUNS);
            let child = parent * FAN + local;
            if child < nodes && !(level == SPLATS && child < first) {
                let bounds = tree[start + child];
                if all(firsts(bounds) <= last) && all(lasts(bounds) >= corner) {
                    atomicOr(&hits[half + 2u * i + local / 32u], 1u << (local % 32u));
                }
            }
        }
        workgroupBarrier();
        var hit = 0u;
        for (var i = 0u; i < count; i++) {
            let low = atomicLoad(&hits[half + 2u * i]);
            let high = atomicLoad(&hits[half + 2u * i + 1u]);
            let own = select(low, high, local >= 32u);
            let bit = 1u << (local % 32u);
            if (own & bit) != 0u {
                let rank = hit + countOneBits(own & (bit - 1u)) + select(0u, countOneBits(low), local >= 32u);
                let parent = select(listed[at + parents.x + i], parents.x + i, level == RUNS_OF_RUNS);
                let to = select(
                    select(rank, LIST + rank, level == RUNS),
                    2u * LIST + (waiting.y + rank) % RING,
                    level == SPLATS,
                );
                listed[to] = parent * FAN + local;
            }
            hit += countOneBits(low) + countOneBits(high);
        }
        half = 16u - half;
        if level == RUNS_OF_RUNS {
            above.x += count;
            runs_of_runs = vec2u(0u, hit);
        } else if level == RUNS {
            runs_of_runs.x += count;
            runs = vec2u(0u, hit);
        } else {
            runs.x += count;
            waiting.y += hit;
        }
    }
}

// Loads `count` splats from place `at` of the ring on.
fn prepare(corner: vec2u, local: u32, count: u32, at: u32) {
    var meets = 0u;
    if local < count {
        let index = listed[2u * LIST + (at + local) % RING];
        let splat = splats[index];
        brushes[local] = Brush(
            splat.center_px,
            splat.plane,
            splat.u,
            splat.v,
            select(splat.depth, 1.0 / splat.depth, frame.perspective == 1u),
            splat.epsilon,
            splat.depth - splat.depth_reach,
            splat.depth + splat.depth_reach,
        );
        let bounds = tree[level_start(SPLATS) + index];
        let low = max(firsts(bounds), corner) - corner;
        let high = min(lasts(bounds) - corner, vec2u(PATCH - 1u));
        let bits = (vec2u(2u) << high) - (vec2u(1u) << low);
        meets = bits.x | bits.y << PATCH;
        load(local, index);
    }
    met[local] = meets;
    workgroupBarrier();
    // An invocation per column or row and sixteen splats.
    let line = local % 16u;
    let part = local / 16u;
    var word = 0u;
    for (var i = 0u; i < 16u; i++) {
        word |= ((met[16u * part + i] >> line) & 1u) << i;
    }
    meeting[4u * line + part] = word;
    workgroupBarrier();
}

// Draws the splats that may cover the invocation's pixel, in order.
fn draw_prepared(local: u32) {
    let column = 4u * (local % PATCH);
    let row = 4u * (PATCH + local / PATCH);
    for (var half = 0u; half < 2u; half++) {
        let low = meeting[column + 2u * half] & meeting[row + 2u * half];
        let high = meeting[column + 2u * half + 1u] & meeting[row + 2u * half + 1u];
        var rest = low | high << 16u;
        while rest != 0u {
            draw(32u * half + firstTrailingBit(rest));
            rest &= rest - 1u;
        }
    }
}

// A splat at the centre of a pixel.
fn fragment(slot: u32, pixel_center: vec2f) -> Fragment {
    let d = pixel_center - brushes[slot].center_px;
    let plane = (brushes[slot].start + brushes[slot].plane.y * d.y) + brushes[slot].plane.x * d.x;
    var u = brushes[slot].u.y * d.y + brushes[slot].u.x * d.x;
    var v = brushes[slot].v.y * d.y + brushes[slot].v.x * d.x;
    var depth = plane;
    if frame.perspective == 1u {
        depth = 1.0 / plane;
        u *= depth;
        v *= depth;
    }
    let disc = u * u + v * v;
    let dot = (d.x * d.x + d.y * d.y) * (1.0 / (DOT_RADIUS_PX * DOT_RADIUS_PX));
    // The dot reaches beyond the disc, where its plane is of no use; the disc may not be a number there.
    return Fragment(select(dot, disc, disc < dot), min(max(depth, brushes[slot].low), brushes[slot].high));
}
