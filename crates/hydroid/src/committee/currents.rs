//! Currents of the training runs, estimated along with a model of the motion through the water.
//!
//! Each run has one current. For given currents, a ridge regression of difference equations in the velocities through the
//! water is linear in its coefficients; the currents minimize the errors of its rollouts over a window (variable
//! projection: G. H. Golub and V. Pereyra, *SIAM Journal on Numerical Analysis* 10 (1973) 413), by Gauss-Newton steps with
//! Huber weights.

use hydroid_core::current::in_body;
use hydroid_core::model::committee::Shape;
use rayon::prelude::*;

use super::folds::{Fold, Segment, folds};
use super::library::Library;
use super::regression::{Moments, Regression};
use super::ridge::{Fit, factorize, solve};
use super::rollouts::{Coefficients, predictions};
use crate::log::{Table, Trajectory};
use crate::progress::{self, Cancelled, Progress};
use crate::sindy::subsample;

/// Currents of runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Currents {
    /// North and east \[m/s\], for each run.
    pub of: Vec<[f64; 2]>,
    /// Variance north, covariance, variance east \[m^2/s^2\], for each run.
    pub covariance: Vec<[f64; 3]>,
    /// Cross-validated errors of the best regressions over ground and through the water: mean NRMSE of the outputs over a
    /// window. The currents of the runs that are left out are known here, so that the gain is an upper limit.
    pub errors: [f64; 2],
}

impl Currents {
    /// Root mean square of the components over all runs, their uncertainty included \[m/s\].
    pub fn deviation(&self) -> f64 {
        let squares: f64 = self.of.iter().flatten().map(|c| c * c).sum();
        let variances: f64 = self.covariance.iter().map(|[p, _, r]| p + r).sum();
        ((squares + variances) / (2 * self.of.len()) as f64).sqrt()
    }
}

/// Libraries of the regressions.
const LIBRARIES: [Library; 3] = [Library::Plain, Library::QuadraticModulus, Library::Marine];

/// Numbers of past values of the regressions.
const LAGS: [usize; 2] = [1, 2];

/// Clock steps in a horizon.
const CLOCK_STEPS: usize = 30;

/// Clock steps over which rows are averaged.
const AVERAGING: usize = 4;

/// Rows of the regressions, of all runs together.
const ROWS: usize = 12_000;

/// Most samples of all runs, and the shortest segment of a longer run.
const SAMPLES: usize = 300_000;
const SEGMENT: usize = 3_000;

/// Most windows of all runs.
const WINDOWS: usize = 1_500;

/// Ridge penalty relative to the mean square of a term.
const RIDGE: f64 = 1e-4;

/// Weak prior of each component \[m/s\].
const PRIOR_M_S: f64 = 1.0;

/// Step of the numerical derivatives \[m/s\].
const STEP_M_S: f64 = 0.02;

/// Change of the currents at which the iteration ends \[m/s\].
const SMALL_M_S: f64 = 0.002;

/// Most Gauss-Newton steps.
const ITERATIONS: usize = 15;

/// Windows that overlap at any time.
const OVERLAP: usize = 2;

/// Most halvings of a step that does not reduce the cost.
const HALVINGS: i32 = 4;

/// Huber's constant \[standard deviations\].
const HUBER: f64 = 1.345;

/// A run in the velocities through the water.
pub fn through_water(run: &Trajectory, motion: [usize; 3], current: [f64; 2]) -> Trajectory {
    let Some(heading) = &run.heading else { return run.clone() };
    let mut values = run.outputs.rows(0, run.len()).to_vec();
    for (row, &heading) in values.chunks_exact_mut(run.outputs.width()).zip(heading) {
        let [surge, sway] = in_body(current, heading);
        row[motion[0]] -= surge;
        row[motion[1]] -= sway;
    }
    Trajectory {
        outputs: Table::new(run.outputs.channels().to_vec(), values),
        truth: None,
        position: None,
        ..run.clone()
    }
}

