//! The exported state space against the sessions of hydroid.

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

        // Along a run with measurements; those of a committee are complete.
        let inputs = c.len();
        let along = commands(&model, 60, 2.0);
        for (k, c) in along.chunks_exact(inputs).enumerate() {
            let measured = measured(&model, &y, k);
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

#[test]
fn rates_are_the_limit_of_short_steps() {
    let mut count = 0;
    for model in all() {
        let (y, c) = (first_outputs(&model), commands(&model, 1, 0.4));
        let run = Run::start(&model, &y, &c);
        let c = commands(&model, 1, 0.9);
        let Some(rates) = run.rates(&c) else { continue };
        count += 1;
        // Steps of a vessel of 1 ms and less; the sample time of other models is fixed.
        let Ok(short) = model.clone().at_step(1e-4) else { continue };
        if short.description.dt > 1e-3 {
            continue;
        }
        let mut after = Run::start(&short, &y, &commands(&model, 1, 0.4));
        after.step(&c);
        for (k, rate) in rates.iter().take(3).enumerate() {
            let slope = (after.state()[k] - run.state()[k]) / 1e-4;
            let tolerance = 2e-3 * (1.0 + rates.iter().take(3).map(|rate| rate.abs()).fold(0.0, f64::max));
            assert!((slope - rate).abs() < tolerance, "{}: {slope} {rate}", model.description.name);
        }
    }
    assert!(count >= 8, "{count} models with rates");
}
