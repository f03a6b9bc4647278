//! Hidden actuator states and regime switches, found by what they leave of the residual.
//!
//! A time constant, or the centre and slope of a gate, changes the columns of the regression. For each value
//! the coefficients are least squares, so that the residual is a function of these few numbers alone
//! (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413). It is scanned coarsely, then
//! minimised. The measure is `J = sum_i ln rms_i` over the equations' residuals: the log-likelihood for each
//! row, with noise of unknown size in each equation.
//!
//! What is found here is a proposal. Whether it predicts better is for rollouts to say.

use rayon::prelude::*;

use super::fit::Prepared;
use super::kernel::Regression;
use super::library::{Kind, Library, Variables};
use super::options::Preparation;
use super::simplex::{Stop, minimise};
use super::structure::{Lag, Schedule, Structure};
use crate::log::Trajectory;
use crate::progress::{self, Cancelled, Progress};

/// What is looked for.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Wanted<T> {
    /// Nothing.
    None,
    /// What the data show.
    #[default]
    Found,
    /// This.
    Given(T),
}

/// Samples that a scan reads; the final minimisation reads [`REFINE_SAMPLES`].
const SCAN_SAMPLES: usize = 12_000;
/// Samples that the final minimisation reads.
const REFINE_SAMPLES: usize = 60_000;
/// Length of the pieces that stand for runs that are longer together.
const PIECE: usize = 3_000;
/// A proposal lowers the residual of the equations by this share in the mean, at least.
const WORTH: f64 = 0.02;
/// Share of the samples that each mode of a gate must have.
const VISITED: f64 = 0.05;
/// A warm-up that takes more than this share of the samples away is not worth it.
const WARM_UP: f64 = 0.1;

/// Structures to try beside the plain library, the simpler ones first.
///
/// # Errors
/// If the work was interrupted.
pub fn discover(
    runs: &[&Trajectory],
    library: &Library,
    regression: Regression,
    lags: &Wanted<Vec<Lag>>,
    gate: &Wanted<Schedule>,
    progress: Progress<'_>,
) -> Result<Vec<Structure>, Cancelled> {
    let Some(first) = runs.first() else { return Ok(Vec::new()) };
    let scan = Scan {
        runs: &thinned(runs, SCAN_SAMPLES),
        variables: Variables::of(first),
        regression,
        longest: 0.25 * regression.window() as f64 * first.dt * 5.0,
    };
    let plain = Structure::from(library.clone());
    let Some(before) = scan.cost(&plain) else { return Ok(Vec::new()) };
    let mut structures = Vec::new();
    let with_lags = match lags {
        Wanted::None => None,
        Wanted::Given(lags) => Some(Structure { lags: lags.clone(), ..plain.clone() }),
        Wanted::Found => scan.lags(&plain, before, &mut |f| progress(0.3 * f))?,
    };
    let base = with_lags.clone().unwrap_or_else(|| plain.clone());
    let mut with_gate = match gate {
        Wanted::None => None,
        Wanted::Given(schedule) => Some(Structure { gate: Some(*schedule), ..base.clone() }),
        Wanted::Found => scan.gate(&base, &mut |f| progress(0.3 + 0.3 * f))?,
    };
    // Equations of one mode that are asked to fit two show lags that no actuator has. With the modes apart the
    // lags are looked for once more, from none.
    if let Some(structure) = &mut with_gate
        && *lags == Wanted::Found
    {
        let without = Structure { lags: Vec::new(), ..structure.clone() };
        if let Some(before) = scan.cost(&without) {
            let again = scan.lags(&without, before, &mut |f| progress(0.6 + 0.2 * f))?;
            *structure = again.unwrap_or(without);
        }
    }
    let all = thinned(runs, REFINE_SAMPLES);
    let fine = Scan { runs: &all, ..scan };
    let found = [with_lags, with_gate];
    for (index, structure) in found.into_iter().enumerate().filter_map(|(i, s)| Some((i, s?))) {
        let free = [*lags == Wanted::Found, *gate == Wanted::Found];
        let refined = fine.refined(structure, free);
        structures.push(if free[0] { fine.without_idle_lags(refined) } else { refined });
        progress::report(progress, 0.85 + 0.15 * index as f64)?;
    }
    Ok(structures)
}

