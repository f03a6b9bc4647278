//! A vessel with free numbers as a parametric model.

use hydroid_core::craft::{Craft, Dynamics};
use hydroid_core::model::{CraftModel, CraftModelError};
use hydroid_core::predict::Workspace;
use hydroid_core::vessel::Dual;

use crate::craft::{CraftFile, Estimate};
use crate::sindy::refine::{Parametric, ShootingModel};

const OUTPUTS: usize = 3;

/// Derivatives of one dual number.
const LANES: usize = 8;

type Number = Dual<LANES>;

/// A number of the file that is estimated.
#[derive(Clone, Copy, Debug)]
struct Free {
    given: f64,
    /// Whether its sign is fixed: it is the exponential of its parameter.
    fixed: bool,
}

impl Free {
    /// The number and its derivative at a value of the parameter.
    fn number(&self, w: f64) -> [f64; 2] {
        if self.fixed {
            let number = self.given * w.exp();
            [number, number]
        } else {
            [self.given + self.given.abs() * w, self.given.abs()]
        }
    }
}

/// The free numbers of a vessel file.
pub(super) struct FreeNumbers {
    craft: Craft,
    free: Vec<Free>,
    /// For each number of the craft the free one that it equals.
    places: Vec<Option<usize>>,
    dt: f64,
    steps: usize,
    warm_up: usize,
}

impl FreeNumbers {
    pub(super) fn new(file: &CraftFile, dt: f64) -> Result<Self, CraftModelError> {
        let parameters = file.craft.parameters();
        let free = file.estimate.iter().map(|estimate| {
            let (parameter, given) = &parameters[estimate.index];
            Free { given: *given, fixed: !parameter.signed }
        });
        let free = free.collect();
        let place = |of: usize| file.estimate.iter().position(|estimate| estimate.index == of);
        let steps = CraftModel::new(file.craft.clone(), dt)?.steps();
        // The actuators have forgotten an unknown start.
        let settling = (file.craft.settling_time() / dt).ceil();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of samples")]
        let warm_up = 1 + settling.clamp(0.0, 1e6) as usize;
        Ok(Self {
            craft: file.craft.clone(),
            free,
            places: file.representatives().into_iter().map(place).collect(),
            dt,
            steps,
            warm_up,
        })
    }

    pub(super) fn len(&self) -> usize {
        self.free.len()
    }

    /// All numbers of the craft.
    pub(super) fn numbers(&self, values: &[f64]) -> Vec<f64> {
        let given = self.craft.parameters().into_iter().map(|(_, number)| number);
        let number = |(given, place): (f64, &Option<usize>)| {
            place.map_or(given, |place| self.free[place].number(values[place])[0])
        };
        given.zip(&self.places).map(number).collect()
    }

    /// The parameters of a vessel with the same free numbers.
    pub(super) fn values(&self, file: &CraftFile) -> Vec<f64> {
        let numbers = file.craft.parameters();
        let value = |(free, estimate): (&Free, &Estimate)| {
            let number = numbers[estimate.index].1;
            if free.fixed { (number / free.given).ln() } else { (number - free.given) / free.given.abs() }
        };
        self.free.iter().zip(&file.estimate).map(value).collect()
    }

    /// Derivative of each free number by its parameter.
    pub(super) fn slopes(&self, values: &[f64]) -> Vec<f64> {
        self.free.iter().zip(values).map(|(free, &w)| free.number(w)[1]).collect()
    }
}

/// A vessel with its derivatives by the start and the parameters, [`LANES`] in each pass.
pub(super) struct ShootingCraft {
    passes: Vec<Dynamics<Number>>,
    inputs: usize,
    parameters: usize,
    h: f64,
    steps: usize,
    warm_up: usize,
}

impl Parametric for FreeNumbers {
    type Model = ShootingCraft;

