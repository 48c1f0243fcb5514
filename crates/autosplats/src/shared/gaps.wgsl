// When a neighbourhood ends at a gap: see the host's SearchRules. Imports: frame.

// How much further than its furthest neighbour a neighbourhood of so many may go without another.
fn gap_growth_after(neighbors: u32) -> f32 {
    let is_single = frame.adaptive == 1u && neighbors == 1u;
    return select(frame.gap_growth, frame.gap_growth * frame.gap_growth, is_single);
}
