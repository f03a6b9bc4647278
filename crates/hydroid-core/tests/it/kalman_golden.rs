//! The filter over state and weights against an independent implementation (JAX, `NumPy`): its trace of the first 200
//! samples, and the errors of the networks that it adapts along a closed-loop log of a hydrofoil.

use std::sync::Arc;

use hydroid_core::adapt::kalman::{FilterOptions, KalmanNetwork};
use hydroid_core::adapt::{Learning, Outcome};
use hydroid_core::model::recurrent::Recurrent;
use hydroid_core::predict::{Predictor, Workspace};

use crate::networks::{NAMES, pretrained, rows};

/// A network trained at low speed only, and the reference's options (`filter.json`).
fn model(name: &str) -> (Arc<Recurrent>, FilterOptions) {
    let (model, noise) = pretrained(name);
    let noise: Vec<f64> = noise.iter().map(|variance| 5.0 * variance).collect();
    let options = FilterOptions {
        leak: 3e-5,
        ..FilterOptions::uniform(model.weights.len(), 4e-3, 1e-7, (1.0, 1e-5), &noise)
    };
    (Arc::new(model), options)
}

/// Command `k`, then measurement `k + 1`. The reference does not use the measurement before the first command.
fn step(session: &mut KalmanNetwork, log: &[Vec<f64>], k: usize) {
    session.advance(&log[k][1..3]);
    session.observe(&log[k + 1][3..6]);
    assert_eq!(session.outcome(), Outcome::Accepted, "{k}");
}

#[test]
fn the_trace_is_that_of_the_reference() {
    let log = rows("lawn3.csv");
    for name in NAMES {
        let reference = rows(&format!("{name}_filter_trace.csv"));
        let (model, options) = model(name);
        let mut session = KalmanNetwork::new(Arc::clone(&model), options).unwrap();
        let mut worst = [0.0_f64; 11];
        for (k, row) in reference.iter().enumerate() {
            step(&mut session, &log, k);
            let (e, s) = session.filter().innovation();
            let (hh, tt) = session.filter().variances();
            let moved: f64 = session.weights().iter().zip(&model.weights).map(|(a, b)| (a - b).powi(2)).sum();
            let mut ours = vec![k as f64];
            ours.extend(e.iter().chain(s));
            ours.extend([session.nis(), hh.iter().sum(), tt.iter().sum(), moved.sqrt()]);
            assert_eq!(ours.len(), row.len());
            for (worst, (ours, theirs)) in worst.iter_mut().zip(ours.iter().zip(row)) {
                *worst = worst.max((ours - theirs).abs());
            }
        }
        for (column, &worst) in worst.iter().enumerate().skip(1) {
            let square: f64 = reference.iter().map(|row| row[column].powi(2)).sum();
            let rms = (square / reference.len() as f64).sqrt();
            println!("{name}: column {column} differs by {:.1e} of its RMS", worst / rms);
            assert!(worst < 1e-8 * rms, "{name}: column {column}: {worst} of {rms}");
        }
    }
}

/// Mean absolute errors of each output against the truth at horizons 1..100, over windows that start every 5 samples
/// from the 100th on, with the weights of that time.
fn errors(name: &str, log: &[Vec<f64>]) -> Vec<[f64; 3]> {
    let (model, options) = model(name);
    let mut session = KalmanNetwork::new(model, options).unwrap();
    let commands: Vec<f64> = log.iter().flat_map(|row| [row[1], row[2]]).collect();
    let (mut sums, mut windows) = (vec![[0.0; 3]; 100], 0.0);
    let (mut work, mut y) = (Workspace::new(), vec![0.0; 300]);
    for k in 0..log.len() - 100 {
        if k >= 100 && k % 5 == 0 {
            session.rollout(&commands[2 * k..2 * (k + 100)], &mut work, &mut y);
            for (n, sums) in sums.iter_mut().enumerate() {
                for i in 0..3 {
                    sums[i] += (y[3 * n + i] - log[k + n + 1][6 + i]).abs();
                }
            }
            windows += 1.0;
        }
        step(&mut session, log, k);
    }
    assert_eq!(windows, 1070.0);
    sums.iter_mut().flatten().for_each(|sum| *sum /= windows);
    sums
}

/// The largest relative difference from the errors in the reference.
fn worst_error(name: &str) -> f64 {
    let reference = rows(&format!("{name}_error_by_horizon.csv"));
    let mut worst = 0.0_f64;
    for (ours, row) in errors(name, &rows("lawn3.csv")).iter().zip(&reference) {
        for i in 0..3 {
            worst = worst.max((ours[i] / row[7 + i] - 1.0).abs());
        }
    }
    worst
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn errors_along_the_log_are_those_of_the_reference() {
    for name in NAMES {
        let worst = worst_error(name);
        println!("{name}: errors differ by {worst:.1e}");
        assert!(worst < 1e-6, "{name}: {worst}");
    }
}
