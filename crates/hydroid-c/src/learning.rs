//! What an adapter does beyond a session.

use hydroid::adapt;
use hydroid::model::Model;
use hydroid_core::adapt::Rejection;
use hydroid_core::adapt::guard;
use hydroid_core::memory::Memory;

use crate::error::{Error, Outcome, Status, check_finite, check_length};
use crate::session::{Learner, Session};

/// Effect of a sample on the weights.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutcomeKind {
    /// No update: a window is incomplete, a value is missing, or the adapter is frozen.
    Waiting = 0,
    /// Update with full weight.
    Accepted = 1,
    /// Update with a reduced weight.
    Inflated = 2,
    /// No update: an innovation exceeds the upper threshold of the gate.
    Outlier = 3,
    /// No update: a value is infinite, or its square overflows.
    NotFinite = 4,
    /// The weights were restored from an earlier snapshot.
    RolledBack = 5,
}

/// Effect of a sample on the weights, with its numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleOutcome {
    /// What the sample did.
    pub kind: OutcomeKind,
    /// The largest innovation [standard deviations], for HYDROID_OUTCOME_INFLATED and HYDROID_OUTCOME_OUTLIER; else NaN.
    pub deviations: f64,
    /// Weight relative to an accepted sample: 1 if accepted, between 0 and 1 if inflated, else 0.
    pub weight: f64,
}

/// Indicators of the covariance that precede prediction errors; NaN if unknown or correct by construction.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Health {
    /// The smallest variance of a weight or a hidden state, in its scaled unit. A negative one is a fault.
    pub least_variance: f64,
    /// The smallest ratio of innovation variance and noise variance at the last measurement; at least 1 up to rounding.
    pub min_s_over_r: f64,
}

/// A model from which an adapter predicts.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expert {
    /// The adapted model.
    Adapted = 0,
    /// The reference model: the weights of the file with a filter on the state.
    Reference = 1,
    /// The adapted model as it would be without a guard.
    Unguarded = 2,
}

impl From<hydroid_core::adapt::Outcome> for SampleOutcome {
    fn from(outcome: hydroid_core::adapt::Outcome) -> Self {
        use hydroid_core::adapt::Outcome as Of;
        let (kind, deviations, weight) = match outcome {
            Of::Waiting => (OutcomeKind::Waiting, f64::NAN, 0.0),
            Of::Accepted => (OutcomeKind::Accepted, f64::NAN, 1.0),
            Of::Inflated { deviations, weight } => (OutcomeKind::Inflated, deviations, weight),
            Of::Rejected(Rejection::Outlier { deviations }) => (OutcomeKind::Outlier, deviations, 0.0),
            Of::Rejected(Rejection::NotFinite) => (OutcomeKind::NotFinite, f64::NAN, 0.0),
            Of::RolledBack => (OutcomeKind::RolledBack, f64::NAN, 0.0),
        };
        Self { kind, deviations, weight }
    }
}

impl Session {
    pub(crate) fn outcome(&self) -> Outcome<SampleOutcome> {
        self.learner(|learner, _| Ok(learner.adapter.outcome().into()))
    }

    /// Innovations and their standard deviations; NaN where there are none.
    pub(crate) fn innovations(&self, values: &mut [f64], deviations: &mut [f64]) -> Outcome {
        check_length("values", self.sizes.outputs, values.len())?;
        check_length("deviations", self.sizes.outputs, deviations.len())?;
        self.learner(|learner, _| {
            values.fill(f64::NAN);
            deviations.fill(f64::NAN);
            let places = values.iter_mut().zip(deviations);
            for (innovation, (value, deviation)) in learner.adapter.innovations().iter().zip(places) {
                (*value, *deviation) = (innovation.value, innovation.deviation);
            }
            Ok(())
        })
    }

    pub(crate) fn weights(&self, into: &mut [f64]) -> Outcome {
        self.learner(|learner, _| {
            check_length("weights", self.sizes.weights, into.len())?;
            into.copy_from_slice(learner.adapter.weights());
            Ok(())
        })
    }

    pub(crate) fn freeze(&self, frozen: bool) -> Outcome {
        self.learner(|learner, _| {
            learner.adapter.freeze(frozen);
            Ok(())
        })
    }

    pub(crate) fn scale_noise(&self, factor: f64) -> Outcome {
        self.learner(|learner, _| {
            if !(factor > 0.0 && factor.is_finite()) {
                let message = format!("the factor of the noise is {factor}: give a positive number");
                return Err(Error::new(Status::Value, message));
            }
            learner.adapter.scale_noise(factor);
            Ok(())
        })
    }

