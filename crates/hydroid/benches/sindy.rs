//! Library evaluation and regression: `cargo bench -p hydroid --bench sindy`.

use divan::{Bencher, counter::ItemsCount};
use hydroid::log::{Channel, Table, Trajectory};
use hydroid::sindy::{
    AssemblyOptions, BLOCK_ROWS, BootstrapOptions, Constraints, Criterion, FitOptions, LinearRegression,
    Loss, Optimizer, QrFactor, RegressionForm, RegressionOptions, assemble, assemble_with,
};
use hydroid_core::model::sparse::{Program, Term};

fn main() {
    divan::main();
}

/// A smooth made-up run: what is timed does not depend on the numbers.
fn run(samples: usize, outputs: usize, inputs: usize) -> Trajectory {
    let wave = |k: usize, j: usize| (0.013 * (j + 1) as f64 * k as f64 + j as f64).sin();
    let table = |name: &str, width: usize, shift: usize| {
        let channels: Vec<Channel> = (0..width).map(|j| Channel::new(format!("{name}{j}"), "")).collect();
        let values = (0..samples).flat_map(|k| (0..width).map(move |j| wave(k, j + shift))).collect();
        Table::new(channels, values)
    };
    Trajectory {
        name: String::from("bench"),
        t0: 0.0,
        dt: 0.1,
        outputs: table("y", outputs, 0),
        inputs: table("c", inputs, outputs),
        truth: None,
        heading: None,
        position: None,
    }
}

/// Fifty monomials of degree up to 3 in five variables.
fn fifty_terms() -> Vec<Term> {
    let mut terms = vec![Term::constant()];
    for i in 0..5u16 {
        terms.push(Term::monomial(&[i]));
        for j in i..5 {
            terms.push(Term::monomial(&[i, j]));
            for k in j..5 {
                terms.push(Term::monomial(&[i, j, k]));
            }
        }
    }
    terms.sort_by_key(Term::degree);
    terms.truncate(50);
    terms
}

#[divan::bench(args = [72_000, 1_000_000])]
fn evaluate_library_50_terms(bencher: Bencher, samples: usize) {
    let program = Program::new(&fifty_terms(), 5).unwrap();
    let run = run(4096, 3, 2);
    let mut slots = vec![0.0; program.slots() * 256];
    for k in 0..256 {
        for j in 0..5 {
            slots[(1 + j) * 256 + k] = if j < 3 { run.outputs.row(k)[j] } else { run.inputs.row(k)[j - 3] };
        }
    }
    bencher.counter(ItemsCount::new(samples)).bench_local(|| {
        for _ in 0..samples.div_ceil(256) {
            program.evaluate_block(divan::black_box(&mut slots), 256);
        }
    });
}

#[divan::bench(args = [72_000, 1_000_000])]
fn fold_in_53_columns(bencher: Bencher, samples: usize) {
    let block: Vec<f64> = (0..53 * BLOCK_ROWS).map(|i| (i as f64).sin()).collect();
    bencher.counter(ItemsCount::new(samples)).bench_local(|| {
        let mut triangle = QrFactor::new(53);
        let mut work = block.clone();
        for _ in 0..samples.div_ceil(BLOCK_ROWS) {
            work.copy_from_slice(&block);
            triangle.append_rows(&mut work, BLOCK_ROWS);
        }
        triangle
    });
}

#[divan::bench(args = [(72_000, 1), (72_000, 10), (1_000_000, 1)])]
fn regression_50_terms_3_outputs(bencher: Bencher, (samples, intervals): (usize, usize)) {
    let program = Program::new(&fifty_terms(), 5).unwrap();
    let run = run(samples, 3, 2);
    bencher
        .counter(ItemsCount::new(samples))
        .bench_local(|| assemble(&program, &[&run], RegressionForm::Midpoint { intervals }));
}

#[divan::bench(args = [(72_000, 40), (1_000_000, 40), (1_000_000, 200)])]
fn weak_form_50_terms_3_outputs(bencher: Bencher, (samples, intervals): (usize, usize)) {
    let program = Program::new(&fifty_terms(), 5).unwrap();
    let run = run(samples, 3, 2);
    bencher
        .counter(ItemsCount::new(samples))
        .bench_local(|| assemble(&program, &[&run], RegressionForm::Weak { intervals }));
}

#[divan::bench(args = [72_000, 1_000_000])]
fn regression_in_24_groups(bencher: Bencher, samples: usize) {
    let program = Program::new(&fifty_terms(), 5).unwrap();
    let run = run(samples, 3, 2);
    let streaming = AssemblyOptions { groups: 24, ..AssemblyOptions::default() };
    bencher
        .counter(ItemsCount::new(samples))
        .bench_local(|| assemble_with(&program, &[&run], RegressionForm::default(), &streaming));
}

/// Several rounds of streaming, with the residuals' sizes counted.
#[divan::bench]
fn huber_1_000_000_samples(bencher: Bencher) {
    let run = run(1_000_000, 3, 2);
    let preparation = RegressionOptions { loss: Loss::Huber(1.345), ..RegressionOptions::default() };
    bencher.bench_local(|| {
        LinearRegression::with(&[&run], fifty_terms(), RegressionForm::default(), &preparation)
            .unwrap()
            .rows()
    });
}

/// A hundred resamples of 50 terms and 3 outputs, whatever the number of samples.
#[divan::bench]
fn ensemble_of_100(bencher: Bencher) {
    let run = run(20_000, 3, 2);
    let preparation = RegressionOptions { groups: 24, ..RegressionOptions::default() };
    let prepared =
        LinearRegression::with(&[&run], fifty_terms(), RegressionForm::default(), &preparation).unwrap();
    let options = FitOptions {
        optimizer: Optimizer::Criterion(Criterion::Bic),
        ridge: 1e-6,
        substeps: 1,
        constraints: Constraints::default(),
    };
    bencher.bench_local(|| prepared.ensemble(&options, &BootstrapOptions::default()).unwrap());
}
