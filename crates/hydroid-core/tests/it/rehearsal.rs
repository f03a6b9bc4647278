//! Rehearsal of training windows against forgetting.

use std::sync::Arc;

use hydroid_core::adapt::kalman::{CovarianceForm, FilterOptions, KalmanNetwork, RehearsalOptions};
use hydroid_core::adapt::{Learning, Rehearsing, SaveState};
use hydroid_core::model::recurrent::{BaseModel, Cell, Network, Recurrent, Scaling};
use hydroid_core::predict::{Predictor, Workspace};

const NETWORK: Network = Network { cell: Cell::Gru { hidden: 6 }, inputs: 2, outputs: 2, read_out: true };
const REHEARSAL: RehearsalOptions =
    RehearsalOptions { windows: 6, samples: 40, every: 1, initial_state: 0.1, noise_factor: 1.0 };

fn shore() -> Vec<f64> {
    (0..NETWORK.weights()).map(|k| 0.5 * (1.7 * k as f64).sin()).collect()
}

fn model(weights: Vec<f64>) -> Arc<Recurrent> {
    let (ones, zeros) = (vec![1.0; 2], vec![0.0; 2]);
    let scaling = Scaling {
        output_mean: zeros.clone(),
        output_scale: ones.clone(),
        input_mean: zeros,
        input_scale: ones.clone(),
        correction_scale: ones,
    };
    let (base, feedback, wash_out) = (BaseModel::Nothing, false, 20);
    Arc::new(Recurrent { network: NETWORK, weights, scaling, base, feedback, wash_out })
}

fn options(covariance: CovarianceForm) -> FilterOptions {
    let uniform = FilterOptions::uniform(NETWORK.weights(), 0.02, 1e-7, (1.0, 1e-5), &[1e-4; 2]);
    FilterOptions { leak: 1e-5, covariance, ..uniform }
}

fn session(covariance: CovarianceForm, rehearsal: Option<RehearsalOptions>) -> KalmanNetwork {
    KalmanNetwork::with_rehearsal(model(shore()), options(covariance), rehearsal).unwrap()
}

/// Commands of two regimes: small about one value, and fast about another.
fn command(water: usize, k: usize) -> [f64; 2] {
    let (at, speed) = [(-0.8, 0.05), (0.9, 0.15)][water];
    let t = speed * k as f64;
    [at + 0.5 * t.sin(), at + 0.5 * (1.3 * t + 0.4).cos()]
}

/// Outputs of a network with these weights in a regime, and commands, row by row.
fn sailed(weights: Vec<f64>, water: usize, count: usize) -> (Vec<f64>, Vec<f64>) {
    let mut truth = KalmanNetwork::new(model(weights), options(CovarianceForm::Full)).unwrap();
    let (mut outputs, mut commands, mut y) = (Vec::new(), Vec::new(), [0.0; 2]);
    for k in 0..count {
        truth.output(&mut y);
        outputs.extend(y);
        commands.extend(command(water, k));
        truth.advance(&command(water, k));
    }
    (outputs, commands)
}

/// The new regime has another network.
fn new_water(count: usize) -> (Vec<f64>, Vec<f64>) {
    let other = shore().iter().enumerate().map(|(k, w)| w + 0.3 * (0.9 * k as f64).cos()).collect();
    sailed(other, 1, count)
}

fn keep(session: &mut KalmanNetwork) {
    let (y, c) = sailed(shore(), 0, 600);
    for window in 0..session.rehearsal().map_or(0, |rehearsal| rehearsal.windows) {
        let rows = 2 * 80 * window..2 * (80 * window + 100);
        session.store_window(&y[rows.clone()], &c[rows]);
    }
}

fn sail(session: &mut KalmanNetwork, (y, c): &(Vec<f64>, Vec<f64>), from: usize, to: usize) {
    for k in 2 * from..2 * to {
        if k % 2 == 0 {
            session.observe(&y[k..k + 2]);
            session.advance(&c[k..k + 2]);
        }
    }
}

