//! The bound on the deviation of a prediction from the prediction of the reference model.
//!
//! For the predictions `p` of an adapted model and `f` of the reference model, and half the design range `w`:
//!
//! ```text
//! d      = mean over outputs of |p - f| / w, with its range over the last stride of steps of the horizon
//! answer = p                if supported_from <= min d and max d <= supported_to, and p does not contradict the motion
//!        = f                if max d <= limit and the account of the guarantee is in deficit
//!        = f + a (p - f)    otherwise, with a = min(1, limit / max d) for all steps
//! ```
//!
//! Within `limit`, the error of the answer exceeds the error of `f` by at most `limit` (triangle inequality). If the
//! error of `p` is at most `E`, the error of `f` is at least `d - E`, and the cost of `p` beyond `factor` times the
//! error of `f` is at most `limit` where `d >= (E (1 + factor) - limit) / factor`. For a reference model with small
//! recent errors `supported_to` is small. In deficit, a small deviation does not justify further cost.
//!
//! The motion of the vessel is a third estimate: `m = y + k dy` after `k` samples, from the measured value `y` and its
//! change `dy` per sample. It is inaccurate, but independent of training data. With `motion_check`, a prediction is
//! rejected if its distance from `m` exceeds [`MOTION_RATIO`] times the distance of the reference model from `m`.

use alloc::boxed::Box;

use crate::predict::{Predictor, Workspace};

/// Maximum distance of a prediction from the extrapolated motion, relative to the distance of the reference model.
const MOTION_RATIO: f64 = 1.5;

/// Motion of the vessel: value and change per sample of each output; NaN where an output was not measured.
pub(super) type Motion = [[f64; 2]];

/// Deviations that the guarantee permits: up to `limit`, or from `supported_from` to `supported_to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Budget {
    pub(super) limit: f64,
    pub(super) supported_from: f64,
    pub(super) supported_to: f64,
    /// Whether the account is in deficit: the reference model then replaces small deviations.
    pub(super) in_deficit: bool,
    /// Whether a large deviation is rejected if it contradicts the motion of the vessel.
    pub(super) motion_check: bool,
}

impl Budget {
    pub(super) const NONE: Self = Self {
        limit: 0.0,
        supported_from: f64::INFINITY,
        supported_to: 0.0,
        in_deficit: false,
        motion_check: false,
    };

    pub(super) const LEN: usize = 5;

    pub(super) fn numbers(self) -> [f64; Self::LEN] {
        let [in_deficit, motion_check] =
            [self.in_deficit, self.motion_check].map(|flag| f64::from(u8::from(flag)));
        [self.limit, self.supported_from, self.supported_to, in_deficit, motion_check]
    }

    pub(super) fn of(numbers: [f64; Self::LEN]) -> Self {
        let [limit, supported_from, supported_to, in_deficit, motion_check] = numbers;
        let (in_deficit, motion_check) = (in_deficit != 0.0, motion_check != 0.0);
        Self { limit, supported_from, supported_to, in_deficit, motion_check }
    }
}

/// Deviation of a prediction from the reference model, with its size if the prediction is projected.
enum Deviation {
    Within,
    /// Large and supported by shadow tests.
    Supported,
    /// Too small for the support by shadow tests.
    Unsupported(f64),
    /// Larger than the error that the reference model can have, or against the motion of the vessel.
    Rejected(f64),
}

#[derive(Clone, Debug)]
pub(super) struct DeviationBound {
    /// Predictions are compared within `horizon` steps, over the last `stride` of them \[samples\].
    pub(super) horizon: usize,
    pub(super) stride: usize,
    /// `w`: half the design range of each output.
    pub(super) scale: Box<[f64]>,
}

