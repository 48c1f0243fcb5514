//! Eigenvectors of symmetric 3×3 matrices, sixteen at a time.

use crate::search::{LANES, Lanes};

/// Cyclic Jacobi converges quadratically: after four sweeps the off-diagonal of a 3×3 matrix is below f32's rounding.
const SWEEPS: usize = 4;

/// Sixteen symmetric matrices as xx, xy, xz, yy, yz, zz.
pub(super) type SymmetricLanes = [Lanes; 6];

/// Eigenvalues, ascending, and the unit eigenvectors that belong to them, sixteen of each.
pub(super) struct Eigen {
    pub(super) values: [Lanes; 3],
    /// `vectors[i][axis]`.
    pub(super) vectors: [[Lanes; 3]; 3],
}

/// Diagonalises sixteen symmetric matrices.
#[inline(always)]
pub(super) fn eigen(matrix: &SymmetricLanes) -> Eigen {
    let mut values = [Lanes::default(); 3];
    let mut vectors = [[Lanes::default(); 3]; 3];
    for lane in 0..LANES {
        let [xx, xy, xz, yy, yz, zz] = [0, 1, 2, 3, 4, 5].map(|term: usize| matrix[term].0[lane]);
        let mut d = [xx, yy, zz];
        // Off-diagonal entries by the axis they leave out.
        let mut o = [yz, xz, xy];
        let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for _ in 0..SWEEPS {
            rotate::<0, 1, 2>(&mut d, &mut o, &mut v);
            rotate::<0, 2, 1>(&mut d, &mut o, &mut v);
            rotate::<1, 2, 0>(&mut d, &mut o, &mut v);
        }
        order::<0, 1>(&mut d, &mut v);
        order::<1, 2>(&mut d, &mut v);
        order::<0, 1>(&mut d, &mut v);
        for i in 0..3 {
            values[i].0[lane] = d[i];
            for axis in 0..3 {
                vectors[i][axis].0[lane] = v[i][axis];
            }
        }
    }
    Eigen { values, vectors }
}

/// One Jacobi rotation that zeroes the entry (P, Q); R is the third axis.
#[inline(always)]
fn rotate<const P: usize, const Q: usize, const R: usize>(d: &mut [f32; 3], o: &mut [f32; 3], v: &mut [[f32; 3]; 3]) {
    // The entry (P, Q) is the one that leaves out R, and so on.
    let apq = o[R];
    let difference = 0.5 * (d[Q] - d[P]);
    // tan of the smaller rotation angle: sign(θ)·a/(|δ| + √(δ² + a²)); a zero entry gives 0 through the least divisor.
    let length = (difference * difference + apq * apq).sqrt();
    let signed = if difference < 0.0 { -apq } else { apq };
    let t = signed / (difference.abs() + length).max(f32::MIN_POSITIVE);
    let c = 1.0 / (1.0 + t * t).sqrt();
    let s = t * c;
    d[P] -= t * apq;
    d[Q] += t * apq;
    o[R] = 0.0;
    // (P, R) leaves out Q, (Q, R) leaves out P.
    let [apr, aqr] = [o[Q], o[P]];
    o[Q] = c * apr - s * aqr;
    o[P] = s * apr + c * aqr;
    for axis in 0..3 {
        let [vp, vq] = [v[P][axis], v[Q][axis]];
        v[P][axis] = c * vp - s * vq;
        v[Q][axis] = s * vp + c * vq;
    }
}

/// Swaps two eigenpairs that are out of order.
#[inline(always)]
fn order<const A: usize, const B: usize>(d: &mut [f32; 3], v: &mut [[f32; 3]; 3]) {
    let swap = d[A] > d[B];
    let [a, b] = [d[A], d[B]];
    d[A] = if swap { b } else { a };
    d[B] = if swap { a } else { b };
    for axis in 0..3 {
        let [a, b] = [v[A][axis], v[B][axis]];
        v[A][axis] = if swap { b } else { a };
        v[B][axis] = if swap { a } else { b };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A·v = λ·v for each pair, unit orthogonal vectors, values ascending: no sign or order ambiguity to compare around.
    #[test]
    fn reconstructs_random_matrices() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f32 / (1u64 << 23) as f32 - 1.0
        };
        for round in 0..200 {
            let mut matrix = [Lanes::default(); 6];
            for lane in 0..LANES {
                // Gram matrices of three vectors, from flat to round.
                let flat = 10f32.powi(-(round % 5));
                let b: [[f32; 3]; 3] = std::array::from_fn(|_| [random(), random(), random() * flat]);
                let gram = |i: usize, j: usize| (0..3).map(|k| b[k][i] * b[k][j]).sum::<f32>();
                for (term, (i, j)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
                    matrix[term].0[lane] = gram(i, j);
                }
            }
            let eigen = eigen(&matrix);
            for lane in 0..LANES {
                let m = matrix.map(|term| f64::from(term.0[lane]));
                let a = [[m[0], m[1], m[2]], [m[1], m[3], m[4]], [m[2], m[4], m[5]]];
                let scale = a[0][0] + a[1][1] + a[2][2];
                for i in 0..3 {
                    let v = eigen.vectors[i].map(|axis| f64::from(axis.0[lane]));
                    let value = f64::from(eigen.values[i].0[lane]);
                    for row in 0..3 {
                        let av: f64 = (0..3).map(|k| a[row][k] * v[k]).sum();
                        // f32 rounding of some hundred operations on entries up to the trace.
                        assert!((av - value * v[row]).abs() < 2e-6 * scale, "round {round}: A·v is not λ·v");
                    }
                    for j in 0..3 {
                        let dot: f64 = (0..3).map(|k| v[k] * f64::from(eigen.vectors[j][k].0[lane])).sum();
                        assert!((dot - f64::from(i == j)).abs() < 2e-6, "round {round}: vectors {i}, {j} give {dot}");
                    }
                    assert!(i == 0 || eigen.values[i].0[lane] >= eigen.values[i - 1].0[lane], "values out of order");
                }
            }
        }
    }

    #[test]
    fn zero_matrix_gives_axes() {
        let eigen = eigen(&[Lanes::default(); 6]);
        assert_eq!(eigen.values[2].0[3], 0.0, "no extent");
        assert_eq!(eigen.vectors[0].map(|axis| axis.0[3]), [1.0, 0.0, 0.0], "unit axes, not NaN");
    }
}