/// Estimates the currents of runs with headings, for predictions up to `horizon` samples ahead. `None` if the runs are too
/// short, or nothing can be fitted to them.
///
/// # Errors
/// If `progress` cancels.
pub fn estimate(
    runs: &[&Trajectory],
    motion: [usize; 3],
    horizon: usize,
    progress: Progress<'_>,
) -> Result<Option<Currents>, Cancelled> {
    let Some(run) = runs.first() else { return Ok(None) };
    let window = (horizon / 4).max(1);
    let pieces = pieces(runs, SEGMENT.max(10 * horizon));
    let structure = |(library, lags): (Library, usize)| {
        let (outputs, inputs) = (run.outputs.width(), run.inputs.width());
        let shape = Shape { outputs, inputs, lags, clock: (horizon / CLOCK_STEPS).max(1), dt: run.dt };
        Regression::new(library.terms(&shape, run)?, shape, AVERAGING).ok()
    };
    let all = LIBRARIES.iter().flat_map(|&library| LAGS.map(|lags| (library, lags)));
    let structures: Vec<Regression> = all.filter_map(structure).collect();
    let mut best: Option<Currents> = None;
    for (i, of) in structures.iter().enumerate() {
        progress::report(progress, i as f64 / structures.len() as f64)?;
        let problem = Problem::new(of, &pieces, runs.len(), motion, window);
        let found = problem.and_then(|problem| problem.solve());
        best = match (best, found) {
            (Some(best), Some(found)) => {
                let over_ground = best.errors[0].min(found.errors[0]);
                let least = if found.errors[1] < best.errors[1] { found } else { best };
                Some(Currents { errors: [over_ground, least.errors[1]], ..least })
            }
            (best, found) => best.or(found),
        };
    }
    Ok(best)
}

/// A run or a part of it.
struct Piece {
    run: Trajectory,
    /// Index of the run, which has one current.
    of: usize,
    fold: usize,
}

/// The runs, or blocks of one or two runs, with their folds; evenly spaced segments of long runs.
fn pieces(runs: &[&Trajectory], segment: usize) -> Vec<Piece> {
    let samples: usize = runs.iter().map(|run| run.len()).sum();
    let of_fold = |(fold, of): (usize, Fold<'_>)| -> Vec<Piece> {
        let of_segment = |&Segment { run, from, to }: &Segment<'_>| {
            let index = runs.iter().position(|known| std::ptr::eq(*known, run)).unwrap_or(0);
            let most = (SAMPLES * (to - from)).div_ceil(samples.max(1));
            let parts = subsample(&[&run.slice(from, to)], most, segment);
            parts.into_iter().map(move |run| Piece { run, of: index, fold }).collect::<Vec<_>>()
        };
        of.segments.iter().flat_map(of_segment).collect()
    };
    folds(runs, 0).into_iter().enumerate().flat_map(of_fold).collect()
}

struct Problem<'a> {
    of: &'a Regression,
    pieces: &'a [Piece],
    /// Number of currents.
    currents: usize,
    motion: [usize; 3],
    window: usize,
    every: usize,
    origins: Vec<Vec<usize>>,
    limits: Vec<(f64, f64)>,
    /// Standard deviation of each output.
    deviations: Vec<f64>,
}