/// Mean error of a simulation of the old regime with these weights.
fn forgotten(weights: &[f64]) -> f64 {
    let (y, c) = sailed(shore(), 0, 300);
    let held = KalmanNetwork::new(
        model(weights.to_vec()),
        FilterOptions {
            initial_weights: vec![0.0; weights.len()],
            weight_noise: vec![0.0; weights.len()],
            ..options(CovarianceForm::Full)
        },
    )
    .unwrap();
    let mut predicted = vec![0.0; c.len()];
    held.rollout(&c, &mut Workspace::new(), &mut predicted);
    let errors = predicted[40..c.len() - 2].iter().zip(&y[42..]).map(|(a, b)| (a - b).abs());
    errors.sum::<f64>() / (c.len() - 42) as f64
}

#[test]
fn impossible_rehearsals_are_refused() {
    for wrong in [
        RehearsalOptions { windows: 0, ..REHEARSAL },
        RehearsalOptions { noise_factor: f64::NAN, ..REHEARSAL },
        RehearsalOptions { windows: 1 << 40, ..REHEARSAL },
        RehearsalOptions { samples: usize::MAX, ..REHEARSAL },
    ] {
        let made = KalmanNetwork::with_rehearsal(model(shore()), options(CovarianceForm::Full), Some(wrong));
        let message = made.map(|_| ()).unwrap_err().to_string();
        assert!(message.contains("at most 1000000 samples"), "{message}");
    }
}

#[test]
fn rehearsal_keeps_the_old_regime_and_learns_the_new_regime() {
    let sea = new_water(1200);
    for covariance in [CovarianceForm::Full, CovarianceForm::Blocks { group: 2 }] {
        let errors = [None, Some(REHEARSAL)].map(|rehearsal| {
            let mut session = session(covariance, rehearsal);
            keep(&mut session);
            sail(&mut session, &sea, 0, 1000);
            let mut predicted = [0.0; 200];
            session.rollout(&sea.1[2000..2200], &mut Workspace::new(), &mut predicted);
            let ahead = predicted.iter().zip(&sea.0[2002..]).map(|(a, b)| (a - b).abs()).sum::<f64>() / 200.0;
            (forgotten(session.weights()), ahead)
        });
        let [(plain, plain_ahead), (rehearsed, ahead)] = errors;
        println!(
            "{covariance}: old water {plain:.5} and {rehearsed:.5}, new one {plain_ahead:.5} and {ahead:.5}"
        );
        assert!(rehearsed < 0.4 * plain, "{covariance}: {rehearsed} {plain}");
        assert!(ahead < 2.0 * plain_ahead + 0.01, "{covariance}: {ahead} {plain_ahead}");
    }
}

#[test]
fn without_rehearsal_windows_the_filter_is_unchanged() {
    let sea = new_water(200);
    for covariance in [CovarianceForm::Full, CovarianceForm::Blocks { group: 2 }] {
        let weights = [None, Some(REHEARSAL)].map(|rehearsal| {
            let mut session = session(covariance, rehearsal);
            sail(&mut session, &sea, 0, 200);
            session.weights().to_vec()
        });
        assert_eq!(weights[0], weights[1], "{covariance}");
    }
}

#[test]
fn a_rehearsing_filter_stays_positive_and_resumes_from_its_saved_state() {
    let sea = new_water(400);
    for covariance in [CovarianceForm::Full, CovarianceForm::Blocks { group: 2 }] {
        let mut one = session(covariance, Some(REHEARSAL));
        keep(&mut one);
        for k in 0..333 {
            sail(&mut one, &sea, k, k + 1);
            let (hh, tt) = one.filter().variances();
            assert!(hh.iter().chain(&tt).all(|&p| p > 0.0 && p.is_finite()), "{covariance}, {k}");
            assert!(one.filter().innovation().1.iter().all(|&s| k == 0 || s >= 1e-4), "{covariance}, {k}");
        }
        let mut saved = vec![0.0; one.memory_len()];
        one.save(&mut saved);
        let mut other = session(covariance, Some(REHEARSAL));
        other.load(&saved);
        for session in [&mut one, &mut other] {
            sail(session, &sea, 333, 400);
        }
        let (mut ours, mut theirs) = (saved.clone(), saved);
        one.save(&mut ours);
        other.save(&mut theirs);
        assert_eq!(ours, theirs, "{covariance}");
    }
}
