//! Ridge regression from second moments.

pub(crate) use super::regression::Moments;

/// Solution of a ridge regression.
pub(crate) struct Fit {
    /// Coefficients, `outputs x terms`.
    pub(crate) coefficients: Vec<f64>,
    /// Scale `s_j` of each term: its root mean square.
    pub(super) scale: Vec<f64>,
    /// Triangle `R` of the moments with the ridge, in scaled terms: `R'R = S^-1 G S^-1 + ridge g00 I` with
    /// `S = diag(s)`.
    pub(super) r_factor: Vec<f64>,
}

/// Ridge regression with a penalty relative to the mean square of each term (A. E. Hoerl and R. W. Kennard,
/// Technometrics 12 (1970) 55). Term 0 is the constant, so that `g00` is the number of rows. `None` if the matrix is not
/// positive definite.
pub(crate) fn solve(moments: &Moments, terms: usize, ridge: f64) -> Option<Fit> {
    let g00 = moments.gram[0];
    let scale: Vec<f64> =
        (0..terms).map(|j| (moments.gram[j * terms + j] / g00).sqrt().max(LEAST_SCALE)).collect();
    if !scale.iter().all(|s| s.is_finite()) {
        return None;
    }
    // The upper triangle in scaled units, row by row.
    let mut r = vec![0.0; terms * terms];
    for i in 0..terms {
        for j in i..terms {
            r[i * terms + j] = moments.gram[i * terms + j] / (scale[i] * scale[j]);
        }
        r[i * terms + i] += ridge * g00;
    }
    factorize(&mut r, terms)?;
    let mut coefficients = Vec::with_capacity(moments.right.len());
    for right in moments.right.chunks_exact(terms) {
        let mut x: Vec<f64> = right.iter().zip(&scale).map(|(b, s)| b / s).collect();
        // Forward substitution with R', then backward with R.
        for i in 0..terms {
            x[i] /= r[i * terms + i];
            let (known, rest) = x.split_at_mut(i + 1);
            for (x, r) in rest.iter_mut().zip(&r[i * terms + i + 1..(i + 1) * terms]) {
                *x -= r * known[i];
            }
        }
        for i in (0..terms).rev() {
            let row = &r[i * terms + i + 1..(i + 1) * terms];
            let known: f64 = row.iter().zip(&x[i + 1..]).map(|(r, x)| r * x).sum();
            x[i] = (x[i] - known) / r[i * terms + i];
        }
        coefficients.extend(x.iter().zip(&scale).map(|(x, s)| x / s));
    }
    coefficients.iter().all(|x| x.is_finite()).then_some(Fit { coefficients, scale, r_factor: r })
}

/// Scale of a term that is zero in all rows.
const LEAST_SCALE: f64 = 1e-12;

/// Cholesky factorization `A = R'R` in place, upper triangle, row by row.
pub(super) fn factorize(a: &mut [f64], n: usize) -> Option<()> {
    for k in 0..n {
        let pivot = a[k * n + k];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return None;
        }
        let root = pivot.sqrt();
        a[k * n + k..(k + 1) * n].iter_mut().for_each(|x| *x /= root);
        let (done, rest) = a.split_at_mut((k + 1) * n);
        let row = &done[k * n..];
        for i in k + 1..n {
            let factor = row[i];
            let line = &mut rest[(i - k - 1) * n..][i..n];
            line.iter_mut().zip(&row[i..]).for_each(|(x, r)| *x -= factor * r);
        }
    }
    Some(())
}
