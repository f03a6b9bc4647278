//! Sparse equations of motion and their integration over one sample.

mod batch_rollout;

use alloc::vec::Vec;

use super::memory::Memory;
use super::program::{Program, ProgramError, is_held};
use super::signal::Signal;
use super::term::Term;

pub(crate) use batch_rollout::BatchRollout;

/// Integration steps in one sample at the most: more is a mistake, and would look like a hang.
const MOST_SUBSTEPS: usize = 10_000;

/// Reasons why equations are invalid.
#[derive(Clone, Debug, PartialEq)]
pub enum EquationsError {
    /// The terms do not compile.
    Program(ProgramError),
    /// The coefficients are not `outputs x terms`.
    Shape {
        /// Numbers expected.
        expected: usize,
        /// Numbers given.
        given: usize,
    },
    /// A coefficient is not finite.
    NotFinite {
        /// Equation of the coefficient.
        output: usize,
        /// Term of the coefficient.
        term: usize,
    },
    /// The sample time is not a positive number, or the number of integration steps in it is absurd.
    Step,
    /// A signal is of no input or output that there is, or its time is not positive.
    Signal {
        /// Its place in the list.
        index: usize,
    },
}

impl core::fmt::Display for EquationsError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Program(error) => error.fmt(f),
            Self::Shape { expected, given } => write!(f, "{expected} coefficients expected, {given} given"),
            Self::NotFinite { output, term } => {
                write!(f, "the coefficient of term {term} in equation {output} is not a finite number")
            }
            Self::Step => {
                write!(
                    f,
                    "the sample time must be positive, with 1 to {MOST_SUBSTEPS} integration steps in it"
                )
            }
            Self::Signal { index } => {
                write!(
                    f,
                    "signal {index} is of no input or output that there is, or its time is not positive"
                )
            }
        }
    }
}

impl core::error::Error for EquationsError {}

/// `dy/dt = Xi theta(y, c, s)`: one row of coefficients for each output, in physical units, over the terms `theta` in
/// the variables `[y, c, s]`: outputs, inputs, and signals that the model makes from them (lag states of actuators,
/// past values). The command is held over a sample, which is integrated by the classical Runge-Kutta method of order 4
/// in `substeps` equal steps.
///
/// The state is flat: the outputs, then the memory of the signals ([`state_len`](Self::state_len) numbers). A NaN in
/// the memory is a past that is not known yet.
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
    /// Coefficients of terms in held variables alone, the constant among them.
    held: Sparse,
    /// Coefficients of all other terms.
    moving: Sparse,
    memory: Memory,
}

/// Rows of non-zero coefficients, each with the slot that it multiplies.
#[derive(Clone, Debug, Default, PartialEq)]
struct Sparse {
    entries: Vec<(u16, f64)>,
    /// Where each entry stands in the table of all coefficients.
    places: Vec<usize>,
    /// End of each row's part of `entries`.
    ends: Vec<usize>,
}

impl Sparse {
    /// Takes the entries' coefficients from the table.
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
            // Two sums side by side: one chain of additions would wait for itself.
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
    /// If shapes do not fit, a coefficient is not finite, or the step is absurd.
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
        // Only the terms that some equation uses are evaluated.
        let used: Vec<usize> = (0..terms.len())
            .filter(|j| (0..outputs).any(|i| coefficients[i * terms.len() + j] != 0.0))
            .collect();
        let compiled: Vec<Term> = used.iter().map(|&j| terms[j].clone()).collect();
        if let Some(index) = signals.iter().position(|signal| !signal.is_valid(outputs, inputs)) {
            return Err(EquationsError::Signal { index });
        }
        // All terms are checked, also those that no equation uses.
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

    /// Replaces the coefficients within the same sparsity, without allocating. Entries that were zero at construction
    /// are ignored.
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

    /// Signals, in the order of their variables, which follow those of outputs and inputs.
    pub fn signals(&self) -> &[Signal] {
        &self.signals
    }

    /// Number of variables that terms can be of: outputs, inputs, signals.
    pub fn variables(&self) -> usize {
        self.outputs + self.inputs + self.signals.len()
    }

    /// Length of the state: the outputs, then the memory of the signals.
    pub fn state_len(&self) -> usize {
        self.outputs + self.memory.len()
    }

    /// Number of samples after which the unknown past before a run does not matter.
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

    /// How signals are made and kept.
    pub(super) fn memory(&self) -> &Memory {
        &self.memory
    }

    /// Numbers of scratch that [`derivative`](Self::derivative) needs.
    pub fn slots(&self) -> usize {
        self.program.slots()
    }

    /// Numbers of scratch that [`step`](Self::step) needs.
    pub fn scratch(&self) -> usize {
        self.program.slots() + 4 * self.outputs
    }

    /// `dy = Xi theta(y, c, s)`, where the variables stand in `slots[1..]`: outputs, inputs, signals.
    #[inline]
    pub fn derivative(&self, slots: &mut [f64], dy: &mut [f64]) {
        self.program.evaluate(slots);
        self.held.times(slots, |i, sum| dy[i] = sum);
        self.moving.times(slots, |i, sum| dy[i] += sum);
    }

    /// Puts the variables of this moment into `slots[1..]`, where [`derivative`](Self::derivative) expects them;
    /// `state` as [`step`](Self::step) moves it.
    pub fn load(&self, state: &[f64], c: &[f64], slots: &mut [f64]) {
        let (n, m) = (self.outputs, self.inputs);
        slots[1..=n].copy_from_slice(&state[..n]);
        slots[1 + n..=n + m].copy_from_slice(&c[..m]);
        self.memory.load_held(state, slots);
        self.memory.load_moving(state, &state[..n], c, slots, (0, 0.0));
    }

    /// One sample: the outputs in `state` become those after `dt` seconds under the held command `c`, and the memory
    /// behind them follows.
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
            // Stages of the classical Runge-Kutta method: where each starts in half steps, and its weight.
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
