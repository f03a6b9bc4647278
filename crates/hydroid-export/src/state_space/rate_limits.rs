//! Actuators with limited rates in front of a model.

use super::{Channels, Label, Sizes, StateSpace};
use crate::graph::{Binary, Builder};

/// A state space behind limits of the rates of the inputs \[unit/s\]: the positions of the actuators come first in its state.
///
/// ```text
/// a_k = sat(c_k, a_{k-1} - rate dt, a_{k-1} + rate dt)
/// ```
///
/// The index is that of the function `(positions, command) -> positions`; none without a limit. The result has no rates, because positions that follow their commands at once are not states of differential equations.
pub(super) fn behind(
    space: StateSpace,
    rates: &[Option<f64>],
    sizes: Sizes,
    channels: &Channels,
) -> (StateSpace, Option<usize>) {
    if rates.iter().all(Option::is_none) {
        return (space, None);
    }
    let Sizes { outputs: n, inputs: m, dt } = sizes;
    let steps: Vec<f64> = rates.iter().map(|rate| rate.map_or(f64::MAX, |rate| rate * dt)).collect();
    let inner = space.state.len();
    let states = m + inner;
    let StateSpace { mut module, state, start, step, observe, output, block, .. } = space;

    let b = Builder::new();
    let (y, c) = (b.argument("outputs", n), b.argument("command", m));
    let first = b.concat(&[c, b.call(start, inner, &[y, c])]);
    let start = module.add(b.finish("start_limited", "State of a steady motion", first));

    let b = Builder::new();
    let (a, c) = (b.argument("positions", m), b.argument("command", m));
    let steps = b.constant(&steps);
    let moved = c.binary(Binary::Max, a - steps).binary(Binary::Min, a + steps);
    let limit = module.add(b.finish("limit", "Positions of the actuators after a sample", moved));

    let b = Builder::new();
    let (x, c) = (b.argument("state", states), b.argument("command", m));
    let a = b.call(limit, m, &[x.slice(0, m), c]);
    let next = b.concat(&[a, b.call(step, inner, &[x.slice(m, inner), a])]);
    let step = module.add(b.finish("step_limited", "State after a sample with the command held", next));

    let b = Builder::new();
    let (x, y) = (b.argument("state", states), b.argument("outputs", n));
    let next = b.concat(&[x.slice(0, m), b.call(observe, inner, &[x.slice(m, inner), y])]);
    let observe = module.add(b.finish("observe_limited", "State after a measurement of the outputs", next));

    let b = Builder::new();
    let x = b.argument("state", states);
    let y = b.call(output, n, &[x.slice(m, inner)]);
    let output = module.add(b.finish("output_limited", "Outputs in a state", y));

    let block = block.map(|mut block| {
        let horizon = block.horizon;
        let b = Builder::new();
        let (x, ahead) = (b.argument("state", states), b.argument("commands", horizon * m));
        let mut a = x.slice(0, m);
        let rows: Vec<_> = (0..horizon)
            .map(|k| {
                a = b.call(limit, m, &[a, ahead.slice(k * m, m)]);
                a
            })
            .collect();
        let y = b.call(block.predict, horizon * n, &[x.slice(m, inner), b.concat(&rows)]);
        let predict = module.add(b.finish("predict_limited", "Outputs over the horizon, row by row", y));

        let b = Builder::new();
        let (x, ahead) = (b.argument("state", states), b.argument("commands", horizon * m));
        let y = b.argument("outputs", horizon * n);
        let mut a = x.slice(0, m);
        let rows: Vec<_> = (0..horizon)
            .map(|k| {
                a = b.call(limit, m, &[a, ahead.slice(k * m, m)]);
                a
            })
            .collect();
        let next = b.call(block.follow, inner, &[x.slice(m, inner), b.concat(&rows), y]);
        let follow =
            b.finish("follow_limited", "State at the end of a predicted horizon", b.concat(&[a, next]));
        block.predict = predict;
        block.follow = module.add(follow);
        block
    });

    let mut labels: Vec<Label> = channels
        .inputs
        .iter()
        .map(|input| Label::new(format!("position behind {}", input.name), &input.unit))
        .collect();
    labels.extend(state);
    let space = StateSpace { module, state: labels, start, step, observe, output, rates: None, block };
    (space, Some(limit))
}
