//! The state space of a model and its derivatives, computed in `f64`: for tests of the formats.

use hydroid::adapt::Options;
use hydroid::model::Model;

use crate::ExportError;
use crate::adapter::{Adapter, Method};
use crate::graph::{Binary, Builder, Matrix, Module, Test, Unary, vector_jacobian_product};
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

    /// A run of a model that learns, whose weights come last in the state.
    pub fn of_learning(model: &Model, options: &Options, y: &[f64], c: &[f64]) -> Result<Self, ExportError> {
        let space = Adapter::of(model, options)?.space;
        let x = space.module.evaluate(space.start, &[y, c]);
        Ok(Self { space, x })
    }

    pub fn state(&self) -> &[f64] {
        &self.x
    }

    pub fn step(&mut self, c: &[f64]) {
        self.x = self.space.module.evaluate(self.space.step, &[&self.x, c]);
    }

    pub fn observe(&mut self, y: &[f64]) {
        self.x = self.space.module.evaluate(self.space.observe, &[&self.x, y]);
    }

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

/// Values and derivatives of a network that learns, as exported code computes them.
#[derive(Clone, Debug)]
pub struct Derivatives {
    module: Module,
    transition: [usize; 2],
    observation: [usize; 2],
}

impl Derivatives {
    /// The functions of a network; `None` for another kind of model.
    pub fn of(model: &Model, options: &Options) -> Result<Option<Self>, ExportError> {
        let Adapter { space, method, .. } = Adapter::of(model, options)?;
        let Method::Network(learner) = method else { return Ok(None) };
        Ok(Some(Self {
            module: space.module,
            transition: [learner.transition, learner.of_transition],
            observation: [learner.observation, learner.of_observation],
        }))
    }

    /// The next hidden state, and its derivatives by hidden state and weights, row by row.
    pub fn transition(&self, hidden: &[f64], input: &[f64], weights: &[f64]) -> [Vec<f64>; 2] {
        self.evaluate(self.transition, &[hidden, input, weights])
    }

    /// The output, and its derivatives by hidden state and weights, row by row.
    pub fn observation(&self, hidden: &[f64], weights: &[f64]) -> [Vec<f64>; 2] {
        self.evaluate(self.observation, &[hidden, weights])
    }

    fn evaluate(&self, [function, product]: [usize; 2], arguments: &[&[f64]]) -> [Vec<f64>; 2] {
        let value = self.module.evaluate(function, arguments);
        let mut rows = Vec::new();
        for i in 0..value.len() {
            let unit: Vec<f64> = (0..value.len()).map(|k| f64::from(u8::from(k == i))).collect();
            rows.extend(self.module.evaluate(product, &[arguments, &[&unit]].concat()));
        }
        [value, rows]
    }
}

/// A function of six numbers with all operations that have a derivative: its value, and its derivatives.
pub fn operations(x: &[f64; 6]) -> (f64, Vec<f64>) {
    let b = Builder::new();
    let argument = b.argument("x", 6);
    let (three, pair) = (argument.slice(0, 3), argument.slice(3, 2));
    let one = argument.slice(5, 1);
    let positive = (three * three + one * one).unary(Unary::Sqrt);
    let mut terms = vec![
        (three.unary(Unary::Sin) / positive).unary(Unary::Neg),
        three.unary(Unary::Cos) - one,
        positive.unary(Unary::Ln) * three.unary(Unary::Abs),
        three.unary(Unary::Tanh) + pair.slice(1, 1).unary(Unary::Logistic),
        (one * three).unary(Unary::Exp) * three.unary(Unary::Sign),
        three.binary(Binary::Min, one).binary(Binary::Max, pair.slice(0, 1)),
        three.select(Test::Less, one, three * three, one),
    ];
    let weights = Matrix { rows: 3, columns: 2, numbers: vec![0.3, -0.7, 1.1, 0.2, 0.9, -0.4] };
    terms.push(pair.affine(weights, vec![0.1, 0.2, 0.3]));
    // Matrices of computed numbers, of which parts overlap.
    let matrix = b.concat(&[three, pair, one]);
    terms.push(matrix.product(pair * pair));
    terms.push(matrix.slice(0, 3) * argument.slice(2, 3));
    let sum = terms.into_iter().reduce(|sum, term| sum + term * three.unary(Unary::Cos)).unwrap_or(three);
    let total = b.constant(&[0.5, -1.3, 0.8]).product(sum);
    let mut module = Module::default();
    let function = b.finish("operations", "All operations", total);
    let product = vector_jacobian_product(&function, &[0], "gradient", "Derivatives");
    let [function, product] = [function, product].map(|function| module.add(function));
    let value = module.evaluate(function, &[x]);
    (value[0], module.evaluate(product, &[x, &[1.0]]))
}
