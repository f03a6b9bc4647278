//! Hidden actuator states and regime switches, found by what they leave of the residual.
//!
//! A time constant, or the centre and slope of a gate, changes the columns of the regression. For each value
//! the coefficients are least squares, so that the residual is a function of these few numbers alone
//! (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413). It is scanned coarsely, then
//! minimised. The measure is `J = sum_i ln rms_i` over the equations' residuals: the log-likelihood for each
//! row, with noise of unknown size in each equation.
//!
//! What is found here is a proposal. Whether it predicts better is for rollouts to say.

use hydroid_core::model::sparse::{Real, Signal};
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
/// Longest time constant that is tried, in windows of the regression.
const LONGEST: f64 = 2.5;
/// Time constants tried, but one.
const TIMES: u8 = 7;
/// Slopes tried, over the width of the output's range.
const SLOPES: [f64; 3] = [6.0, 20.0, 60.0];
/// Share of the samples at the starts of runs that may be left out for lags to warm up; bounds what time
/// constants can be found in short runs.
const WARM_UP: f64 = 0.1;

/// Steps of the search at the most: each adds a gate, or lags.
const STEPS: usize = 4;

/// Structures to try beside the plain library, the simpler ones first.
///
/// Step by step, whatever lowers the cost most is added: a lag on an input, one on all inputs, or a gate.
/// A lag that was taken for want of a gate leaves again once the gate is there.
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
    let (some, all) = (thinned(runs, SCAN_SAMPLES), thinned(runs, REFINE_SAMPLES));
    let free = [*lags == Wanted::Found, *gate == Wanted::Found];
    let longest = LONGEST * regression.window() as f64 * first.dt;
    // What the shortest parts can bear; the fewer, longer parts of the refinement bear it too.
    let bearable = some.iter().map(Trajectory::len).sum::<usize>() as f64 / some.len() as f64;
    let longest = longest.min(WARM_UP * bearable * first.dt / Signal::SETTLING);
    let scan = Scan::new(&some, Variables::of(first), regression, longest, free);
    let fine = Scan::new(&all, Variables::of(first), regression, longest, free);
    let mut now = Structure::from(library.clone());
    if let Wanted::Given(lags) = lags {
        now.lags.clone_from(lags);
    }
    if let Wanted::Given(schedule) = gate {
        now.gate = Some(*schedule);
    }
    let mut structures = Vec::new();
    if now.parameters() > 0 {
        structures.push(now.clone());
    }
    for step in 0..STEPS {
        let Some(before) = scan.cost(&now) else { break };
        let Some((after, next)) = scan
            .steps(&now)
            .into_par_iter()
            .filter_map(|s| Some((scan.cost(&s)?, s)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
        else {
            break;
        };
        progress::report(progress, (step as f64 + 0.5) / STEPS as f64)?;
        if !scan.is_worth(before, after, scan.size(&next) - scan.size(&now)) {
            break;
        }
        now = fine.pruned(fine.refined(next));
        progress::report(progress, (step as f64 + 1.0) / STEPS as f64)?;
        if !structures.contains(&now) {
            structures.push(now.clone());
        }
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
    /// Whether lags and gate are looked for.
    free: [bool; 2],
    /// Weight 0 for the samples in which the longest lag warms up, 1 for the others. All structures are
    /// compared on the same rows: a cost that could choose its rows would invent lags that leave out what does
    /// not fit.
    weights: Vec<Vec<f64>>,
}

impl<'a> Scan<'a> {
    fn new(
        runs: &'a [Trajectory],
        variables: Variables,
        regression: Regression,
        longest: f64,
        free: [bool; 2],
    ) -> Self {
        let slowest = Signal::Lag { input: 0, time_constant_s: Real(longest) };
        let weights = |run: &Trajectory| {
            let warm_up = if free[0] { slowest.warm_up(run.dt) } else { 0 };
            (0..run.len()).map(|k| if k < warm_up { 0.0 } else { 1.0 }).collect()
        };
        Self { runs, variables, regression, longest, free, weights: runs.iter().map(weights).collect() }
    }
}

impl Scan<'_> {
    /// `J`, or nothing where the regression cannot be made.
    fn cost(&self, structure: &Structure) -> Option<f64> {
        // Making the terms of a library of degree 60 takes more memory than there is.
        structure.check(&self.variables).ok()?;
        let signals = structure.signals(&self.variables);
        let runs: Vec<&Trajectory> = self.runs.iter().collect();
        let terms = structure.terms(&self.variables);
        let preparation = Preparation { signals: &signals, weights: &self.weights, ..Preparation::default() };
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

    /// Coefficients and parameters of a structure.
    fn size(&self, structure: &Structure) -> usize {
        structure.count(&self.variables) * self.variables.outputs().count() + structure.parameters()
    }

    /// Structures one step beyond another.
    fn steps(&self, now: &Structure) -> Vec<Structure> {
        let mut steps = Vec::new();
        if self.free[0] {
            steps.extend(self.lag_steps(now));
        }
        if self.free[1] && now.gate.is_none() {
            steps.extend(self.gate_steps(now));
        }
        steps
    }

    /// Inputs one by one, and all together, through a lag.
    fn lag_steps(&self, now: &Structure) -> Vec<Structure> {
        let commands = self.variables.inputs().map(|(_, kind)| kind).enumerate();
        // No actuator stands between the wind and the vessel.
        let commands = commands.filter(|(_, kind)| *kind != Kind::Wind).map(|(i, _)| i);
        let free: Vec<usize> = commands.filter(|i| now.lags.iter().all(|lag| lag.input != *i)).collect();
        let mut sets: Vec<Vec<usize>> = free.iter().map(|&i| vec![i]).collect();
        if free.len() > 1 {
            sets.push(free);
        }
        let shortest = self.runs.first().map_or(1.0, |run| run.dt);
        let time = |k: u8| shortest * (self.longest / shortest).powf(f64::from(k) / f64::from(TIMES));
        let with = |set: &[usize], k: u8| {
            let mut structure = now.clone();
            structure.lags.extend(set.iter().map(|&input| Lag { input, time_constant_s: time(k) }));
            structure
        };
        sets.iter().flat_map(|set| (0..=TIMES).map(move |k| with(set, k))).collect()
    }

    /// Gates on each output, at nine places and of three slopes.
    fn gate_steps(&self, now: &Structure) -> Vec<Structure> {
        let mut steps = Vec::new();
        for output in 0..self.variables.outputs().count() {
            let of_run = |run: &'_ Trajectory| run.outputs.column(output).collect::<Vec<f64>>();
            let mut values: Vec<f64> = self.runs.iter().flat_map(of_run).filter(|v| v.is_finite()).collect();
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
                for slope in SLOPES {
                    let schedule = Schedule::new(output, at(0.1 * f64::from(tenth)), slope / width);
                    steps.push(Structure { gate: Some(schedule), ..now.clone() });
                }
            }
        }
        steps
    }

    /// Without the lags that are not worth their parameters beside the rest.
    fn pruned(&self, mut structure: Structure) -> Structure {
        let mut index = 0;
        while self.free[0] && structure.gate.is_some() && index < structure.lags.len() {
            let mut fewer = structure.clone();
            fewer.lags.remove(index);
            let fewer = self.refined(fewer);
            match (self.cost(&fewer), self.cost(&structure)) {
                (Some(without), Some(with)) if !self.is_worth(without, with, 1) => structure = fewer,
                _ => index += 1,
            }
        }
        structure
    }

    /// The structure with its free parameters at the minimum of the cost: logarithms of the time constants,
    /// place of the gate in widths of its change, logarithm of its slope.
    fn refined(&self, structure: Structure) -> Structure {
        let [lags, gate] = self.free;
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
            let sensible = next.lags.iter().all(|lag| lag.time_constant_s <= self.longest)
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
