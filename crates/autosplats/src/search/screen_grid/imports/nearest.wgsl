// List of the k least squared distances, ascending, in up to sixteen vectors of four. All indices are constants, so
// that the vectors stay in registers.

override K: u32;

// Number of vectors in use.
override QUADS: u32 = (K + 3u) / 4u;

alias Nearest = array<vec4f, 16>;

// The empty list. Unused places hold MAX_F32. Surplus places at the front hold -1, below any distance, so that the k-th
// place is the last one.
fn nearest_none() -> Nearest {
    let m = vec4f(MAX_F32);
    let first = select(m, vec4f(-1.0), vec4u(0u, 1u, 2u, 3u) < vec4u(4u * QUADS - K));
    return Nearest(first, m, m, m, m, m, m, m, m, m, m, m, m, m, m, m);
}

// Each place takes the lesser of its own value and the greater of its left neighbour and the new value.
fn nearest_sift(own: vec4f, left: f32, squared: f32) -> vec4f {
    return min(own, max(vec4f(left, own.xyz), vec4f(squared)));
}

// Inserts a squared distance, without branches or dependences between places.
fn nearest_add(list: ptr<function, Nearest>, squared: f32) {
    if QUADS > 15u {
        (*list)[15] = nearest_sift((*list)[15], (*list)[14].w, squared);
    }
    if QUADS > 14u {
        (*list)[14] = nearest_sift((*list)[14], (*list)[13].w, squared);
    }
    if QUADS > 13u {
        (*list)[13] = nearest_sift((*list)[13], (*list)[12].w, squared);
    }
    if QUADS > 12u {
        (*list)[12] = nearest_sift((*list)[12], (*list)[11].w, squared);
    }
    if QUADS > 11u {
        (*list)[11] = nearest_sift((*list)[11], (*list)[10].w, squared);
    }
    if QUADS > 10u {
        (*list)[10] = nearest_sift((*list)[10], (*list)[9].w, squared);
    }
    if QUADS > 9u {
        (*list)[9] = nearest_sift((*list)[9], (*list)[8].w, squared);
    }
    if QUADS > 8u {
        (*list)[8] = nearest_sift((*list)[8], (*list)[7].w, squared);
    }
    if QUADS > 7u {
        (*list)[7] = nearest_sift((*list)[7], (*list)[6].w, squared);
    }
    if QUADS > 6u {
        (*list)[6] = nearest_sift((*list)[6], (*list)[5].w, squared);
    }
    if QUADS > 5u {
        (*list)[5] = nearest_sift((*list)[5], (*list)[4].w, squared);
    }
    if QUADS > 4u {
        (*list)[4] = nearest_sift((*list)[4], (*list)[3].w, squared);
    }
    if QUADS > 3u {
        (*list)[3] = nearest_sift((*list)[3], (*list)[2].w, squared);
    }
    if QUADS > 2u {
        (*list)[2] = nearest_sift((*list)[2], (*list)[1].w, squared);
    }
    if QUADS > 1u {
        (*list)[1] = nearest_sift((*list)[1], (*list)[0].w, squared);
    }
    (*list)[0] = nearest_sift((*list)[0], squared, squared);
}

// Removes and returns the first place; the others move up.
fn nearest_take(list: ptr<function, Nearest>) -> f32 {
    let least = (*list)[0].x;
    (*list)[0] = vec4f((*list)[0].yzw, (*list)[1].x);
    if QUADS > 1u {
        (*list)[1] = vec4f((*list)[1].yzw, (*list)[2].x);
    }
    if QUADS > 2u {
        (*list)[2] = vec4f((*list)[2].yzw, (*list)[3].x);
    }
    if QUADS > 3u {
        (*list)[3] = vec4f((*list)[3].yzw, (*list)[4].x);
    }
    if QUADS > 4u {
        (*list)[4] = vec4f((*list)[4].yzw, (*list)[5].x);
    }
    if QUADS > 5u {
        (*list)[5] = vec4f((*list)[5].yzw, (*list)[6].x);
    }
    if QUADS > 6u {
        (*list)[6] = vec4f((*list)[6].yzw, (*list)[7].x);
    }
    if QUADS > 7u {
        (*list)[7] = vec4f((*list)[7].yzw, (*list)[8].x);
    }
    if QUADS > 8u {
        (*list)[8] = vec4f((*list)[8].yzw, (*list)[9].x);
    }
    if QUADS > 9u {
        (*list)[9] = vec4f((*list)[9].yzw, (*list)[10].x);
    }
    if QUADS > 10u {
        (*list)[10] = vec4f((*list)[10].yzw, (*list)[11].x);
    }
    if QUADS > 11u {
        (*list)[11] = vec4f((*list)[11].yzw, (*list)[12].x);
    }
    if QUADS > 12u {
        (*list)[12] = vec4f((*list)[12].yzw, (*list)[13].x);
    }
    if QUADS > 13u {
        (*list)[13] = vec4f((*list)[13].yzw, (*list)[14].x);
    }
    if QUADS > 14u {
        (*list)[14] = vec4f((*list)[14].yzw, (*list)[15].x);
    }
    (*list)[15] = vec4f((*list)[15].yzw, MAX_F32);
    return least;
}

// The k-th least squared distance.
fn nearest_last(list: ptr<function, Nearest>) -> f32 {
    return (*list)[QUADS - 1u].w;
}
