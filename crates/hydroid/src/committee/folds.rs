//! Folds of the cross-validation: runs, or contiguous blocks where there are few runs.

use hydroid_core::model::committee::Shape;

use crate::log::Trajectory;

/// Fewest and most folds.
const FOLDS: std::ops::RangeInclusive<usize> = 3..=6;

/// Contiguous samples of a run. Rows and rollouts of a segment use no sample outside it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Segment<'a> {
    pub(crate) run: &'a Trajectory,
    pub(crate) from: usize,
    pub(crate) to: usize,
}

/// Segments that are left out together.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fold<'a> {
    pub(crate) segments: Vec<Segment<'a>>,
    /// Whether a segment is part of a validation run.
    pub(super) validation: bool,
}

impl<'a> Segment<'a> {
    pub(super) fn len(&self) -> usize {
        self.to - self.from
    }

    /// Outputs at a sample of the segment.
    pub(super) fn output(&self, k: usize) -> &'a [f64] {
        self.run.outputs.row(self.from + k)
    }

    /// Loads the variables at the sample `k` into every `stride`-th place of `into`. The mean of the present command is
    /// taken over `samples`, or over the clock step.
    pub(super) fn load(
        &self,
        shape: &Shape,
        k: usize,
        samples: Option<usize>,
        into: &mut [f64],
        stride: usize,
    ) {
        let mut places = into.iter_mut().step_by(stride);
        for lag in 0..=shape.lags {
            let at = k - lag * shape.clock;
            for (place, y) in places.by_ref().take(shape.outputs).zip(self.output(at)) {
                *place = *y;
            }
            let samples = samples.filter(|_| lag == 0).unwrap_or(shape.clock);
            for c in 0..shape.inputs {
                if let Some(place) = places.next() {
                    *place = self.mean_command(at, samples, c);
                }
            }
        }
    }

    /// Mean of a command over `samples` from the sample `k` on.
    pub(super) fn mean_command(&self, k: usize, samples: usize, input: usize) -> f64 {
        let end = (k + samples).min(self.len());
        let rows = (k..end).map(|k| self.run.inputs.row(self.from + k)[input]);
        rows.sum::<f64>() / (end - k).max(1) as f64
    }
}

/// Runs as folds if there are at least three; else blocks. Many runs share folds in turn. The last `validation` runs are
/// validation runs.
pub(crate) fn folds<'a>(runs: &[&'a Trajectory], validation: usize) -> Vec<Fold<'a>> {
    let training = runs.len() - validation.min(runs.len());
    let whole = |run: &'a Trajectory| Segment { run, from: 0, to: run.len() };
    if runs.len() >= *FOLDS.start() {
        let mut folds = vec![Fold::default(); runs.len().min(*FOLDS.end())];
        let count = folds.len();
        for (i, run) in runs.iter().enumerate() {
            folds[i % count].segments.push(whole(run));
            folds[i % count].validation |= i >= training;
        }
        return folds;
    }
    let blocks = FOLDS.end().div_ceil(runs.len().max(1));
    let block = |index: usize, run: &'a Trajectory, b: usize| {
        let [from, to] = [b, b + 1].map(|b| b * run.len() / blocks);
        Fold { segments: vec![Segment { run, from, to }], validation: index >= training }
    };
    runs.iter().enumerate().flat_map(|(i, run)| (0..blocks).map(move |b| block(i, run, b))).collect()
}
