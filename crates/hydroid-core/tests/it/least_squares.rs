//! Recursive least squares, compared with a dense recursion, batch least squares and bounds.

use hydroid_core::adapt::RecursiveLeastSquares;
use proptest::prelude::*;

struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn row(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.next()).collect()
    }
}

/// The textbook recursion with a full `P`, symmetrized in each step.
struct Naive {
    n: usize,
    p: Vec<Vec<f64>>,
    theta: Vec<Vec<f64>>,
    prior: Vec<Vec<f64>>,
    information: f64,
    leak: bool,
    turn: usize,
}

impl Naive {
    fn new(n: usize, theta: &[f64], information: f64, leak: bool) -> Self {
        let theta: Vec<Vec<f64>> = theta.chunks(n).map(<[f64]>::to_vec).collect();
        let unit = |i| (0..n).map(|j| if i == j { 1.0 / information } else { 0.0 }).collect();
        Self { n, p: (0..n).map(unit).collect(), prior: theta.clone(), theta, information, leak, turn: 0 }
    }

    fn row(&mut self, phi: &[f64], z: &[f64], weight: f64, learn: bool) {
        let g: Vec<f64> = self.p.iter().map(|row| row.iter().zip(phi).map(|(p, x)| p * x).sum()).collect();
        let s: f64 = 1.0 / weight + g.iter().zip(phi).map(|(g, x)| g * x).sum::<f64>();
        if learn {
            for (theta, z) in self.theta.iter_mut().zip(z) {
                let e = z - theta.iter().zip(phi).map(|(t, x)| t * x).sum::<f64>();
                theta.iter_mut().zip(&g).for_each(|(t, g)| *t += e * g / s);
            }
        }
        for i in 0..self.n {
            for j in 0..=i {
                self.p[i][j] -= g[i] * g[j] / s;
                self.p[j][i] = self.p[i][j];
            }
        }
    }

    fn forget(&mut self, lambda: f64) {
        self.p.iter_mut().flatten().for_each(|p| *p /= lambda);
        let j = self.turn;
        self.turn = (j + 1) % self.n;
        let unit: Vec<f64> = (0..self.n).map(|i| if i == j { 1.0 } else { 0.0 }).collect();
        let z: Vec<f64> = self.prior.iter().map(|p| p[j]).collect();
        self.row(&unit, &z, self.n as f64 * (1.0 - lambda) * self.information, self.leak);
    }
}

fn largest_difference(fast: &RecursiveLeastSquares, naive: &Naive) -> f64 {
    let n = naive.n;
    let theta = fast.coefficients().iter().zip(naive.theta.iter().flatten());
    let p = (0..n * n).map(|k| (fast.covariance(k / n, k % n), naive.p[k / n][k % n]));
    theta
        .map(|(a, b)| (a - b).abs())
        .chain(p.map(|(a, b)| (a - b).abs() * naive.information))
        .fold(0.0, f64::max)
}