impl DeviationBound {
    fn distance_range(&self, predicted: &[f64], reference: &[f64]) -> (f64, f64) {
        let n = self.scale.len();
        let steps = (predicted.len() / n).min(self.horizon);
        let judged = steps.saturating_sub(self.stride) * n..steps * n;
        let rows = predicted[judged.clone()].chunks_exact(n).zip(reference[judged].chunks_exact(n));
        rows.map(|(p, f)| self.distance(p, f)).fold((f64::INFINITY, 0.0), |(least, most), d| {
            let d = if d.is_nan() { f64::INFINITY } else { d };
            (f64::min(least, d), f64::max(most, d))
        })
    }

    pub(super) fn is_rejected(
        &self,
        predicted: &[f64],
        reference: &[f64],
        budget: Budget,
        motion: &Motion,
    ) -> bool {
        let deviation = self.deviation(predicted, reference, budget, motion);
        matches!(deviation, Deviation::Rejected(distance) if distance.is_finite())
    }

    fn deviation(&self, predicted: &[f64], reference: &[f64], budget: Budget, motion: &Motion) -> Deviation {
        let (least, most) = self.distance_range(predicted, reference);
        let contradicts = || budget.motion_check && self.contradicts_motion(motion, predicted, reference);
        if most <= budget.limit {
            Deviation::Within
        } else if least < budget.supported_from {
            Deviation::Unsupported(most)
        } else if most <= budget.supported_to && !contradicts() {
            Deviation::Supported
        } else {
            Deviation::Rejected(most)
        }
    }

    /// Whether a prediction contradicts the motion at its last compared step; false if the motion is unknown.
    fn contradicts_motion(&self, motion: &Motion, predicted: &[f64], reference: &[f64]) -> bool {
        let n = self.scale.len();
        let steps = (predicted.len() / n).min(self.horizon);
        let last = steps.saturating_sub(1) * n..steps * n;
        let off = |from: &[f64]| {
            let each = motion.iter().zip(&from[last.clone()]).zip(&self.scale);
            each.map(|(([y, dy], p), scale)| (y + steps as f64 * dy - p).abs() / scale).sum::<f64>()
        };
        off(predicted) > MOTION_RATIO * off(reference)
    }

    /// Projects a prediction in place onto the permitted deviation from the reference model.
    pub(super) fn project(&self, predicted: &mut [f64], reference: &[f64], budget: Budget, motion: &Motion) {
        let share = match self.deviation(predicted, reference, budget, motion) {
            Deviation::Within => f64::from(u8::from(!budget.in_deficit)),
            Deviation::Supported => 1.0,
            Deviation::Unsupported(distance) | Deviation::Rejected(distance) => budget.limit / distance,
        };
        for (p, &f) in predicted.iter_mut().zip(reference) {
            if share < 1.0 {
                *p = f + share * (*p - f);
            }
            if !p.is_finite() {
                *p = f;
            }
        }
    }

    /// Mean over the outputs of the distance between two predictions of one sample, in units of `w`.
    pub(super) fn distance(&self, p: &[f64], f: &[f64]) -> f64 {
        let off = p.iter().zip(f).zip(&self.scale).map(|((p, f), scale)| (p - f).abs() / scale);
        off.sum::<f64>() / self.scale.len() as f64
    }
}

/// Estimates the motion from measurements (rows of all outputs, oldest first) by the means of the two halves. An output
/// keeps its motion if it is missing in the last row or in more than half of either half.
pub(super) fn estimate_motion(rows: &[f64], motion: &mut Motion) {
    let n = motion.len();
    let count = rows.len() / n / 2;
    let (before, late) = rows.split_at(count * n);
    for (i, into) in motion.iter_mut().enumerate() {
        let mean = |rows: &[f64]| {
            let (mut value, mut time, mut measured) = (0.0, 0.0, 0_usize);
            for (k, y) in rows.iter().skip(i).step_by(n).enumerate().filter(|(_, y)| !y.is_nan()) {
                (value, time, measured) = (value + y, time + k as f64, measured + 1);
            }
            (2 * measured >= count).then(|| (value / measured as f64, time / measured as f64))
        };
        let is_last_measured = !rows[rows.len() - n + i].is_nan();
        if let (true, Some((y0, t0)), Some((y1, t1))) = (is_last_measured, mean(before), mean(late)) {
            let dy = (y1 - y0) / (count as f64 + t1 - t0);
            if dy.is_finite() {
                *into = [y1 + ((count - 1) as f64 - t1) * dy, dy];
            }
        }
    }
}

