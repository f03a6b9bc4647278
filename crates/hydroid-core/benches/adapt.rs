//! One sample of recursive least squares: `cargo bench -p hydroid-core --bench adapt`.

use divan::Bencher;
use hydroid_core::adapt::{InnovationGate, RecursiveEquations, RecursiveLeastSquares, RecursiveOptions};
use hydroid_core::model::sparse::{Equations, Term};
use hydroid_core::predict::Predictor;

fn main() {
    divan::main();
}

fn row(n: usize, k: usize) -> Vec<f64> {
    (0..n).map(|j| (0.37 * (j + 1) as f64 * (k + 1) as f64).sin()).collect()
}

/// Forget, predict, correct: three targets on one regressor, one covariance.
#[divan::bench(args = [20, 40, 100])]
fn kernel_update_3_targets(bencher: Bencher, n: usize) {
    let mut kernel = RecursiveLeastSquares::new(n, &vec![0.1; 3 * n], 10.0, true);
    let rows: Vec<Vec<f64>> = (0..64).map(|k| row(n, k)).collect();
    let mut k = 0;
    bencher.bench_local(|| {
        k = (k + 1) % rows.len();
        kernel.forget(0.999);
        kernel.predict(divan::black_box(&rows[k]), &[0.1, -0.2, 0.3]);
        kernel.correct(0.25);
    });
}

/// Three outputs with 100 coefficients each. `shared`: the same terms in all three equations, one covariance;
/// otherwise each output has a term of its own, and a covariance of its own.
fn equations(shared: bool) -> Equations {
    let terms: Vec<Term> = (0..8)
        .flat_map(|a| (a..8).flat_map(move |b| (b..8).map(move |c| Term::monomial(&[a, b, c]))))
        .take(102)
        .collect();
    let count = terms.len();
    let mut coefficients = vec![0.0; 3 * count];
    for i in 0..3 {
        for j in 0..100 {
            let j = if j == 99 && !shared { 99 + i } else { j };
            coefficients[i * count + j] = -1e-3;
        }
    }
    Equations::new(terms, coefficients, 3, 5, 0.1, 1).unwrap()
}

/// A whole sample, observed and advanced, with a row at each of them (window of one sample: the worst).
#[divan::bench(args = [true, false])]
fn sample_100_coefficients_3_outputs(bencher: Bencher, shared: bool) {
    let options = RecursiveOptions {
        forgetting_s: 60.0,
        window: 1,
        prior_s: 10.0,
        leak: true,
        all_terms: false,
        gate: InnovationGate::OPEN,
    };
    let mut adapter = RecursiveEquations::new(&equations(shared), &[(-1.0, 1.0); 8], &options).unwrap();
    let samples: Vec<Vec<f64>> = (0..64).map(|k| row(8, k)).collect();
    let mut k = 0;
    bencher.bench_local(|| {
        k = (k + 1) % samples.len();
        adapter.observe(divan::black_box(&samples[k][..3]));
        adapter.advance(divan::black_box(&samples[k][3..]));
    });
}
