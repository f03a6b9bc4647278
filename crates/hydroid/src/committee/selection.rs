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

    /// Mean NRMSE over marks and outputs of `scale * predicted`.
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
    let limits = grid.limits(1.0);
    let judge = Judge::new(&grid.truth, grid.outputs * grid.marks());
    let constant = grid.constant();
    let mut all = trials(grid, &judge, &constant, &mut |f| progress(0.4 * f))?;
    let best: Vec<Candidate> = all.iter().map(|trial| trial.candidate).collect();
    let learning = Grid::learning(&best);
    all.truncate(SHORTLIST);
    all.extend(trials(grid, &judge, &learning, &mut |f| progress(0.4 + 0.5 * f))?);
    all.sort_by(|a, b| a.error.total_cmp(&b.error));
    all.truncate(SHORTLIST);
    let Some(best_error) = all.first().map(|trial| trial.error) else { return Err(ChooseError::Singular) };
    let outputs = grid.outputs;
    for trial in &mut all {
        for (at, p) in trial.predicted.iter_mut().enumerate() {
            let (low, high) = limits[at % outputs];
            #[expect(clippy::cast_possible_truncation, reason = "single precision suffices for the choice")]
            let limited = p.clamp(low as f32, high as f32);
            *p = limited;
        }
    }
    let mut sum = vec![0.0f64; grid.truth.len()];
    let mut votes = vec![0; all.len()];
    let mut error = best_error;
    for round in 0..VOTES {
        let share = 1.0 / f64::from(round + 1);
        let errors: Vec<f64> = all
            .par_iter()
            .map(|trial| {
                judge.error(sum.iter().zip(&trial.predicted).map(|(s, p)| share * (s + f64::from(*p))))
            })
            .collect();
        let Some(best) = (0..all.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b])) else { break };
        error = errors[best];
        votes[best] += 1;
        sum.iter_mut().zip(&all[best].predicted).for_each(|(sum, p)| *sum += f64::from(*p));
        report(progress, 0.9 + 0.1 * f64::from(round) / f64::from(VOTES))?;
    }
    let mut members = Vec::new();
    for (trial, votes) in all.iter().zip(votes).filter(|(_, votes)| *votes > 0) {
        members.push(member(grid, &trial.candidate, votes).ok_or(ChooseError::Singular)?);
    }
    Ok(Chosen {
        committee: Committee::new(members)?,
        candidates: constant.len() + learning.len(),
        error,
        best_error,
    })
}

/// A member, fitted on all folds.
fn member(grid: &Grid<'_>, candidate: &Candidate, votes: u32) -> Option<Member> {
    let of = &grid.regressions[candidate.regression];
    let fit = grid.fit(candidate, None)?;
    let prior = candidate.information.map(|information| {
        let mut r_factor = fit.r_factor;
        for row in r_factor.chunks_exact_mut(of.terms.len()) {
            row.iter_mut().zip(&fit.scale).for_each(|(r, s)| *r *= s);
        }
        Prior { averaging: of.averaging, information, r_factor }
    });
    Some(Member { equations: of.equations(fit.coefficients).ok()?, votes, prior })
}
