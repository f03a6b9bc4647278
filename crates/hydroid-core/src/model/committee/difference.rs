//! Difference equations with a clock step of several samples, and their rollout.

use alloc::vec::Vec;

use crate::model::sparse::{EquationsError, Program, ProgramError, Term};

/// Largest number of samples from the oldest past value to the end of a clock step.
pub(super) const MOST_PAST: usize = 1 << 20;

/// Difference equations over a clock step of `T = clock dt` seconds:
///
/// ```text
/// y(t + T) = y(t) + T Xi theta(z(t))
/// z(t) = [y(t), c(t), y(t - T), c(t - T), .., y(t - lags T), c(t - lags T)]
/// ```
///
/// with the outputs `y` (`outputs` numbers), the inputs `c` (`inputs` numbers; `c(t)` is the mean of the command over
/// `[t, t + T)`), the terms `theta` in the variables `z`, and one row of coefficients `Xi` for each output \[unit of the
/// output per second\]. Between two clock instants the outputs advance in proportion to time, with the mean of the
/// command since the last instant, so that no prediction depends on later commands.
///
/// This is a nonlinear ARX model (L. Ljung, *System Identification*, 2nd ed., 1999, section 5.4).
#[derive(Clone, Debug, PartialEq)]
pub struct DifferenceEquations {
    terms: Vec<Term>,
    coefficients: Vec<f64>,
    shape: Shape,
    program: Program,
    /// Terms without the present command, and all others.
    held: Vec<usize>,
    moving: Vec<usize>,
}

/// Shape of [`DifferenceEquations`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Number of outputs.
    pub outputs: usize,
    /// Number of inputs.
    pub inputs: usize,
    /// Number of past clock steps in the variables.
    pub lags: usize,
    /// Samples of a clock step.
    pub clock: usize,
    /// Sample time \[s\].
    pub dt: f64,
}

impl Shape {
    /// Number of variables `z`.
    pub fn variables(&self) -> usize {
        (self.outputs + self.inputs) * (self.lags + 1)
    }

    /// Samples before the present one on which the variables depend.
    pub fn span(&self) -> usize {
        self.lags * self.clock
    }
}

/// Past of a session: rows in the order of time. The last row of `outputs` is the present, the last row of `inputs` the
/// command before it.
#[derive(Clone, Copy, Debug)]
pub struct Past<'a> {
    /// Outputs, row by row.
    pub outputs: &'a [f64],
    /// Commands, row by row.
    pub inputs: &'a [f64],
}

/// Limits of predictions, a number for each output.
#[derive(Clone, Copy, Debug)]
pub struct Limits<'a> {
    /// Lowest predictions.
    pub low: &'a [f64],
    /// Highest predictions.
    pub high: &'a [f64],
}

/// A rollout in progress.
#[derive(Debug)]
pub(super) struct Rolling<'a> {
    slots: &'a mut [f64],
    /// Outputs at the last clock instant.
    start: &'a mut [f64],
    /// Part of the rates without the present command.
    held: &'a mut [f64],
    rate: &'a mut [f64],
    /// Samples since the last clock instant.
    pub(super) elapsed: usize,
}

impl Rolling<'_> {
    /// Adds a disturbance to the outputs: at once, and to the variables from the next clock instant on.
    pub(super) fn shift(&mut self, by: &[f64]) {
        assert_eq!(by.len(), self.start.len(), "a number for each output");
        self.start.iter_mut().zip(by).for_each(|(start, by)| *start += by);
        if self.elapsed == 0 {
            self.slots[1..=by.len()].copy_from_slice(self.start);
        }
    }
}

