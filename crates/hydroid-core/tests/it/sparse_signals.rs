//! Signals of sparse equations: lag states and past values compared with exponentials and shifted sequences.

use std::sync::Arc;

use hydroid_core::model::sparse::{Equations, EquationsError, EquationsSession, Real, Signal, Term};
use hydroid_core::predict::{Predictor, Workspace};

fn lag(input: u16, seconds: f64) -> Signal {
    Signal::Lag { input, time_constant_s: Real(seconds) }
}

fn past(variable: u16, samples: u16) -> Signal {
    Signal::Past { variable, samples }
}

/// One output, one input, given signals: `y' = sum of coefficients times signals`.
fn of_signals(signals: Vec<Signal>, coefficients: Vec<f64>, dt: f64, substeps: usize) -> Equations {
    let terms: Vec<Term> =
        (0..signals.len()).map(|i| Term::monomial(&[2 + u16::try_from(i).unwrap()])).collect();
    Equations::with_signals(terms, coefficients, 1, 1, signals, dt, substeps).unwrap()
}

fn rolled(equations: Equations, start: f64, commands: &[f64]) -> Vec<f64> {
    let mut session = EquationsSession::new(Arc::new(equations));
    session.observe(&[start]);
    let mut y = vec![0.0; commands.len()];
    session.rollout(commands, &mut Workspace::new(), &mut y);
    y
}

/// `y' = a`, `T a' = c - a`: after a step of the command from `c0` to `c1`, `y = c1 t + (c0 - c1) T (1 - exp(-t/T))`.
#[test]
fn a_lag_is_an_exponential() {
    let (t_c, dt, c0, c1) = (0.8, 0.1, -1.0, 2.0);
    for substeps in [1, 3] {
        let mut session =
            EquationsSession::new(Arc::new(of_signals(vec![lag(1, t_c)], vec![1.0], dt, substeps)));
        session.observe(&[0.0]);
        // At rest under c0, so that the lag state is c0.
        session.advance(&[c0]);
        session.observe(&[0.0]);
        let mut y = vec![0.0; 40];
        session.rollout(&[c1; 40], &mut Workspace::new(), &mut y);
        for (k, y) in y.iter().enumerate() {
            let t = dt * (k + 1) as f64;
            let exact = c1 * t + (c0 - c1) * t_c * (1.0 - (-t / t_c).exp());
            assert!((y - exact).abs() < 3e-7, "{substeps} at {t}: {y} for {exact}");
        }
    }
}

#[test]
fn past_inputs_are_held_and_past_outputs_interpolated() {
    let dt = 0.5;
    let commands: Vec<f64> = (0..12).map(|k| f64::from(k * k)).collect();
    // y' = c two samples ago.
    let mut session = EquationsSession::new(Arc::new(of_signals(vec![past(1, 2)], vec![1.0], dt, 3)));
    assert_eq!(session.warm_up(), 3);
    session.observe(&[0.0]);
    let mut expected = 0.0;
    for (k, &c) in commands.iter().enumerate() {
        session.observe(&[expected]);
        session.advance(&[c]);
        let mut y = [0.0];
        session.output(&mut y);
        if k < 2 {
            assert!(y[0].is_nan(), "what happened before the start is not known");
            continue;
        }
        expected += dt * commands[k - 2];
        assert!((y[0] - expected).abs() < 1e-12, "{k}: {} for {expected}", y[0]);
    }
    // y' = y(t - L dt) with y(t) = t before 0, by the method of steps: with L samples of history y(-tau + s) = s - tau
    // the first L samples integrate exactly to y(s) = y0 + s^2/2 - tau s, for any number of substeps.
    for (samples, substeps) in [(1u16, 1), (1, 4), (3, 1), (3, 2)] {
        let equations = of_signals(vec![past(0, samples)], vec![1.0], dt, substeps);
        let mut session = EquationsSession::new(Arc::new(equations));
        let tau = dt * f64::from(samples);
        for k in (1..=samples).rev() {
            session.observe(&[-dt * f64::from(k)]);
            session.advance(&[0.0]);
        }
        session.observe(&[0.0]);
        let mut y = vec![0.0; usize::from(samples)];
        session.rollout(&vec![0.0; usize::from(samples)], &mut Workspace::new(), &mut y);
        for (k, y) in y.iter().enumerate() {
            let s = dt * (k + 1) as f64;
            let exact = 0.5 * s * s - tau * s;
            assert!((y - exact).abs() < 1e-12, "{samples} {substeps} {k}: {y} for {exact}");
        }
    }
}

