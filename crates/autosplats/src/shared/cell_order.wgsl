// Cell order: the screen is cut into strips, a cell is a pixel wide and a strip high, cells follow each other along the
// strip, pixels down the cell, and slots of a pixel one after the other. Imports: frame.

#import divide

struct CellSlot {
    // Of the keys.
    slot: u32,
    pixel: vec2u,
    // Whether the slot is the first of its cell, and the cell.
    first: bool,
    cell: u32,
}

// The slot at a place in cell order.
fn cell_slot(at_slot: u32, strip_px: u32) -> CellSlot {
    // One slot a pixel, or two.
    let at = at_slot >> frame.halves;
    let half = at_slot & frame.halves;
    let strip = divide(at, strip_px * frame.size.x).x;
    let top = strip * strip_px;
    // The last strip may be lower.
    let height = min(strip_px, frame.size.y - top);
    let place = divide(at - top * frame.size.x, height);
    let pixel = vec2u(place.x, top + place.y);
    let slot = ((pixel.y * frame.size.x + pixel.x) << frame.halves) + half;
    return CellSlot(slot, pixel, place.y == 0u && half == 0u, strip * frame.size.x + pixel.x);
}
