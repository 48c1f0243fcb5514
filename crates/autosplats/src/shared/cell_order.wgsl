// Cell order: the screen is cut into strips, a cell is a pixel wide and a strip high, cells follow each other along the
// strip, and pixels down the cell. Imports: frame.

#import divide

struct CellPixel {
    pixel: vec2u,
    // Whether the pixel is the first of its cell, and the cell.
    first: bool,
    cell: u32,
}

// The pixel at a place in cell order.
fn cell_pixel(at: u32, strip_px: u32) -> CellPixel {
    let strip = divide(at, strip_px * frame.size.x).x;
    let top = strip * strip_px;
    // The last strip may be lower.
    let height = min(strip_px, frame.size.y - top);
    let place = divide(at - top * frame.size.x, height);
    let pixel = vec2u(place.x, top + place.y);
    return CellPixel(pixel, place.y == 0u, strip * frame.size.x + pixel.x);
}
