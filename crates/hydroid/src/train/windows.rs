//! Windows on runs.

use rand::RngExt as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::Scaling;

use super::TrainError;
use super::base_rollout::BaseRollout;
use crate::log::{Table, Trajectory};

/// Scaled run, `(value - mean) / scale`, row by row; a missing value is NaN. Windows refer to it without copies.
#[derive(Clone, Debug)]
pub(super) struct ScaledRun<T> {
    pub(super) samples: usize,
    pub(super) outputs: Vec<T>,
    pub(super) inputs: Vec<T>,
    /// Inputs in physical units, for equations.
    pub(super) commands: Vec<f64>,
    complete: bool,
    /// Rollouts of the base equations of a direct predictor.
    pub(super) base_rollout: Option<BaseRollout<T>>,
}

impl<T: Scalar> ScaledRun<T> {
    pub(super) fn new(run: &Trajectory, scaling: &Scaling) -> Self {
        let scaled = |table: &Table, mean: &[f64], scale: &[f64]| -> Vec<T> {
            (0..table.len())
                .flat_map(|k| table.row(k).iter().zip(mean).zip(scale).map(|((x, m), s)| T::of((x - m) / s)))
                .collect()
        };
        let outputs = scaled(&run.outputs, &scaling.output_mean, &scaling.output_scale);
        let inputs = scaled(&run.inputs, &scaling.input_mean, &scaling.input_scale);
        let complete = outputs.iter().chain(&inputs).all(|x| x.is_finite());
        let commands = run.inputs.rows(0, run.inputs.len()).to_vec();
        Self { samples: run.len(), outputs, inputs, commands, complete, base_rollout: None }
    }
}

/// A window: `wash_out` samples before the origin in which the hidden state converges under measured outputs, then
/// `length` predicted and compared samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) run: usize,
    /// Origin: the sample from which the model receives no outputs.
    pub(super) origin: usize,
    /// Number of compared values.
    pub(super) targets: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    pub(super) outputs: usize,
    pub(super) inputs: usize,
    /// Steps before the origin.
    pub(super) wash_out: usize,
    /// Steps from the origin on.
    pub(super) length: usize,
    /// Whether predictions start from measured outputs, which must then be available at the origin.
    pub(super) measured: bool,
}

impl Shape {
    /// Samples of a run in a window, the last predicted one included.
    pub(super) fn samples(&self) -> usize {
        self.wash_out.saturating_add(self.length).saturating_add(1)
    }

    /// Window at an origin, if usable.
    pub(super) fn window<T: Scalar>(
        &self,
        runs: &[ScaledRun<T>],
        run: usize,
        origin: usize,
    ) -> Option<Window> {
        let data = &runs[run];
        let (first, last) = (origin.checked_sub(self.wash_out)?, origin.saturating_add(self.length));
        if last >= data.samples {
            return None;
        }
        if data.base_rollout.as_ref().is_some_and(|base_rollout| !base_rollout.is_known(origin)) {
            return None;
        }
        let (n, m) = (self.outputs, self.inputs);
        if data.complete {
            return Some(Window { run, origin, targets: n * self.length });
        }
        if !data.inputs[first * m..last * m].iter().all(|x| x.is_finite()) {
            return None;
        }
        let known = |c: usize| (first..=origin).any(|k| !data.outputs[k * n + c].is_nan());
        if self.measured && !(0..n).all(known) {
            return None;
        }
        let compared = &data.outputs[(origin + 1) * n..(last + 1) * n];
        let targets = compared.iter().filter(|y| !y.is_nan()).count();
        (targets > 0).then_some(Window { run, origin, targets })
    }

    /// Windows of an epoch: the compared parts tile each run from an offset drawn for each run and epoch.
    pub(super) fn tiles<T: Scalar>(&self, runs: &[ScaledRun<T>], rng: &mut ChaCha8Rng) -> Vec<Window> {
        let mut windows = Vec::new();
        for (index, run) in runs.iter().enumerate() {
            let Some(spare) = run.samples.checked_sub(self.samples()) else { continue };
            let offset = rng.random_range(0..=spare.min(self.length - 1));
            let origins = (self.wash_out + offset..run.samples).step_by(self.length);
            windows.extend(origins.filter_map(|origin| self.window(runs, index, origin)));
        }
        windows
    }

