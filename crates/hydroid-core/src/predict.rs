//! The prediction session: what every model offers to evaluation, filters and controllers.
//!
//! A session walks along a run, sample by sample, and can be asked at any moment what comes next:
//!
//! ```text
//! reset   observe(y_0)   advance(c_0)   observe(y_1)   advance(c_1)   observe(y_2) ...
//!                     |                              |
//!                  rollout(c_0, c_1, ..)          rollout(c_1, c_2, ..)
//! ```
//!
//! All that a model remembers lives in the session: the last outputs, hidden and lag states, a state
//! filter, and the weights of the moment where they are adapted on board. What a prediction depends on can
//! be copied out as a flat slice and put back ([`Predictor::snapshot`], [`Predictor::restore`]), so that
//! evaluation walks a run once and rolls out from many origins in parallel, and a controller tries a
//! thousand command sequences from one state.

use alloc::boxed::Box;
use alloc::vec::Vec;

use crate::adapt::guard::Guarded;
use crate::model::direct::DirectSession;
use crate::model::recurrent::RecurrentSession;
use crate::model::sparse::EquationsSession;

/// Scratch memory for rollouts. It grows when a model first asks for more and is kept: later calls of
/// the same size do not allocate.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    buffer: Vec<f64>,
    lent: Vec<f64>,
}

impl Workspace {
    /// An empty workspace.
    pub const fn new() -> Self {
        Self { buffer: Vec::new(), lent: Vec::new() }
    }

    /// Memory that outlives a rollout in this workspace; to be given back, so that it is there the next time.
    pub(crate) fn lend(&mut self) -> Vec<f64> {
        core::mem::take(&mut self.lent)
    }

    /// See [`lend`](Self::lend).
    pub(crate) fn give_back(&mut self, lent: Vec<f64>) {
        self.lent = lent;
    }

    /// `len` numbers of scratch; their content is what the last user left.
    pub fn take(&mut self, len: usize) -> &mut [f64] {
        if self.buffer.len() < len {
            self.buffer.resize(len, 0.0);
        }
        &mut self.buffer[..len]
    }
}

/// A session of a model on one run.
///
/// Shapes: `y` has [`outputs`](Self::outputs) numbers, `c` has [`inputs`](Self::inputs) numbers, in the
/// units of the model's channels. Sequences are flat, row by row.
///
/// None of the methods but [`fork`](Self::fork) allocates once the workspace has grown.
pub trait Predictor: Send + Sync {
    /// Number of outputs.
    fn outputs(&self) -> usize;

    /// Number of inputs.
    fn inputs(&self) -> usize;

    /// Samples that the session must have observed before its predictions count.
    fn warm_up(&self) -> usize {
        1
    }

    /// Back to the start of a run: outputs, hidden and lag states are forgotten. Whether a session that
    /// learns also drops what it learned is its own setting; evaluation resets before every run.
    fn reset(&mut self);

    /// Takes the measurement `y_k`. A NaN is a missing value: the session keeps what it predicted for
    /// that channel.
    fn observe(&mut self, y: &[f64]);

    /// Passes from `t_k` to `t_{k+1}` under the command `c_k` held in between.
    fn advance(&mut self, c: &[f64]);

    /// The session's estimate of the present outputs; NaN where it has none yet.
    fn output(&self, y: &mut [f64]);

    /// Predicts `y_{k+1} .. y_{k+H}` under the commands `c_k .. c_{k+H-1}` without moving the session;
    /// `H` is `y.len() / outputs()`. A rollout that blows up gives non-finite numbers, never a panic.
    ///
    /// # Panics
    /// If `commands` and `y` do not hold the same whole number of rows.
    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]);

    /// How many numbers a snapshot has; constant over the life of a session.
    fn snapshot_len(&self) -> usize;

    /// Copies all that the predictions from here depend on into `into`: outputs, lag and hidden states,
    /// adapted weights. What only further learning needs, a filter's covariance above all, is not in it.
    ///
    /// # Panics
    /// If `into` has not [`snapshot_len`](Self::snapshot_len) numbers.
    fn snapshot(&self, into: &mut [f64]);

    /// Puts a snapshot of a session of the same model back.
    ///
    /// # Panics
    /// If `from` has not [`snapshot_len`](Self::snapshot_len) numbers.
    fn restore(&mut self, from: &[f64]);

    /// The session that rollouts are made by, for those who can roll it out under many command sequences at once
    /// ([`Abreast`](crate::control::cem::Abreast)): it has the state and the weights of this moment.
    fn source(&self) -> Source<'_> {
        Source::Own
    }

    /// A session of its own that predicts from here as this one does; weights that do not change are
    /// shared. The fork of a session that learns need not learn.
    fn fork(&self) -> Box<dyn Predictor>;
}

/// What makes the rollouts of a session.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Source<'a> {
    /// The session, in a way of its own.
    Own,
    /// Equations.
    Equations(&'a EquationsSession),
    /// A recurrent network, on its own or on a base.
    Recurrent(&'a RecurrentSession),
    /// A direct predictor.
    Direct(&'a DirectSession),
    /// A model that learned, as far from the one from shore as a guard allows.
    Guarded(Guarded<'a>),
}

/// Checks the shapes of a rollout and gives its number of steps.
///
/// # Panics
/// If `commands` and `y` do not hold the same whole number of rows.
pub fn rollout_steps(commands: &[f64], inputs: usize, y: &[f64], outputs: usize) -> usize {
    let steps = y.len() / outputs.max(1);
    assert_eq!(y.len(), steps * outputs, "predictions do not fill whole rows");
    assert_eq!(commands.len(), steps * inputs, "one row of commands for each predicted row");
    steps
}
