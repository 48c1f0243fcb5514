// What points tell each other in the compute form: an entry for each screen point. The including pass binds `searches`
// and `told`.

#import point_search
#import radius_search

struct Told {
    // Bits of the distance to the furthest query that reaches the point: the feedback radius.
    feedback: atomic<u32>,
    // Bits of the distance to the furthest neighbour that answered.
    furthest: atomic<u32>,
    // Neighbours that answered, each counted at the least of the four sample radii that reaches it.
    reached: array<atomic<u32>, 4>,
}

fn search_of(point: u32) -> Search {
    let asked = searches[point];
    return Search(asked.low, asked.high, asked.count);
}

fn known_of(point: u32) -> GatheredCounts {
    var counts: vec4f;
    var sum = 0u;
    for (var sample = 0u; sample < 4u; sample++) {
        sum += atomicLoad(&told[point].reached[sample]);
        counts[sample] = f32(sum);
    }
    let search = search_of(point);
    let furthest = bitcast<f32>(atomicLoad(&told[point].furthest));
    return recall(vec4f(search.low, search.high, search.count, furthest), counts);
}

// Forgets the answers to a point.
fn forget_answers(point: u32) {
    atomicStore(&told[point].furthest, 0u);
    for (var sample = 0u; sample < 4u; sample++) {
        atomicStore(&told[point].reached[sample], 0u);
    }
}