/// What costs are computed from.
struct Scan<'a> {
    runs: &'a [Trajectory],
    variables: Variables,
    regression: Regression,
    /// Longest time constant tried \[s\].
    longest: f64,
}

impl Scan<'_> {
    /// `J`, or nothing where the regression cannot be made or a warm-up takes too much of the runs.
    fn cost(&self, structure: &Structure) -> Option<f64> {
        let signals = structure.signals(&self.variables);
        let dt = self.runs.first()?.dt;
        let warm_up = signals.iter().map(|s| s.warm_up(dt)).max().unwrap_or(0);
        let total: usize = self.runs.iter().map(Trajectory::len).sum();
        let lost: usize = self.runs.iter().map(|run| warm_up.min(run.len())).sum();
        if lost as f64 > WARM_UP * total as f64 {
            return None;
        }
        let runs: Vec<&Trajectory> = self.runs.iter().collect();
        let terms = structure.terms(&self.variables);
        let preparation = Preparation { signals: &signals, ..Preparation::default() };
        let prepared = Prepared::with(&runs, terms, self.regression, &preparation).ok()?;
        Some(prepared.least_squares_rms().iter().map(|rms| rms.ln()).sum())
    }

    /// Whether a cost is worth the added terms and parameters: by the Bayesian information criterion on the
    /// independent windows there are, and by an effect that matters.
    fn is_worth(&self, before: f64, after: f64, added: usize) -> bool {
        let samples: usize = self.runs.iter().map(Trajectory::len).sum();
        let windows = (samples as f64 / self.regression.window() as f64).max(2.0);
        let outputs = self.variables.outputs().count() as f64;
        let gain = before - after;
        gain > WORTH * outputs && windows * gain > 0.5 * added as f64 * windows.ln()
    }

    /// Inputs one by one, and all together, through a lag; the best stays, and others may follow.
    fn lags(
        &self,
        plain: &Structure,
        before: f64,
        progress: Progress<'_>,
    ) -> Result<Option<Structure>, Cancelled> {
        let commands = self.variables.inputs().map(|(_, kind)| kind).enumerate();
        // No actuator stands between the wind and the vessel.
        let inputs: Vec<usize> = commands.filter(|(_, kind)| *kind != Kind::Wind).map(|(i, _)| i).collect();
        let shortest = self.runs[0].dt;
        let steps = 7;
        let times: Vec<f64> = (0..=steps)
            .map(|k| shortest * (self.longest / shortest).powf(f64::from(k) / f64::from(steps)))
            .collect();
        let mut best = (before, plain.clone());
        loop {
            let free: Vec<usize> =
                inputs.iter().copied().filter(|i| best.1.lags.iter().all(|lag| lag.input != *i)).collect();
            let mut sets: Vec<Vec<usize>> = free.iter().map(|&i| vec![i]).collect();
            if free.len() > 1 {
                sets.push(free);
            }
            let tries: Vec<(f64, Structure)> = sets
                .iter()
                .flat_map(|set| times.iter().map(move |&t| (set, t)))
                .collect::<Vec<_>>()
                .into_par_iter()
                .filter_map(|(set, time_constant_s)| {
                    let mut structure = best.1.clone();
                    structure.lags.extend(set.iter().map(|&input| Lag { input, time_constant_s }));
                    Some((self.cost(&structure)?, structure))
                })
                .collect();
            progress::report(progress, best.1.lags.len() as f64 / (1 + inputs.len()) as f64)?;
            let Some(next) = tries.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            let added = next.1.lags.len() - best.1.lags.len();
            if !self.is_worth(best.0, next.0, added) {
                break;
            }
            best = next;
        }
        Ok((!best.1.lags.is_empty()).then_some(best.1))
    }

    /// The structure without the lags that, now that all is at its best, are worth nothing, or are so short
    /// that no sample shows them.
    fn without_idle_lags(&self, mut structure: Structure) -> Structure {
        let shortest = 0.5 * self.runs.first().map_or(0.0, |run| run.dt);
        for position in (0..structure.lags.len()).rev() {
            let mut without = structure.clone();
            let lag = without.lags.remove(position);
            let worth = self
                .cost(&without)
                .zip(self.cost(&structure))
                .is_some_and(|(before, after)| self.is_worth(before, after, 1));
            if lag.time_constant_s < shortest || !worth {
                structure = without;
            }
        }
        structure
    }

    /// Gates on each output, at nine places and of three slopes.
    fn gate(&self, base: &Structure, progress: Progress<'_>) -> Result<Option<Structure>, Cancelled> {
        let Some(before) = self.cost(base) else { return Ok(None) };
        let mut tries = Vec::new();
        for output in 0..self.variables.outputs().count() {
            let mut values: Vec<f64> = self
                .runs
                .iter()
                .flat_map(|run| run.outputs.column(output))
                .filter(|v| v.is_finite())
                .collect();
            values.sort_unstable_by(f64::total_cmp);
            let Some(last) = values.len().checked_sub(1) else { continue };
            let at = |share: f64| {
                // An index below the length.
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                let index = (share * last as f64) as usize;
                values[index.min(last)]
            };
            let width = at(0.975) - at(0.025);
            if width <= 0.0 {
                continue;
            }
            for tenth in 1..10 {
                for slope in [6.0, 20.0, 60.0] {
                    tries.push(Schedule::new(output, at(0.1 * f64::from(tenth)), slope / width));
                }
            }
        }
        progress::report(progress, 0.1)?;
        let best = tries
            .into_par_iter()
            .filter_map(|schedule| {
                let structure = Structure { gate: Some(schedule), ..base.clone() };
                Some((self.cost(&structure)?, structure))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0));
        progress::report(progress, 1.0)?;
        let Some((after, structure)) = best else { return Ok(None) };
        let added = base.count(&self.variables) * self.variables.outputs().count() + 2;
        Ok(self.is_worth(before, after, added).then_some(structure))
    }

    /// The structure with its free parameters at the minimum of the cost: logarithms of the time constants,
    /// place of the gate in widths of its change, logarithm of its slope.
    fn refined(&self, structure: Structure, [lags, gate]: [bool; 2]) -> Structure {
        let mut start: Vec<f64> = Vec::new();
        if lags {
            start.extend(structure.lags.iter().map(|lag| lag.time_constant_s.ln()));
        }
        if gate && let Some(schedule) = structure.gate {
            start.extend([0.0, schedule.gate.slope.0.ln()]);
        }
        let made = |x: &[f64]| {
            let mut next = structure.clone();
            let mut x = x.iter();
            if lags {
                for (lag, ln) in next.lags.iter_mut().zip(&mut x) {
                    lag.time_constant_s = ln.exp();
                }
            }
            if gate && let (Some(schedule), Some(shift), Some(ln)) = (structure.gate, x.next(), x.next()) {
                let centre = schedule.gate.centre.0 + shift / schedule.gate.slope.0;
                next.gate = Some(Schedule::new(schedule.output, centre, ln.exp()));
            }
            next
        };
        let cost = |x: &[f64]| {
            let next = made(x);
            let sensible = next.lags.iter().all(|lag| lag.time_constant_s < 4.0 * self.longest)
                && next.gate.is_none_or(|schedule| {
                    (VISITED..=1.0 - VISITED).contains(&schedule.share_above(self.runs.iter()))
                });
            if sensible { self.cost(&next).unwrap_or(f64::INFINITY) } else { f64::INFINITY }
        };
        let edges = vec![0.5; start.len()];
        let stop = Stop { spread: 1e-6, evaluations: 80 };
        let (x, cost) = minimise(cost, &start, &edges, stop);
        if cost.is_finite() { made(&x) } else { structure }
    }
}

/// The runs, or evenly spread pieces of them where they are longer together than `most` samples.
fn thinned(runs: &[&Trajectory], most: usize) -> Vec<Trajectory> {
    let total: usize = runs.iter().map(|run| run.len()).sum();
    if total <= most {
        return runs.iter().map(|&run| run.clone()).collect();
    }
    let every = total.div_ceil(most);
    let pieces = runs.iter().flat_map(|run| {
        (0..run.len()).step_by(PIECE).map(move |from| (run, from, (from + PIECE).min(run.len())))
    });
    pieces.step_by(every).map(|(run, from, to)| run.slice(from, to)).collect()
}