impl<'a> Problem<'a> {
    fn new(
        of: &'a Regression,
        pieces: &'a [Piece],
        currents: usize,
        motion: [usize; 3],
        window: usize,
    ) -> Option<Self> {
        let runs = || pieces.iter().map(|piece| &piece.run);
        let samples: usize = runs().map(Trajectory::len).sum();
        let (stride, _) = of.increments();
        let every = (samples / stride).div_ceil(ROWS).max(1);
        let apart = (window / OVERLAP).max(samples / WINDOWS).max(1);
        let origins = runs().map(|run| {
            let first = of.shape.span();
            let known = |k: &usize| {
                let row = |k: usize| {
                    run.heading_at(k).is_finite() && run.outputs.row(k).iter().all(|y| y.is_finite())
                };
                (k - first..=*k).all(row) && row(k + window)
            };
            (first..run.len().saturating_sub(window)).step_by(apart).filter(known).collect()
        });
        let range = |c: usize| {
            let values = runs().flat_map(|run| run.outputs.column(c)).filter(|y| y.is_finite());
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), y| (low.min(y), high.max(y)))
        };
        let limit = |c: usize| {
            let (low, high) = range(c);
            (low - (high - low), high + (high - low))
        };
        let deviation = |c: usize| {
            let values = || runs().flat_map(|run| run.outputs.column(c)).filter(|y| y.is_finite());
            let count = values().count().max(1) as f64;
            let mean = values().sum::<f64>() / count;
            (values().map(|y| (y - mean).powi(2)).sum::<f64>() / count).sqrt()
        };
        let outputs = of.shape.outputs;
        let origins: Vec<Vec<usize>> = origins.collect();
        let problem = Self {
            of,
            pieces,
            currents,
            motion,
            window,
            every,
            limits: (0..outputs).map(limit).collect(),
            deviations: (0..outputs).map(deviation).collect(),
            origins,
        };
        problem.origins.iter().any(|at| !at.is_empty()).then_some(problem)
    }

    /// A piece in the velocities through the water.
    fn water(&self, piece: usize, current: [f64; 2]) -> Water {
        let run = through_water(&self.pieces[piece].run, self.motion, current);
        let segment = Segment { run: &run, from: 0, to: run.len() };
        let moments = self.of.moments(&Fold { segments: vec![segment], validation: false }, self.every);
        Water { run, moments }
    }

    fn fit<'m>(&self, moments: impl Iterator<Item = &'m Moments>) -> Option<Fit> {
        let mut sum = Moments::zero(self.of.terms.len(), self.of.shape.outputs);
        moments.for_each(|of| sum.add(of));
        solve(&sum, self.of.terms.len(), RIDGE)
    }

    /// Errors of the rollouts of a piece, windows x outputs.
    fn errors(&self, fit: &Fit, piece: usize, water: &Water, into: &mut Vec<f64>) {
        let segment = Segment { run: &water.run, from: 0, to: water.run.len() };
        let origins = &self.origins[piece];
        if origins.is_empty() {
            return;
        }
        let coefficients = Coefficients::Shared(&fit.coefficients);
        let predicted = predictions(self.of, coefficients, &segment, origins, &[self.window], &self.limits);
        for (row, &k) in predicted.chunks_exact(self.of.shape.outputs).zip(origins) {
            into.extend(row.iter().zip(segment.output(k + self.window)).map(|(p, y)| f64::from(*p) - y));
        }
    }

    fn solve(&self) -> Option<Currents> {
        let parameters = 2 * self.currents;
        let mut c = vec![0.0; parameters];
        let mut state = self.state(&c)?;
        let over_ground = self.left_out_error(&state)?;
        let mut information = vec![0.0; parameters * parameters];
        for _ in 0..ITERATIONS {
            let scale = robust_scales(&state.errors, self.of.shape.outputs);
            let change;
            (information, change) = self.step(&c, &state, &scale)?;
            // The longest of the halved steps that reduces the cost.
            let before = cost(&state.errors, &scale, &c);
            let next = (0..HALVINGS).find_map(|halvings| {
                let share = 0.5_f64.powi(halvings);
                let tried: Vec<f64> = c.iter().zip(&change).map(|(c, d)| c + share * d).collect();
                let state = self.state(&tried)?;
                (cost(&state.errors, &scale, &tried) < before).then_some((tried, state))
            });
            let Some(next) = next else { break };
            (c, state) = next;
            if change.iter().all(|d| d.abs() < SMALL_M_S) {
                break;
            }
        }
        let covariance = (0..self.currents).map(|run| {
            let column = |p: usize| {
                let mut unit = vec![0.0; parameters];
                unit[p] = 1.0;
                back_substitute(&information, parameters, &mut unit);
                unit
            };
            let (north, east) = (column(2 * run), column(2 * run + 1));
            // Windows overlap, so that only a part of each is new information.
            [north[2 * run], north[2 * run + 1], east[2 * run + 1]].map(|x| OVERLAP as f64 * x)
        });
        Some(Currents {
            covariance: covariance.collect(),
            errors: [over_ground, self.left_out_error(&state)?],
            of: c.chunks_exact(2).map(|c| [c[0], c[1]]).collect(),
        })
    }

    /// Triangle of the information matrix and Gauss-Newton step of the currents `c`.
    fn step(&self, c: &[f64], state: &State, scale: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let parameters = c.len();
        let column = |p: usize| {
            let run = p / 2;
            let mut own = [c[2 * run], c[2 * run + 1]];
            own[p % 2] += STEP_M_S;
            let moved = |piece: usize| (self.pieces[piece].of == run).then(|| self.water(piece, own));
            let moved: Vec<Option<Water>> = (0..self.pieces.len()).map(moved).collect();
            let water =
                || moved.iter().zip(&state.water).map(|(moved, water)| moved.as_ref().unwrap_or(water));
            let fit = self.fit(water().map(|water| &water.moments))?;
            let mut errors = Vec::with_capacity(state.errors.len());
            water().enumerate().for_each(|(piece, water)| self.errors(&fit, piece, water, &mut errors));
            errors.iter_mut().zip(&state.errors).for_each(|(e, e0)| *e = (*e - e0) / STEP_M_S);
            Some(errors)
        };
        let columns: Option<Vec<Vec<f64>>> = (0..parameters).into_par_iter().map(column).collect();
        let columns = columns?;
        let weight = |(i, e): (usize, &f64)| {
            let s = scale[i % scale.len()];
            (HUBER * s / e.abs()).min(1.0) / (s * s)
        };
        let weights: Vec<f64> = state.errors.iter().enumerate().map(weight).collect();
        let product = |a: &[f64], b: &[f64]| -> f64 {
            a.iter().zip(b).zip(&weights).map(|((a, b), weight)| a * b * weight).sum()
        };
        let prior = PRIOR_M_S.powi(-2);
        let mut information = vec![0.0; parameters * parameters];
        let mut right = vec![0.0; parameters];
        for i in 0..parameters {
            for j in i..parameters {
                information[i * parameters + j] = product(&columns[i], &columns[j]);
            }
            information[i * parameters + i] += prior;
            right[i] = -product(&columns[i], &state.errors) - prior * c[i];
        }
        factorize(&mut information, parameters)?;
        back_substitute(&information, parameters, &mut right);
        Some((information, right))
    }

    /// Error on each fold of the model without it.
    fn left_out_error(&self, state: &State) -> Option<f64> {
        let n = self.of.shape.outputs;
        let mut errors = Vec::new();
        let folds = self.pieces.iter().map(|piece| piece.fold + 1).max().unwrap_or(0);
        for fold in 0..folds {
            let all = || self.pieces.iter().zip(&state.water).enumerate();
            let others = all().filter(|(_, (piece, _))| piece.fold != fold);
            let fit = self.fit(others.map(|(_, (_, water))| &water.moments))?;
            let own = all().filter(|(_, (piece, _))| piece.fold == fold);
            own.for_each(|(index, (_, water))| self.errors(&fit, index, water, &mut errors));
        }
        let mut squares = vec![0.0; n];
        for row in errors.chunks_exact(n) {
            squares.iter_mut().zip(row).for_each(|(sum, e)| *sum += e * e);
        }
        let count = (errors.len() / n) as f64;
        let nrmse = squares.iter().zip(&self.deviations).filter(|(_, d)| **d > 0.0);
        Some(nrmse.map(|(sum, d)| (sum / count).sqrt() / d).sum::<f64>() / n as f64)
    }

    fn state(&self, c: &[f64]) -> Option<State> {
        let water =
            |(index, piece): (usize, &Piece)| self.water(index, [c[2 * piece.of], c[2 * piece.of + 1]]);
        let water: Vec<Water> = self.pieces.par_iter().enumerate().map(water).collect();
        let fit = self.fit(water.iter().map(|water| &water.moments))?;
        let mut errors = Vec::new();
        water.iter().enumerate().for_each(|(piece, water)| self.errors(&fit, piece, water, &mut errors));
        errors.iter().all(|e| e.is_finite()).then_some(State { water, errors })
    }
}

