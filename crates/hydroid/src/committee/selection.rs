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

/// A candidate with its predictions on the folds that were left out.
struct Trial {
    candidate: Candidate,
    predicted: Vec<f32>,
}

/// Result of a selection of members.
struct Ballot {
    members: Vec<(Candidate, u32)>,
    /// Error of the mean prediction of the members.
    error: f64,
    /// Error of the best single candidate.
    best_error: f64,
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

    fn error_of(&self, predicted: &[f32]) -> f64 {
        self.error(predicted.iter().map(|p| f64::from(*p)))
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

/// Predictions of candidates, in their order; without those that cannot be fitted.
fn trials(
    grid: &Grid<'_>,
    candidates: &[Candidate],
    progress: Progress<'_>,
) -> Result<Vec<Trial>, ChooseError> {
    let mut trials = Vec::new();
    for (batch, part) in candidates.chunks(BATCH).enumerate() {
        report(progress, (batch * BATCH) as f64 / candidates.len() as f64)?;
        trials.par_extend(part.par_iter().filter_map(|candidate| {
            Some(Trial { candidate: *candidate, predicted: grid.predictions(candidate)? })
        }));
    }
    Ok(trials)
}

pub(super) fn choose(grid: &Grid<'_>, progress: Progress<'_>) -> Result<Chosen, ChooseError> {
    let mut all = trials(grid, &grid.constant(), &mut |f| progress(0.4 * f))?;
    let constant = all.len();
    let best: Vec<Candidate> = {
        let judge = Judge::new(&grid.truth, grid.outputs * grid.marks());
        let errors: Vec<f64> = all.par_iter().map(|trial| judge.error_of(&trial.predicted)).collect();
        order(&errors).into_iter().map(|i| all[i].candidate).collect()
    };
    let learning = Grid::learning(&best);
    let compared = best.len() + learning.len();
    all.extend(trials(grid, &learning, &mut |f| progress(0.4 + 0.5 * f))?);
    let committee = |without: Option<usize>, with: &dyn Fn(usize) -> bool| {
        let fitted = |ballot: &Ballot| -> Result<Vec<Member>, ChooseError> {
            let member = |(candidate, votes): &(Candidate, u32)| {
                member(grid, candidate, *votes, with).ok_or(ChooseError::Singular)
            };
            ballot.members.iter().map(member).collect()
        };
        let (ballot, frozen) = (ballot(grid, &all, without)?, ballot(grid, &all[..constant], without)?);
        let committee = Committee::new(fitted(&ballot)?)?.with_constant(fitted(&frozen)?)?;
        let committee = committee.with_ranges(grid.ranges_of(with))?;
        Ok::<_, ChooseError>((committee, ballot, frozen))
    };
    report(progress, 0.9)?;
    let (chosen, ballot, frozen) = committee(None, &|_| true)?;
    let (before_refit, ..) = committee(None, &|fold| grid.is_training(fold))?;
    let mut left_out = Vec::new();
    for fold in 0..grid.folds() {
        report(progress, 0.92 + 0.08 * fold as f64 / grid.folds() as f64)?;
        left_out.push(committee(Some(fold), &|other| other != fold)?.0);
    }
    Ok(Chosen {
        committee: chosen,
        before_refit,
        left_out,
        candidates: compared,
        error: ballot.error,
        constant_error: frozen.error,
        best_error: ballot.best_error,
    })
}

/// Indices in ascending order of the errors.
fn order(errors: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..errors.len()).collect();
    order.sort_by(|&a, &b| errors[a].total_cmp(&errors[b]));
    order
}

/// Selects members by their predictions on all folds but `without`.
fn ballot(grid: &Grid<'_>, trials: &[Trial], without: Option<usize>) -> Result<Ballot, ChooseError> {
    let columns = grid.outputs * grid.marks();
    let rows = grid.windows_outside(without);
    let pick = |values: &[f32]| -> Vec<f32> {
        rows.iter().flat_map(|row| &values[row * columns..(row + 1) * columns]).copied().collect()
    };
    let truth = pick(&grid.truth);
    let judge = Judge::new(&truth, columns);
    let errors: Vec<f64> = trials.par_iter().map(|trial| judge.error_of(&pick(&trial.predicted))).collect();
    let shortlist: Vec<usize> = order(&errors).into_iter().take(SHORTLIST).collect();
    let best_error = shortlist.first().map(|&i| errors[i]).ok_or(ChooseError::Singular)?;
    let predicted: Vec<Vec<f32>> = shortlist.iter().map(|&i| pick(&trials[i].predicted)).collect();
    let (votes, error) = select(&judge, &predicted);
    let members = shortlist.iter().zip(votes).filter(|(_, votes)| *votes > 0);
    let members = members.map(|(&i, votes)| (trials[i].candidate, votes)).collect();
    Ok(Ballot { members, error, best_error })
}

/// Votes of predictions, chosen with replacement, and the error of their mean.
fn select(judge: &Judge<'_>, predicted: &[Vec<f32>]) -> (Vec<u32>, f64) {
    let mut sum = vec![0.0f64; judge.truth.len()];
    let mut votes = vec![0; predicted.len()];
    let mut error = f64::INFINITY;
    for round in 0..VOTES {
        let share = 1.0 / f64::from(round + 1);
        let with = |predicted: &Vec<f32>| {
            judge.error(sum.iter().zip(predicted).map(|(s, p)| share * (s + f64::from(*p))))
        };
        let errors: Vec<f64> = predicted.par_iter().map(with).collect();
        let Some(best) = (0..predicted.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b])) else { break };
        error = errors[best];
        votes[best] += 1;
        sum.iter_mut().zip(&predicted[best]).for_each(|(sum, p)| *sum += f64::from(*p));
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