/// Solves `a x = b` for a symmetric positive `a`.
fn solve(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for k in 0..n {
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            for j in k..n {
                a[i][j] -= factor * a[k][j];
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        b[k] = (b[k] - (k + 1..n).map(|j| a[k][j] * b[j]).sum::<f64>()) / a[k][k];
    }
    b
}

#[test]
fn equals_the_naive_recursion_over_a_long_run() {
    for leak in [false, true] {
        let (n, targets) = (12, 3);
        let mut numbers = Numbers(7);
        let theta = numbers.row(n * targets);
        let mut fast = RecursiveLeastSquares::new(n, &theta, 5.0, leak);
        let mut naive = Naive::new(n, &theta, 5.0, leak);
        for k in 0..20_000 {
            let mut phi = numbers.row(n);
            // Most directions lack excitation half of the time.
            if (k / 1000) % 2 == 1 {
                phi[3..].fill(0.0);
            }
            let z = numbers.row(targets);
            let weight = 0.1 + 0.4 * (1.0 + numbers.next());
            fast.predict(&phi, &z);
            fast.correct(weight);
            naive.row(&phi, &z, weight, true);
            fast.forget(0.99);
            naive.forget(0.99);
        }
        let difference = largest_difference(&fast, &naive);
        assert!(difference < 1e-10, "leak {leak}: {difference}");
    }
}

#[test]
fn without_excitation_the_covariance_stays_bounded_and_coefficients_return() {
    let (n, lambda, information) = (8, 0.98f64, 2.0);
    let mut numbers = Numbers(3);
    let mut fast = RecursiveLeastSquares::new(n, &[1.0; 8], information, true);
    for _ in 0..2_000 {
        let phi = numbers.row(n);
        let z = 2.0 * phi.iter().sum::<f64>();
        fast.predict(&phi, &[z]);
        fast.correct(1.0);
        fast.forget(lambda);
    }
    assert!(fast.coefficients().iter().all(|t| (1.7..2.1).contains(t)), "{:?}", fast.coefficients());
    // A million samples with zero or constant regressors.
    let bound = lambda.powi(1 - i32::try_from(n).unwrap()) / information;
    for k in 0..1_000_000 {
        let mut phi = vec![0.0; n];
        if k % 3 == 0 {
            phi[0] = 1.0;
        }
        fast.predict(&phi, &[2.0 * phi[0]]);
        fast.correct(1.0);
        fast.forget(lambda);
        if k % 100_000 == 0 {
            for i in 0..n {
                let p = fast.covariance(i, i);
                assert!(p > 0.0 && p <= bound * 1.000_001, "P[{i}][{i}] = {p}, bound {bound}");
            }
        }
    }
    let theta = fast.coefficients();
    assert!(theta[0] > 1.4, "excited: {theta:?}");
    assert!(theta[1..].iter().all(|t| (t - 1.0).abs() < 1e-6), "not excited: {theta:?}");
}

#[test]
fn an_eigenvalue_never_exceeds_the_bound_whatever_the_data() {
    let (n, lambda, information) = (6, 0.9f64, 4.0);
    let mut numbers = Numbers(11);
    let mut fast = RecursiveLeastSquares::new(n, &[0.0; 6], information, true);
    let bound = lambda.powi(1 - i32::try_from(n).unwrap()) / information;
    for _ in 0..5_000 {
        let size = 10f64.powf(3.0 * numbers.next());
        let phi: Vec<f64> = numbers.row(n).iter().map(|x| x * size).collect();
        fast.predict(&phi, &[numbers.next()]);
        fast.correct(1.0);
        fast.forget(lambda);
        // x' P x of unit vectors is at most the largest eigenvalue.
        let x = numbers.row(n);
        let square: f64 = x.iter().map(|x| x * x).sum();
        let form: f64 = (0..n * n).map(|k| x[k / n] * fast.covariance(k / n, k % n) * x[k % n]).sum();
        assert!(form > 0.0 && form / square <= bound * (1.0 + 1e-9), "{} beyond {bound}", form / square);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn without_forgetting_it_is_batch_least_squares_with_a_ridge(
        seed in 0u64..1000, n in 1usize..9, rows in 1usize..60, information in 1e-3..10.0f64,
    ) {
        let mut numbers = Numbers(seed);
        let prior = numbers.row(n);
        let mut fast = RecursiveLeastSquares::new(n, &prior, information, true);
        let mut a = vec![vec![0.0; n]; n];
        let mut b: Vec<f64> = prior.iter().map(|t| information * t).collect();
        (0..n).for_each(|i| a[i][i] = information);
        for _ in 0..rows {
            let (phi, z, w) = (numbers.row(n), numbers.next(), 1.5 + numbers.next());
            fast.forget(1.0);
            fast.predict(&phi, &[z]);
            fast.correct(w);
            for i in 0..n {
                b[i] += w * phi[i] * z;
                for j in 0..n {
                    a[i][j] += w * phi[i] * phi[j];
                }
            }
        }
        for (theta, batch) in fast.coefficients().iter().zip(solve(a, b)) {
            prop_assert!((theta - batch).abs() < 1e-9 * (1.0 + batch.abs()), "{theta} against {batch}");
        }
    }

    #[test]
    fn the_order_of_columns_does_not_matter_without_forgetting(seed in 0u64..1000, n in 2usize..9) {
        let mut numbers = Numbers(seed);
        let mut forward = RecursiveLeastSquares::new(n, &vec![0.0; n], 0.1, true);
        let mut backward = forward.clone();
        for _ in 0..50 {
            let mut phi = numbers.row(n);
            let z = numbers.next();
            forward.predict(&phi, &[z]);
            forward.correct(1.0);
            phi.reverse();
            backward.predict(&phi, &[z]);
            backward.correct(1.0);
        }
        for (a, b) in forward.coefficients().iter().zip(backward.coefficients().iter().rev()) {
            prop_assert!((a - b).abs() < 1e-9, "{a} against {b}");
        }
        prop_assert!((forward.covariance(0, n - 1) - backward.covariance(n - 1, 0)).abs() < 1e-9);
    }
}

#[test]
fn a_triangular_prior_equals_its_rows() {
    // The prior R = T'T against the three rows of T as data; without forgetting, then with forgetting and no data.
    let r_factor = [2.0, 0.5, -1.0, 0.0, 0.7, 0.3, 0.0, 0.0, 1.5];
    let mut shaped = RecursiveLeastSquares::with_r_factor(&[1.0, -2.0, 0.5], 4.0, &r_factor, true);
    let mut plain = RecursiveLeastSquares::new(3, &[1.0, -2.0, 0.5], 1e-9, true);
    for row in r_factor.chunks_exact(3) {
        let z = row[0] - 2.0 * row[1] + 0.5 * row[2];
        plain.predict(row, &[z]);
        plain.correct(4.0);
    }
    let close = |a: &RecursiveLeastSquares, b: &RecursiveLeastSquares, tolerance: f64| {
        for i in 0..3 {
            assert!((a.coefficients()[i] - b.coefficients()[i]).abs() < tolerance);
            for j in 0..3 {
                assert!((a.covariance(i, j) - b.covariance(i, j)).abs() < tolerance, "{i} {j}");
            }
        }
    };
    close(&shaped, &plain, 1e-7);
    for learner in [&mut shaped, &mut plain] {
        learner.predict(&[1.0, 1.0, -1.0], &[3.0]);
        learner.correct(2.0);
    }
    close(&shaped, &plain, 1e-7);
    for _ in 0..6000 {
        shaped.forget(0.99);
    }
    let fresh = RecursiveLeastSquares::with_r_factor(&[1.0, -2.0, 0.5], 4.0, &r_factor, true);
    for i in 0..3 {
        assert!((shaped.coefficients()[i] - fresh.coefficients()[i]).abs() < 1e-6);
        let ratio = shaped.covariance(i, i) / fresh.covariance(i, i);
        assert!((0.95..1.05).contains(&ratio), "{ratio}");
    }
}
