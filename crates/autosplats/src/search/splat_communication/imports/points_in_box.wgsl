// Steps through the pixels of a box that have points, row by row: empty pixels cost next to nothing, as they do where
// early-Z drops them. The including pass binds `pixels`.

#import frame
#import depth_mask
#import pixel_words
#import screen
#import window

const NONE = 0xffffffffu;

// A box over pixels [Paper, §4]: first and last columns and rows, and the depth of its splat.
struct Box {
    columns: vec2u,
    rows: vec2u,
    depth: f32,
}

// The neighbourhood box: tight about the projected sphere. The last row is below the first if it covers no pixel.
fn box_about(center: vec3f, radius: f32) -> Box {
    let window = window_of_sphere(center, radius);
    if any(window.low > window.high) {
        return Box(vec2u(0u), vec2u(1u, 0u), 0.0);
    }
    let low = vec2u(window.low);
    let high = vec2u(window.high);
    return Box(vec2u(low.x, high.x), vec2u(low.y, high.y), splat_depth(center, radius));
}

// First bit that is set from `first` to `last`, counted from a word; NONE if there is none.
fn next_bit(start: u32, first: u32, last: u32) -> u32 {
    var word = first / 32u;
    var bits = pixels[start + word] & (0xffffffffu << (first % 32u));
    while bits == 0u && word < last / 32u {
        word++;
        bits = pixels[start + word];
    }
    let bit = 32u * word + firstTrailingBit(bits);
    return select(NONE, bit, bits != 0u && bit <= last);
}

// First column from `first` to `last` with a point in this row; NONE if there is none.
fn next_column(row: u32, first: u32, last: u32) -> u32 {
    if first > last {
        return NONE;
    }
    let starts = row_starts(row);
    let word = first / 32u;
    let end = min(32u * word + 31u, last);
    let near = next_bit(starts.x, first, end);
    if near != NONE || end == last {
        return near;
    }
    let filled = next_bit(starts.y, word + 1u, last / 32u);
    if filled == NONE {
        return NONE;
    }
    return next_bit(starts.x, 32u * filled, last);
}

// The index of the point of a pixel, if the pixel has one.
fn owner_of(column: u32, row: u32) -> u32 {
    return pixels[row * frame.size.x + column];
}

// The mask test: whether a splat at this depth reaches a point.
fn passes_mask(depth: f32, point: ScreenPoint) -> bool {
    return depth > mask_depth(point.position_view.z);
}