#[test]
fn signal_series_equal_the_session() {
    let dt = 0.1;
    let commands: Vec<f64> = (0..200).map(|k| (0.2 * f64::from(k)).sin()).collect();
    for signal in [lag(1, 0.35), past(1, 4)] {
        let series = signal.series(&commands, dt);
        let warm_up = signal.warm_up(dt);
        assert!(series[..warm_up].iter().all(|x| x.is_nan()) && warm_up > 0);
        let equations = of_signals(vec![signal], vec![1.0], dt, 1);
        let mut slots = vec![0.0; equations.slots()];
        let mut state = vec![f64::NAN; equations.state_len()];
        let mut scratch = vec![0.0; equations.scratch()];
        for (k, &c) in commands.iter().enumerate() {
            if k >= warm_up {
                equations.load(&state, &[c], &mut slots);
                assert!((slots[3] - series[k]).abs() < 1e-13, "{signal:?} at {k}");
            }
            equations.wait(&mut state, &[c], &mut scratch);
        }
    }
}

#[test]
fn snapshots_carry_lags_and_pasts() {
    let equations = || {
        let signals = vec![lag(1, 0.7), past(0, 3), past(1, 2), past(0, 1)];
        of_signals(signals, vec![1.0, -0.4, 0.3, -0.2], 0.1, 2)
    };
    let mut session = EquationsSession::new(Arc::new(equations()));
    for k in 0..20 {
        session.observe(&[0.01 * f64::from(k)]);
        session.advance(&[(f64::from(k)).cos()]);
    }
    let mut kept = vec![0.0; session.snapshot_len()];
    session.snapshot(&mut kept);
    let commands: Vec<f64> = (0..30).map(|k| (0.3 * f64::from(k)).sin()).collect();
    let roll = |s: &dyn Predictor| {
        let mut y = vec![0.0; 30];
        s.rollout(&commands, &mut Workspace::new(), &mut y);
        y
    };
    let expected = roll(&session);
    assert!(expected.iter().all(|y| y.is_finite()));
    // A rollout equals repeated advances.
    let mut walked = session.fork();
    for (c, y) in commands.iter().zip(&expected) {
        walked.advance(&[*c]);
        let mut now = [0.0];
        walked.output(&mut now);
        assert_eq!(now[0], *y);
    }
    let mut fresh = EquationsSession::new(Arc::new(equations()));
    fresh.restore(&kept);
    assert_eq!(roll(&fresh), expected);
    session.reset();
    assert!(roll(&session).iter().all(|y| y.is_nan()));
}

#[test]
fn a_lag_follows_its_command_also_before_the_outputs_are_known() {
    let equations = of_signals(vec![lag(1, 0.5)], vec![1.0], 0.1, 1);
    let mut session = EquationsSession::new(Arc::new(equations.clone()));
    for _ in 0..100 {
        session.advance(&[1.0]);
    }
    session.observe(&[0.0]);
    let mut y = [0.0];
    session.rollout(&[1.0], &mut Workspace::new(), &mut y);
    assert!((y[0] - 0.1).abs() < 1e-12);
    assert_eq!(rolled(equations, 0.0, &[0.0])[0], 0.0);
}

#[test]
fn invalid_signals_are_refused() {
    let make = |signal| Equations::with_signals(vec![], vec![], 1, 1, vec![past(0, 1), signal], 0.1, 1);
    for bad in [lag(0, 1.0), lag(2, 1.0), lag(1, 0.0), lag(1, f64::NAN), past(2, 1), past(0, 0)] {
        assert_eq!(make(bad).unwrap_err(), EquationsError::Signal { index: 1 }, "{bad:?}");
    }
    assert!(make(lag(1, 1.0)).is_ok());
}
