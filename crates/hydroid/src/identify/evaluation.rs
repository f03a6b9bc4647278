//! Evaluation of the models on validation and test runs, and selection of the best one.

use std::sync::Arc;

use hydroid_core::predict::Predictor;

use super::training::{Trained, Training};
use super::{Candidate, IdentifyError, Job, Parts};
use crate::evaluate::{self, EvaluateError, PredictionBands, evaluate, evaluate_each};
use crate::log::Trajectory;
use crate::model::{Body, Model};
use crate::progress::Progress;
use crate::sindy::{BlockLosses, SearchError};

impl Parts<'_> {
    fn held_out(&self) -> impl Iterator<Item = (&'static str, &[&Trajectory])> {
        let validation = if self.folds.is_some() { "left-out" } else { "validation" };
        let parts = [(validation, &self.validation[..]), ("test", &self.test[..])];
        parts.into_iter().filter(|(_, runs)| !runs.is_empty())
    }
}

/// Checks before the training that some run of each part is longer than the horizon.
pub(super) fn check_horizon(job: &Job, parts: &Parts<'_>) -> Result<(), IdentifyError> {
    let longest =
        parts.held_out().map(|(part, runs)| (runs.iter().map(|run| run.len()).max().unwrap_or(0), part));
    let (longest, part) = longest.min().unwrap_or((0, "training"));
    if job.horizon < longest {
        return Ok(());
    }
    let (horizon, horizon_s) = (job.horizon, job.horizon as f64 * parts.train[0].dt);
    Err(IdentifyError::Horizon { part, horizon, horizon_s, longest })
}

/// Checks that some run of each part has an origin of [`evaluate`](fn@evaluate) for a model with this warm-up.
pub(super) fn check_evaluable(job: &Job, parts: &Parts<'_>, warm_up: usize) -> Result<(), IdentifyError> {
    let horizon = job.horizon;
    for (part, runs) in parts.held_out() {
        let has_origin = |run: &&Trajectory| {
            let seen = |c: usize| run.outputs.column(c).position(|y| !y.is_nan());
            let all = (0..run.outputs.width()).try_fold(0, |last: usize, c| Some(last.max(seen(c)?)));
            let first = all.map(|all| all.max(warm_up.saturating_sub(1)));
            first.is_some_and(|first| first.saturating_add(horizon) < run.len())
        };
        if !runs.iter().any(has_origin) {
            let longest = runs.iter().map(|run| run.len()).max().unwrap_or(0);
            return Err(IdentifyError::NotEvaluable { part, warm_up, horizon, longest });
        }
    }
    Ok(())
}

/// Evaluates all models on the same windows: the warm-up is the longest of all models.
pub(super) fn evaluate_candidates(
    job: &Job,
    parts: &Parts<'_>,
    trained: Vec<Trained>,
    progress: Progress<'_>,
) -> Result<Vec<Candidate>, IdentifyError> {
    let models = trained.iter().flat_map(|t| std::iter::once(&t.model).chain(&t.left_out));
    let warm_up = models.map(|model| model.session().warm_up()).max().unwrap_or(1);
    let options = evaluate::Options {
        horizon: job.horizon,
        origin_stride: job.origin_stride,
        warm_up,
        errors_at: PredictionBands::horizons(job.horizon),
        ..evaluate::Options::default()
    };
    let count = trained.len() as f64;
    let mut candidates = Vec::new();
    for Trained { mut model, training, train_seconds, left_out, .. } in trained {
        let start = candidates.len() as f64;
        let mut evaluate_on = |part, sessions: &mut [Box<dyn Predictor>], runs: &[&Trajectory], from: f64| {
            let mut report = |f: f64| progress((start + from + 0.5 * f) / count);
            let (name, ranges) = (&model.description.name, &parts.ranges);
            let evaluation = match sessions {
                [session] => evaluate(name, session.as_mut(), ranges, runs, &options, &mut report),
                sessions => evaluate_each(name, sessions, ranges, runs, &options, &mut report),
            };
            evaluation.map_err(|error| match error {
                EvaluateError::Cancelled(c) => IdentifyError::Sindy(SearchError::Cancelled(c)),
                error => IdentifyError::Evaluate { part, error },
            })
        };
        // After a refit on all runs, the validation errors are those of the model before the refit.
        let before_refit = match &training {
            Training::Network(trained) if trained.refit.is_some() => {
                Some(Body::from(trained.before_refit().clone()))
            }
            Training::Committee(chosen) => Some(Body::Committee(Arc::new(chosen.before_refit.clone()))),
            _ => None,
        };
        let before_refit = before_refit.map(|body| Model { body, ..model.clone() });
        let mut of_validation: Vec<Box<dyn Predictor>> = match parts.folds {
            Some(folds) => {
                let runs = folds.runs(&job.split.train);
                runs.into_iter().map(|(fold, _)| left_out[fold].session()).collect()
            }
            None => vec![before_refit.as_ref().unwrap_or(&model).session()],
        };
        let validation = evaluate_on("validation", &mut of_validation, &parts.validation, 0.0)?;
        let test = if parts.test.is_empty() {
            None
        } else {
            // A new session, because sessions may adapt.
            Some(evaluate_on("test", &mut [model.session()], &parts.test, 0.5)?)
        };
        model.description.bands = PredictionBands::new(&validation);
        candidates.push(Candidate { model, training, train_seconds, validation, test, left_out });
    }
    Ok(candidates)
}