pub(super) fn extrapolate(motion: &mut Motion) {
    for [y, dy] in motion {
        *y += *dy;
    }
}

pub(super) struct BoundedRollout<'a> {
    pub(super) bound: &'a DeviationBound,
    pub(super) budget: Budget,
    pub(super) motion: &'a Motion,
    pub(super) model: &'a dyn Predictor,
    pub(super) reference: &'a dyn Predictor,
}

impl BoundedRollout<'_> {
    pub(super) fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        let (beside, [of_model, of_reference]) = work.take_pair(y.len());
        if self.budget == Budget::NONE {
            return self.reference.rollout(commands, of_reference, y);
        }
        self.reference.rollout(commands, of_reference, beside);
        self.model.rollout(commands, of_model, y);
        self.bound.project(y, beside, self.budget, self.motion);
    }

    pub(super) fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        let (beside, [of_model, of_reference]) = work.take_pair(y.len());
        if self.budget == Budget::NONE {
            return self.reference.rollout_batch(count, commands, of_reference, y);
        }
        self.reference.rollout_batch(count, commands, of_reference, beside);
        self.model.rollout_batch(count, commands, of_model, y);
        let len = y.len() / count;
        for (y, beside) in y.chunks_exact_mut(len).zip(beside.chunks_exact(len)) {
            self.bound.project(y, beside, self.budget, self.motion);
        }
    }
}

/// A fork of a guard without learning: the active model, bounded by the reference model.
pub(super) struct GuardFork {
    pub(super) bound: DeviationBound,
    pub(super) budget: Budget,
    pub(super) motion: Box<Motion>,
    pub(super) model: Box<dyn Predictor>,
    pub(super) reference: Box<dyn Predictor>,
}

impl GuardFork {
    fn bounded(&self) -> BoundedRollout<'_> {
        let Self { bound, budget, motion, model, reference } = self;
        let (model, reference) = (model.as_ref(), reference.as_ref());
        BoundedRollout { bound, budget: *budget, motion, model, reference }
    }
}

