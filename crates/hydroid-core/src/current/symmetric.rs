//! Symmetric matrices of two rows: upper left, off the diagonal, lower right.

/// Inverse; `None` unless the matrix is positive definite.
pub(super) fn inverse([a, b, c]: [f64; 3]) -> Option<[f64; 3]> {
    let determinant = determinant([a, b, c]);
    let sound = a > 0.0 && determinant > 0.0 && determinant.is_finite();
    sound.then(|| [c / determinant, -b / determinant, a / determinant])
}

pub(super) fn determinant([a, b, c]: [f64; 3]) -> f64 {
    a * c - b * b
}

pub(super) fn product([a, b, c]: [f64; 3], [x, y]: [f64; 2]) -> [f64; 2] {
    [a * x + b * y, b * x + c * y]
}

pub(super) fn quadratic(matrix: [f64; 3], vector: [f64; 2]) -> f64 {
    let [a, b] = product(matrix, vector);
    vector[0] * a + vector[1] * b
}
