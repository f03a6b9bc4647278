//! A session of a model on one run, which may learn, behind a lock.

use std::sync::Mutex;

use hydroid::adapt::{Options, ResolvedOptions};
use hydroid::model::Model;
use hydroid_core::adapt::Adapter;
use hydroid_core::predict::{Current, Predictor, Workspace};

use crate::error::{Error, Outcome, Status, check_finite, check_length};

/// A session of a model on one run. It follows the run sample by sample and predicts from any sample on. An adapter also
/// learns from the measurements.
pub struct Session {
    pub(crate) sizes: Sizes,
    state: Mutex<State>,
}

/// Lengths, which are constant over the life of a session.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sizes {
    pub(crate) outputs: usize,
    pub(crate) inputs: usize,
    pub(crate) warm_up: usize,
    pub(crate) snapshot: usize,
    /// Zero for a session that does not learn.
    pub(crate) weights: usize,
    pub(crate) memory: usize,
}

struct State {
    of: Of,
    work: Workspace,
}

enum Of {
    Predictor(Box<dyn Predictor>),
    Adapter(Box<Learner>),
}

/// An adapter, and what the learned model and the memory need to know of it.
pub(crate) struct Learner {
    pub(crate) adapter: Box<dyn Adapter>,
    pub(crate) model: Model,
    pub(crate) options: Options,
    pub(crate) used: ResolvedOptions,
    /// Fingerprint of model, options and version, as two whole numbers.
    pub(crate) identity: [f64; 2],
}

impl Session {
    /// A session of any model in Rust.
    pub fn of(session: Box<dyn Predictor>) -> Self {
        let sizes = Sizes::of(session.as_ref(), 0, 0);
        Self { sizes, state: Mutex::new(State { of: Of::Predictor(session), work: Workspace::new() }) }
    }

    pub(crate) fn learning(mut learner: Learner) -> Self {
        let adapter = learner.adapter.as_mut();
        let memory = learner.identity.len() + adapter.memory_len();
        let sizes = Sizes::of(adapter, adapter.weights().len(), memory);
        Self {
            sizes,
            state: Mutex::new(State { of: Of::Adapter(Box::new(learner)), work: Workspace::new() }),
        }
    }

    pub(crate) const fn is_adapter(&self) -> bool {
        self.sizes.memory > 0
    }

    fn with<T>(&self, act: impl FnOnce(&mut State) -> Outcome<T>) -> Outcome<T> {
        let message = "an internal error ended an earlier call of this session: free it and make a new one";
        let mut state = self.state.lock().map_err(|_| Error::new(Status::Failed, message))?;
        act(&mut state)
    }

    /// Acts on the session, which may learn.
    fn predictor<T>(&self, act: impl FnOnce(&mut dyn Predictor, &mut Workspace) -> T) -> Outcome<T> {
        self.with(|State { of, work }| {
            Ok(match of {
                Of::Predictor(session) => act(session.as_mut(), work),
                Of::Adapter(learner) => act(learner.adapter.as_mut(), work),
            })
        })
    }

    /// Acts on an adapter.
    pub(crate) fn learner<T>(
        &self,
        act: impl FnOnce(&mut Learner, &mut Workspace) -> Outcome<T>,
    ) -> Outcome<T> {
        let message = "this session does not learn: hydroid_model_adapter makes one that does";
        self.with(|State { of, work }| match of {
            Of::Predictor(_) => Err(Error::new(Status::NotAdapter, message)),
            Of::Adapter(learner) => act(learner, work),
        })
    }

    pub(crate) fn reset(&self) -> Outcome {
        self.predictor(|session, _| session.reset())
    }

    pub(crate) fn observe_heading(&self, heading: f64) -> Outcome {
        if heading.is_infinite() {
            return Err(Error::new(Status::Value, "the heading is infinite: give NaN where it is missing"));
        }
        self.predictor(|session, _| session.observe_heading(heading))
    }

    pub(crate) fn observe(&self, y: &[f64]) -> Outcome {
        check_length("y", self.sizes.outputs, y.len())?;
        self.predictor(|session, _| session.observe(y))
    }

    pub(crate) fn advance(&self, c: &[f64]) -> Outcome {
        check_length("c", self.sizes.inputs, c.len())?;
        check_finite("c", c)?;
        self.predictor(|session, _| session.advance(c))
    }

    pub(crate) fn advance_observe(&self, c: &[f64], y: &[f64]) -> Outcome {
        check_length("c", self.sizes.inputs, c.len())?;
        check_length("y", self.sizes.outputs, y.len())?;
        check_finite("c", c)?;
        self.predictor(|session, _| session.advance_observe(c, y))
    }

    pub(crate) fn output(&self, y: &mut [f64]) -> Outcome {
        check_length("y", self.sizes.outputs, y.len())?;
        self.predictor(|session, _| session.output(y))
    }

    pub(crate) fn output_through_water(&self, y: &mut [f64]) -> Outcome {
        check_length("y", self.sizes.outputs, y.len())?;
        self.predictor(|session, _| session.output_through_water(y))
    }

    pub(crate) fn current(&self) -> Outcome<Current> {
        let message = "the model predicts the motion over ground and estimates no current: set the option current_m_s \
            of an adapter, or identify a model with `hydroid identify --motion through-water`";
        self.predictor(|session, _| session.current().copied())?
            .ok_or_else(|| Error::new(Status::Unsupported, message))
    }

    pub(crate) fn rollout(&self, commands: &[f64], y: &mut [f64]) -> Outcome {
        self.rollout_batch(1, commands, y)
    }

    pub(crate) fn rollout_batch(&self, count: usize, commands: &[f64], y: &mut [f64]) -> Outcome {
        let Sizes { outputs, inputs, .. } = self.sizes;
        let row = outputs.checked_mul(count).filter(|row| *row > 0);
        let Some(row) = row else { return Err(Error::new(Status::Value, "count is 0 or too large")) };
        if !y.len().is_multiple_of(row) {
            return Err(Error::length("y", format!("a multiple of {row}"), y.len()));
        }
        // The length of a slice, by outputs of which there is one at least.
        check_length("commands", (y.len() / outputs).saturating_mul(inputs), commands.len())?;
        check_finite("commands", commands)?;
        self.predictor(|session, work| {
            if count == 1 {
                session.rollout(commands, work, y);
            } else {
                session.rollout_batch(count, commands, work, y);
            }
        })
    }

    pub(crate) fn snapshot(&self, into: &mut [f64]) -> Outcome {
        check_length("the snapshot", self.sizes.snapshot, into.len())?;
        self.predictor(|session, _| session.snapshot(into))
    }

    pub(crate) fn restore(&self, from: &[f64]) -> Outcome {
        check_length("the snapshot", self.sizes.snapshot, from.len())?;
        self.predictor(|session, _| session.restore(from))
    }

    pub(crate) fn fork(&self) -> Outcome<Self> {
        self.predictor(|session, _| Self::of(session.fork()))
    }
}

impl Sizes {
    fn of<P: Predictor + ?Sized>(session: &P, weights: usize, memory: usize) -> Self {
        Self {
            outputs: session.outputs(),
            inputs: session.inputs(),
            warm_up: session.warm_up(),
            snapshot: session.snapshot_len(),
            weights,
            memory,
        }
    }
}