    fn model(&self, values: &[f64]) -> Option<ShootingCraft> {
        let numbers = self.numbers(values);
        let craft: Craft = self.craft.with_numbers(&numbers);
        craft.validate().ok()?;
        let slopes = self.slopes(values);
        let pass = |pass: usize| {
            let seeded = |(number, place): (&f64, &Option<usize>)| match place {
                // A place outside the pass gives a constant.
                Some(place) => {
                    Number::along(*number, (OUTPUTS + place).wrapping_sub(pass * LANES), slopes[*place])
                }
                None => Number::along(*number, LANES, 0.0),
            };
            let numbers: Vec<Number> = numbers.iter().zip(&self.places).map(seeded).collect();
            Dynamics::new(&self.craft.with_numbers(&numbers))
        };
        Some(ShootingCraft {
            passes: (0..(OUTPUTS + self.free.len()).div_ceil(LANES)).map(pass).collect(),
            inputs: craft.commands.len(),
            parameters: self.free.len(),
            h: self.dt / self.steps as f64,
            steps: self.steps,
            warm_up: self.warm_up,
        })
    }
}

/// The last measurement, and the positions of the actuators in each pass.
pub(super) struct Past {
    y: [f64; OUTPUTS],
    positions: Vec<Vec<Number>>,
}

impl ShootingCraft {
    /// Rolls out one pass, and shows each sample.
    fn roll_pass(
        &self,
        pass: usize,
        past: &Past,
        start: &[f64],
        commands: &[f64],
        mut show: impl FnMut(usize, &[Number; OUTPUTS]),
    ) {
        let lane = |i: usize| i.wrapping_sub(pass * LANES);
        let mut nu: [Number; OUTPUTS] = std::array::from_fn(|i| Number::along(start[i], lane(i), 1.0));
        let mut positions = past.positions[pass].clone();
        show(0, &nu);
        for (k, c) in commands.chunks_exact(self.inputs).enumerate() {
            self.passes[pass].advance(&mut nu, &mut positions, c, self.h, self.steps);
            show(k + 1, &nu);
        }
    }
}

impl ShootingModel for ShootingCraft {
    type Past = Past;

    fn outputs(&self) -> usize {
        OUTPUTS
    }

    fn inputs(&self) -> usize {
        self.inputs
    }

    fn parameters(&self) -> usize {
        self.parameters
    }

    fn warm_up(&self) -> usize {
        self.warm_up
    }

    fn past(&self) -> Past {
        Past { y: [f64::NAN; OUTPUTS], positions: vec![Vec::new(); self.passes.len()] }
    }

    fn observe(&self, past: &mut Past, y: &[f64]) {
        past.y.copy_from_slice(&y[..OUTPUTS]);
    }

    fn is_known(&self, past: &Past) -> bool {
        past.y.iter().all(|y| y.is_finite()) && past.positions.iter().all(|positions| !positions.is_empty())
    }

    fn wait(&self, past: &mut Past, c: &[f64]) {
        if c.iter().any(|c| !c.is_finite()) {
            past.positions.iter_mut().for_each(Vec::clear);
            return;
        }
        for (dynamics, positions) in self.passes.iter().zip(&mut past.positions) {
            if positions.is_empty() {
                positions.resize(dynamics.servos(), Number::along(0.0, LANES, 0.0));
                dynamics.settle(c, positions);
            }
            dynamics.move_servos(positions, c, self.h * self.steps as f64);
        }
    }

    fn roll_start(
        &self,
        past: &Past,
        start: &[f64],
        commands: &[f64],
        _: &mut Workspace,
        y: &mut [f64],
        by_start: &mut [f64],
    ) {
        self.roll_pass(0, past, start, commands, |k, nu| {
            for (i, x) in nu.iter().enumerate() {
                y[k * OUTPUTS + i] = x.value;
                by_start[(k * OUTPUTS + i) * OUTPUTS..][..OUTPUTS].copy_from_slice(&x.partials[..OUTPUTS]);
            }
        });
    }

    fn roll(
        &self,
        past: &Past,
        start: &[f64],
        commands: &[f64],
        _: &mut Workspace,
        y: &mut [f64],
        jacobian: &mut [f64],
    ) {
        let columns = OUTPUTS + self.parameters;
        for pass in 0..self.passes.len() {
            let first = pass * LANES;
            let count = LANES.min(columns - first);
            self.roll_pass(pass, past, start, commands, |k, nu| {
                for (i, x) in nu.iter().enumerate() {
                    let row = k * OUTPUTS + i;
                    y[row] = x.value;
                    jacobian[row * columns + first..][..count].copy_from_slice(&x.partials[..count]);
                }
            });
        }
    }
}
