//! Predictions whose cost is known before they are made.
//!
//! A prediction `p` of another model stands beside that of the model from shore, `f`:
//!
//! ```text
//! d = mean over outputs of |p - f| / w, the largest over the last stride of steps up to the horizon
//! answer = p                      if free <= d <= far (the least d there, the largest here), and the vessel does not move otherwise
//!        = f                      if d <= most and something is owed
//!        = f + a (p - f)          otherwise, with a = min(1, most / d), the same for all steps
//! ```
//!
//! Near the other model its error exceeds that of `f` by at most `most`, whatever will be measured (triangle inequality). And
//! where the two are far apart, one of them is far off: if the error of `p` is at most `E`, that of `f` is at least `d - E`,
//! and what `p` costs beyond `factor` times that is at most `most` where `d >= (E (1 + factor) - most) / factor`. (Of a model from shore that has
//! been right of late nobody believes that: then `far` is small.) While something is owed, what is near anyway is not worth owing more.
//!
//! And there is a third opinion: that the vessel goes on as it moves, `m = y + k dy` after `k` samples, with `y` and `dy` as they were
//! measured. It is a poor prediction, but it knows no water: a model that says that the vessel flies on, while it comes down, is farther from
//! `m` than the one from shore is. Where that shall be heeded, what is farther from `m` by `AGAINST` times does not stand.

use alloc::boxed::Box;

use crate::predict::{Predictor, Workspace};

/// A prediction is against how the vessel moves where it is farther from that, by this factor, than that of the model from shore.
const AGAINST: f64 = 1.5;

/// How the vessel moves: of each output its value, and how much it changes in a sample; NaN where that was not measured.
pub(super) type Motion = [[f64; 2]];

/// How far predictions may be from those of the model from shore: up to `most`, or from `free` up to `far`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Allowed {
    pub(super) most: f64,
    pub(super) free: f64,
    pub(super) far: f64,
    /// Whether something is owed: nothing is owed in addition for predictions that are near anyway, and those of the model from shore
    /// stand for them.
    pub(super) owes: bool,
    /// Whether a prediction that is far off may not be against how the vessel moves.
    pub(super) heeds: bool,
}

impl Allowed {
    /// The model from shore alone.
    pub(super) const NONE: Self =
        Self { most: 0.0, free: f64::INFINITY, far: 0.0, owes: false, heeds: false };

    /// Numbers that it is kept in.
    pub(super) const LEN: usize = 5;

    pub(super) fn numbers(self) -> [f64; Self::LEN] {
        let [owes, heeds] = [self.owes, self.heeds].map(|flag| f64::from(u8::from(flag)));
        [self.most, self.free, self.far, owes, heeds]
    }

    pub(super) fn of([most, free, far, owes, heeds]: [f64; Self::LEN]) -> Self {
        Self { most, free, far, owes: owes != 0.0, heeds: heeds != 0.0 }
    }
}

/// Where a prediction stands beside that of the model from shore, and how far off where it is drawn towards it.
enum Standing {
    Near,
    /// Far off, and tests say that it is the other one that is wrong.
    Proven,
    /// Not far enough for tests to say that.
    Unproven(f64),
    /// Farther than is believed, or against how the vessel moves.
    Refused(f64),
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

    /// Whether a prediction is drawn for nothing but being farther off than is believed, or against how the vessel moves.
    pub(super) fn is_refused(
        &self,
        predicted: &[f64],
        shore: &[f64],
        allowed: Allowed,
        motion: &Motion,
    ) -> bool {
        let standing = self.standing(predicted, shore, allowed, motion);
        matches!(standing, Standing::Refused(distance) if distance.is_finite())
    }

    fn standing(&self, predicted: &[f64], shore: &[f64], allowed: Allowed, motion: &Motion) -> Standing {
        let (least, most) = self.reach(predicted, shore);
        if most <= allowed.most {
            Standing::Near
        } else if least < allowed.free {
            Standing::Unproven(most)
        } else if most <= allowed.far && !(allowed.heeds && self.is_against(motion, predicted, shore)) {
            Standing::Proven
        } else {
            Standing::Refused(most)
        }
    }

