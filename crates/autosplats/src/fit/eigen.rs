//! Eigenvectors of symmetric 3×3 matrices, one SIMD vector of matrices at a time.

use pulp::Simd;

use crate::simd::F32s;

/// Number of Jacobi sweeps. Cyclic Jacobi converges quadratically: after four sweeps the off-diagonal of a 3×3 matrix
/// is below the rounding of f32.
pub(crate) const SWEEPS: usize = 4;

/// Eigenvalues, ascending, and their unit eigenvectors.
pub(super) struct Eigen<S: Simd> {
    pub(super) values: [F32s<S>; 3],
    /// `vectors[i][axis]`.
    pub(super) vectors: [[F32s<S>; 3]; 3],
}

/// Diagonalises symmetric matrices given as xx, xy, xz, yy, yz, zz.
#[inline(always)]
pub(super) fn eigen<S: Simd>(simd: S, [xx, xy, xz, yy, yz, zz]: [F32s<S>; 6]) -> Eigen<S> {
    let [zero, one] = [0.0, 1.0].map(|value| F32s::splat(simd, value));
    let mut matrix = Rotated {
        diagonal: [xx, yy, zz],
        rest: [yz, xz, xy],
        vectors: [[one, zero, zero], [zero, one, zero], [zero, zero, one]],
    };
    for _ in 0..SWEEPS {
        matrix.rotate::<0, 1, 2>(simd);
        matrix.rotate::<0, 2, 1>(simd);
        matrix.rotate::<1, 2, 0>(simd);
    }
    matrix.order::<0, 1>();
    matrix.order::<1, 2>();
    matrix.order::<0, 1>();
    Eigen { values: matrix.diagonal, vectors: matrix.vectors }
}

/// Eigenvalues, ascending, and unit eigenvectors of one symmetric matrix given as xx, xy, xz, yy, yz, zz.
#[inline(always)]
pub(crate) fn eigenvectors(matrix: [f32; 6]) -> ([f32; 3], [[f32; 3]; 3]) {
    let simd = pulp::Scalar;
    let Eigen { values, vectors } = eigen(simd, matrix.map(|entry| F32s::splat(simd, entry)));
    let first = |vector: F32s<pulp::Scalar>| {
        let mut value = [0.0];
        vector.store(&mut value, 0);
        value[0]
    };
    (values.map(first), vectors.map(|vector| vector.map(first)))
}

/// A matrix that rotations make diagonal.
struct Rotated<S: Simd> {
    diagonal: [F32s<S>; 3],
    /// Off-diagonal entries, each at the index of the axis missing from it.
    rest: [F32s<S>; 3],
    vectors: [[F32s<S>; 3]; 3],
}

impl<S: Simd> Rotated<S> {
    /// One Jacobi rotation that zeroes the entry (P, Q); R is the third axis.
    #[inline(always)]
    fn rotate<const P: usize, const Q: usize, const R: usize>(&mut self, simd: S) {
        let [zero, half, one] = [0.0, 0.5, 1.0].map(|value| F32s::splat(simd, value));
        let least = F32s::splat(simd, f32::MIN_POSITIVE);
        let pq = self.rest[R];
        let difference = half * (self.diagonal[Q] - self.diagonal[P]);
        // Tangent of the smaller angle: sign(δ)·a/(|δ| + √(δ² + a²)). The least divisor makes it 0 for a zero entry.
        let length = (difference * difference + pq * pq).sqrt();
        let signed = difference.less(zero).select(zero - pq, pq);
        let tan = signed / (difference.abs() + length).max(least);
        let cos = one / (one + tan * tan).sqrt();
        let sin = tan * cos;
        self.diagonal[P] = self.diagonal[P] - tan * pq;
        self.diagonal[Q] += tan * pq;
        self.rest[R] = zero;
        // (P, R) leaves out Q, (Q, R) leaves out P.
        let [pr, qr] = [self.rest[Q], self.rest[P]];
        self.rest[Q] = cos * pr - sin * qr;
        self.rest[P] = sin * pr + cos * qr;
        for axis in 0..3 {
            let [p, q] = [self.vectors[P][axis], self.vectors[Q][axis]];
            self.vectors[P][axis] = cos * p - sin * q;
            self.vectors[Q][axis] = sin * p + cos * q;
        }
    }

