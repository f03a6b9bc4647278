//! The prediction session, which every model offers to evaluation, filters and controllers.
//!
//! A session follows a run sample by sample. At every sample it can predict the outputs under future commands:
//!
//! ```text
//! reset   observe(y_0)   advance(c_0)   observe(y_1)   advance(c_1)   observe(y_2) ...
//!                     |                              |
//!                  rollout(c_0, c_1, ..)          rollout(c_1, c_2, ..)
//! ```
//!
//! The session holds all memory of a model: the last outputs, hidden and lag states, a state filter, and adapted
//! weights. [`Predictor::snapshot`] copies the part on which predictions depend into a flat slice, and
//! [`Predictor::restore`] puts it back: evaluation follows a run once and rolls out from many origins in parallel.

mod methods;

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::any::Any;

#[doc(hidden)]
pub use crate::delegate_session as delegate;
#[doc(inline)]
pub use crate::plain_session as plain;

/// Scratch memory for rollouts. Only the first call of a size and model allocates. A clone is empty.
#[derive(Debug, Default)]
pub struct Workspace {
    buffer: Vec<f64>,
    batch: Option<Box<dyn Any + Send + Sync>>,
    pair: Option<Box<[Workspace; 2]>>,
}

impl Clone for Workspace {
    fn clone(&self) -> Self {
        Self::new()
    }
}

impl Workspace {
    /// An empty workspace.
    pub const fn new() -> Self {
        Self { buffer: Vec::new(), batch: None, pair: None }
    }

    /// `len` numbers of scratch, with arbitrary content.
    pub fn take(&mut self, len: usize) -> &mut [f64] {
        if self.buffer.len() < len {
            self.buffer.resize(len, 0.0);
        }
        &mut self.buffer[..len]
    }

    pub(crate) fn take_pair(&mut self, len: usize) -> (&mut [f64], &mut [Self; 2]) {
        if self.buffer.len() < len {
            self.buffer.resize(len, 0.0);
        }
        (&mut self.buffer[..len], self.pair.get_or_insert_default())
    }

    /// Memory of a batch rollout, kept between calls; `make` replaces it where `fits` does not hold. `None` where
    /// `make` returns `None`, which must not allocate.
    pub(crate) fn batch<M: Any + Send + Sync>(
        &mut self,
        fits: impl FnOnce(&M) -> bool,
        make: impl FnOnce() -> Option<M>,
    ) -> Option<&mut M> {
        let kept = self.batch.as_deref().and_then(<dyn Any + Send + Sync>::downcast_ref);
        if !kept.is_some_and(fits) {
            self.batch = Some(Box::new(make()?));
        }
        self.batch.as_deref_mut().and_then(<dyn Any + Send + Sync>::downcast_mut)
    }
}

/// An estimate of the current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Current {
    /// Components north and east \[m/s\].
    pub velocity: [f64; 2],
    /// Variance of the north component, covariance, variance of the east component \[m^2/s^2\].
    pub covariance: [f64; 3],
}

/// A session of a model on one run.
///
/// `y` has [`outputs`](Self::outputs) numbers, `c` has [`inputs`](Self::inputs) numbers, in the units of the model's
/// channels. Sequences are flat, row by row. Only [`fork`](Self::fork) allocates once the workspace has grown.
///
/// No method has a default: a session around another one that forgets a method would answer without the other one. Sessions
/// around no other write the plain behaviour by name with [`plain!`](plain).
pub trait Predictor: Send + Sync {
    /// Number of outputs.
    fn outputs(&self) -> usize;

    /// Number of inputs.
    fn inputs(&self) -> usize;

    /// Number of samples that the session must observe before its predictions are valid.
    fn warm_up(&self) -> usize;

    /// Returns to the start of a run and clears outputs, hidden and lag states. Whether an adapted session also resets
    /// its weights is an option of the session.
    fn reset(&mut self);

    /// Takes the heading \[rad\], clockwise from north, of the sample that is observed next. Models of the motion over
    /// ground ignore it; see [`ThroughWater`](crate::current::ThroughWater).
    fn observe_heading(&mut self, heading: f64);

    /// The estimate of the current; `None` for a model of the motion over ground.
    fn current(&self) -> Option<&Current>;

    /// As [`output`](Self::output), with the motion through the water.
    fn output_through_water(&self, y: &mut [f64]);

    /// Takes the measurement `y_k`. A NaN is a missing value, for which the session keeps its own prediction.
    fn observe(&mut self, y: &[f64]);

    /// Steps from `t_k` to `t_{k+1}` under the command `c_k`, which is held over the interval.
    fn advance(&mut self, c: &[f64]);

