//! How sure the coefficients are: the same fit on many results samples of the data (bootstrap: Breiman, Machine
//! Learning 24 (1996) 123; for sparse equations Fasel, Kutz, Brunton, Brunton, Proc. R. Soc. A 478 (2022)).
//!
//! Rows that are neighbours in time share their noise and the state of the vessel; results one by one they
//! would promise far too much. So contiguous groups of rows are results (block bootstrap: Kuensch, Ann. Statist. 17
//! (1989) 1217). A group results `w` times enters with weight `w`, its qr times `sqrt(w)`: the runs are
//! not read again.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::constraints::{Coefficient, ConstraintError, Sign};
use super::error::FitError;
use super::fit::LinearRegression;
use super::options::FitOptions;
use super::qr::QrFactor;
use crate::evaluate::quantile;

/// How an ensemble is results.
#[derive(Clone, Debug, PartialEq)]
pub struct BootstrapOptions {
    /// Number of members.
    pub resamples: usize,
    /// Seed of all draws.
    pub seed: u64,
    /// Probability with which a member goes without a term, below 1: terms that stand in for others show.
    pub term_dropout: f64,
    /// Lower and upper quantile of the intervals.
    pub quantiles: (f64, f64),
}

impl Default for BootstrapOptions {
    fn default() -> Self {
        Self { resamples: 100, seed: 0, term_dropout: 0.0, quantiles: (0.05, 0.95) }
    }
}

/// Many fits and what they have in common. All lists over coefficients are `outputs x terms`; coefficients
/// are in physical units.
#[derive(Clone, Debug, PartialEq)]
pub struct Ensemble {
    /// Coefficients of each member. There are fewer than were asked for where the constraints cannot be kept on some
    /// draws.
    pub members: Vec<Vec<f64>>,
    /// The draw that each member was fitted to, counted from 0.
    pub draws: Vec<usize>,
    /// Share of the members that have a term, among those to which it was offered.
    pub inclusion: Vec<f64>,
    /// Lower quantile of a coefficient among the members that have it; zero where none has.
    pub low: Vec<f64>,
    /// Upper quantile, likewise.
    pub high: Vec<f64>,
    /// Mean, likewise.
    pub mean: Vec<f64>,
    /// Median, likewise.
    pub median: Vec<f64>,
}

impl Ensemble {
    /// An ensemble of so many members without terms.
    pub(super) fn zero(members: usize, outputs: usize, terms: usize) -> Self {
        let zeros = || vec![0.0; outputs * terms];
        Self {
            members: vec![zeros(); members],
            draws: (0..members).collect(),
            inclusion: zeros(),
            low: zeros(),
            high: zeros(),
            mean: zeros(),
            median: zeros(),
        }
    }

    /// Moves every member by what refinement has shift the coefficients by, `outputs x terms`; a coefficient that would
    /// get a sign that it must not have is zero. How often a term was there remains what the selection has said.
    ///
    /// The spread stays the regression's, which is wider than that of refined coefficients. Draws of one Gauss-Newton step
    /// would be narrower, but too narrow: they know the noise, and neither the choice of terms nor the uncertainty of lag
    /// and gate.
    pub(super) fn shift(&mut self, by: &[f64], signs: &[(Coefficient, Sign)], terms: usize) {
        for member in &mut self.members {
            member.iter_mut().zip(by).for_each(|(x, by)| *x += by);
            for (at, sign) in signs {
                let x = &mut member[at.equation * terms + at.term];
                let allowed = if *sign == Sign::NotNegative { *x >= 0.0 } else { *x <= 0.0 };
                if !allowed {
                    *x = 0.0;
                }
            }
        }
        for list in [&mut self.low, &mut self.high, &mut self.mean, &mut self.median] {
            list.iter_mut().zip(&self.inclusion).zip(by).for_each(|((x, share), by)| {
                if *share > 0.0 {
                    *x += by;
                }
            });
        }
    }

    /// Takes the equation of one output from an ensemble over other terms: its term `j` is this one's term
    /// `places[j]`.
    ///
    /// Members that only one of the two has are dropped.
    pub(super) fn replace_equation(&mut self, output: usize, other: &Self, places: &[Option<usize>]) {
        let mut kept = self.draws.iter().map(|draw| other.draws.contains(draw));
        self.members.retain(|_| kept.next() == Some(true));
        self.draws.retain(|draw| other.draws.contains(draw));
        let common = other.draws.iter().zip(&other.members).filter(|(draw, _)| self.draws.contains(draw));
        let others: Vec<&Vec<f64>> = common.map(|(_, member)| member).collect();
        let Some(outputs) = other.low.len().checked_div(places.len()) else { return };
        let terms = self.low.len() / outputs.max(1);
        for (j, place) in places.iter().enumerate().filter_map(|(j, p)| Some((j, (*p)?))) {
            let (from, to) = (output * places.len() + j, output * terms + place);
            for (own, other) in self.members.iter_mut().zip(&others) {
                own[to] = other[from];
            }
            for (own, others) in [
                (&mut self.inclusion, &other.inclusion),
                (&mut self.low, &other.low),
                (&mut self.high, &other.high),
                (&mut self.mean, &other.mean),
                (&mut self.median, &other.median),
            ] {
                own[to] = others[from];
            }
        }
    }
}

