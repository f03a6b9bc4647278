//! Scores of equations on the windows of a search.

use std::sync::Arc;

use hydroid_core::model::sparse::{Equations, Signal};
use rayon::prelude::*;

use super::windows::Windows;
use super::{SearchError, SearchOptions};
use crate::log::Trajectory;
use crate::progress::{self, Progress};
use crate::sindy::fit::Fit;
use crate::sindy::parsimony::BlockLosses;

/// Scores of equations on validation runs and on excerpts of the training runs.
pub(super) struct TrialScore {
    pub(super) score: f64,
    pub(super) validation: f64,
    pub(super) training: Option<f64>,
    pub(super) diverged: usize,
    pub(super) losses: BlockLosses,
}

/// Trials between two reports of the progress, which may cancel.
const BETWEEN_REPORTS: usize = 16;

/// Windows of validation runs and of excerpts of training runs.
pub(super) struct Judge<'a> {
    validation: Windows<'a>,
    training: Option<Windows<'a>>,
}

impl<'a> Judge<'a> {
    pub(super) fn new(
        options: &'a SearchOptions<'_>,
        excerpts: &'a [&'a Trajectory],
        thinning: usize,
    ) -> Result<Self, SearchError> {
        let (ranges, evaluation) = (options.outputs, &options.evaluation);
        let stride = evaluation.origin_stride.max(1);
        let validation = Windows::new(options.validation, ranges, evaluation, (stride, thinning))
            .map_err(SearchError::Validation)?;
        // The number of origins equals that on the validation runs.
        let samples = |runs: &[&Trajectory]| runs.iter().map(|run| run.len()).sum::<usize>();
        let ratio = samples(excerpts) / samples(options.validation).max(1);
        let training = Windows::new(excerpts, ranges, evaluation, (stride * ratio.max(1), thinning)).ok();
        Ok(Self { validation, training })
    }

    pub(super) fn snapshots(&self, equations: &Arc<Equations>) -> [Vec<f64>; 2] {
        let training = self.training.as_ref();
        [self.validation.snapshots(equations), training.map_or_else(Vec::new, |of| of.snapshots(equations))]
    }

    pub(super) fn score(
        &self,
        equations: &Arc<Equations>,
        [validation, training]: &[Vec<f64>; 2],
    ) -> TrialScore {
        let judged = self.validation.score(equations, validation);
        let trained = self.training.as_ref().map(|windows| windows.score(equations, training));
        let of_training = trained.as_ref().map(|trained| trained.score);
        TrialScore {
            score: of_training.map_or(judged.score, |trained| 0.5 * (judged.score + trained)),
            validation: judged.score,
            training: of_training,
            diverged: judged.diverged + trained.as_ref().map_or(0, |trained| trained.diverged),
            losses: BlockLosses {
                validation: judged.blocks,
                training: trained.map_or_else(Vec::new, |trained| trained.blocks),
            },
        }
    }

    /// Scores of all fits. Equations with the same lags and past values share their snapshots.
    pub(super) fn score_all(
        &self,
        fits: &[&Fit],
        progress: Progress<'_>,
    ) -> Result<Vec<TrialScore>, SearchError> {
        let complete = |windows: &Windows<'_>| windows.is_complete();
        let share = complete(&self.validation) && self.training.as_ref().is_none_or(complete);
        let mut known: Vec<(&[Signal], [Vec<f64>; 2])> = Vec::new();
        for fit in fits.iter().filter(|_| share) {
            let signals = fit.equations.signals();
            if known.iter().all(|(of, _)| *of != signals) {
                known.push((signals, self.snapshots(&Arc::new(fit.equations.clone()))));
            }
        }
        let score = |fit: &&Fit| {
            let equations = Arc::new(fit.equations.clone());
            match known.iter().find(|(signals, _)| *signals == fit.equations.signals()) {
                Some((_, snapshots)) => self.score(&equations, snapshots),
                None => self.score(&equations, &self.snapshots(&equations)),
            }
        };
        let mut scores = Vec::with_capacity(fits.len());
        for part in fits.chunks(BETWEEN_REPORTS) {
            progress::report(progress, scores.len() as f64 / fits.len() as f64)?;
            scores.par_extend(part.par_iter().map(score));
        }
        Ok(scores)
    }
}
