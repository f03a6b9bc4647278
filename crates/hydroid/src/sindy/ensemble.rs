//! Bootstrap ensemble of a fit: intervals and inclusion probabilities of the coefficients (bagging: Breiman, Machine
//! Learning 24 (1996) 123; ensemble `SINDy`: Fasel, Kutz, Brunton and Brunton, Proc. R. Soc. A 478 (2022) 20210904).
//!
//! Contiguous blocks of rows are drawn, because neighbouring rows are correlated (block bootstrap: Künsch, Ann.
//! Statist. 17 (1989) 1217). A block drawn `w` times has the weight `w`: its factor is multiplied by `sqrt(w)`.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::constraints::{Coefficient, ConstraintError, Sign};
use super::error::FitError;
use super::fit::LinearRegression;
use super::options::FitOptions;
use super::qr::QrFactor;
use crate::evaluate::quantile;

/// Options of the bootstrap.
#[derive(Clone, Debug, PartialEq)]
pub struct BootstrapOptions {
    /// Number of resamples.
    pub resamples: usize,
    /// Seed of all draws.
    pub seed: u64,
    /// Probability of withholding a term from a member, below 1; it reveals terms that substitute for each other.
    pub term_dropout: f64,
    /// Lower and upper quantile of the intervals.
    pub quantiles: (f64, f64),
}

impl Default for BootstrapOptions {
    fn default() -> Self {
        Self { resamples: 100, seed: 0, term_dropout: 0.0, quantiles: (0.05, 0.95) }
    }
}

/// Fits of all resamples and their statistics. All lists over coefficients are `outputs x terms`, in physical units.
#[derive(Clone, Debug, PartialEq)]
pub struct Ensemble {
    /// Coefficients of each member. Resamples on which the constraints are infeasible have no member.
    pub members: Vec<Vec<f64>>,
    /// Index of the resample of each member.
    pub draws: Vec<usize>,
    /// Share of the members with a non-zero coefficient, among those to which the term was offered.
    pub inclusion: Vec<f64>,
    /// Lower quantile of the non-zero values of a coefficient; zero if there are none.
    pub low: Vec<f64>,
    /// Upper quantile, likewise.
    pub high: Vec<f64>,
    /// Mean, likewise.
    pub mean: Vec<f64>,
    /// Median, likewise.
    pub median: Vec<f64>,
}

impl Ensemble {
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

    /// Adds the change by the refinement, `outputs x terms`, to every member; zero where it would violate a sign.
    ///
    /// The spread of the regression is kept. A Gauss-Newton covariance would omit the uncertainty of terms, lag and
    /// gate.
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

    /// Copies the equation of an output from another ensemble, whose term `j` is `places[j]`; only common members
    /// remain.
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
    /// Fits every resample. The result depends on the seed and not on the number of threads.
    ///
    /// # Errors
    /// If there are fewer than two groups, an option is out of range, or the constraints are infeasible on all
    /// resamples.
    pub fn ensemble(&self, options: &FitOptions, bootstrap: &BootstrapOptions) -> Result<Ensemble, FitError> {
        let setting = |text: &str| Err(FitError::Setting(text.to_owned()));
        let (low, high) = bootstrap.quantiles;
        if self.groups().len() < 2 {
            return setting("an ensemble draws from groups of rows: prepare the regression with two or more");
        }
        if bootstrap.resamples == 0 {
            return setting("the ensemble needs at least one resample");
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
                // An input that rarely moves may be constant in some resamples; equalities on it are infeasible there.
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

    /// Draws as many groups as there are, with replacement; terms that are not offered become zero.
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