/// Huber's loss of errors, with the prior of the currents.
fn cost(errors: &[f64], scale: &[f64], c: &[f64]) -> f64 {
    let huber = |(i, e): (usize, &f64)| {
        let e = e.abs() / scale[i % scale.len()];
        if e < HUBER { e * e } else { HUBER * (2.0 * e - HUBER) }
    };
    errors.iter().enumerate().map(huber).sum::<f64>()
        + c.iter().map(|c| c * c).sum::<f64>() * PRIOR_M_S.powi(-2)
}

struct State {
    water: Vec<Water>,
    errors: Vec<f64>,
}

/// A piece in the velocities through the water.
struct Water {
    run: Trajectory,
    moments: Moments,
}

/// Standard deviation of each output from the median of its absolute errors.
fn robust_scales(errors: &[f64], outputs: usize) -> Vec<f64> {
    let scale = |c: usize| {
        let mut sizes: Vec<f64> = errors.iter().skip(c).step_by(outputs).map(|e| e.abs()).collect();
        let middle = sizes.len() / 2;
        let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
        (*median / 0.6745).max(1e-9)
    };
    (0..outputs).map(scale).collect()
}

/// Solves `R'R x = b` in place.
fn back_substitute(r: &[f64], n: usize, x: &mut [f64]) {
    for i in 0..n {
        x[i] /= r[i * n + i];
        let (known, rest) = x.split_at_mut(i + 1);
        for (x, r) in rest.iter_mut().zip(&r[i * n + i + 1..(i + 1) * n]) {
            *x -= r * known[i];
        }
    }
    for i in (0..n).rev() {
        let row = &r[i * n + i + 1..(i + 1) * n];
        let known: f64 = row.iter().zip(&x[i + 1..]).map(|(r, x)| r * x).sum();
        x[i] = (x[i] - known) / r[i * n + i];
    }
}
