// Eigenvectors of symmetric 3×3 matrices by cyclic Jacobi rotations: see the CPU form.

struct Eigen {
    // Eigenvalues, ascending.
    values: vec3f,
    // Unit eigenvectors of the least, the middle and the largest eigenvalue.
    least: vec3f,
    middle: vec3f,
    largest: vec3f,
}

// Result of a rotation that zeroes the entry (p, q); r is the third axis.
struct Rotated {
    p: f32,
    q: f32,
    pr: f32,
    qr: f32,
    vector_p: vec3f,
    vector_q: vec3f,
}

fn rotate(p: f32, q: f32, pq: f32, pr: f32, qr: f32, vector_p: vec3f, vector_q: vec3f) -> Rotated {
    let difference = 0.5 * (q - p);
    // tan of the smaller angle: sign(δ)·a/(|δ| + √(δ² + a²)). For a zero entry, the least divisor makes it 0.
    let length = sqrt(difference * difference + pq * pq);
    let signed = select(pq, -pq, difference < 0.0);
    let tan = signed / max(abs(difference) + length, MIN_POSITIVE);
    let cos = 1.0 / sqrt(1.0 + tan * tan);
    let sin = tan * cos;
    return Rotated(
        p - tan * pq,
        q + tan * pq,
        cos * pr - sin * qr,
        sin * pr + cos * qr,
        cos * vector_p - sin * vector_q,
        sin * vector_p + cos * vector_q,
    );
}

// Diagonalises a matrix, given as xx, yy, zz and yz, xz, xy.
fn eigen(diagonal: vec3f, rest: vec3f) -> Eigen {
    var d = diagonal;
    var yz = rest.x;
    var xz = rest.y;
    var xy = rest.z;
    var x = vec3f(1.0, 0.0, 0.0);
    var y = vec3f(0.0, 1.0, 0.0);
    var z = vec3f(0.0, 0.0, 1.0);
    for (var sweep = 0u; sweep < SWEEPS; sweep++) {
        let a = rotate(d.x, d.y, xy, xz, yz, x, y);
        d = vec3f(a.p, a.q, d.z);
        xz = a.pr;
        yz = a.qr;
        // The entry (x, y) is 0 here.
        let b = rotate(d.x, d.z, xz, 0.0, yz, a.vector_p, z);
        d = vec3f(b.p, d.y, b.q);
        xy = b.pr;
        yz = b.qr;
        let c = rotate(d.y, d.z, yz, xy, 0.0, a.vector_q, b.vector_q);
        d = vec3f(d.x, c.p, c.q);
        xy = c.pr;
        xz = c.qr;
        yz = 0.0;
        x = b.vector_p;
        y = c.vector_p;
        z = c.vector_q;
    }
    var found = Eigen(d, x, y, z);
    if found.values.y < found.values.x {
        found = Eigen(found.values.yxz, found.middle, found.least, found.largest);
    }
    if found.values.z < found.values.y {
        found = Eigen(found.values.xzy, found.least, found.largest, found.middle);
    }
    if found.values.y < found.values.x {
        found = Eigen(found.values.yxz, found.middle, found.least, found.largest);
    }
    return found;
}
