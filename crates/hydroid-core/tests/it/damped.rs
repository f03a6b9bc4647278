//! Fixture of tests of adapted equations: a damped vessel with a lag and a past value.

use hydroid_core::adapt::kalman::{FilterOptions, KalmanEquations, LearnableEquations};
use hydroid_core::model::sparse::{Equations, Real, Signal, Term};

pub(crate) const RANGES: [(f64, f64); 3] = [(0.0, 4.0), (-0.5, 0.5), (2.0, 12.0)];

/// Two outputs, a command, its lag, and the first output of two samples ago; damped by `drag`.
pub(crate) fn equations(drag: f64) -> Equations {
    let signals = vec![
        Signal::Lag { input: 2, time_constant_s: Real(0.8) },
        Signal::Past { variable: 0, samples: 2 },
        Signal::Past { variable: 1, samples: 1 },
    ];
    let terms = [&[0_usize][..], &[0, 0], &[1], &[2], &[3], &[4], &[0, 1], &[5]];
    let terms: Vec<Term> = terms
        .iter()
        .map(|of| Term::monomial(&of.iter().map(|&v| u16::try_from(v).unwrap()).collect::<Vec<_>>()))
        .collect();
    let coefficients = vec![
        -0.2,
        -0.15 * drag,
        0.4,
        0.0,
        0.3,
        0.05,
        0.0,
        0.0, //
        0.0,
        0.01,
        -0.9 * drag,
        0.02,
        0.0,
        0.0,
        -0.3,
        0.1,
    ];
    Equations::with_signals(terms, coefficients, 2, 1, signals, 0.2, 2).unwrap()
}

pub(crate) fn learnable() -> LearnableEquations {
    LearnableEquations::new(&equations(1.0), &RANGES).unwrap()
}

pub(crate) fn options() -> FilterOptions {
    let count = learnable().places().len();
    let mut options = FilterOptions::uniform(count, 0.05, 1e-5, (0.3, 1e-4), &[1e-3, 2e-3]);
    for (i, q) in options.weight_noise.iter_mut().enumerate() {
        *q *= 1.0 + (i % 5) as f64;
    }
    FilterOptions { leak: 1e-3, forgetting: 0.999, ..options }
}

pub(crate) fn session() -> KalmanEquations {
    KalmanEquations::new(learnable(), options()).unwrap()
}

pub(crate) fn command(k: usize) -> f64 {
    7.0 + 3.0 * (0.11 * k as f64).sin() + 1.5 * (0.031 * k as f64).cos()
}

/// Something like noise, of deviation 1.
pub(crate) fn noise(k: usize, i: usize) -> f64 {
    let x = ((k * 2 + i) as f64 * 12.9898).sin() * 43758.5453;
    12.0_f64.sqrt() * (x - x.floor() - 0.5)
}

/// Measurements of a vessel whose drag is `drag(k)`, with noise of the given deviations.
pub(crate) fn measured(count: usize, deviations: [f64; 2], drag: impl Fn(usize) -> f64) -> Vec<[f64; 2]> {
    let first = equations(drag(0));
    let (mut state, mut scratch) = (vec![0.0; first.state_len()], vec![0.0; first.scratch()]);
    state[..2].copy_from_slice(&[2.0, 0.1]);
    (0..count)
        .map(|k| {
            let y = [state[0] + deviations[0] * noise(k, 0), state[1] + deviations[1] * noise(k, 1)];
            equations(drag(k)).step(&mut state, &[command(k)], &mut scratch);
            y
        })
        .collect()
}

pub(crate) fn close(ours: &[f64], theirs: &[f64], tolerance: f64, what: &str) {
    assert_eq!(ours.len(), theirs.len());
    for (a, b) in ours.iter().zip(theirs) {
        assert!((a - b).abs() < tolerance * (1.0 + b.abs()), "{what}: {a} {b}");
    }
}