impl DifferenceEquations {
    /// Equations from terms and coefficients (`outputs x terms`, row by row).
    ///
    /// # Errors
    /// If the number of coefficients is wrong, one is not finite, the clock step is not positive or too long, or a term is
    /// invalid.
    pub fn new(terms: Vec<Term>, coefficients: Vec<f64>, shape: Shape) -> Result<Self, EquationsError> {
        let past = shape.lags.checked_add(1).and_then(|lags| lags.checked_mul(shape.clock));
        let possible = past.is_some_and(|samples| (1..=MOST_PAST).contains(&samples));
        if !(shape.dt.is_finite() && shape.dt > 0.0 && possible) {
            return Err(EquationsError::Step);
        }
        let expected = shape.outputs * terms.len();
        if coefficients.len() != expected {
            return Err(EquationsError::Shape { expected, given: coefficients.len() });
        }
        if let Some(bad) = coefficients.iter().position(|c| !c.is_finite()) {
            return Err(EquationsError::NotFinite { output: bad / terms.len(), term: bad % terms.len() });
        }
        let present = shape.outputs..shape.outputs + shape.inputs;
        // The number of variables must fit the index of a variable.
        let variables = shape.lags.checked_add(1).and_then(|l| l.checked_mul(shape.outputs + shape.inputs));
        let variables = variables.filter(|&v| v < usize::from(u16::MAX));
        let variables = variables.ok_or(EquationsError::Program(ProgramError::TooLarge))?;
        let constant: Vec<bool> = (0..variables).map(|v| !present.contains(&v)).collect();
        let program = Program::with_held(&terms, &constant).map_err(EquationsError::Program)?;
        let is_held = |t: &usize| terms[*t].factors().iter().all(|f| constant[usize::from(f.variable)]);
        let (held, moving) = (0..terms.len()).partition(is_held);
        Ok(Self { terms, coefficients, shape, program, held, moving })
    }

    /// The terms.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }

    /// Coefficients, `outputs x terms`, row by row.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Its shape.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Compiled terms.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// Length of the scratch memory of [`rollout`](Self::rollout).
    pub fn scratch(&self) -> usize {
        self.program.slots() + 3 * self.shape.outputs
    }

    /// Loads the variables at the instant `ago` samples before the present into `slots[1..]`. The mean command of the
    /// present clock step is loaded if it is in the past, that is for `ago >= clock`.
    ///
    /// # Panics
    /// If the past is shorter than [`Shape::span`] and `ago` together.
    pub fn load(&self, past: Past<'_>, ago: usize, slots: &mut [f64]) {
        let Shape { outputs: n, inputs: m, lags, clock, .. } = self.shape;
        let (rows, commands) = (past.outputs.len() / n.max(1), past.inputs.len() / m.max(1));
        for lag in 0..=lags {
            let back = ago + lag * clock;
            let block = &mut slots[1 + lag * (n + m)..][..n + m];
            let row = rows - 1 - back;
            block[..n].copy_from_slice(&past.outputs[row * n..][..n]);
            if m > 0 && back >= clock {
                let mean = &mut block[n..];
                mean.fill(0.0);
                for j in 0..clock {
                    let c = &past.inputs[(commands - back + j) * m..][..m];
                    add_to_mean(mean, c, j + 1);
                }
            }
        }
    }

    /// Predicts the outputs of the next samples under `commands` (rows), with `coefficients` in place of the own ones and
    /// within `limits`. `scratch` has [`scratch`](Self::scratch) numbers.
    ///
    /// # Panics
    /// If the slices are shorter than documented.
    pub fn rollout(
        &self,
        coefficients: &[f64],
        past: Past<'_>,
        commands: &[f64],
        limits: Limits<'_>,
        scratch: &mut [f64],
        y: &mut [f64],
    ) {
        let Shape { outputs: n, inputs: m, .. } = self.shape;
        let mut rolling = self.begin(past, scratch);
        for (k, y) in y.chunks_exact_mut(n).enumerate() {
            self.step(coefficients, &mut rolling, &commands[k * m..][..m], limits, y);
        }
    }

