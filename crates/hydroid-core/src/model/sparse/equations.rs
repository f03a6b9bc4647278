//! Sparse equations of motion and their integration over one sample.

mod batch_rollout;

use alloc::vec::Vec;

use super::memory::Memory;
use super::program::{Program, ProgramError, is_held};
use super::signal::Signal;
use super::term::Term;

pub(crate) use batch_rollout::BatchRollout;

/// Largest number of integration steps in a sample; more is an error in the input.
const MOST_SUBSTEPS: usize = 10_000;

/// Reasons why equations are invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum EquationsError {
    #[error(transparent)]
    Program(ProgramError),
    /// The number of coefficients is not `outputs x terms`.
    #[error("{expected} coefficients expected, {given} given")]
    Shape { expected: usize, given: usize },
    #[error("the coefficient of term {term} in equation {output} is not a finite number")]
    NotFinite { output: usize, term: usize },
    #[error("the sample time must be positive, with 1 to {MOST_SUBSTEPS} integration steps in it")]
    Step,
    #[error("signal {index} refers to an unknown input or output, or its time is not positive")]
    Signal { index: usize },
}

/// `dy/dt = Xi theta(y, c, s)`: one row of coefficients for each output, in physical units, over the terms `theta` in
/// the variables `[y, c, s]`: outputs, inputs, and signals computed from them (lag states of actuators, past values). A
/// sample with held command is integrated by the classical Runge-Kutta method of order 4 in `substeps` equal steps.
///
/// The state is flat: the outputs, then the memory of the signals ([`state_len`](Self::state_len) numbers). NaN in the
/// memory marks an unknown past.
#[derive(Clone, Debug, PartialEq)]
pub struct Equations {
    terms: Vec<Term>,
    coefficients: Vec<f64>,
    outputs: usize,
    inputs: usize,
    signals: Vec<Signal>,
    dt: f64,
    substeps: usize,
    program: Program,
    /// Coefficients of terms in held variables alone, with the constant.
    held: Sparse,
    moving: Sparse,
    memory: Memory,
}

#[derive(Clone, Debug, Default, PartialEq)]
struct Sparse {
    entries: Vec<(u16, f64)>,
    /// Place of each entry in the table of all coefficients.
    places: Vec<usize>,
    ends: Vec<usize>,
}

impl Sparse {
    fn refresh(&mut self, coefficients: &[f64]) {
        for ((_, xi), &place) in self.entries.iter_mut().zip(&self.places) {
            *xi = coefficients[place];
        }
    }

    /// Calls `row` with each row's sum of coefficients times slots.
    #[inline]
    fn times(&self, slots: &[f64], mut row: impl FnMut(usize, f64)) {
        let mut start = 0;
        for (i, &end) in self.ends.iter().enumerate() {
            // Two parallel sums hide the latency of the additions.
            let (mut even, mut odd) = (0.0, 0.0);
            let mut pairs = self.entries[start..end].chunks_exact(2);
            for pair in &mut pairs {
                even += pair[0].1 * slots[usize::from(pair[0].0)];
                odd += pair[1].1 * slots[usize::from(pair[1].0)];
            }
            for &(slot, xi) in pairs.remainder() {
                even += xi * slots[usize::from(slot)];
            }
            row(i, even + odd);
            start = end;
        }
    }
}

impl Equations {
    /// Equations from terms and coefficients (`outputs x terms`, row by row), for samples of `dt` seconds.
    ///
    /// # Errors
    /// If shapes do not fit, a coefficient is not finite, or the step is out of range.
    pub fn new(
        terms: Vec<Term>,
        coefficients: Vec<f64>,
        outputs: usize,
        inputs: usize,
        dt: f64,
        substeps: usize,
    ) -> Result<Self, EquationsError> {
        Self::with_signals(terms, coefficients, outputs, inputs, Vec::new(), dt, substeps)
    }