    pub(crate) fn restart(&self) -> Outcome {
        self.learner(|learner, _| {
            learner.adapter.restart();
            Ok(())
        })
    }

    pub(crate) fn health(&self) -> Outcome<Health> {
        self.learner(|learner, _| {
            let health = learner.adapter.health();
            Ok(Health { least_variance: health.least_variance, min_s_over_r: health.min_s_over_r })
        })
    }

    pub(crate) fn active(&self) -> Outcome<Expert> {
        self.learner(|learner, _| {
            Ok(match learner.adapter.guard().map(guard::Guard::active) {
                Some(guard::Expert::Reference) => Expert::Reference,
                Some(guard::Expert::Unguarded) => Expert::Unguarded,
                Some(guard::Expert::Adapted) | None => Expert::Adapted,
            })
        })
    }

    pub(crate) fn deviations(&self, commands: &[f64], horizons: &[usize], into: &mut [f64]) -> Outcome {
        let sizes = self.sizes;
        self.learner(|learner, work| {
            let last = horizons.last().copied().unwrap_or(0);
            if horizons.first().is_none_or(|first| *first == 0) || !horizons.is_sorted_by(|a, b| a < b) {
                let message = format!("the horizons are {horizons:?}: give samples from 1 on, ascending");
                return Err(Error::new(Status::Value, message));
            }
            check_length("commands", last.saturating_mul(sizes.inputs), commands.len())?;
            check_length("deviations", horizons.len().saturating_mul(sizes.outputs), into.len())?;
            check_finite("commands", commands)?;
            learner.adapter.deviations(commands, horizons, work, into);
            Ok(())
        })
    }

    pub(crate) fn store_window(&self, outputs: &[f64], commands: &[f64]) -> Outcome {
        let sizes = self.sizes;
        self.learner(|learner, _| {
            let Some(rehearsal) = learner.adapter.rehearsal() else {
                let message =
                    "the adapter does not rehearse: set the option rehearsal of a recurrent network";
                return Err(Error::new(Status::Unsupported, message));
            };
            let least = rehearsal.samples.saturating_add(1);
            let rows = outputs.len() / sizes.outputs;
            if rows < least || !outputs.len().is_multiple_of(sizes.outputs) {
                let needed = format!("whole rows of {} numbers, at least {least},", sizes.outputs);
                return Err(Error::length("outputs", needed, outputs.len()));
            }
            check_length("commands", rows.saturating_mul(sizes.inputs), commands.len())?;
            check_finite("outputs", outputs)?;
            check_finite("commands", commands)?;
            learner.adapter.store_window(outputs, commands);
            Ok(())
        })
    }

    /// Numbers that identify model and options, then those of the adapter.
    pub(crate) fn save(&self, into: &mut [f64]) -> Outcome {
        self.learner(|learner, _| {
            check_length("the memory", self.sizes.memory, into.len())?;
            let (identity, rest) = into.split_at_mut(learner.identity.len());
            identity.copy_from_slice(&learner.identity);
            learner.adapter.save(rest);
            Ok(())
        })
    }

    pub(crate) fn load(&self, from: &[f64]) -> Outcome {
        self.learner(|learner, _| {
            check_length("the memory", self.sizes.memory, from.len())?;
            let (identity, rest) = from.split_at(learner.identity.len());
            if identity != learner.identity {
                let message = "the memory is that of an adapter of another model, of other options or of another version \
                    of hydroid: begin without it";
                return Err(Error::new(Status::Memory, message));
            }
            let before = Memory::saved(|memory| learner.adapter.visit_state(memory));
            learner.adapter.load(rest);
            if learner.adapter.is_sound() {
                return Ok(());
            }
            learner.adapter.load(&before);
            let message = "the memory is damaged: no adapter has its numbers; begin without it";
            Err(Error::new(Status::Memory, message))
        })
    }

    pub(crate) fn is_sound(&self) -> Outcome<bool> {
        self.learner(|learner, _| Ok(learner.adapter.is_sound()))
    }

    /// The model with the learned weights; `run` is the name of the run, for the provenance.
    pub(crate) fn learned(&self, run: Option<&str>) -> Outcome<Model> {
        self.learner(|Learner { adapter, model, options, used, .. }, _| {
            adapt::learned(model, options, adapter.weights(), run.as_slice(), used)
                .map_err(|error| Error::new(Status::Unsupported, error.to_string()))
        })
    }
}
