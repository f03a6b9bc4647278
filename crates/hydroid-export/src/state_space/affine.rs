//! Control-affine networks.

use hydroid_core::actuator::{Map, rk4_first_stage};
use hydroid_core::model::affine::ControlAffine;
use hydroid_core::model::direct::Perceptron;

use super::recurrent::{matrix, scaled};
use super::{Channels, Label, StateSpace, lag, outputs_first, rk4};
use crate::graph::{Builder, Module, Scalar, Unary, Vector};

/// A perceptron with `tanh` between its layers.
pub(super) fn perceptron<'a>(network: &Perceptron, weights: &[f64], x: Vector<'a>) -> Vector<'a> {
    let mut x = x;
    let layers = network.hidden.len();
    for (layer, pair) in network.tensors().chunks_exact(2).enumerate() {
        let [weight, bias] = [&pair[0], &pair[1]];
        let of = matrix(&weights[weight.range()], weight.rows, weight.columns);
        x = x.affine(of, weights[bias.range()].to_vec());
        if layer < layers {
            x = x.unary(Unary::Tanh);
        }
    }
    x
}

fn effort(map: Map, a: Scalar<'_>) -> Scalar<'_> {
    match map {
        Map::Identity => a,
        Map::Sine => a.unary(Unary::Sin),
        Map::SignedSquare => a * a.unary(Unary::Abs),
    }
}

pub(super) fn state_space(model: &ControlAffine, channels: &Channels) -> StateSpace {
    let (n, m) = (model.outputs(), model.inputs());
    let states = n + m;
    let mut module = Module::default();

    let b = Builder::new();
    let (y, a) = (b.argument("outputs", n), b.argument("positions", m));
    let z = scaled(&b, y, &model.scaling.output_mean, &model.scaling.output_scale);
    let g = perceptron(&model.network, &model.weights, z);
    let mut sum = g.slice(0, n);
    for (i, effector) in model.effectors.iter().enumerate() {
        let effort = effort(effector.map, a.at(i)) / effector.unit;
        sum = sum + g.slice(n * (1 + i), n) * b.vector_of(effort);
    }
    let rate = b.constant(&model.scaling.correction_scale) * sum;
    let motion = module.add(b.finish("motion", "Rates of the outputs at positions of the actuators", rate));

    let b = Builder::new();
    let (x, c) = (b.argument("state", states), b.argument("command", m));
    let dy = b.call(motion, n, &[x.slice(0, n), x.slice(n, m)]);
    let lags = model.effectors.iter().enumerate();
    let lags: Vec<Scalar<'_>> =
        lags.map(|(i, effector)| (c.at(i) - x.at(n + i)) / effector.time_constant_s).collect();
    let dx = b.concat(&[dy, b.gather(&lags)]);
    let rates = module.add(b.finish("rates", "Rates of the state", dx));

    let b = Builder::new();
    let (x, c) = (b.argument("state", states), b.argument("command", m));
    let positions = |decay: &dyn Fn(f64) -> f64| -> Vector<'_> {
        let at = |i: usize| lag(x.at(n + i), c.at(i), decay(model.effectors[i].time_constant_s));
        b.gather(&(0..m).map(at).collect::<Vec<_>>())
    };
    let dt = model.dt;
    let half = |time: f64| (-0.5 * dt / time).exp();
    let y = rk4(&b, x.slice(0, n), dt, |stage, y| {
        let at = match stage {
            0 => positions(&|time| rk4_first_stage(dt / time)),
            1 | 2 => positions(&half),
            _ => positions(&|time| half(time) * half(time)),
        };
        b.call(motion, n, &[y, at])
    });
    let next = b.concat(&[y, positions(&|time| half(time) * half(time))]);
    let step = module.add(b.finish("step", "State after a sample with the command held", next));

    let b = Builder::new();
    let (y, c) = (b.argument("outputs", n), b.argument("command", m));
    let start = module.add(b.finish("start", "State of a steady motion", b.concat(&[y, c])));
    let [observe, output] = outputs_first(&mut module, n, states);
    let mut state = channels.outputs.clone();
    state.extend(
        channels.inputs.iter().map(|input| Label::new(format!("position of {}", input.name), &input.unit)),
    );
    StateSpace { module, state, start, step, observe, output, rates: Some(rates), block: None }
}
