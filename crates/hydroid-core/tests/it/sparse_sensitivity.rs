//! Derivatives of rollouts compared with finite differences.

use hydroid_core::model::sparse::{
    Equations, EquationsSession, Gate, Real, Sensitivity, Shape, Signal, Term,
};
use hydroid_core::predict::{Predictor, Workspace};
use std::sync::Arc;

/// Two outputs and one input with every feature of equations: products, a kink, a gate, a lag, past values of one and
/// of several samples, of outputs and of the input, and several substeps.
fn equations(coefficients: &[f64]) -> Equations {
    let gate = Gate { centre: Real(0.4), slope: Real(5.0) };
    let terms = vec![
        Term::monomial(&[0]),
        Term::signed_square(1, 1),
        Term::monomial(&[0, 1]),
        Term::monomial(&[3]),
        Term::monomial(&[1, 2]).gated(0, gate)[0].clone(),
        Term::of(0, Shape::Above(gate)),
        Term::monomial(&[4]),
        Term::monomial(&[5, 0]),
        Term::monomial(&[6]),
        Term::constant(),
    ];
    let signals = vec![
        Signal::Lag { input: 2, time_constant_s: Real(0.7) },
        Signal::Past { variable: 0, samples: 1 },
        Signal::Past { variable: 1, samples: 3 },
        Signal::Past { variable: 2, samples: 2 },
    ];
    Equations::with_signals(terms, coefficients.to_vec(), 2, 1, signals, 0.1, 2).unwrap()
}

fn coefficients() -> Vec<f64> {
    // Some coefficients are zero, as in any sparse model.
    (0..20).map(|i| if i % 7 == 3 { 0.0 } else { 0.9 * (1.3 * f64::from(i) + 0.4).sin() - 0.3 }).collect()
}

/// A state with a known past, and future commands.
fn start(equations: &Equations) -> (Vec<f64>, Vec<f64>) {
    let mut session = EquationsSession::new(Arc::new(equations.clone()));
    let command = |k: usize| (0.31 * k as f64).sin();
    for k in 0..80 {
        let t = 0.1 * k as f64;
        session.observe(&[0.5 + 0.3 * t.sin(), 0.4 * (1.7 * t).cos()]);
        if k < 79 {
            session.advance(&[command(k)]);
        }
    }
    let mut state = vec![0.0; session.snapshot_len()];
    session.snapshot(&mut state);
    (state, (79..109).map(command).collect())
}

fn rolled_out(equations: &Equations, state: &[f64], commands: &[f64]) -> Vec<f64> {
    let mut session = EquationsSession::new(Arc::new(equations.clone()));
    session.restore(state);
    let mut y = vec![0.0; 2 * commands.len()];
    session.rollout(commands, &mut Workspace::new(), &mut y);
    y
}

#[test]
fn derivatives_are_those_of_the_rollout() {
    let coefficients = coefficients();
    let equations = equations(&coefficients);
    let places: Vec<usize> = (0..20).filter(|i| coefficients[*i] != 0.0).collect();
    let (state, commands) = start(&equations);
    let sensitivity = Sensitivity::new(&equations, &places).unwrap();
    let p = sensitivity.parameters();
    assert_eq!(p, 2 + places.len());
    let rows = commands.len() + 1;
    let (mut y, mut s) = (vec![0.0; 2 * rows], vec![0.0; 2 * rows * p]);
    sensitivity.rollout(&state, &commands, &mut vec![0.0; sensitivity.scratch()], &mut y, &mut s);
    let plain = rolled_out(&equations, &state, &commands);
    for (a, b) in y[2..].iter().zip(&plain) {
        assert!((a - b).abs() < 1e-12, "the rollout itself: {a}, {b}");
    }
    let by = 1e-5;
    for q in 0..p {
        let beside = |sign: f64| {
            let (mut state, mut moved) = (state.clone(), coefficients.clone());
            if q < 2 {
                state[q] += sign * by;
            } else {
                moved[places[q - 2]] += sign * by;
            }
            rolled_out(&self::equations(&moved), &state, &commands)
        };
        let (low, high) = (beside(-1.0), beside(1.0));
        for (k, (low, high)) in low.iter().zip(&high).enumerate() {
            let expected = (high - low) / (2.0 * by);
            let got = s[(k + 2) * p + q];
            assert!((got - expected).abs() < 1e-7 * (1.0 + expected.abs()), "{q} at {k}: {got}, {expected}");
        }
    }
}

#[test]
fn an_unknown_coefficient_index_is_refused() {
    assert!(Sensitivity::new(&equations(&coefficients()), &[20]).is_err());
}