    /// [`advance`](Self::advance) and [`observe`](Self::observe) in one. A model may omit the prediction where a complete
    /// measurement replaces it.
    fn advance_observe(&mut self, c: &[f64], y: &[f64]);

    /// The estimate of the present outputs; NaN where there is none yet.
    fn output(&self, y: &mut [f64]);

    /// Predicts `y_{k+1} .. y_{k+H}` under the commands `c_k .. c_{k+H-1}` without changing the session; `H` is
    /// `y.len() / outputs()`. A rollout that diverges gives non-finite numbers, never a panic.
    ///
    /// # Panics
    /// If `commands` and `y` do not hold the same whole number of rows.
    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]);

    /// Rolls out `count` command sequences from the present state: `commands` are `count x H x inputs`, `y` are
    /// `count x H x outputs`, sequence by sequence.
    ///
    /// The plain form runs [`rollout`](Self::rollout) for each sequence. Equations, recurrent networks, direct predictors
    /// and vessels compute sequences side by side, with sums in another order or another logistic function, and results
    /// differ in the last digits. Their memory in `work` grows with `count`; [`BATCH`] sequences fill the vector units.
    ///
    /// # Panics
    /// If `commands` and `y` do not hold `count` sequences of the same whole number of rows.
    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]);

    /// Length of a snapshot; constant over the life of a session.
    fn snapshot_len(&self) -> usize;

    /// Copies all numbers on which predictions depend into `into`: outputs, lag and hidden states, adapted weights.
    /// Memory that only serves learning, such as the covariance of a filter, is not part of a snapshot.
    ///
    /// # Panics
    /// If `into` has not [`snapshot_len`](Self::snapshot_len) numbers.
    fn snapshot(&self, into: &mut [f64]);

    /// Restores a snapshot of a session of the same model.
    ///
    /// # Panics
    /// If `from` has not [`snapshot_len`](Self::snapshot_len) numbers.
    fn restore(&mut self, from: &[f64]);

    /// Rolls out each of `count` command sequences from a snapshot of its own: `snapshots` are `count x snapshot_len`,
    /// `commands` and `y` as in [`rollout_batch`](Self::rollout_batch). The state of the session afterwards is that of one
    /// of the snapshots.
    ///
    /// The plain form restores and rolls out one snapshot after another. Equations compute all of them side by side; they
    /// add sums in another order, and results differ in the last digits.
    ///
    /// # Panics
    /// If the slices do not hold `count` snapshots and `count` sequences of the same whole number of rows.
    fn rollout_snapshots(
        &mut self,
        count: usize,
        snapshots: &[f64],
        commands: &[f64],
        work: &mut Workspace,
        y: &mut [f64],
    );

    /// A new session with the same predictions; constant weights are shared. The fork of a session that learns does not
    /// learn.
    fn fork(&self) -> Box<dyn Predictor>;
}

/// What [`Predictor::fork`] gives.
#[doc(hidden)]
pub type Fork = Box<dyn Predictor>;

/// Number of command sequences that callers of [`Predictor::rollout_batch`] should pass at a time.
pub const BATCH: usize = 64;

#[doc(hidden)]
pub fn rollout_each<P: Predictor + ?Sized>(
    session: &P,
    count: usize,
    commands: &[f64],
    work: &mut Workspace,
    y: &mut [f64],
) {
    let (inputs, outputs) = (commands.len() / count.max(1), y.len() / count.max(1));
    assert!(commands.len() == count * inputs && y.len() == count * outputs, "whole sequences");
    for k in 0..count {
        let y = &mut y[k * outputs..(k + 1) * outputs];
        session.rollout(&commands[k * inputs..(k + 1) * inputs], work, y);
    }
}

#[doc(hidden)]
pub fn restore_and_roll_out<P: Predictor + ?Sized>(
    session: &mut P,
    count: usize,
    snapshots: &[f64],
    commands: &[f64],
    work: &mut Workspace,
    y: &mut [f64],
) {
    let (inputs, outputs) = (commands.len() / count.max(1), y.len() / count.max(1));
    let size = session.snapshot_len();
    let whole = commands.len() == count * inputs && y.len() == count * outputs;
    assert!(whole && snapshots.len() == count * size, "whole sequences and snapshots");
    for k in 0..count {
        session.restore(&snapshots[k * size..(k + 1) * size]);
        let y = &mut y[k * outputs..(k + 1) * outputs];
        session.rollout(&commands[k * inputs..(k + 1) * inputs], work, y);
    }
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