    /// Equations with signals.
    ///
    /// # Errors
    /// As [`new`](Self::new), or if a signal is invalid.
    pub fn with_signals(
        terms: Vec<Term>,
        coefficients: Vec<f64>,
        outputs: usize,
        inputs: usize,
        signals: Vec<Signal>,
        dt: f64,
        substeps: usize,
    ) -> Result<Self, EquationsError> {
        if !(dt.is_finite() && dt > 0.0 && (1..=MOST_SUBSTEPS).contains(&substeps)) {
            return Err(EquationsError::Step);
        }
        let expected = outputs * terms.len();
        if coefficients.len() != expected {
            return Err(EquationsError::Shape { expected, given: coefficients.len() });
        }
        if let Some(bad) = coefficients.iter().position(|c| !c.is_finite()) {
            return Err(EquationsError::NotFinite { output: bad / terms.len(), term: bad % terms.len() });
        }
        let used: Vec<usize> = (0..terms.len())
            .filter(|j| (0..outputs).any(|i| coefficients[i * terms.len() + j] != 0.0))
            .collect();
        let compiled: Vec<Term> = used.iter().map(|&j| terms[j].clone()).collect();
        if let Some(index) = signals.iter().position(|signal| !signal.is_valid(outputs, inputs)) {
            return Err(EquationsError::Signal { index });
        }
        // All terms are checked, also unused ones.
        Program::new(&terms, outputs + inputs + signals.len()).map_err(EquationsError::Program)?;
        let held_variables: Vec<bool> = (0..outputs + inputs)
            .map(|v| v >= outputs)
            .chain(signals.iter().map(|signal| signal.is_held(outputs)))
            .collect();
        let program = Program::with_held(&compiled, &held_variables).map_err(EquationsError::Program)?;
        let (mut held, mut moving) = (Sparse::default(), Sparse::default());
        for i in 0..outputs {
            for (index, &j) in used.iter().enumerate() {
                let coefficient = coefficients[i * terms.len() + j];
                if coefficient != 0.0 {
                    let slot = u16::try_from(program.slot(index))
                        .map_err(|_| EquationsError::Program(ProgramError::TooLarge))?;
                    let rows =
                        if is_held(&compiled[index], &held_variables) { &mut held } else { &mut moving };
                    rows.entries.push((slot, coefficient));
                    rows.places.push(i * terms.len() + j);
                }
            }
            held.ends.push(held.entries.len());
            moving.ends.push(moving.entries.len());
        }
        let memory = Memory::new(&signals, outputs, inputs, dt / substeps as f64);
        Ok(Self {
            terms,
            coefficients,
            outputs,
            inputs,
            signals,
            dt,
            substeps,
            program,
            held,
            moving,
            memory,
        })
    }

    /// The library's terms.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }

    /// All coefficients, `outputs x terms`, row by row; zero where a term is not in an equation.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Replaces the coefficients, without allocating. Entries that were zero at construction are ignored.
    ///
    /// # Panics
    /// If there are not `outputs x terms` numbers.
    pub fn set_coefficients(&mut self, coefficients: &[f64]) {
        assert_eq!(coefficients.len(), self.coefficients.len(), "one coefficient for each place");
        for rows in [&mut self.held, &mut self.moving] {
            rows.refresh(coefficients);
            for &place in &rows.places {
                self.coefficients[place] = coefficients[place];
            }
        }
    }

