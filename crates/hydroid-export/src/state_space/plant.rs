//! Vessels with given parameters.

use hydroid_core::model::PlantModel;
use hydroid_core::vessel::{Actuation, Number as _, Plant, RudderLaw};

use super::{Label, StateSpace, outputs_first, rk4};
use crate::graph::{Builder, Module, Scalar, Unary, Vector};

/// The equations of motion, computed with the numbers of the graph.
fn vessel<'a>(model: &PlantModel) -> Plant<Scalar<'a>> {
    Plant::assemble(model.form(), &model.numbers().map(Scalar::constant))
}

fn actuation<'a>(model: &PlantModel, command: Vector<'a>) -> Actuation<Scalar<'a>> {
    let params = model.params();
    let rudder = match params.rudder.law {
        RudderLaw::Linear => command.at(1),
        RudderLaw::Sine => command.at(1).unary(Unary::Sin),
    };
    Actuation { pp: command.at(0), moment_per_speed: Scalar::constant(params.rudder.gain) * rudder }
}

pub(super) fn state_space(model: &PlantModel) -> StateSpace {
    const STATES: usize = 4;
    let mut module = Module::default();

    let b = Builder::new();
    let (x, c) = (b.argument("state", STATES), b.argument("command", PlantModel::INPUTS));
    let held = actuation(model, c);
    let [u, v, r, force] = [0, 1, 2, 3].map(|i| x.at(i));
    let [du, dv, dr] = vessel(model).acceleration([u, v, r], force, held.moment_per_speed);
    let lag_rate = 1.0 / model.params().propeller.lag;
    let rates = b.gather(&[du, dv, dr, (held.pp - force) * lag_rate]);
    let rates = module.add(b.finish("rates", "Rates of the state (Fossen 2021, chapter 6)", rates));

    let b = Builder::new();
    let (x, c) = (b.argument("state", STATES), b.argument("command", PlantModel::INPUTS));
    let h = model.dt() / model.steps() as f64;
    let next = rk4(&b, x, h, |_, x| b.call(rates, STATES, &[x, c]));
    let substep = module.add(b.finish("integrate", "One step of the Runge-Kutta method of order 4", next));

    let b = Builder::new();
    let (x, c) = (b.argument("state", STATES), b.argument("command", PlantModel::INPUTS));
    let next = b.repeat(substep, model.steps(), &[x, c]);
    let step = module.add(b.finish("step", "State after a sample with the command held", next));

    let b = Builder::new();
    let y = b.argument("outputs", PlantModel::OUTPUTS);
    let _ = b.argument("command", PlantModel::INPUTS);
    let state = b.concat(&[y, b.gather(&[holding_force(model, y.at(0))])]);
    let start = module.add(b.finish("start", "State of a steady motion", state));

    let [observe, output] = outputs_first(&mut module, PlantModel::OUTPUTS, STATES);
    let state = [("u", "m/s"), ("v", "m/s"), ("r", "rad/s"), ("propeller force", "N")];
    let state = state.map(|(name, unit)| Label::new(name, unit)).to_vec();
    StateSpace { module, state, start, step, observe, output, rates: Some(rates), block: None }
}

/// The propeller force that holds a surge velocity, with the drag blended between the modes as in
/// [`Plant::holding_force`].
fn holding_force<'a>(model: &PlantModel, u: Scalar<'a>) -> Scalar<'a> {
    let zero = Scalar::constant(0.0);
    let plant = vessel(model);
    let [drag, ..] = plant.drag([u, zero, zero]);
    if model.params().flying.is_none() {
        return drag;
    }
    // The acceleration is affine in the force: its root is the holding force.
    let one = Scalar::constant(1.0);
    let at = |force| plant.acceleration([u, zero, zero], force, zero)[0];
    let still = at(zero);
    -still / (at(one) - still)
}
