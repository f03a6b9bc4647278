//! Structure of the equations: a library with actuator lags, a gate and past values.

use std::fmt;

use hydroid_core::model::sparse::{Gate, Real, Signal, Term};
use serde::{Deserialize, Serialize};

use super::library::{Library, Variables};
use super::search::{MOST_TERMS, SearchError};
use super::substitution::{gated, substitute_variable};
use crate::log::Trajectory;

/// A library with lag states, a gate and past values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Structure {
    /// The terms of one mode.
    pub library: Library,
    /// Inputs with a first-order lag: the lag state replaces the command in every term.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lags: Vec<Lag>,
    /// A gate between two modes: every term appears once for the mode below and once for the mode above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gate: Option<GateSpec>,
    /// Delays of outputs and inputs that enter linearly \[samples\]; empty for a memoryless model.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub past: Vec<u16>,
    /// Whether only inputs enter with delays.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub past_inputs_only: bool,
}

/// First-order lag of an actuator: `dz/dt = (c - z) / T`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lag {
    /// Index among the inputs.
    pub input: usize,
    /// Time constant \[s\].
    pub time_constant_s: f64,
}

/// A gate on an output.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GateSpec {
    /// Index among the outputs.
    pub output: usize,
    /// Centre and slope.
    pub gate: Gate,
}

impl GateSpec {
    /// A gate on an output.
    pub fn new(output: usize, centre: f64, slope: f64) -> Self {
        Self { output, gate: Gate { centre: Real(centre), slope: Real(slope) } }
    }

    /// Mean activation of the upper mode over the samples of runs; NaN without samples.
    pub fn upper_mode_share<'a>(self, runs: impl Iterator<Item = &'a Trajectory>) -> f64 {
        let (mut above, mut count) = (0.0, 0.0);
        for run in runs {
            for value in run.outputs.column(self.output).filter(|value| value.is_finite()) {
                above += self.gate.above(value);
                count += 1.0;
            }
        }
        above / count
    }
}

impl From<Library> for Structure {
    fn from(library: Library) -> Self {
        Self { library, lags: Vec::new(), gate: None, past: Vec::new(), past_inputs_only: false }
    }
}

impl Structure {
    /// The signals in the order of their variables, which follow outputs and inputs.
    pub fn signals(&self, variables: &Variables) -> Vec<Signal> {
        let (outputs, inputs) = (variables.outputs().count(), variables.inputs().count());
        let lags = self.lags.iter().map(|lag| Signal::Lag {
            input: index(outputs + lag.input),
            time_constant_s: Real(lag.time_constant_s),
        });
        let past = self.past.iter().flat_map(|&samples| {
            let first = if self.past_inputs_only { outputs } else { 0 };
            (first..outputs + inputs).map(move |variable| Signal::Past { variable: index(variable), samples })
        });
        lags.chain(past).collect()
    }

    /// The terms, over outputs, inputs and signals.
    pub fn terms(&self, variables: &Variables) -> Vec<Term> {
        let first = variables.len();
        let mut terms: Vec<Term> =
            self.library.terms(variables).iter().map(|term| self.with_lag_states(term, variables)).collect();
        let signals = self.signals(variables).len();
        terms.extend((self.lags.len()..signals).map(|signal| Term::monomial(&[index(first + signal)])));
        match self.gate {
            Some(schedule) => gated(&terms, index(schedule.output), schedule.gate),
            None => terms,
        }
    }

    /// A term of the library in each mode.
    pub(super) fn mode_terms(&self, term: &Term, variables: &Variables) -> Vec<Term> {
        let term = self.with_lag_states(term, variables);
        match self.gate {
            Some(schedule) => term.gated(index(schedule.output), schedule.gate).to_vec(),
            None => vec![term],
        }
    }

    fn with_lag_states(&self, term: &Term, variables: &Variables) -> Term {
        let (outputs, first) = (variables.outputs().count(), variables.len());
        let lags = self.lags.iter().enumerate();
        lags.fold(term.clone(), |term, (position, lag)| {
            substitute_variable(&term, index(outputs + lag.input), index(first + position))
        })
    }

    /// Number of terms, computed without making them; saturates.
    pub fn count(&self, variables: &Variables) -> usize {
        let one = if self.past_inputs_only { variables.inputs().count() } else { variables.len() };
        let past = self.past.len() * one;
        let modes = if self.gate.is_some() { 2 } else { 1 };
        self.library.count(variables).saturating_add(past).saturating_mul(modes)
    }

    /// Checks the number of terms without making them.
    ///
    /// # Errors
    /// If there are none, or more than [`MOST_TERMS`].
    pub fn check_size(&self, variables: &Variables) -> Result<(), SearchError> {
        let library = || self.library.to_string();
        match self.count(variables) {
            0 => Err(SearchError::LibraryEmpty(library())),
            1..=MOST_TERMS => Ok(()),
            terms => Err(SearchError::LibraryTooLarge { library: library(), terms }),
        }
    }

    /// Number of estimated parameters besides the coefficients: time constants, centre and slope.
    pub fn parameters(&self) -> usize {
        self.lags.len() + if self.gate.is_some() { 2 } else { 0 }
    }
}

/// Short form for tables, without names of channels.
impl fmt::Display for Structure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.library.fmt(f)?;
        if !self.lags.is_empty() {
            write!(f, ", lag")?;
        }
        if self.gate.is_some() {
            write!(f, ", two modes")?;
        }
        if !self.past.is_empty() {
            write!(f, ", past")?;
        }
        Ok(())
    }
}

/// Index of a variable; the compiler of terms refuses more than 65,535 variables.
fn index(variable: usize) -> u16 {
    u16::try_from(variable).unwrap_or(u16::MAX)
}
