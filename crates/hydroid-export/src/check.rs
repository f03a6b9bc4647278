//! The state space of a model, computed in `f64`: for tests of the formats.

use hydroid::model::Model;

use crate::state_space::StateSpace;

/// A run of a model as it is exported.
#[derive(Clone, Debug)]
pub struct Run {
    space: StateSpace,
    x: Vec<f64>,
}

impl Run {
    /// A run in a steady motion.
    pub fn start(model: &Model, y: &[f64], c: &[f64]) -> Self {
        let space = StateSpace::of(model);
        let x = space.module.evaluate(space.start, &[y, c]);
        Self { space, x }
    }

    /// The state.
    pub fn state(&self) -> &[f64] {
        &self.x
    }

    /// Predicts a sample.
    pub fn step(&mut self, c: &[f64]) {
        self.x = self.space.module.evaluate(self.space.step, &[&self.x, c]);
    }

    /// Takes a measurement.
    pub fn observe(&mut self, y: &[f64]) {
        self.x = self.space.module.evaluate(self.space.observe, &[&self.x, y]);
    }

    /// The outputs.
    pub fn output(&self) -> Vec<f64> {
        self.space.module.evaluate(self.space.output, &[&self.x])
    }

    /// Rates of the state; none in discrete time.
    pub fn rates(&self, c: &[f64]) -> Option<Vec<f64>> {
        Some(self.space.module.evaluate(self.space.rates?, &[&self.x, c]))
    }

    /// The outputs of the next samples, one row for each row of commands.
    pub fn rollout(&self, commands: &[f64]) -> Vec<f64> {
        let (mut at, inputs) = (self.clone(), self.space.inputs());
        let Some(block) = &self.space.block else {
            return commands
                .chunks_exact(inputs)
                .flat_map(|c| {
                    at.step(c);
                    at.output()
                })
                .collect();
        };
        let mut y = Vec::new();
        for rows in commands.chunks(block.horizon * inputs) {
            let mut ahead = rows.to_vec();
            while ahead.len() < block.horizon * inputs {
                ahead.extend_from_slice(&rows[rows.len() - inputs..]);
            }
            let predicted = self.space.module.evaluate(block.predict, &[&at.x, &ahead]);
            at.x = self.space.module.evaluate(block.follow, &[&at.x, &ahead, &predicted]);
            y.extend_from_slice(&predicted[..rows.len() / inputs * self.space.outputs()]);
        }
        y
    }
}
