// Draws splats into a patch of pixels, one workgroup per patch. An invocation draws a column of eight pixels, as the
// components of two vectors, so that each read of a splat serves eight pixels.
//
// The including pass binds `tree` and `splats`, and defines two functions. `load(slot, index)` reads what it needs of a
// splat besides its geometry. `draw(slot)` draws a splat that may cover the invocation's pixels. Each pixel draws its
// splats in the order of their list.
//
// How it works: the workgroup descends the tree and tests the children of several nodes at a time, one child per
// invocation. Hits become bits in workgroup memory, and the bits become an ordered list. The splats found are drawn 64
// at a time: each invocation loads one. The splats that meet each column, and each band of eight rows, become bits. An
// invocation draws the splats that meet both its column and its band.

#import frame
#import patches
#import splat

// Rows of an invocation. As many invocations draw a patch as splats are drawn at a time.
const OWN_ROWS = PATCH.x * PATCH.y / BATCH;
// Words of bits for the children that are tested at a time.
const HIT_WORDS = 16u;

// Geometry of a splat.
struct Brush {
    center_px: vec2f,
    plane: vec2f,
    u: vec2f,
    v: vec2f,
    // Value of the plane at the centre.
    start: f32,
    epsilon: f32,
    // Nearest and furthest depth of the disc.
    low: f32,
    high: f32,
}

// A splat at four pixels.
struct Fragments {
    // Squared distance from the centre, in supports; the splat covers up to 1.
    squared: vec4f,
    // Depth along the viewing axis.
    depth: vec4f,
}

var<workgroup> found_nodes: u32;
// Flags of the children that are hit; twice, so that one half can be cleared while the other is in use.
var<workgroup> hits: array<atomic<u32>, 2u * HIT_WORDS>;
// First word of the half in use.
var<private> hits_half: u32;
// Lists of the nodes found at each level: see `list_start`.
var<workgroup> listed: array<u32, 1280>;
var<workgroup> brushes: array<Brush, BATCH>;
// Per splat, the patch's columns that it meets in the low 16 bits, above them the bands of eight rows. Scalars, because
// writes of components of one vector by several invocations may overwrite each other.
var<workgroup> met: array<u32, BATCH>;
// The transpose: the splats that meet each column, then each band, sixteen to a word.
var<workgroup> meeting: array<u32, 80>;

// Offset of the invocation's pixels in the patch: column and first row.
fn own_offset(local: u32) -> vec2u {
    return vec2u(local % PATCH.x, OWN_ROWS * (local / PATCH.x));
}

// Draws all living splats into the patch with first pixel `corner`. Returns whether any meets it. Loops break at their
// end: most patches need a single pass, and software devices pay for a pass that only ends a loop.
fn draw_patch(corner: vec2u, local: u32) -> bool {
    let end = tree[0].x;
    if local < 2u * HIT_WORDS {
        atomicStore(&hits[local], 0u);
    }
    workgroupBarrier();
    // Roots: groups of nodes of the top level.
    let size = 1u << (FAN_BITS * (TOP + 1u));
    let roots = (end + size - 1u) / size;
    var is_met = false;
    var root = 0u;
    loop {
        let tops = find(TOP, root, roots, corner, local, end);
        var top = 0u;
        loop {
            let runs = find(RUNS, top, tops, corner, local, end);
            var run = 0u;
            loop {
                let leaves = find(LEAVES, run, runs, corner, local, end);
                var leaf = 0u;
                loop {
                    let found = find(SPLATS, leaf, leaves, corner, local, end);
                    is_met |= found > 0u;
                    var at = 0u;
                    loop {
                        prepare(corner, local, at, found);
                        draw_prepared(local);
                        // The next splats overwrite these.
                        workgroupBarrier();
                        at += BATCH;
                        if at >= found {
                            break;
                        }
                    }
                    leaf += most_parents(SPLATS);
                    if leaf >= leaves {
                        break;
                    }
                }
                run += most_parents(LEAVES);
                if run >= runs {
                    break;
                }
            }
            top += most_parents(RUNS);
            if top >= tops {
                break;
            }
        }
        root += most_parents(TOP);
        if root >= roots {
            break;
        }
    }
    return is_met;
}

// Number of nodes whose children at a level are tested at a time.
fn most_parents(level: u32) -> u32 {
    return select(16u, 32u, level == SPLATS);
}

// Start of a level's list in `listed`.
fn list_start(level: u32) -> u32 {
    return select(256u + 256u * level, 0u, level == SPLATS);
}