impl LinearRegression {
    /// Fits every resample of an ensemble. The same seed gives the same numbers on any number of threads.
    ///
    /// # Errors
    /// If the regression was prepared without groups, a setting is out of its range, or no resample at all can be
    /// fitted under the constraints.
    pub fn ensemble(&self, options: &FitOptions, bootstrap: &BootstrapOptions) -> Result<Ensemble, FitError> {
        let setting = |text: &str| Err(FitError::Setting(text.to_owned()));
        let (low, high) = bootstrap.quantiles;
        if self.groups().len() < 2 {
            return setting("an ensemble draws from groups of rows: prepare the regression with two or more");
        }
        if bootstrap.resamples == 0 {
            return setting("an ensemble needs at least one resample");
        }
        if !(0.0..1.0).contains(&bootstrap.term_dropout) {
            return setting("the probability of leaving a term out is 0 or more and below 1");
        }
        if !(0.0 <= low && low <= high && high <= 1.0) {
            return setting("quantiles of an interval ascend between 0 and 1");
        }
        let results: Vec<Result<Resample, FitError>> = (0..bootstrap.resamples)
            .into_par_iter()
            .map(|resample| self.resample(options, bootstrap, resample))
            .collect();
        let (mut resamples, mut first_error) = (Vec::new(), None);
        for resample in results {
            match resample {
                Ok(resample) => resamples.push(resample),
                // An input that hardly ever moves is still in some draws, and no equality on it holds there.
                Err(FitError::Constraints(error @ ConstraintError::Contradiction { .. })) => {
                    first_error.get_or_insert(error);
                }
                Err(other) => return Err(other),
            }
        }
        match first_error {
            Some(error) if resamples.is_empty() => Err(error.into()),
            _ => Ok(summarise(resamples, self.outputs(), bootstrap.quantiles)),
        }
    }

    fn resample(
        &self,
        options: &FitOptions,
        bootstrap: &BootstrapOptions,
        resample: usize,
    ) -> Result<Resample, FitError> {
        let mut rng = ChaCha8Rng::seed_from_u64(bootstrap.seed);
        // A stream for each resample: its draws do not depend on who draws before.
        rng.set_stream(resample as u64);
        let offered: Vec<bool> =
            self.terms().iter().map(|_| !chance(&mut rng, bootstrap.term_dropout)).collect();
        let qr = self.draw(&mut rng, &offered);
        let solutions = self.solve(&qr, options)?;
        let coefficients = solutions
            .iter()
            .enumerate()
            .flat_map(|(i, s)| s.coefficients.iter().enumerate().map(move |(j, x)| x * self.unit(i, j)))
            .collect();
        Ok(Resample { draw: resample, coefficients, offered })
    }

    /// As many groups as there are, results with replacement; terms that are not offered are zero.
    fn draw(&self, rng: &mut ChaCha8Rng, offered: &[bool]) -> QrFactor {
        let groups = self.groups();
        let mut times = vec![0u32; groups.len()];
        for _ in groups {
            times[rng.random_range(0..groups.len())] += 1;
        }
        let width = groups[0].width();
        let mut total = QrFactor::new(width);
        for (group, &times) in groups.iter().zip(&times).filter(|(_, times)| **times > 0) {
            let weight = f64::from(times).sqrt();
            let kept = |j: usize| offered.get(j).copied().unwrap_or(true);
            let scale: Vec<f64> = (0..width).map(|j| if kept(j) { weight } else { 0.0 }).collect();
            total.merge(&group.scaled(&scale));
        }
        total
    }
}

fn chance(rng: &mut impl Rng, probability: f64) -> bool {
    rng.random::<f64>() < probability
}

struct Resample {
    draw: usize,
    coefficients: Vec<f64>,
    offered: Vec<bool>,
}

fn summarise(resamples: Vec<Resample>, outputs: usize, (low, high): (f64, f64)) -> Ensemble {
    let terms = resamples.first().map_or(0, |resample| resample.offered.len());
    let size = outputs * terms;
    let zeros = || vec![0.0; size];
    let mut ensemble = Ensemble {
        members: Vec::new(),
        draws: resamples.iter().map(|resample| resample.draw).collect(),
        inclusion: zeros(),
        low: zeros(),
        high: zeros(),
        mean: zeros(),
        median: zeros(),
    };
    for k in 0..size {
        let offered = resamples.iter().filter(|resample| resample.offered[k % terms]).count();
        let mut values: Vec<f64> =
            resamples.iter().map(|resample| resample.coefficients[k]).filter(|x| *x != 0.0).collect();
        if values.is_empty() {
            continue;
        }
        values.sort_by(f64::total_cmp);
        ensemble.inclusion[k] = values.len() as f64 / offered as f64;
        ensemble.low[k] = quantile(&values, low);
        ensemble.high[k] = quantile(&values, high);
        ensemble.median[k] = quantile(&values, 0.5);
        ensemble.mean[k] = values.iter().sum::<f64>() / values.len() as f64;
    }
    ensemble.members = resamples.into_iter().map(|resample| resample.coefficients).collect();
    ensemble
}