    /// Coefficient of a term in an output's equation.
    pub fn coefficient(&self, output: usize, term: usize) -> f64 {
        self.coefficients[output * self.terms.len() + term]
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Signals, in the order of their variables, which follow outputs and inputs.
    pub fn signals(&self) -> &[Signal] {
        &self.signals
    }

    /// Number of variables: outputs, inputs, signals.
    pub fn variables(&self) -> usize {
        self.outputs + self.inputs + self.signals.len()
    }

    /// Length of the state: the outputs, then the memory of the signals.
    pub fn state_len(&self) -> usize {
        self.outputs + self.memory.len()
    }

    /// Number of samples after which the unknown past before a run has no effect.
    pub fn warm_up(&self) -> usize {
        1 + self.signals.iter().map(|signal| signal.warm_up(self.dt)).max().unwrap_or(0)
    }

    /// Number of non-zero coefficients.
    pub fn active_terms(&self) -> usize {
        self.held.entries.len() + self.moving.entries.len()
    }

    /// Sample time \[s\].
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// Integration steps in one sample.
    pub fn substeps(&self) -> usize {
        self.substeps
    }

    pub(super) fn memory(&self) -> &Memory {
        &self.memory
    }

    /// Length of the scratch of [`derivative`](Self::derivative).
    pub fn slots(&self) -> usize {
        self.program.slots()
    }

    /// Length of the scratch of [`step`](Self::step).
    pub fn scratch(&self) -> usize {
        self.program.slots() + 4 * self.outputs
    }

    /// `dy = Xi theta(y, c, s)` with outputs, inputs and signals in `slots[1..]`.
    #[inline]
    pub fn derivative(&self, slots: &mut [f64], dy: &mut [f64]) {
        self.program.evaluate(slots);
        self.held.times(slots, |i, sum| dy[i] = sum);
        self.moving.times(slots, |i, sum| dy[i] += sum);
    }

    /// Loads the present variables into `slots[1..]` for [`derivative`](Self::derivative).
    pub fn load(&self, state: &[f64], c: &[f64], slots: &mut [f64]) {
        let (n, m) = (self.outputs, self.inputs);
        slots[1..=n].copy_from_slice(&state[..n]);
        slots[1 + n..=n + m].copy_from_slice(&c[..m]);
        self.memory.load_held(state, slots);
        self.memory.load_moving(state, &state[..n], c, slots, (0, 0.0));
    }

    /// One sample under the held command `c`: the outputs in `state` advance by `dt` seconds, and the memory with them.
    ///
    /// # Panics
    /// If a slice is shorter than documented: `state` [`state_len`](Self::state_len), `c` inputs, `scratch`
    /// [`scratch`](Self::scratch).
    #[inline]
    pub fn step(&self, state: &mut [f64], c: &[f64], scratch: &mut [f64]) {
        let n = self.outputs;
        let (slots, rest) = scratch.split_at_mut(self.program.slots());
        let (k, rest) = rest.split_at_mut(n);
        let (sum, rest) = rest.split_at_mut(n);
        let (held, rest) = rest.split_at_mut(n);
        let before = &mut rest[..n];
        before.copy_from_slice(&state[..n]);
        slots[1 + n..=n + self.inputs].copy_from_slice(&c[..self.inputs]);
        self.memory.load_held(state, slots);
        self.program.evaluate_held(slots);
        self.held.times(slots, |i, sum| held[i] = sum);
        let h = self.dt / self.substeps as f64;
        let share = 0.5 / self.substeps as f64;
        for substep in 0..self.substeps {
            // Stages of RK4: offset in half steps, and weight.
            sum.fill(0.0);
            for (halves, weight) in [(0, 1.0), (1, 2.0), (1, 2.0), (2, 1.0)] {
                let offset = halves as f64 * 0.5 * h;
                for i in 0..n {
                    slots[1 + i] = if halves == 0 { state[i] } else { state[i] + offset * k[i] };
                }
                if !self.memory.is_empty() {
                    let time = (2 * substep + halves) as f64 * share;
                    self.memory.load_moving(state, before, c, slots, (halves, time));
                }
                self.program.evaluate_moving(slots);
                self.moving.times(slots, |i, rate| k[i] = held[i] + rate);
                for i in 0..n {
                    sum[i] += weight * k[i];
                }
            }
            for i in 0..n {
                state[i] += h / 6.0 * sum[i];
            }
            self.memory.decay(state, c);
        }
        self.memory.shift(state, before, c);
    }

    /// Advances the memory by a sample with unknown outputs: lags follow their commands.
    pub fn wait(&self, state: &mut [f64], c: &[f64], scratch: &mut [f64]) {
        let before = &mut scratch[..self.outputs];
        before.copy_from_slice(&state[..self.outputs]);
        for _ in 0..self.substeps {
            self.memory.decay(state, c);
        }
        self.memory.shift(state, before, c);
    }
}
