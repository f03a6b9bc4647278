//! The state filter compared with an independent implementation (`NumPy`, JAX): the frozen networks of
//! `/tests/golden/adaptation` on a closed-loop log of a hydrofoil.

use std::sync::Arc;

use hydroid_core::adapt::kalman::KalmanNetwork;
use hydroid_core::model::recurrent::{BaseModel, Cell, Network, Recurrent, RecurrentSession, Scaling};
use hydroid_core::predict::{Predictor, Workspace};

use crate::networks::{NAMES, pretrained, rows};

/// A network trained at low speed. The filter is that of the reference: process noise 1e-4, measurement noise as simulated
/// (1 cm/s, 1 cm/s, 1 deg/s).
fn filtered(name: &str) -> KalmanNetwork {
    let (model, noise) = pretrained(name);
    KalmanNetwork::state_filter(Arc::new(model), 1e-4, 1.0, &noise).unwrap()
}

fn frozen(name: &str) -> RecurrentSession {
    RecurrentSession::new(Arc::new(pretrained(name).0)).unwrap()
}

/// Mean absolute errors of each output against the truth at horizons 1..100, over windows that start every 5 samples
/// from the 100th on.
fn errors(session: &mut dyn Predictor, log: &[Vec<f64>]) -> Vec<[f64; 3]> {
    let commands: Vec<f64> = log.iter().flat_map(|row| [row[1], row[2]]).collect();
    let (mut sums, mut windows) = (vec![[0.0; 3]; 100], 0.0);
    let (mut work, mut y) = (Workspace::new(), vec![0.0; 300]);
    for k in 0..log.len() - 100 {
        session.observe(&log[k][3..6]);
        if k >= 100 && k % 5 == 0 {
            session.rollout(&commands[2 * k..2 * (k + 100)], &mut work, &mut y);
            for (n, sums) in sums.iter_mut().enumerate() {
                for i in 0..3 {
                    sums[i] += (y[3 * n + i] - log[k + n + 1][6 + i]).abs();
                }
            }
            windows += 1.0;
        }
        session.advance(&commands[2 * k..2 * k + 2]);
    }
    assert_eq!(windows, 1070.0);
    sums.iter_mut().flatten().for_each(|sum| *sum /= windows);
    sums
}

#[test]
fn frozen_and_filtered_errors_are_those_of_the_reference() {
    let log = rows("lawn3.csv");
    for name in NAMES {
        let reference = rows(&format!("{name}_error_by_horizon.csv"));
        let sessions: [(&mut dyn Predictor, usize); 2] = [(&mut frozen(name), 1), (&mut filtered(name), 13)];
        for (session, first) in sessions {
            let ours = errors(session, &log);
            let mut worst = 0.0_f64;
            for (ours, row) in ours.iter().zip(&reference) {
                for i in 0..3 {
                    worst = worst.max((ours[i] / row[first + i] - 1.0).abs());
                }
            }
            println!(
                "{name}, column {first}: largest relative difference {worst:.1e}; 20 steps {:?}",
                ours[19]
            );
            assert!(worst < 1e-6, "{name}, column {first}: {worst:e}");
        }
    }
}

#[test]
fn missing_channels_are_left_out() {
    let log = rows("lawn3.csv");
    let mut sessions = [0, 1, 2].map(|_| filtered("gru"));
    let mut open = frozen("gru");
    let mut errors = [0.0; 4];
    for row in &log[..3000] {
        sessions[0].observe(&row[3..6]);
        sessions[1].observe(&[row[3], f64::NAN, f64::NAN]);
        sessions[2].observe(&[f64::NAN; 3]);
        let [all, one, none] = &mut sessions;
        let sessions: [&mut dyn Predictor; 4] = [all, one, none, &mut open];
        for (session, error) in sessions.into_iter().zip(&mut errors) {
            session.advance(&row[1..3]);
            let mut y = [0.0; 3];
            session.output(&mut y);
            *error += (y[0] - row[6]).abs() / 3000.0;
        }
    }
    println!("mean error in u one sample ahead: {errors:?}");
    assert_eq!(sessions[2].filter().state(), open.hidden(), "without measurements, open loop");
    assert!(errors[0] < 0.3 * errors[3] && errors[1] < 0.3 * errors[3], "{errors:?}");
}

#[test]
fn outputs_may_be_more_than_the_state_has_numbers() {
    for hidden in [1, 2] {
        let network = Network { cell: Cell::Gru { hidden }, inputs: 1, outputs: 3, read_out: true };
        let weights = (0..network.weights()).map(|k| (k as f64).sin()).collect();
        let ones = vec![1.0; 3];
        let scaling = Scaling {
            output_mean: vec![0.0; 3],
            output_scale: ones.clone(),
            input_mean: vec![0.0],
            input_scale: vec![1.0],
            correction_scale: ones,
        };
        let (base, feedback) = (BaseModel::Nothing, false);
        let model = Recurrent { network, weights, scaling, base, feedback, wash_out: 1 };
        // The filter follows measurements of the network itself from another initial state.
        let open = Arc::new(model);
        let mut truth = RecurrentSession::new(Arc::clone(&open)).unwrap();
        let mut blind = RecurrentSession::new(Arc::clone(&open)).unwrap();
        let mut filtered = KalmanNetwork::state_filter(open, 1e-3, 1.0, &[0.01; 3]).unwrap();
        truth.observe(&[0.0; 3]);
        (0..20).for_each(|_| truth.advance(&[-1.0]));
        let mut far = [0.0; 2];
        for k in 0..10 {
            let mut y = [0.0; 3];
            truth.output(&mut y);
            filtered.observe(&y);
            truth.advance(&[0.5]);
            filtered.advance(&[0.5]);
            blind.advance(&[0.5]);
            if k == 3 {
                far = [filtered.filter().state(), blind.hidden()]
                    .map(|state| state.iter().zip(truth.hidden()).map(|(a, b)| (a - b).abs()).sum());
            }
        }
        assert!(far[0] < 0.2 * far[1], "{hidden}: {far:?}");
    }
}

#[test]
fn a_diverged_filter_restarts() {
    let mut session = filtered("lstm");
    let log = rows("lawn3.csv");
    for (k, row) in log[..300].iter().enumerate() {
        let wild = if k % 50 == 20 { 1e300 } else { row[3] };
        session.observe(&[wild, row[4], row[5]]);
        session.advance(&[if k % 50 == 40 { f64::NAN } else { row[1] }, row[2]]);
    }
    for row in &log[300..500] {
        session.observe(&row[3..6]);
        session.advance(&row[1..3]);
    }
    let mut y = [0.0; 3];
    session.output(&mut y);
    assert!(y.iter().all(|y| y.abs() < 10.0), "{y:?}");
}
