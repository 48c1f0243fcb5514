// The splats of a workgroup, an invocation each, as lines of pixels that all invocations share: none waits for another
// whose splat is larger.

// Numbers of splats and of lines in `lines_told`: the latter in the low bits.
const LINE_BITS = 23u;

// Splats and lines told so far.
var<workgroup> lines_told: atomic<u32>;
// For each splat that has lines, in any order: its number in the workgroup, and the number of lines before its own.
var<workgroup> line_splats: array<u32, LARGE_GROUP>;
var<workgroup> lines_before: array<u32, LARGE_GROUP>;

// To be called by all invocations of a workgroup before any tells lines; ends with a barrier.
fn clear_lines(local: u32) {
    if local == 0u {
        atomicStore(&lines_told, 0u);
    }
    workgroupBarrier();
}

// Tells the number of lines of an invocation's splat, one for each of its rows. A screen has fewer than 2¹⁵ rows.
fn tell_lines(rows: u32, local: u32) {
    let told = atomicAdd(&lines_told, (1u << LINE_BITS) | rows);
    line_splats[told >> LINE_BITS] = local;
    lines_before[told >> LINE_BITS] = told & ((1u << LINE_BITS) - 1u);
}

// Number of all lines. To be called by all invocations; begins with a barrier.
fn line_count() -> u32 {
    workgroupBarrier();
    return atomicLoad(&lines_told) & ((1u << LINE_BITS) - 1u);
}

// Splat of a line, as a number in the workgroup, and the line's number in the splat.
fn splat_line(line: u32) -> vec2u {
    let splats = atomicLoad(&lines_told) >> LINE_BITS;
    var place = 0u;
    for (var step = LARGE_GROUP / 2u; step > 0u; step /= 2u) {
        let tried = place + step;
        place = select(place, tried, tried < splats && lines_before[tried] <= line);
    }
    return vec2u(line_splats[place], line - lines_before[place]);
}
