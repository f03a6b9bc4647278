//! Predictions whose cost is known before they are made.
//!
//! A prediction `p` of another model stands beside that of the model from shore, `f`:
//!
//! ```text
//! d = mean over outputs of |p - f| / w, the largest over the last stride of steps up to the horizon
//! answer = p                      if free <= d <= far (the least d there, the largest here)
//!        = f                      if d <= most and something is owed
//!        = f + a (p - f)          otherwise, with a = min(1, most / d), the same for all steps
//! ```
//!
//! Near the other model its error exceeds that of `f` by at most `most`, whatever will be measured (triangle inequality). And
//! where the two are far apart, one of them is far off: if the error of `p` is at most `E`, that of `f` is at least `d - E`,
//! and what `p` costs beyond `factor` times that is at most `most` where `d >= (E (1 + factor) - most) / factor`. (Of a model from shore that has
//! been right of late nobody believes that: then `far` is small.) While something is owed, what is near anyway is not worth owing more.

use alloc::boxed::Box;

use crate::predict::{Predictor, Source, Workspace};

/// How far predictions may be from those of the model from shore: up to `most`, or from `free` up to `far`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Allowed {
    pub(super) most: f64,
    pub(super) free: f64,
    pub(super) far: f64,
    /// Whether something is owed: nothing is owed in addition for predictions that are near anyway, and those of the model from shore
    /// stand for them.
    pub(super) owes: bool,
}

impl Allowed {
    /// The model from shore alone.
    pub(super) const NONE: Self = Self { most: 0.0, free: f64::INFINITY, far: 0.0, owes: false };

    /// Numbers that it is kept in.
    pub(super) const LEN: usize = 4;

    pub(super) fn numbers(self) -> [f64; Self::LEN] {
        [self.most, self.free, self.far, f64::from(u8::from(self.owes))]
    }

    pub(super) fn of([most, free, far, owes]: [f64; Self::LEN]) -> Self {
        Self { most, free, far, owes: owes != 0.0 }
    }
}

/// How predictions are compared with those of the model from shore.
#[derive(Clone, Debug)]
pub(super) struct Bound {
    /// Where predictions are judged: the last of these many steps ..
    pub(super) horizon: usize,
    /// .. so many.
    pub(super) stride: usize,
    /// `w`: half the design range of each output.
    pub(super) scale: Box<[f64]>,
}

impl Bound {
    /// Predicts by a model, as far from the one from shore as is allowed.
    pub(super) fn rollout(
        &self,
        [model, shore]: [&dyn Predictor; 2],
        allowed: Allowed,
        commands: &[f64],
        work: &mut Workspace,
        y: &mut [f64],
    ) {
        if allowed == Allowed::NONE {
            return shore.rollout(commands, work, y);
        }
        let mut other = work.lend();
        other.resize(y.len(), 0.0);
        shore.rollout(commands, work, &mut other);
        model.rollout(commands, work, y);
        self.draw(y, &other, allowed);
        work.give_back(other);
    }

    /// The least and the largest distance of two predictions over the steps by which they are judged.
    fn reach(&self, predicted: &[f64], shore: &[f64]) -> (f64, f64) {
        let n = self.scale.len();
        let steps = (predicted.len() / n).min(self.horizon);
        let judged = steps.saturating_sub(self.stride) * n..steps * n;
        let rows = predicted[judged.clone()].chunks_exact(n).zip(shore[judged].chunks_exact(n));
        rows.map(|(p, f)| self.apart(p, f)).fold((f64::INFINITY, 0.0), |(least, most), d| {
            let d = if d.is_nan() { f64::INFINITY } else { d };
            (f64::min(least, d), f64::max(most, d))
        })
    }

    /// Whether a prediction is drawn for nothing but being farther off than is believed.
    pub(super) fn is_too_far(&self, predicted: &[f64], shore: &[f64], allowed: Allowed) -> bool {
        let (least, most) = self.reach(predicted, shore);
        most.is_finite() && most > allowed.most && most > allowed.far && least >= allowed.free
    }

    /// Draws a prediction towards another one, unless it may stand.
    pub(super) fn draw(&self, predicted: &mut [f64], shore: &[f64], allowed: Allowed) {
        let (least, most) = self.reach(predicted, shore);
        let share = if most <= allowed.most {
            if allowed.owes { 0.0 } else { 1.0 }
        } else if least >= allowed.free && most <= allowed.far {
            1.0
        } else {
            allowed.most / most
        };
        for (p, &f) in predicted.iter_mut().zip(shore) {
            if share < 1.0 {
                *p = f + share * (*p - f);
            }
            // Where it blew up the other one stands.
            if !p.is_finite() {
                *p = f;
            }
        }
    }

