//! The filter on the hidden state alone against an independent implementation (`NumPy`, JAX): the frozen networks of
//! `/tests/golden/adaptation` on a closed-loop log of a hydrofoil.

use std::sync::Arc;

use hydroid_core::model::recurrent::{
    BaseModel, Cell, Network, Recurrent, RecurrentSession, Scaling, StateFilter,
};
use hydroid_core::predict::{Predictor, Workspace};

use crate::networks::{NAMES, pretrained, rows};

/// A network trained on low speed alone. The filter is that of the reference: process noise 1e-4, measurement noise
/// as simulated (1 cm/s, 1 cm/s, 1 deg/s).
fn model(name: &str, filtered: bool) -> Recurrent {
    let (model, noise) = pretrained(name);
    let state_filter = filtered.then_some(StateFilter { process: 1e-4, initial: 1.0, noise });
    Recurrent { state_filter, ..model }
}

/// Mean absolute errors against the truth at horizons 1..100 of each output, over windows that begin every 5 samples
/// from the 100th on.
fn errors(model: &Recurrent, log: &[Vec<f64>]) -> Vec<[f64; 3]> {
    let mut session = RecurrentSession::new(Arc::new(model.clone())).unwrap();
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
        for (filtered, first) in [(false, 1), (true, 13)] {
            let ours = errors(&model(name, filtered), &log);
            let mut worst = 0.0_f64;
            for (ours, row) in ours.iter().zip(&reference) {
                for i in 0..3 {
                    worst = worst.max((ours[i] / row[first + i] - 1.0).abs());
                }
            }
            println!(
                "{name}, filtered {filtered}: largest relative difference {worst:.1e}; 20 steps {:?}",
                ours[19]
            );
            assert!(worst < 1e-6, "{name}, filtered {filtered}: {worst:e}");
        }
    }
}

/// What is missing is left out: the filter lives on what other sensors say, and a run with none is open loop.
#[test]
fn missing_channels_are_left_out() {
    let log = rows("lawn3.csv");
    let model = model("gru", true);
    let mut sessions = [0, 1, 2].map(|_| RecurrentSession::new(Arc::new(model.clone())).unwrap());
    let mut frozen = RecurrentSession::new(Arc::new(Recurrent { state_filter: None, ..model })).unwrap();
    let mut errors = [0.0; 4];
    for row in &log[..3000] {
        let all = &row[3..6];
        sessions[0].observe(all);
        sessions[1].observe(&[row[3], f64::NAN, f64::NAN]);
        sessions[2].observe(&[f64::NAN; 3]);
        for (session, error) in sessions.iter_mut().chain([&mut frozen]).zip(&mut errors) {
            session.advance(&row[1..3]);
            let mut y = [0.0; 3];
            session.output(&mut y);
            *error += (y[0] - row[6]).abs() / 3000.0;
        }
    }
    println!("mean error in u one sample ahead: {errors:?}");
    assert_eq!(sessions[2].hidden(), frozen.hidden(), "without measurements, open loop");
    assert!(errors[0] < 0.3 * errors[3] && errors[1] < 0.3 * errors[3], "{errors:?}");
}

/// The filter's scratch was made for as many outputs as the state has numbers.
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
        let state_filter = Some(StateFilter { process: 1e-3, initial: 1.0, noise: vec![0.01; 3] });
        let (base, feedback) = (BaseModel::Nothing, false);
        let model = Recurrent { network, weights, scaling, base, feedback, wash_out: 1, state_filter };
        // It follows measurements of the network itself, begun elsewhere.
        let open = Recurrent { state_filter: None, ..model.clone() };
        let mut truth = RecurrentSession::new(Arc::new(open.clone())).unwrap();
        let mut blind = RecurrentSession::new(Arc::new(open)).unwrap();
        let mut filtered = RecurrentSession::new(Arc::new(model)).unwrap();
        truth.observe(&[0.0; 3]);
        (0..20).for_each(|_| truth.advance(&[-1.0]));
        let mut far = [0.0; 2];
        for k in 0..10 {
            let mut y = [0.0; 3];
            truth.output(&mut y);
            filtered.observe(&y);
            truth.advance(&[0.5]);
            for (session, far) in [&mut filtered, &mut blind].into_iter().zip(&mut far) {
                session.advance(&[0.5]);
                if k == 3 {
                    let ours = session.hidden().iter().zip(truth.hidden());
                    *far = ours.map(|(a, b)| (a - b).abs()).sum();
                }
            }
        }
        assert!(far[0] < 0.2 * far[1], "{hidden}: {far:?}");
    }
}

/// Numbers beyond all bounds do not end a session: it starts again.
#[test]
fn a_diverged_filter_restarts() {
    let model = Arc::new(model("lstm", true));
    let mut session = RecurrentSession::new(model).unwrap();
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
