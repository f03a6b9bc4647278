//! What a filter keeps of how uncertain state and weights are.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::ops::Range;

use super::full::Full;
use super::gain::Gain;
use super::learnable::Learnable;
use super::reduced::Reduced;
use super::tuning::{Memory, Tuning};
use crate::math::Scalar;

/// The joint covariance of state and weights as [`Memory`] says. Vectors with a number for each weight are in the order of
/// its columns (`width`), of which [`places`](Self::places) says where they stand among the weights.
#[derive(Clone, Debug)]
pub(super) enum Joint<T> {
    Full(Box<Full<T>>),
    Reduced(Box<Reduced<T>>),
}

/// The same of each.
macro_rules! each {
    ($own:expr, $joint:ident => $does:expr) => {
        match $own {
            Joint::Full($joint) => $does,
            Joint::Reduced($joint) => $does,
        }
    };
}

impl<T: Scalar> Joint<T> {
    /// Of the blocks that are learned; all zero.
    pub(super) fn new<M: Learnable<T>>(model: &M, tuning: &Tuning, learned: Vec<usize>) -> Self {
        match tuning.memory {
            Memory::Full => Self::Full(Box::new(Full::new(model, tuning, learned))),
            _ => Self::Reduced(Box::new(Reduced::new(model, tuning, &learned))),
        }
    }

    /// Of each column: where its weight stands. `None` has none.
    pub(super) fn places(&self) -> &[Option<usize>] {
        each!(self, joint => &joint.places)
    }

    /// The weights are as uncertain as this says (`width`), independent of each other and of the state.
    pub(super) fn restart(&mut self, initial: &[T]) {
        each!(self, joint => joint.restart(initial));
    }

    /// Each number of the state is as uncertain as this says, independent of all others and of the weights.
    pub(super) fn reset(&mut self, initial: &[T]) {
        each!(self, joint => joint.reset(initial));
    }

    /// Each number of a part of the state is as uncertain as this says, independent of all others and of the weights.
    pub(super) fn reset_part(&mut self, part: Range<usize>, initial: T) {
        each!(self, joint => joint.reset_part(part, initial));
    }

    /// Time update of a step that was just made: the weights' part grows by `grows^2` and by its noise, the part of the
    /// state that moved gains `noise`.
    pub(super) fn advance<M: Learnable<T>>(&mut self, model: &M, grows: T, noise: T) {
        each!(self, joint => joint.advance(model, grows, noise));
    }

    /// `H P H'` of the outputs after that step, into `gain`.
    pub(super) fn expect<M: Learnable<T>>(&mut self, model: &M, gain: &mut Gain<T>) {
        each!(self, joint => joint.expect(model, gain));
    }

    /// Measurement update of what is expected; corrects the state, and says how the weights change (`width`), unless they
    /// do not learn. False where numbers have left all bounds.
    pub(super) fn correct(
        &mut self,
        gain: &Gain<T>,
        state: &mut [T],
        change: &mut [T],
        learns: bool,
    ) -> bool {
        match self {
            Self::Full(full) => {
                full.correct(gain, state, change, learns);
                true
            }
            Self::Reduced(reduced) => reduced.correct(gain, state, change, learns),
        }
    }

    /// The diagonals of the state's and the weights' part (`width`).
    pub(super) fn variances(&self) -> (Vec<T>, Vec<T>) {
        each!(self, joint => joint.variances())
    }

    /// The smallest variance there is.
    pub(super) fn least_variance(&self) -> T {
        each!(self, joint => joint.least_variance())
    }

    /// `v' P v` of a vector of state and weights (`width`).
    pub(super) fn variance(&mut self, v_h: &[T], v_t: &[T]) -> T {
        each!(self, joint => joint.variance(v_h, v_t))
    }

    /// Numbers that are kept of the covariance.
    pub(super) fn len(&self) -> usize {
        each!(self, joint => joint.len())
    }

    /// A flag that belongs to what is saved.
    pub(super) fn pending(&self) -> bool {
        matches!(self, Self::Full(full) if full.pending)
    }

    /// The same, to put it back.
    pub(super) fn set_pending(&mut self, pending: bool) {
        if let Self::Full(full) = self {
            full.pending = pending;
        }
    }

    /// All that it goes on from, but for the flag.
    pub(super) fn parts(&self) -> [&[T]; 6] {
        each!(self, joint => joint.parts())
    }

    /// The same, to put it back.
    pub(super) fn parts_mut(&mut self) -> [&mut [T]; 6] {
        each!(self, joint => joint.parts_mut())
    }
}
