//! Search for actuator lags and gates by the residual of the regression.
//!
//! A time constant, or the centre and slope of a gate, changes the columns of the regression. For given values the
//! coefficients follow by least squares (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413).
//! The search evaluates a coarse grid and then minimises the cost `J = sum_i ln rms_i` over the residuals of all
//! equations: the negative log-likelihood per row under noise of unknown variance in each equation.
//!
//! The result is a list of proposals for rollouts.

use hydroid_core::model::sparse::{Real, Signal};
use rayon::prelude::*;

use super::fit::LinearRegression;
use super::library::{Library, VariableKind, Variables};
use super::nelder_mead::{NelderMeadOptions, nelder_mead};
use super::options::RegressionOptions;
use super::regression_form::RegressionForm;
use super::structure::{GateSpec, Lag, Structure};
use crate::log::Trajectory;
use crate::progress::{self, Cancelled, Progress};

/// A part of the structure (lags, gate) and how it is determined.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum StructureSpec<T> {
    /// The structure has none.
    Absent,
    /// The data decide.
    #[default]
    Search,
    /// The given value, unchanged.
    Fixed(T),
}

const SCAN_SAMPLES: usize = 12_000;
const REFINE_SAMPLES: usize = 60_000;
/// Length of the segments that represent longer runs \[samples\].
const SEGMENT_SAMPLES: usize = 3_000;
/// Smallest mean relative decrease of the residuals of the equations that justifies a proposal.
const MIN_GAIN: f64 = 0.02;
const MIN_MODE_SHARE: f64 = 0.05;
/// Longest time constant of the grid, in windows of the regression.
const MAX_TIME_CONSTANT: f64 = 2.5;
const TIME_CONSTANTS: u8 = 7;
/// Slopes of the grid, relative to the inverse width of the range of the output.
const SLOPES: [f64; 3] = [6.0, 20.0, 60.0];
/// Largest share of a run for the warm-up of a lag; it limits the time constants in short runs.
const MAX_WARM_UP_SHARE: f64 = 0.1;

const MAX_STEPS: usize = 4;

