//! Symmetric 3 x 3 matrices.

/// Rows of a matrix.
pub type Mat = [[f64; 3]; 3];

/// Adds `weight` times the outer product of a vector with itself.
#[inline]
pub fn add_outer(to: &mut Mat, v: [f64; 3], weight: f64) {
    for i in 0..3 {
        for j in 0..3 {
            to[i][j] += weight * v[i] * v[j];
        }
    }
}

/// The scalar product.
#[inline]
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `v` from both sides: the variance along `v`.
pub fn quadratic(m: &Mat, v: [f64; 3]) -> f64 {
    dot(m.map(|row| dot(row, v)), v)
}

/// An eigenvalue with its unit vector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eigen {
    /// The value.
    pub value: f64,
    /// The vector.
    pub vector: [f64; 3],
}

/// Eigenvalues of a symmetric matrix, the largest first, by Jacobi's rotations (Golub and Van Loan, "Matrix Computations",
/// 8.5): small eigenvalues of a matrix whose scales are alike keep their digits.
pub fn eigen(m: &Mat) -> [Eigen; 3] {
    let mut a = *m;
    let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..30 {
        let off = a[0][1].abs() + a[0][2].abs() + a[1][2].abs();
        if off == 0.0 || !off.is_finite() {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let tau = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = tau.signum() / (tau.abs() + tau.hypot(1.0));
            let t = if tau == 0.0 { 1.0 } else { t };
            let c = 1.0 / t.hypot(1.0);
            let s = t * c;
            let rotate = |x: f64, y: f64| [c * x - s * y, s * x + c * y];
            for row in &mut a {
                [row[p], row[q]] = rotate(row[p], row[q]);
            }
            (0..3).for_each(|k| [a[p][k], a[q][k]] = rotate(a[p][k], a[q][k]));
            (a[p][q], a[q][p]) = (0.0, 0.0);
            for row in &mut v {
                [row[p], row[q]] = rotate(row[p], row[q]);
            }
        }
    }
    let mut all = [0, 1, 2].map(|i| Eigen { value: a[i][i], vector: v.map(|row| row[i]) });
    all.sort_by(|x, y| y.value.total_cmp(&x.value));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvectors_make_the_matrix_again() {
        for m in [
            [[4.0, 1.0, -2.0], [1.0, 3.0, 0.5], [-2.0, 0.5, 5.0]],
            [[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]],
            [[2.0, 0.0, 0.0], [0.0, 7.0, 0.0], [0.0, 0.0, 1.0]],
            [[0.0; 3]; 3],
            [[1.0, 1.0 - 1e-9, 0.3], [1.0 - 1e-9, 1.0, 0.3], [0.3, 0.3, 1e-3]],
        ] {
            let all = eigen(&m);
            assert!(all[0].value >= all[1].value && all[1].value >= all[2].value);
            let mut again = [[0.0; 3]; 3];
            all.iter().for_each(|e| add_outer(&mut again, e.vector, e.value));
            for i in 0..3 {
                for j in 0..3 {
                    assert!((again[i][j] - m[i][j]).abs() < 1e-14 * 8.0, "{again:?} {m:?}");
                }
            }
            assert!((quadratic(&m, all[1].vector) - all[1].value).abs() < 1e-14);
        }
        // Grey: one direction has all of it.
        let grey = eigen(&[[2.0; 3]; 3]);
        assert!((grey[0].value - 6.0).abs() < 1e-14 && grey[1].value.abs() < 1e-15);
    }
}