    /// Begins a rollout at the present of `past`.
    pub(super) fn begin<'a>(&self, past: Past<'_>, scratch: &'a mut [f64]) -> Rolling<'a> {
        let rolling = self.rolling(0, scratch);
        self.load(past, 0, rolling.slots);
        rolling.start.copy_from_slice(&rolling.slots[1..=self.shape.outputs]);
        rolling
    }

    /// A rollout in progress, `elapsed` samples after the last clock instant.
    pub(super) fn rolling<'a>(&self, elapsed: usize, scratch: &'a mut [f64]) -> Rolling<'a> {
        let n = self.shape.outputs;
        let (slots, rest) = scratch.split_at_mut(self.program.slots());
        let (start, rest) = rest.split_at_mut(n);
        let (held, rate) = rest.split_at_mut(n);
        Rolling { slots, start, held, rate: &mut rate[..n], elapsed }
    }

    /// The next sample of a rollout under the command `c`.
    #[inline]
    pub(super) fn step(
        &self,
        coefficients: &[f64],
        rolling: &mut Rolling<'_>,
        c: &[f64],
        limits: Limits<'_>,
        y: &mut [f64],
    ) {
        let Shape { outputs: n, inputs: m, lags, clock, dt } = self.shape;
        let Rolling { slots, start, held, rate, elapsed } = rolling;
        if *elapsed == 0 {
            slots[1 + n..=n + m].fill(0.0);
            self.program.evaluate_held(slots);
            self.rates(coefficients, &self.held, slots, held);
        }
        *elapsed += 1;
        // Under a constant command the rate is constant.
        if add_to_mean(&mut slots[1 + n..=n + m], c, *elapsed) || *elapsed == 1 {
            self.program.evaluate_moving(slots);
            self.rates(coefficients, &self.moving, slots, rate);
            rate.iter_mut().zip(&**held).for_each(|(rate, held)| *rate += held);
        }
        let elapsed_s = *elapsed as f64 * dt;
        let limits = limits.low.iter().zip(limits.high);
        for ((y, (y0, rate)), (low, high)) in y.iter_mut().zip(start.iter().zip(&**rate)).zip(limits) {
            // What is not a number stays so.
            *y = limited(y0 + elapsed_s * rate, *low, *high);
        }
        if *elapsed == clock {
            slots.copy_within(1..=lags * (n + m), 1 + n + m);
            start.copy_from_slice(y);
            slots[1..=n].copy_from_slice(y);
            *elapsed = 0;
        }
    }

    fn rates(&self, coefficients: &[f64], of: &[usize], slots: &[f64], rates: &mut [f64]) {
        let count = self.terms.len();
        // Without terms the rates are zero.
        rates.fill(0.0);
        for (rate, row) in rates.iter_mut().zip(coefficients.chunks_exact(count.max(1))) {
            let (mut even, mut odd) = (0.0, 0.0);
            let mut pairs = of.chunks_exact(2);
            for pair in &mut pairs {
                even += row[pair[0]] * slots[self.program.slot(pair[0])];
                odd += row[pair[1]] * slots[self.program.slot(pair[1])];
            }
            for &t in pairs.remainder() {
                even += row[t] * slots[self.program.slot(t)];
            }
            *rate = even + odd;
        }
    }
}

/// A value within limits; NaN stays NaN.
fn limited(value: f64, low: f64, high: f64) -> f64 {
    if value < low {
        low
    } else if value > high {
        high
    } else {
        value
    }
}

/// Adds the `count`-th value to means; whether a mean changed. A constant value leaves it as it is to the last bit.
fn add_to_mean(mean: &mut [f64], values: &[f64], count: usize) -> bool {
    let share = 1.0 / count as f64;
    let mut changed = false;
    for (mean, value) in mean.iter_mut().zip(values) {
        let next = if count == 1 { *value } else { *mean + (value - *mean) * share };
        changed |= next != *mean;
        *mean = next;
    }
    changed
}
