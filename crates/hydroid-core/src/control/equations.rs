//! Identified equations as a model that a control law can invert.

use alloc::vec;
use alloc::vec::Vec;

use super::affine::{Affine, Motion};
use super::affine_form::{AffineForm, affine_form};
use crate::actuator::{Channel, Lag};
use crate::model::sparse::{Equations, Program};

pub use super::affine_form::NotAffine;

/// Identified [`Equations`] in the form `d nu/dt = f(nu) + sum_i g_i(nu) phi_i(a_i)`.
///
/// Each term is a product of factors of `u`, `v`, `r` (gates included) and, for `g_i`, one function `phi_i` of one
/// actuator: `c`, `sin(c)` or `c |c|`. The actuator is the command itself, its hidden first-order lag
/// ([`Signal::Lag`](crate::model::sparse::Signal::Lag)), or an output that follows it (a measured propeller force,
/// `d P_f/dt = a P_f + b PP + c`). [`NotAffine`] names a term of another form.
#[derive(Debug, PartialEq)]
pub struct AffineEquations {
    program: Program,
    slots: Vec<f64>,
    entries: Vec<Entry>,
    channels: Vec<Channel>,
    /// For a channel that is an output: indices of the coefficients of itself, its command and 1.
    measured: Vec<Option<[Option<usize>; 3]>>,
    outputs: usize,
    len: usize,
}

impl Clone for AffineEquations {
    fn clone(&self) -> Self {
        let Self { program, slots, entries, channels, measured, outputs, len } = self;
        Self {
            program: program.clone(),
            slots: slots.clone(),
            entries: entries.clone(),
            channels: channels.clone(),
            measured: measured.clone(),
            outputs: *outputs,
            len: *len,
        }
    }

    /// Does not allocate for the same equations with other coefficients: a law keeps the previous model at an update.
    fn clone_from(&mut self, from: &Self) {
        if self.program != from.program {
            self.program = from.program.clone();
        }
        self.slots.clone_from(&from.slots);
        self.entries.clone_from(&from.entries);
        self.channels.clone_from(&from.channels);
        self.measured.clone_from(&from.measured);
        (self.outputs, self.len) = (from.outputs, from.len);
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Entry {
    /// Row of `nu`.
    row: usize,
    /// Channel of `g`; none for `f`.
    channel: Option<usize>,
    slot: usize,
    place: usize,
    coefficient: f64,
}

impl AffineEquations {
    /// Converts equations to this form; `motion` are the outputs `u`, `v` and `r`, in m/s and rad/s.
    ///
    /// # Errors
    /// If they are not affine in known maps of their commands: [`NotAffine`].
    pub fn new(equations: &Equations, motion: [usize; 3]) -> Result<Self, NotAffine> {
        let AffineForm { parts, terms, channels, measured } = affine_form(equations, motion)?;
        let program = Program::new(&terms, 3).map_err(NotAffine::Program)?;
        let entry = |part: &super::affine_form::Part| Entry {
            row: part.row,
            channel: part.channel,
            slot: program.slot(part.term),
            place: part.place,
            coefficient: 0.0,
        };
        let entries = parts.iter().map(entry).collect();
        let (slots, outputs) = (vec![0.0; program.slots()], equations.outputs());
        let len = equations.coefficients().len();
        let mut affine = Self { program, slots, entries, channels, measured, outputs, len };
        affine.set_coefficients(equations.coefficients());
        Ok(affine)
    }

    /// Replaces the coefficients (`outputs x terms`) without allocating. Entries that were zero at construction stay
    /// zero.
    ///
    /// # Panics
    /// If the number of coefficients differs.
    pub fn set_coefficients(&mut self, coefficients: &[f64]) {
        assert_eq!(coefficients.len(), self.len, "one coefficient for each place");
        for entry in &mut self.entries {
            entry.coefficient = coefficients[entry.place];
        }
        for (channel, measured) in self.channels.iter_mut().zip(&self.measured) {
            if let Some(places) = measured {
                let [rate, gain, offset] = places.map(|place| place.map_or(0.0, |place| coefficients[place]));
                channel.lag = Lag::FirstOrder { rate, gain, offset };
            }
        }
    }

    /// Copies measured actuators from the outputs `y`: `into` has one number for each command, NaN if none is measured.
    ///
    /// # Panics
    /// If the slices have not these lengths.
    pub fn actuators_of(&self, y: &[f64], into: &mut [f64]) {
        assert!(
            y.len() == self.outputs && into.len() == self.channels.len(),
            "outputs, and one for each command"
        );
        for (value, measured) in into.iter_mut().zip(&self.measured) {
            // The row of the coefficient of `a` is the output.
            let output = measured.and_then(|[rate, ..]| rate).map(|place| place / (self.len / self.outputs));
            *value = output.map_or(f64::NAN, |output| y[output]);
        }
    }
}

impl Affine for AffineEquations {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn evaluate(&mut self, nu: [f64; 3], into: &mut Motion) {
        assert_eq!(into.g.len(), self.channels.len(), "one column for each command");
        self.slots[1..=3].copy_from_slice(&nu);
        self.program.evaluate(&mut self.slots);
        into.f = [0.0; 3];
        into.g.fill([0.0; 3]);
        for entry in &self.entries {
            let value = entry.coefficient * self.slots[entry.slot];
            match entry.channel {
                None => into.f[entry.row] += value,
                Some(channel) => into.g[channel][entry.row] += value,
            }
        }
    }
}