impl Predictor for GuardFork {
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
        self.reference.reset();
        self.motion.fill([f64::NAN; 2]);
    }

    fn observe(&mut self, y: &[f64]) {
        self.model.observe(y);
        self.reference.observe(y);
    }

    fn advance(&mut self, c: &[f64]) {
        self.model.advance(c);
        self.reference.advance(c);
        extrapolate(&mut self.motion);
    }

    fn output(&self, y: &mut [f64]) {
        self.model.output(y);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.bounded().rollout(commands, work, y);
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.bounded().rollout_batch(count, commands, work, y);
    }

    fn snapshot_len(&self) -> usize {
        self.model.snapshot_len() + self.reference.snapshot_len() + Budget::LEN + 2 * self.motion.len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        let (model, rest) = into.split_at_mut(self.model.snapshot_len());
        let (reference, rest) = rest.split_at_mut(self.reference.snapshot_len());
        let (budget, motion) = rest.split_at_mut(Budget::LEN);
        self.model.snapshot(model);
        self.reference.snapshot(reference);
        budget.copy_from_slice(&self.budget.numbers());
        motion.copy_from_slice(self.motion.as_flattened());
    }

    fn restore(&mut self, from: &[f64]) {
        let (model, rest) = from.split_at(self.model.snapshot_len());
        let (reference, rest) = rest.split_at(self.reference.snapshot_len());
        let (budget, motion) = rest.split_at(Budget::LEN);
        self.model.restore(model);
        self.reference.restore(reference);
        self.budget = Budget::of(core::array::from_fn(|i| budget[i]));
        self.motion.as_flattened_mut().copy_from_slice(motion);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(Self {
            bound: self.bound.clone(),
            budget: self.budget,
            motion: self.motion.clone(),
            model: self.model.fork(),
            reference: self.reference.fork(),
        })
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn motion_is_estimated_from_two_halves() {
        let mut motion = [[f64::NAN; 2], [f64::NAN; 2], [7.0, 1.0], [7.0, 1.0]];
        // The second output is measured in half of each half, the third in less, the fourth not at the end.
        let row = |k: u32| {
            let line = 2.0 + 0.1 * f64::from(k);
            let with = |measured: bool| if measured { line } else { f64::NAN };
            [line, with([1, 2, 4, 7].contains(&k)), with([0, 1, 2, 3, 7].contains(&k)), with(k < 7)]
        };
        estimate_motion(&(0..8).flat_map(row).collect::<Vec<_>>(), &mut motion);
        extrapolate(&mut motion);
        let [all, some, less, ended] = motion;
        for [y, dy] in [all, some] {
            assert!((y - 2.8).abs() < 1e-12 && (dy - 0.1).abs() < 1e-12, "{motion:?}");
        }
        assert_eq!([less, ended], [[8.0, 1.0]; 2]);
    }

    /// One prediction stays foil-borne, the other is in the water after five samples.
    #[test]
    fn a_prediction_against_the_motion_is_rejected() {
        let bound = DeviationBound { horizon: 5, stride: 2, scale: [3.0, 0.5].into() };
        let (flies, falls) = ([5.0, 0.0].repeat(5), [1.0, 0.0].repeat(5));
        let budget = Budget {
            limit: 0.1,
            supported_from: 0.2,
            supported_to: 10.0,
            in_deficit: false,
            motion_check: true,
        };
        let stands = |motion: [[f64; 2]; 2], budget: Budget| {
            let mut answer = flies.clone();
            bound.project(&mut answer, &falls, budget, &motion);
            let stands = answer == flies;
            assert_eq!(stands, !bound.is_rejected(&flies, &falls, budget, &motion));
            stands
        };
        let (steady, slower) = ([[5.0, 0.0], [0.0; 2]], [[4.5, -0.5], [0.0; 2]]);
        assert!(stands(steady, budget));
        assert!(!stands(slower, budget));
        assert!(stands(slower, Budget { motion_check: false, ..budget }));
        // A slightly slower vessel, and an output that was never measured.
        assert!(stands([[4.5, -0.2], [0.0; 2]], budget));
        assert!(stands([slower[0], [f64::NAN; 2]], budget));
    }

    proptest! {
        /// The error at the horizon exceeds the error of the reference model by at most the limit.
        #[test]
        fn an_answer_costs_no_more_than_the_limit(
            predicted in prop::collection::vec(-10.0..10.0_f64, 12),
            reference in prop::collection::vec(-1.0..1.0_f64, 12),
            measured in prop::collection::vec(-2.0..2.0_f64, 12),
            most in 0.0..3.0_f64,
            in_deficit in any::<bool>(),
            motion_check in any::<bool>(),
            motion in prop::array::uniform2([-2.0..2.0_f64, -0.5..0.5_f64]),
            bad in prop::option::of((0_usize..12, prop_oneof![Just(f64::NAN), Just(f64::INFINITY)])),
        ) {
            let bound = DeviationBound { horizon: 5, stride: 2, scale: [3.0, 0.5].into() };
            let mut answer = predicted;
            if let Some((at, value)) = bad {
                answer[at] = value;
            }
            let free = 1.7;
            bound.project(&mut answer, &reference, Budget { limit: most, supported_from: free, supported_to: 4.0, in_deficit, motion_check }, &motion);
            prop_assert!(answer.iter().all(|y| y.is_finite()));
            for row in 3..5 {
                let part = 2 * row..2 * row + 2;
                let own = bound.distance(&answer[part.clone()], &measured[part.clone()]);
                let other = bound.distance(&reference[part.clone()], &measured[part.clone()]);
                let apart = bound.distance(&answer[part.clone()], &reference[part]);
                prop_assert!(own <= other + most + 1e-12 || apart >= free);
            }
        }
    }
}
