// Draws the depths of a splat within its bounds: those of a row, or all by a team of invocations (`large`).

#import fragment
#import large
#import splat

fn draw_row(splat: Splat, bounds: vec2u, row: u32) {
    let line = line_of(splat, row);
    let span = span_of(splat, line, bounds);
    for (var column = span.x; column <= span.y; column++) {
        draw_depth(splat, line, u32(column));
    }
}

fn draw_together(splat: Splat, bounds: vec2u, local: u32) {
    let place = place_in_team(local);
    for (var row = firsts(bounds).y + place.y; row <= lasts(bounds).y; row += 8u) {
        let line = line_of(splat, row);
        let span = span_of(splat, line, bounds);
        for (var column = span.x + i32(place.x); column <= span.y; column += 8) {
            draw_depth(splat, line, u32(column));
        }
    }
}