    /// Swaps two eigenpairs that are out of order.
    #[inline(always)]
    fn order<const A: usize, const B: usize>(&mut self) {
        let swap = self.diagonal[B].less(self.diagonal[A]);
        let [a, b] = [self.diagonal[A], self.diagonal[B]];
        self.diagonal[A] = swap.select(b, a);
        self.diagonal[B] = swap.select(a, b);
        for axis in 0..3 {
            let [a, b] = [self.vectors[A][axis], self.vectors[B][axis]];
            self.vectors[A][axis] = swap.select(b, a);
            self.vectors[B][axis] = swap.select(a, b);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Diagonalises one matrix with the narrowest and the widest vectors, which must give the same bits.
    fn eigen_of(matrix: [f32; 6]) -> ([f32; 3], [[f32; 3]; 3]) {
        #[pulp::with_simd(widest = pulp::Arch::new())]
        #[inline(always)]
        fn widest_with<S: Simd>(simd: S, matrix: [f32; 6]) -> ([f32; 3], [[f32; 3]; 3]) {
            let eigen = eigen(simd, matrix.map(|entry| F32s::splat(simd, entry)));
            let first = |vector: F32s<S>| {
                let mut lanes = [0.0; 16];
                vector.store(&mut lanes, 0);
                lanes[0]
            };
            (eigen.values.map(first), eigen.vectors.map(|vector| vector.map(first)))
        }
        let result = widest(matrix);
        assert_eq!(result, widest_with(pulp::Scalar, matrix), "the width of the vectors changes the result");
        result
    }

    /// Checks A·v = λ·v, unit orthogonal vectors and ascending values, which avoids comparing signs.
    #[test]
    fn reconstructs_random_matrices() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f32 / (1u64 << 23) as f32 - 1.0
        };
        for round in 0..3000 {
            // Gram matrices of three vectors, from flat to round.
            let flat = 10f32.powi(-(round % 5));
            let b: [[f32; 3]; 3] = std::array::from_fn(|_| [random(), random(), random() * flat]);
            let gram = |i: usize, j: usize| (0..3).map(|k| b[k][i] * b[k][j]).sum::<f32>();
            let m = [gram(0, 0), gram(0, 1), gram(0, 2), gram(1, 1), gram(1, 2), gram(2, 2)];
            let (values, vectors) = eigen_of(m);
            let m = m.map(f64::from);
            let a = [[m[0], m[1], m[2]], [m[1], m[3], m[4]], [m[2], m[4], m[5]]];
            let scale = a[0][0] + a[1][1] + a[2][2];
            for i in 0..3 {
                let v = vectors[i].map(f64::from);
                for row in 0..3 {
                    let av: f64 = (0..3).map(|k| a[row][k] * v[k]).sum();
                    // f32 rounding of some hundred operations on entries up to the trace.
                    assert!((av - f64::from(values[i]) * v[row]).abs() < 2e-6 * scale, "round {round}: A·v is not λ·v");
                }
                for j in 0..3 {
                    let dot: f64 = (0..3).map(|k| v[k] * f64::from(vectors[j][k])).sum();
                    assert!((dot - f64::from(i == j)).abs() < 2e-6, "round {round}: vectors {i}, {j} give {dot}");
                }
                assert!(i == 0 || values[i] >= values[i - 1], "round {round}: values out of order");
            }
        }
    }

    #[test]
    fn zero_matrix_gives_axes() {
        let (values, vectors) = eigen_of([0.0; 6]);
        assert_eq!(values, [0.0; 3], "no extent");
        assert_eq!(vectors[0], [1.0, 0.0, 0.0], "unit axes, not NaN");
    }
}
