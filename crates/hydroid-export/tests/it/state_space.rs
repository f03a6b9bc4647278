//! The exported state space against the sessions of hydroid.

use hydroid::model::{Body, Model};
use hydroid_core::model::affine::ControlAffine;
use hydroid_core::model::sparse::Equations;
use hydroid_export::check::Run;

use crate::models::{all, commands, first_outputs};
use crate::run::{difference, measured, rollout, steady};

#[test]
fn rollouts_are_those_of_the_session() {
    for model in all() {
        let (name, n) = (&model.description.name, model.description.outputs.len());
        let (y, c) = (first_outputs(&model), commands(&model, 1, 0.4));
        let (mut session, mut run) = (steady(&model, &y, &c), Run::start(&model, &y, &c));
        let ahead = commands(&model, 1002, 1.0);
        let (expected, found) = (rollout(&*session, &ahead), run.rollout(&ahead));
        assert!(difference(&expected, &found, n) < 1e-12, "{name}: {}", difference(&expected, &found, n));
        let spread = |k: usize| (expected[k * n] - expected[500 * n]).abs();
        assert!((0..1000).map(spread).fold(0.0, f64::max) > 1e-3, "{name} does not move");

        // Along a run with measurements.
        let inputs = c.len();
        let along = commands(&model, 60, 2.0);
        for (k, c) in along.chunks_exact(inputs).enumerate() {
            let measured = measured(&y, k);
            session.advance(c);
            session.observe(&measured);
            run.step(c);
            run.observe(&measured);
        }
        // At the end of a horizon that is not whole, the command is held here, and the position of the actuator there.
        let limited = model.description.inputs.iter().any(|port| port.rate_limit.is_some());
        let samples = if model.direct().is_some() && limited { 96 } else { 100 };
        let ahead = &ahead[..samples * inputs];
        let (expected, found) = (rollout(&*session, ahead), run.rollout(ahead));
        assert!(difference(&expected, &found, n) < 1e-12, "{name} after measurements");
        let mut now = vec![0.0; n];
        session.output(&mut now);
        assert!(difference(&now, &run.output(), n) < 1e-12, "{name}");
    }
}

/// A model in continuous time with samples of `dt` seconds; none for a model behind a limit of the rate.
fn with_step(model: &Model, dt: f64) -> Option<Model> {
    let body = match &model.body {
        Body::Equations(of) => {
            let (terms, coefficients) = (of.terms().to_vec(), of.coefficients().to_vec());
            let (n, m, signals) = (of.outputs(), of.inputs(), of.signals().to_vec());
            Body::Equations(
                Equations::with_signals(terms, coefficients, n, m, signals, dt, 1).unwrap().into(),
            )
        }
        Body::Affine(of) => Body::Affine(ControlAffine { dt, ..ControlAffine::clone(of) }.into()),
        _ => return model.clone().at_step(dt).ok(),
    };
    Some(Model { body, ..model.clone() })
}

#[test]
fn rates_are_the_limit_of_short_steps() {
    const DT: f64 = 1e-4;
    let mut count = 0;
    for model in all() {
        let (y, c) = (first_outputs(&model), commands(&model, 1, 0.4));
        let run = Run::start(&model, &y, &c);
        let next = commands(&model, 1, 0.9);
        let Some(rates) = run.rates(&next) else { continue };
        count += 1;
        let mut after = Run::start(&with_step(&model, DT).unwrap(), &y, &c);
        after.step(&next);
        let tolerance = 2e-3 * (1.0 + rates.iter().map(|rate| rate.abs()).fold(0.0, f64::max));
        for (k, rate) in rates.iter().enumerate() {
            let slope = (after.state()[k] - run.state()[k]) / DT;
            // The position of an actuator that follows at once jumps.
            let jumps = model.craft().is_some() && k >= 3 && *rate == 0.0;
            let name = &model.description.name;
            assert!(jumps || (slope - rate).abs() < tolerance, "{name}, state {k}: {slope} {rate}");
        }
    }
    assert!(count >= 8, "{count} models with rates");
}