/// Structures to try besides the plain library, the simpler ones first.
///
/// Greedy forward search: each step adds the extension with the lowest cost (a lag on one input, lags on all inputs, or
/// a gate). Once a gate is present, lags that no longer improve the cost are removed.
///
/// # Errors
/// If the work was interrupted.
pub(crate) fn structure_search(
    runs: &[&Trajectory],
    library: &Library,
    regression: RegressionForm,
    lags: &StructureSpec<Vec<Lag>>,
    gate: &StructureSpec<GateSpec>,
    progress: Progress<'_>,
) -> Result<Vec<Structure>, Cancelled> {
    let Some(first) = runs.first() else { return Ok(Vec::new()) };
    let of = |most: usize| subsample(runs, most, SEGMENT_SAMPLES);
    let (some, all) = (of(SCAN_SAMPLES), of(REFINE_SAMPLES));
    let free = [*lags == StructureSpec::Search, *gate == StructureSpec::Search];
    let max_time_constant = MAX_TIME_CONSTANT * regression.window() as f64 * first.dt;
    let mean_length = some.iter().map(Trajectory::len).sum::<usize>() as f64 / some.len() as f64;
    let max_time_constant =
        max_time_constant.min(MAX_WARM_UP_SHARE * mean_length * first.dt / Signal::SETTLING);
    let scan = StructureCost::new(&some, Variables::of(first), regression, max_time_constant, free);
    let fine = StructureCost::new(&all, Variables::of(first), regression, max_time_constant, free);
    let mut current = Structure::from(library.clone());
    if let StructureSpec::Fixed(lags) = lags {
        current.lags.clone_from(lags);
    }
    if let StructureSpec::Fixed(gate) = gate {
        current.gate = Some(*gate);
    }
    let mut structures = Vec::new();
    if current.parameters() > 0 {
        structures.push(current.clone());
    }
    for step in 0..MAX_STEPS {
        let Some(before) = scan.cost(&current) else { break };
        let Some((after, next)) = scan
            .extensions(&current)
            .into_par_iter()
            .filter_map(|s| Some((scan.cost(&s)?, s)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
        else {
            break;
        };
        progress::report(progress, (step as f64 + 0.5) / MAX_STEPS as f64)?;
        if !scan.is_significant(before, after, scan.size(&next) - scan.size(&current)) {
            break;
        }
        current = fine.without_redundant_lags(fine.optimised(next));
        progress::report(progress, (step as f64 + 1.0) / MAX_STEPS as f64)?;
        if !structures.contains(&current) {
            structures.push(current.clone());
        }
    }
    Ok(structures)
}

struct StructureCost<'a> {
    runs: &'a [Trajectory],
    variables: Variables,
    regression: RegressionForm,
    /// Longest time constant \[s\].
    max_time_constant: f64,
    /// Whether lags and gate are searched for.
    free: [bool; 2],
    /// Weight 0 in the warm-up of the longest lag, so that all structures are compared on the same rows.
    weights: Vec<Vec<f64>>,
}

impl<'a> StructureCost<'a> {
    fn new(
        runs: &'a [Trajectory],
        variables: Variables,
        regression: RegressionForm,
        max_time_constant: f64,
        free: [bool; 2],
    ) -> Self {
        let slowest = Signal::Lag { input: 0, time_constant_s: Real(max_time_constant) };
        let weights = |run: &Trajectory| {
            let warm_up = if free[0] { slowest.warm_up(run.dt) } else { 0 };
            (0..run.len()).map(|k| if k < warm_up { 0.0 } else { 1.0 }).collect()
        };
        Self {
            runs,
            variables,
            regression,
            max_time_constant,
            free,
            weights: runs.iter().map(weights).collect(),
        }
    }
}

impl StructureCost<'_> {
    /// The cost `J`; none if the regression cannot be assembled.
    fn cost(&self, structure: &Structure) -> Option<f64> {
        // Checked before the terms of a large library are made.
        structure.check_size(&self.variables).ok()?;
        let signals = structure.signals(&self.variables);
        let runs: Vec<&Trajectory> = self.runs.iter().collect();
        let terms = structure.terms(&self.variables);
        let preparation =
            RegressionOptions { signals: &signals, weights: &self.weights, ..RegressionOptions::default() };
        let prepared = LinearRegression::with(&runs, terms, self.regression, &preparation).ok()?;
        Some(prepared.least_squares_rms().iter().map(|rms| rms.ln()).sum())
    }

    /// Whether a lower cost justifies `added` parameters: by the BIC on independent windows, and a minimum effect.
    fn is_significant(&self, before: f64, after: f64, added: usize) -> bool {
        let samples: usize = self.runs.iter().map(Trajectory::len).sum();
        let windows = (samples as f64 / self.regression.window() as f64).max(2.0);
        let outputs = self.variables.outputs().count() as f64;
        let gain = before - after;
        gain > MIN_GAIN * outputs && windows * gain > 0.5 * added as f64 * windows.ln()
    }

    fn size(&self, structure: &Structure) -> usize {
        structure.count(&self.variables) * self.variables.outputs().count() + structure.parameters()
    }

    fn extensions(&self, current: &Structure) -> Vec<Structure> {
        let mut extensions = Vec::new();
        if self.free[0] {
            extensions.extend(self.lag_extensions(current));
        }
        if self.free[1] && current.gate.is_none() {
            extensions.extend(self.gate_extensions(current));
        }
        extensions
    }

    fn lag_extensions(&self, current: &Structure) -> Vec<Structure> {
        let commands = self.variables.inputs().map(|(_, kind)| kind).enumerate();
        // Wind has no actuator.
        let commands = commands.filter(|(_, kind)| *kind != VariableKind::Wind).map(|(i, _)| i);
        let free: Vec<usize> = commands.filter(|i| current.lags.iter().all(|lag| lag.input != *i)).collect();
        let mut sets: Vec<Vec<usize>> = free.iter().map(|&i| vec![i]).collect();
        if free.len() > 1 {
            sets.push(free);
        }
        let shortest = self.runs.first().map_or(1.0, |run| run.dt);
        let time = |k: u8| {
            shortest * (self.max_time_constant / shortest).powf(f64::from(k) / f64::from(TIME_CONSTANTS))
        };
        let with = |set: &[usize], k: u8| {
            let mut structure = current.clone();
            structure.lags.extend(set.iter().map(|&input| Lag { input, time_constant_s: time(k) }));
            structure
        };
        sets.iter().flat_map(|set| (0..=TIME_CONSTANTS).map(move |k| with(set, k))).collect()
    }

    fn gate_extensions(&self, current: &Structure) -> Vec<Structure> {
        let mut extensions = Vec::new();
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
                    let gate = GateSpec::new(output, at(0.1 * f64::from(tenth)), slope / width);
                    extensions.push(Structure { gate: Some(gate), ..current.clone() });
                }
            }
        }
        extensions
    }

    /// The structure without the lags that are not significant beside the gate.
    fn without_redundant_lags(&self, mut structure: Structure) -> Structure {
        let mut index = 0;
        while self.free[0] && structure.gate.is_some() && index < structure.lags.len() {
            let mut fewer = structure.clone();
            fewer.lags.remove(index);
            let fewer = self.optimised(fewer);
            match (self.cost(&fewer), self.cost(&structure)) {
                (Some(without), Some(with)) if !self.is_significant(without, with, 1) => structure = fewer,
                _ => index += 1,
            }
        }
        structure
    }

    /// The structure with its free parameters at the minimum of the cost. Parameters: logarithms of the time constants,
    /// centre of the gate relative to its width, logarithm of its slope.
    fn optimised(&self, structure: Structure) -> Structure {
        let [lags, gate] = self.free;
        let mut start: Vec<f64> = Vec::new();
        if lags {
            start.extend(structure.lags.iter().map(|lag| lag.time_constant_s.ln()));
        }
        if gate && let Some(gate) = structure.gate {
            start.extend([0.0, gate.gate.slope.0.ln()]);
        }
        let structure_at = |x: &[f64]| {
            let mut next = structure.clone();
            let mut x = x.iter();
            if lags {
                for (lag, ln) in next.lags.iter_mut().zip(&mut x) {
                    lag.time_constant_s = ln.exp();
                }
            }
            if gate && let (Some(gate), Some(shift), Some(ln)) = (structure.gate, x.next(), x.next()) {
                let centre = gate.gate.centre.0 + shift / gate.gate.slope.0;
                next.gate = Some(GateSpec::new(gate.output, centre, ln.exp()));
            }
            next
        };
        let cost = |x: &[f64]| {
            let next = structure_at(x);
            let admissible = next.lags.iter().all(|lag| lag.time_constant_s <= self.max_time_constant)
                && next.gate.is_none_or(|gate| {
                    (MIN_MODE_SHARE..=1.0 - MIN_MODE_SHARE).contains(&gate.upper_mode_share(self.runs.iter()))
                });
            if admissible { self.cost(&next).unwrap_or(f64::INFINITY) } else { f64::INFINITY }
        };
        let edges = vec![0.5; start.len()];
        let stop = NelderMeadOptions { spread: 1e-6, evaluations: 80 };
        let (x, cost) = nelder_mead(cost, &start, &edges, stop);
        if cost.is_finite() { structure_at(&x) } else { structure }
    }
}

/// The runs, or evenly spaced segments of them if they have more than `most` samples together.
pub(crate) fn subsample(runs: &[&Trajectory], most: usize, segment: usize) -> Vec<Trajectory> {
    let total: usize = runs.iter().map(|run| run.len()).sum();
    if total <= most {
        return runs.iter().map(|&run| run.clone()).collect();
    }
    let every = total.div_ceil(most);
    let pieces = runs.iter().flat_map(|run| {
        (0..run.len()).step_by(segment).map(move |from| (run, from, (from + segment).min(run.len())))
    });
    pieces.step_by(every).map(|(run, from, to)| run.slice(from, to)).collect()
}
