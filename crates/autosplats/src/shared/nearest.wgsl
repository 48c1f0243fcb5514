// The nearest of many: sorted squared distances, the least first, up to sixteen in four vectors. Places not yet taken hold
// MOST. Imports: frame.

// Vectors in use, 1 to 4.
override QUADS: u32;

struct Nearest {
    a: vec4f,
    b: vec4f,
    c: vec4f,
    d: vec4f,
}

fn nearest_none() -> Nearest {
    return Nearest(vec4f(MOST), vec4f(MOST), vec4f(MOST), vec4f(MOST));
}

// Lets one more in: each place takes the lesser of its own and the greater of its left neighbour and the new one. No
// branch, no index, and no place waits for another.
fn nearest_add(list: ptr<function, Nearest>, squared: f32) {
    let added = vec4f(squared);
    if QUADS > 3u {
        (*list).d = min((*list).d, max(vec4f((*list).c.w, (*list).d.xyz), added));
    }
    if QUADS > 2u {
        (*list).c = min((*list).c, max(vec4f((*list).b.w, (*list).c.xyz), added));
    }
    if QUADS > 1u {
        (*list).b = min((*list).b, max(vec4f((*list).a.w, (*list).b.xyz), added));
    }
    (*list).a = min((*list).a, max(vec4f(squared, (*list).a.xyz), added));
}

// Takes out the least; the others move up.
fn nearest_take(list: ptr<function, Nearest>) -> f32 {
    let least = (*list).a.x;
    (*list).a = vec4f((*list).a.yzw, (*list).b.x);
    (*list).b = vec4f((*list).b.yzw, (*list).c.x);
    (*list).c = vec4f((*list).c.yzw, (*list).d.x);
    (*list).d = vec4f((*list).d.yzw, MOST);
    return least;
}
