// Cell order of screen points. The screen is cut into strips; a cell is a pixel wide and a strip high. Cells follow
// each other along the strip, pixels down the cell, and slots within the pixel.

#import frame
#import divide

struct CellSlot {
    // Index among the keys.
    slot: u32,
    pixel: vec2u,
    // Which half of the pixel it is; 0 if pixels are whole.
    half: u32,
    // Whether the slot is the first of its cell, and the cell's index.
    first: bool,
    cell: u32,
}

// The slot at a position in cell order.
fn cell_slot(at_slot: u32, strip_px: u32) -> CellSlot {
    // One or two slots per pixel.
    let at = at_slot >> frame.halves;
    let half = at_slot & frame.halves;
    let strip = divide(at, strip_px * frame.size.x).x;
    let top = strip * strip_px;
    // The last strip may be lower.
    let height = min(strip_px, frame.size.y - top);
    let place = divide(at - top * frame.size.x, height);
    let pixel = vec2u(place.x, top + place.y);
    let slot = ((pixel.y * frame.size.x + pixel.x) << frame.halves) + half;
    return CellSlot(slot, pixel, half, place.y == 0u && half == 0u, strip * frame.size.x + pixel.x);
}