    /// Windows at every `stride`-th origin of each run.
    pub(super) fn every<T: Scalar>(&self, runs: &[ScaledRun<T>], stride: usize) -> Vec<Window> {
        let origins = |(run, data): (usize, &ScaledRun<T>)| {
            (self.wash_out..data.samples).step_by(stride).map(move |origin| (run, origin))
        };
        let all = runs.iter().enumerate().flat_map(origins);
        all.filter_map(|(run, origin)| self.window(runs, run, origin)).collect()
    }

    /// Error that explains why there is no window.
    pub(super) fn none<T>(&self, what: &'static str, runs: &[ScaledRun<T>]) -> TrainError {
        let longest = runs.iter().map(|run| run.samples).max().unwrap_or(0);
        let (needed, wash_out, length) = (self.samples(), self.wash_out, self.length);
        if longest < needed {
            TrainError::TooShort { what, needed, wash_out, length, longest }
        } else {
            TrainError::NoWindow { what }
        }
    }
}

pub(super) fn shuffled(windows: &[Window], rng: &mut ChaCha8Rng) -> Vec<Window> {
    let mut order = windows.to_vec();
    order.shuffle(rng);
    order
}

#[cfg(test)]
mod tests {
    use super::super::random::{Purpose, stream};
    use super::*;
    use crate::log::Channel;

    fn run(samples: usize, missing: &[(usize, usize)], missing_input: Option<usize>) -> ScaledRun<f64> {
        let mut y: Vec<f64> = (0..2 * samples).map(|i| i as f64).collect();
        for &(k, c) in missing {
            y[2 * k + c] = f64::NAN;
        }
        let mut x = vec![0.5; samples];
        if let Some(k) = missing_input {
            x[k] = f64::NAN;
        }
        let run = Trajectory {
            name: String::from("run"),
            t0: 0.0,
            dt: 0.1,
            outputs: Table::new([Channel::new("u", "m/s"), Channel::new("v", "m/s")], y),
            inputs: Table::new([Channel::new("n", "1/s")], x),
            truth: None,
            heading: None,
            position: None,
        };
        let one = vec![1.0, 1.0];
        let scaling = Scaling {
            output_mean: vec![0.0; 2],
            output_scale: one.clone(),
            input_mean: vec![0.0],
            input_scale: vec![1.0],
            correction_scale: one,
        };
        ScaledRun::new(&run, &scaling)
    }

    const SHAPE: Shape = Shape { outputs: 2, inputs: 1, wash_out: 5, length: 10, measured: true };

    #[test]
    fn tiles_compare_each_sample_at_most_once_and_stay_inside() {
        let runs = [run(16, &[], None), run(15, &[], None), run(103, &[], None)];
        let mut begins = std::collections::BTreeSet::new();
        for epoch in 0..100 {
            let windows = SHAPE.tiles(&runs, &mut stream(1, Purpose::Offsets, 0, epoch));
            // The first run holds exactly one window, the second none, the third eight or nine.
            assert_eq!(windows[0], Window { run: 0, origin: 5, targets: 20 });
            assert!(windows[1..].iter().all(|w| w.run == 2 && w.origin >= 5 && w.origin + 10 < 103));
            assert!(windows[1..].windows(2).all(|w| w[1].origin == w[0].origin + 10));
            assert!((9..=10).contains(&windows.len()), "{}", windows.len());
            begins.insert(windows[1].origin);
        }
        assert_eq!(begins.into_iter().collect::<Vec<_>>(), (5..15).collect::<Vec<_>>());
    }

    #[test]
    fn windows_that_miss_what_they_need_are_left_out() {
        let one = |run: ScaledRun<f64>| SHAPE.window(&[run], 0, 5);
        assert_eq!(one(run(16, &[(9, 1)], None)).map(|w| w.targets), Some(19));
        // The input after the last step is not needed.
        assert!(one(run(16, &[], Some(15))).is_some());
        assert!(one(run(16, &[], Some(14))).is_none());
        let early: Vec<(usize, usize)> = (0..6).map(|k| (k, 0)).collect();
        assert!(one(run(16, &early, None)).is_none());
        assert!(one(run(16, &early[1..], None)).is_some());
        let late: Vec<(usize, usize)> = (6..16).flat_map(|k| [(k, 0), (k, 1)]).collect();
        assert!(one(run(16, &late, None)).is_none());
        assert!(SHAPE.none("training", &[run(15, &[], None)]).to_string().contains("needs 16 samples"));
    }
}
