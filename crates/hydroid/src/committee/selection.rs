//! Selection of the members.

use hydroid_core::model::committee::{Committee, Member, Prior};
use rayon::prelude::*;

use super::candidates::{Candidate, Grid};
use super::{ChooseError, Chosen};
use crate::progress::{Progress, report};

/// Votes of a committee.
const VOTES: u32 = 20;

/// Best candidates among which members are chosen.
const SHORTLIST: usize = 60;

/// Largest NRMSE in a mean; a candidate that diverges on one output or horizon is not judged by its size there.
const WORST: f64 = 10.0;

/// Candidates computed between two reports of the progress.
const BATCH: usize = 32;

struct Trial {
    candidate: Candidate,
    predicted: Vec<f32>,
    error: f64,
}

/// Reference of the errors: truth and its standard deviation for each mark and output.
struct Judge<'a> {
    truth: &'a [f32],
    deviations: Vec<f64>,
}

impl<'a> Judge<'a> {
    fn new(truth: &'a [f32], columns: usize) -> Self {
        let rows = (truth.len() / columns).max(1) as f64;
        let column = |c: usize| truth.iter().skip(c).step_by(columns).map(|y| f64::from(*y));
        let deviation = |c: usize| {
            let mean = column(c).sum::<f64>() / rows;
            (column(c).map(|y| (y - mean).powi(2)).sum::<f64>() / rows).sqrt()
        };
        Self { truth, deviations: (0..columns).map(deviation).collect() }
    }

    /// Mean NRMSE of predictions over marks and outputs.
    fn error(&self, predicted: impl Iterator<Item = f64>) -> f64 {
        let columns = self.deviations.len();
        let mut squares = vec![0.0; columns];
        for (at, (p, y)) in predicted.zip(self.truth).enumerate() {
            squares[at % columns] += (p - f64::from(*y)).powi(2);
        }
        let rows = (self.truth.len() / columns).max(1) as f64;
        let judged = self.deviations.iter().zip(&squares).filter(|(deviation, _)| **deviation > 0.0);
        let (sum, count) = judged.fold((0.0, 0), |(sum, count), (deviation, square)| {
            (sum + ((square / rows).sqrt() / deviation).min(WORST), count + 1)
        });
        if count > 0 { sum / f64::from(count) } else { 0.0 }
    }
}

/// Predictions and errors of candidates, the best first.
fn trials(
    grid: &Grid<'_>,
    judge: &Judge<'_>,
    candidates: &[Candidate],
    progress: Progress<'_>,
) -> Result<Vec<Trial>, ChooseError> {
    let mut trials = Vec::new();
    for (batch, part) in candidates.chunks(BATCH).enumerate() {
        report(progress, (batch * BATCH) as f64 / candidates.len() as f64)?;
        trials.par_extend(part.par_iter().filter_map(|candidate| {
            let predicted = grid.predictions(candidate)?;
            let error = judge.error(predicted.iter().map(|p| f64::from(*p)));
            Some(Trial { candidate: *candidate, predicted, error })
        }));
    }
    trials.sort_by(|a, b| a.error.total_cmp(&b.error));
    Ok(trials)
}

pub(super) fn choose(grid: &Grid<'_>, progress: Progress<'_>) -> Result<Chosen, ChooseError> {
    let judge = Judge::new(&grid.truth, grid.outputs * grid.marks());
    let candidates = grid.constant();
    let mut constant = trials(grid, &judge, &candidates, &mut |f| progress(0.4 * f))?;
    let best: Vec<Candidate> = constant.iter().map(|trial| trial.candidate).collect();
    let candidates = Grid::learning(&best);
    let compared = best.len() + candidates.len();
    constant.truncate(SHORTLIST);
    limit(grid, &mut constant);
    let mut learning = trials(grid, &judge, &candidates, &mut |f| progress(0.4 + 0.5 * f))?;
    learning.truncate(SHORTLIST);
    limit(grid, &mut learning);
    let constant: Vec<&Trial> = constant.iter().collect();
    let mut all: Vec<&Trial> = constant.iter().copied().chain(&learning).collect();
    all.sort_by(|a, b| a.error.total_cmp(&b.error));
    all.truncate(SHORTLIST);
    let best_error = all.first().ok_or(ChooseError::Singular)?.error;
    let (votes, error) = select(&judge, &all);
    report(progress, 0.95)?;
    let (constant_votes, constant_error) = select(&judge, &constant);
    let fitted = |with: &dyn Fn(usize) -> bool| -> Result<Committee, ChooseError> {
        let members = |trials: &[&Trial], votes: &[u32]| -> Result<Vec<Member>, ChooseError> {
            let chosen = trials.iter().zip(votes).filter(|(_, votes)| **votes > 0);
            let member = |(trial, votes): (&&Trial, &u32)| member(grid, &trial.candidate, *votes, with);
            chosen.map(|pair| member(pair).ok_or(ChooseError::Singular)).collect()
        };
        let committee = Committee::new(members(&all, &votes)?)?;
        Ok(committee.with_constant(members(&constant, &constant_votes)?)?)
    };
    let (committee, before_refit) = (fitted(&|_| true)?, fitted(&|fold| grid.is_training(fold))?);
    Ok(Chosen { committee, before_refit, candidates: compared, error, constant_error, best_error })
}

/// Limits predictions to one range beyond the range of each output.
fn limit(grid: &Grid<'_>, trials: &mut [Trial]) {
    let limits = grid.limits(1.0);
    for (at, p) in trials.iter_mut().flat_map(|trial| trial.predicted.iter_mut().enumerate()) {
        let (low, high) = limits[at % grid.outputs];
        #[expect(clippy::cast_possible_truncation, reason = "single precision suffices for the choice")]
        let limited = p.clamp(low as f32, high as f32);
        *p = limited;
    }
}

/// Votes of candidates, chosen with replacement, and the error of their mean.
fn select(judge: &Judge<'_>, trials: &[&Trial]) -> (Vec<u32>, f64) {
    let mut sum = vec![0.0f64; judge.truth.len()];
    let mut votes = vec![0; trials.len()];
    let mut error = f64::INFINITY;
    for round in 0..VOTES {
        let share = 1.0 / f64::from(round + 1);
        let with = |trial: &&Trial| {
            judge.error(sum.iter().zip(&trial.predicted).map(|(s, p)| share * (s + f64::from(*p))))
        };
        let errors: Vec<f64> = trials.par_iter().map(with).collect();
        let Some(best) = (0..trials.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b])) else { break };
        error = errors[best];
        votes[best] += 1;
        sum.iter_mut().zip(&trials[best].predicted).for_each(|(sum, p)| *sum += f64::from(*p));
    }
    (votes, error)
}

/// A member, fitted on the folds that `with` admits.
fn member(
    grid: &Grid<'_>,
    candidate: &Candidate,
    votes: u32,
    with: &dyn Fn(usize) -> bool,
) -> Option<Member> {
    let of = &grid.regressions[candidate.regression];
    let fit = grid.fit(candidate, with)?;
    let prior = candidate.information.map(|information| {
        let mut r_factor = fit.r_factor;
        for row in r_factor.chunks_exact_mut(of.terms.len()) {
            row.iter_mut().zip(&fit.scale).for_each(|(r, s)| *r *= s);
        }
        Prior { averaging: of.averaging, information, r_factor }
    });
    Some(Member { equations: of.equations(fit.coefficients).ok()?, votes, prior })
}
