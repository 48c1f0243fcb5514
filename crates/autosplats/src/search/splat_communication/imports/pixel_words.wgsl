// What the compute form keeps of pixels, in one list. First the index of the point of each pixel, row by row. Then a
// bit for each pixel with a point, in rows of whole words. Then a bit for each of those words that is not 0, also in
// rows.

#import frame

fn words_of(bits: u32) -> u32 {
    return (bits + 31u) / 32u;
}

// Start of the bits: what is before need not be cleared.
fn bits_start() -> u32 {
    return frame.size.x * frame.size.y;
}

// Start of a row's bits, and of the bits of its words.
fn row_starts(row: u32) -> vec2u {
    let words = words_of(frame.size.x);
    return bits_start() + vec2u(row * words, frame.size.y * words + row * words_of(words));
}