    /// Whether a prediction is against how the vessel moves, at the last step by which it is judged. (Nothing is against what nobody knows.)
    fn is_against(&self, motion: &Motion, predicted: &[f64], shore: &[f64]) -> bool {
        let n = self.scale.len();
        let steps = (predicted.len() / n).min(self.horizon);
        let last = steps.saturating_sub(1) * n..steps * n;
        let off = |from: &[f64]| {
            let each = motion.iter().zip(&from[last.clone()]).zip(&self.scale);
            each.map(|(([y, dy], p), scale)| (y + steps as f64 * dy - p).abs() / scale).sum::<f64>()
        };
        off(predicted) > AGAINST * off(shore)
    }

    /// Draws a prediction towards another one, unless it may stand.
    pub(super) fn draw(&self, predicted: &mut [f64], shore: &[f64], allowed: Allowed, motion: &Motion) {
        let share = match self.standing(predicted, shore, allowed, motion) {
            Standing::Near => f64::from(u8::from(!allowed.owes)),
            Standing::Proven => 1.0,
            Standing::Unproven(distance) | Standing::Refused(distance) => allowed.most / distance,
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

/// How the vessel moves, by two series of measurements of equal length: means of values and of times tell value and change. What was not
/// measured at the end, or in half of each, goes on as it did: one refused value hides nothing, and while values are being refused what
/// is left of those before tells ever less.
pub(super) fn measure(rows: &[f64], motion: &mut Motion) {
    let n = motion.len();
    let count = rows.len() / n / 2;
    let (before, late) = rows.split_at(count * n);
    for (i, into) in motion.iter_mut().enumerate() {
        // Mean value and mean time, in samples since the first.
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

/// A sample later, as far as anybody knows.
pub(super) fn go_on(motion: &mut Motion) {
    for [y, dy] in motion {
        *y += *dy;
    }
}

/// The predictions of a guard: those of a model, bounded by the reference model.
pub(super) struct BoundedRollout<'a> {
    pub(super) bound: &'a Bound,
    pub(super) allowed: Allowed,
    pub(super) motion: &'a Motion,
    pub(super) model: &'a dyn Predictor,
    pub(super) reference: &'a dyn Predictor,
}

impl BoundedRollout<'_> {
    /// [`Predictor::rollout`].
    pub(super) fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        let (beside, [of_model, of_reference]) = work.take_pair(y.len());
        if self.allowed == Allowed::NONE {
            return self.reference.rollout(commands, of_reference, y);
        }
        self.reference.rollout(commands, of_reference, beside);
        self.model.rollout(commands, of_model, y);
        self.bound.draw(y, beside, self.allowed, self.motion);
    }

    /// [`Predictor::rollout_batch`].
    pub(super) fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        let (beside, [of_model, of_reference]) = work.take_pair(y.len());
        if self.allowed == Allowed::NONE {
            return self.reference.rollout_batch(count, commands, of_reference, y);
        }
        self.reference.rollout_batch(count, commands, of_reference, beside);
        self.model.rollout_batch(count, commands, of_model, y);
        let len = y.len() / count;
        for (y, beside) in y.chunks_exact_mut(len).zip(beside.chunks_exact(len)) {
            self.bound.draw(y, beside, self.allowed, self.motion);
        }
    }
}

/// A session of its own that predicts as a guard does: by a model, bounded by the one from shore.
pub(super) struct Bounded {
    pub(super) bound: Bound,
    pub(super) allowed: Allowed,
    pub(super) motion: Box<Motion>,
    pub(super) model: Box<dyn Predictor>,
    pub(super) shore: Box<dyn Predictor>,
}

impl Bounded {
    fn bounded(&self) -> BoundedRollout<'_> {
        let Self { bound, allowed, motion, model, shore } = self;
        BoundedRollout { bound, allowed: *allowed, motion, model: model.as_ref(), reference: shore.as_ref() }
    }
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
        self.motion.fill([f64::NAN; 2]);
    }

    fn observe(&mut self, y: &[f64]) {
        self.model.observe(y);
        self.shore.observe(y);
    }

    fn advance(&mut self, c: &[f64]) {
        self.model.advance(c);
        self.shore.advance(c);
        go_on(&mut self.motion);
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
        self.model.snapshot_len() + self.shore.snapshot_len() + Allowed::LEN + 2 * self.motion.len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        let (model, rest) = into.split_at_mut(self.model.snapshot_len());
        let (shore, rest) = rest.split_at_mut(self.shore.snapshot_len());
        let (allowed, motion) = rest.split_at_mut(Allowed::LEN);
        self.model.snapshot(model);
        self.shore.snapshot(shore);
        allowed.copy_from_slice(&self.allowed.numbers());
        motion.copy_from_slice(self.motion.as_flattened());
    }

    fn restore(&mut self, from: &[f64]) {
        let (model, rest) = from.split_at(self.model.snapshot_len());
        let (shore, rest) = rest.split_at(self.shore.snapshot_len());
        let (allowed, motion) = rest.split_at(Allowed::LEN);
        self.model.restore(model);
        self.shore.restore(shore);
        self.allowed = Allowed::of(core::array::from_fn(|i| allowed[i]));
        self.motion.as_flattened_mut().copy_from_slice(motion);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(Self {
            bound: self.bound.clone(),
            allowed: self.allowed,
            motion: self.motion.clone(),
            model: self.model.fork(),
            shore: self.shore.fork(),
        })
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn what_is_measured_tells_how_the_vessel_moves() {
        let mut motion = [[f64::NAN; 2], [f64::NAN; 2], [7.0, 1.0], [7.0, 1.0]];
        // The second is measured in half of each half, the third in less of the last, the fourth not at the end.
        let row = |k: u32| {
            let line = 2.0 + 0.1 * f64::from(k);
            let with = |measured: bool| if measured { line } else { f64::NAN };
            [line, with([1, 2, 4, 7].contains(&k)), with([0, 1, 2, 3, 7].contains(&k)), with(k < 7)]
        };
        measure(&(0..8).flat_map(row).collect::<Vec<_>>(), &mut motion);
        go_on(&mut motion);
        let [all, some, less, ended] = motion;
        for [y, dy] in [all, some] {
            assert!((y - 2.8).abs() < 1e-12 && (dy - 0.1).abs() < 1e-12, "{motion:?}");
        }
        assert_eq!([less, ended], [[8.0, 1.0]; 2]);
    }

    /// A vessel that flies, by the one, or is back in the water in five samples, by the other.
    #[test]
    fn what_is_against_how_the_vessel_moves_does_not_stand() {
        let bound = Bound { horizon: 5, stride: 2, scale: [3.0, 0.5].into() };
        let (flies, falls) = ([5.0, 0.0].repeat(5), [1.0, 0.0].repeat(5));
        let allowed = Allowed { most: 0.1, free: 0.2, far: 10.0, owes: false, heeds: true };
        let stands = |motion: [[f64; 2]; 2], allowed: Allowed| {
            let mut answer = flies.clone();
            bound.draw(&mut answer, &falls, allowed, &motion);
            let stands = answer == flies;
            assert_eq!(stands, !bound.is_refused(&flies, &falls, allowed, &motion));
            stands
        };
        let (steady, slower) = ([[5.0, 0.0], [0.0; 2]], [[4.5, -0.5], [0.0; 2]]);
        assert!(stands(steady, allowed));
        assert!(!stands(slower, allowed));
        assert!(stands(slower, Allowed { heeds: false, ..allowed }));
        // Slower by little, or where one output was never measured.
        assert!(stands([[4.5, -0.2], [0.0; 2]], allowed));
        assert!(stands([slower[0], [f64::NAN; 2]], allowed));
    }

    proptest! {
        /// Whatever is predicted and measured, the error at the horizon exceeds that of the other by at most what is allowed.
        #[test]
        fn an_answer_costs_no_more_than_is_allowed(
            predicted in prop::collection::vec(-10.0..10.0_f64, 12),
            shore in prop::collection::vec(-1.0..1.0_f64, 12),
            measured in prop::collection::vec(-2.0..2.0_f64, 12),
            most in 0.0..3.0_f64,
            owes in any::<bool>(),
            heeds in any::<bool>(),
            motion in prop::array::uniform2([-2.0..2.0_f64, -0.5..0.5_f64]),
            bad in prop::option::of((0_usize..12, prop_oneof![Just(f64::NAN), Just(f64::INFINITY)])),
        ) {
            let bound = Bound { horizon: 5, stride: 2, scale: [3.0, 0.5].into() };
            let mut answer = predicted;
            if let Some((at, value)) = bad {
                answer[at] = value;
            }
            let free = 1.7;
            bound.draw(&mut answer, &shore, Allowed { most, free, far: 4.0, owes, heeds }, &motion);
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