// Lists the children at `level` that meet the patch, and returns their number. Tests the children of the nodes from
// `at` to `listed_end` in the list of the level above, at most `most_parents` of these.
fn find(level: u32, at: u32, listed_end: u32, corner: vec2u, local: u32, end: u32) -> u32 {
    let last = corner + PATCH - 1u;
    let start = level_start(level);
    // Splats in a node.
    let size = 1u << (FAN_BITS * level);
    let nodes = (end + size - 1u) / size;
    let parents = min(max(listed_end, at) - at, most_parents(level));
    // A word holds the children of two parents; a round of the workgroup tests those of four.
    let rows = (parents + 3u) / 4u;
    let above = list_start(level + 1u) + at;
    let half = hits_half;
    hits_half = HIT_WORDS - half;
    if local < HIT_WORDS {
        atomicStore(&hits[HIT_WORDS - half + local], 0u);
    }
    var row = 0u;
    loop {
        let place = 4u * row + local / FAN;
        if place < parents {
            let child = parent_at(level, at, above, place) * FAN + local % FAN;
            if child < nodes {
                let bounds = tree[start + child];
                if all(firsts(bounds) <= last) && all(lasts(bounds) >= corner) {
                    atomicOr(&hits[half + 2u * row + local / 32u], 1u << (local % 32u));
                }
            }
        }
        row += 1u;
        if row >= rows {
            break;
        }
    }
    workgroupBarrier();
    var hit = 0u;
    row = 0u;
    loop {
        let low = atomicLoad(&hits[half + 2u * row]);
        let high = atomicLoad(&hits[half + 2u * row + 1u]);
        let own = select(low, high, local >= 32u);
        let bit = 1u << (local % 32u);
        if (own & bit) != 0u {
            let rank = hit + countOneBits(own & (bit - 1u)) + select(0u, countOneBits(low), local >= 32u);
            let parent = parent_at(level, at, above, 4u * row + local / FAN);
            listed[list_start(level) + rank] = parent * FAN + local % FAN;
        }
        hit += countOneBits(low) + countOneBits(high);
        row += 1u;
        if row >= rows {
            break;
        }
    }
    if local == 0u {
        found_nodes = hit;
    }
    return workgroupUniformLoad(&found_nodes);
}

// Node at position `place` after `at` in the list of the level above, which begins at `above`. Above the top level, all
// nodes count as listed.
fn parent_at(level: u32, at: u32, above: u32, place: u32) -> u32 {
    if level == TOP {
        return at + place;
    }
    return listed[above + place];
}

// Loads up to 64 listed splats from position `at`.
fn prepare(corner: vec2u, local: u32, at: u32, found: u32) {
    var meets = 0u;
    if at + local < found {
        let index = listed[at + local];
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
        let high = min(lasts(bounds) - corner, PATCH - 1u);
        let bands = vec2u(low.y, high.y) / OWN_ROWS;
        meets = ((2u << high.x) - (1u << low.x)) | (((2u << bands.y) - (1u << bands.x)) << PATCH.x);
        load(local, index);
    }
    met[local] = meets;
    workgroupBarrier();
    // An invocation per column and sixteen splats; the invocations of the first columns also do the bands.
    let line = local % PATCH.x;
    let part = local / PATCH.x;
    var column = 0u;
    var row = 0u;
    var i = 0u;
    loop {
        let first = 16u * part + 4u * i;
        let bits = vec4u(met[first], met[first + 1u], met[first + 2u], met[first + 3u]) >> vec4u(line);
        column |= dot(bits & vec4u(1u), vec4u(1u, 2u, 4u, 8u)) << (4u * i);
        row |= dot((bits >> vec4u(PATCH.x)) & vec4u(1u), vec4u(1u, 2u, 4u, 8u)) << (4u * i);
        i += 1u;
        if i >= 4u {
            break;
        }
    }
    meeting[4u * line + part] = column;
    if line < PATCH.y / OWN_ROWS {
        meeting[4u * (PATCH.x + line) + part] = row;
    }
    workgroupBarrier();
}

// Draws the splats that may cover the invocation's pixels, in order.
fn draw_prepared(local: u32) {
    let column = 4u * (local % PATCH.x);
    let row = 4u * (PATCH.x + local / PATCH.x);
    var low = (meeting[column] & meeting[row]) | ((meeting[column + 1u] & meeting[row + 1u]) << 16u);
    var high = (meeting[column + 2u] & meeting[row + 2u]) | ((meeting[column + 3u] & meeting[row + 3u]) << 16u);
    loop {
        if (low | high) != 0u {
            let rest = select(high, low, low != 0u);
            draw(select(32u, 0u, low != 0u) + firstTrailingBit(rest));
            high = select(high & (high - 1u), high, low != 0u);
            low &= low - 1u;
        }
        if (low | high) == 0u {
            break;
        }
    }
}

// A splat at the centres of four pixels in a column.
fn fragments(brush: Brush, x: f32, y: vec4f) -> Fragments {
    let dx = x - brush.center_px.x;
    let dy = y - brush.center_px.y;
    let plane = (brush.start + brush.plane.y * dy) + brush.plane.x * dx;
    var u = brush.u.y * dy + brush.u.x * dx;
    var v = brush.v.y * dy + brush.v.x * dx;
    var depth = plane;
    if frame.perspective == 1u {
        depth = 1.0 / plane;
        u *= depth;
        v *= depth;
    }
    let disc = u * u + v * v;
    let dot = (dx * dx + dy * dy) * (1.0 / (DOT_RADIUS_PX * DOT_RADIUS_PX));
    // The dot reaches beyond the disc, where the disc's plane is meaningless and `disc` may be NaN.
    let low = vec4f(brush.low);
    // Below an inverse depth of zero, the disc's plane is hit behind the eye.
    let is_ahead = vec4<bool>(frame.perspective == 0u) | (plane >= vec4f(0.0));
    return Fragments(select(dot, disc, is_ahead & (disc < dot)), min(max(depth, low), vec4f(brush.high)));
}