/// Minimum relative decrease of the validation error by a more complex method.
pub(super) const MIN_IMPROVEMENT: f64 = 0.02;

/// The model with the smallest validation error, where a more complex model must improve it by [`MIN_IMPROVEMENT`]. A
/// committee takes its place unless the difference exceeds one standard error (one-standard-error rule: Breiman et al.,
/// Classification and Regression Trees, 1984, section 3.4.3). The test runs do not influence the choice; if its rollouts diverge on them, there is no best model.
pub(super) fn select_best(candidates: &[Candidate]) -> Option<usize> {
    select_among(candidates, |_| true)
}

/// As [`select_best`], among the models that a condition permits.
pub(super) fn select_among(candidates: &[Candidate], may: impl Fn(usize) -> bool) -> Option<usize> {
    let judged = candidates.iter().enumerate().map(|(i, candidate)| {
        let is_sound = candidate.validation.diverged == 0 && may(i);
        (candidate.training.complexity(), is_sound.then(|| candidate.validation.score()))
    });
    let judged: Vec<_> = judged.collect();
    let best = least_error(&judged)?;
    // The error of one winner among many settings is too small on the runs that chose it.
    let committees = candidates.iter().enumerate().filter_map(|(i, candidate)| {
        let committee = matches!(candidate.training, Training::Committee(_));
        Some((i, judged[i].1.filter(|_| committee)?))
    });
    let committee = committees.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i);
    let losses = |i: usize| losses(&candidates[i]);
    let best = match committee {
        Some(committee) if !losses(best).is_significantly_better(&losses(committee)) => committee,
        _ => best,
    };
    Some(best).filter(|&i| candidates[i].judged().diverged == 0)
}

/// Losses on the blocks of the validation, by which two candidates are compared.
pub(super) fn losses(candidate: &Candidate) -> BlockLosses {
    BlockLosses { validation: candidate.validation.blocks.clone(), training: Vec::new() }
}

fn least_error<C: Ord>(judged: &[(C, Option<f64>)]) -> Option<usize> {
    let mut order: Vec<(usize, &C, f64)> = judged
        .iter()
        .enumerate()
        .filter_map(|(i, (complexity, score))| Some((i, complexity, (*score)?)))
        .collect();
    order.sort_by_key(|&(_, complexity, _)| complexity);
    let better = |best: (usize, &C, f64), next: (usize, &C, f64)| {
        let least = if next.1 > best.1 { (1.0 - MIN_IMPROVEMENT) * best.2 } else { best.2 };
        next.2 < least
    };
    let best = order.into_iter().reduce(|best, next| if better(best, next) { next } else { best });
    best.map(|(i, ..)| i)
}

#[cfg(test)]
mod tests {
    use super::least_error;

    #[test]
    fn a_more_complex_method_must_be_worth_it_and_equals_are_told_apart_by_their_error() {
        for (judged, best) in [
            (&[(0, Some(1.0)), (2, Some(0.985))][..], Some(0)),
            (&[(0, Some(1.0)), (2, Some(0.975))], Some(1)),
            // Networks have equal complexity: their order is irrelevant.
            (&[(0, Some(1.0)), (2, Some(0.97)), (2, Some(0.96))], Some(2)),
            (&[(0, Some(1.0)), (2, Some(0.96)), (2, Some(0.97))], Some(1)),
            (&[(2, Some(0.97)), (2, Some(0.965))], Some(1)),
            (&[(2, Some(0.965)), (2, Some(0.97))], Some(0)),
            (&[(2, Some(0.965)), (0, Some(0.97))], Some(1)),
            (&[(0, None), (2, Some(5.0))], Some(1)),
            (&[(0, None)], None),
            (&[], None),
        ] {
            assert_eq!(least_error(judged), best, "{judged:?}");
        }
    }
}
