// Gap rule of neighbourhoods [Paper, §5.3]: see `SearchRules` on the CPU.

#import frame

// Factor on the distance of the furthest of `neighbors` neighbours, up to which the next one must follow.
fn gap_growth_after(neighbors: u32) -> f32 {
    let is_single = frame.lenient == 1u && neighbors == 1u;
    return select(frame.gap_growth, frame.gap_growth * frame.gap_growth, is_single);
}