    /// Mean over the outputs of the distance between two predictions of one sample, in `w`.
    pub(super) fn apart(&self, p: &[f64], f: &[f64]) -> f64 {
        let off = p.iter().zip(f).zip(&self.scale).map(|((p, f), scale)| (p - f).abs() / scale);
        off.sum::<f64>() / self.scale.len() as f64
    }
}

/// What the rollouts of a guard are made of.
#[derive(Clone, Copy)]
pub struct Guarded<'a> {
    pub(super) bound: &'a Bound,
    pub(super) allowed: Allowed,
    pub(super) models: [&'a dyn Predictor; 2],
}

impl<'a> Guarded<'a> {
    /// The model that learned, and the one from shore.
    pub fn models(&self) -> [&'a dyn Predictor; 2] {
        self.models
    }

    /// Whether the one from shore answers alone.
    pub fn is_shore(&self) -> bool {
        self.allowed == Allowed::NONE
    }

    /// Draws a rollout of the model that learned towards that of the one from shore under the same commands, unless it may
    /// stand.
    pub fn draw(&self, predicted: &mut [f64], shore: &[f64]) {
        self.bound.draw(predicted, shore, self.allowed);
    }
}

impl core::fmt::Debug for Guarded<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Guarded").field("allowed", &self.allowed).finish_non_exhaustive()
    }
}

/// A session of its own that predicts as a guard does: by a model, bounded by the one from shore.
pub(super) struct Bounded {
    pub(super) bound: Bound,
    pub(super) allowed: Allowed,
    pub(super) model: Box<dyn Predictor>,
    pub(super) shore: Box<dyn Predictor>,
}

impl Predictor for Bounded {
    fn outputs(&self) -> usize {
        self.model.outputs()
    }

    fn inputs(&self) -> usize {
        self.model.inputs()
    }

    fn warm_up(&self) -> usize {
        self.model.warm_up()
    }

    fn reset(&mut self) {
        self.model.reset();
        self.shore.reset();
    }

    fn observe(&mut self, y: &[f64]) {
        self.model.observe(y);
        self.shore.observe(y);
    }

    fn advance(&mut self, c: &[f64]) {
        self.model.advance(c);
        self.shore.advance(c);
    }

    fn output(&self, y: &mut [f64]) {
        self.model.output(y);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        let models = [self.model.as_ref(), self.shore.as_ref()];
        self.bound.rollout(models, self.allowed, commands, work, y);
    }

    fn snapshot_len(&self) -> usize {
        self.model.snapshot_len() + self.shore.snapshot_len() + Allowed::LEN
    }

    fn snapshot(&self, into: &mut [f64]) {
        let (model, rest) = into.split_at_mut(self.model.snapshot_len());
        let (shore, allowed) = rest.split_at_mut(self.shore.snapshot_len());
        self.model.snapshot(model);
        self.shore.snapshot(shore);
        allowed.copy_from_slice(&self.allowed.numbers());
    }

    fn restore(&mut self, from: &[f64]) {
        let (model, rest) = from.split_at(self.model.snapshot_len());
        let (shore, allowed) = rest.split_at(self.shore.snapshot_len());
        self.model.restore(model);
        self.shore.restore(shore);
        self.allowed = Allowed::of(core::array::from_fn(|i| allowed[i]));
    }

    fn source(&self) -> Source<'_> {
        Source::Guarded(Guarded {
            bound: &self.bound,
            allowed: self.allowed,
            models: [self.model.as_ref(), self.shore.as_ref()],
        })
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(Self {
            bound: self.bound.clone(),
            allowed: self.allowed,
            model: self.model.fork(),
            shore: self.shore.fork(),
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Whatever is predicted and measured, the error at the horizon exceeds that of the other by at most what is allowed.
        #[test]
        fn an_answer_costs_no_more_than_is_allowed(
            predicted in prop::collection::vec(-10.0..10.0_f64, 12),
            shore in prop::collection::vec(-1.0..1.0_f64, 12),
            measured in prop::collection::vec(-2.0..2.0_f64, 12),
            most in 0.0..3.0_f64,
            owes in any::<bool>(),
            bad in prop::option::of((0_usize..12, prop_oneof![Just(f64::NAN), Just(f64::INFINITY)])),
        ) {
            let bound = Bound { horizon: 5, stride: 2, scale: [3.0, 0.5].into() };
            let mut answer = predicted;
            if let Some((at, value)) = bad {
                answer[at] = value;
            }
            let free = 1.7;
            bound.draw(&mut answer, &shore, Allowed { most, free, far: 4.0, owes });
            prop_assert!(answer.iter().all(|y| y.is_finite()));
            for row in 3..5 {
                let part = 2 * row..2 * row + 2;
                let own = bound.apart(&answer[part.clone()], &measured[part.clone()]);
                let other = bound.apart(&shore[part.clone()], &measured[part.clone()]);
                let apart = bound.apart(&answer[part.clone()], &shore[part]);
                prop_assert!(own <= other + most + 1e-12 || apart >= free);
            }
        }
    }
}
