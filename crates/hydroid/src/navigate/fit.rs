//! Maximum likelihood of the statistics.

use hydroid_core::navigation::{Prior, State};

use super::measurements::{Run, Runs, Statistics};
use crate::progress::{self, Cancelled, Progress};

/// Statistics, constants of the vessel and the GNSS, and their likelihood.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The statistics.
    pub statistics: Statistics,
    /// Values of the states of [`CONSTANTS`].
    pub constants: [f64; CONSTANTS.len()],
    /// Logarithm of the likelihood and the prior.
    pub log_likelihood: f64,
    /// Steps of the search.
    pub steps: usize,
}

/// States that are constant, the same in all runs of a vessel, and multiply others. An extended Kalman filter with wide
/// priors of them can converge to wrong values; the likelihood of a filter with fixed values has no such error.
pub const CONSTANTS: [State; 6] =
    [State::Delay, State::Misalignment, State::Pivot, State::PivotShift, State::PivotSlope, State::Heel];
/// Measurements with which the search begins.
const FEW: usize = 10_000;
/// Steps from each first guess.
const COARSE: usize = 40;
/// Steps at most.
const STEPS: usize = 200;
/// Evaluations of the likelihood of all measurements in a usual search, for the progress.
const USUAL: usize = 200;
/// Gain of the log-likelihood in a step; three smaller ones end the search.
const ENOUGH: f64 = 0.1;
/// Standard deviation of the logarithm of a statistic about its first guess: a factor of five.
const WIDE: f64 = 1.6;
/// Largest change in a step.
const FARTHEST: f64 = 1.0;

impl Fitted {
    /// A prior that is linearized at the constants. Its standard deviations of them remain: the smoother finds those that
    /// the measurements leave.
    #[must_use]
    pub fn prior(&self, prior: &Prior) -> Prior {
        let states = CONSTANTS.iter().zip(self.constants);
        states.fold(prior.clone(), |prior, (state, value)| prior.linearized_at(*state, value))
    }
}

/// Maximizes the product of the likelihood of the innovations and the prior over the logarithms of the statistics and the
/// constants. The likelihood has several maxima: the search begins from each of the first guesses with the beginnings of the
/// runs, and continues with all measurements from what explains them best. With several guesses, the constants are searched a
/// second time, with the statistics that were found.
///
/// # Errors
/// If the callback cancels.
///
/// # Panics
/// Without a first guess.
pub fn fit(runs: &Runs, guesses: &[Statistics], progress: Progress<'_>) -> Result<Fitted, Cancelled> {
    let share = FEW / runs.runs.len().max(1);
    let beginning = |run: &Run| Run {
        events: run.events[..run.events.len().min(share)].to_vec(),
        prior: run.prior.clone(),
    };
    let beginnings = Runs { sensors: runs.sensors.clone(), runs: runs.runs.iter().map(beginning).collect() };
    let costs = [guesses.len() * COARSE * count(&beginnings), USUAL * count(runs)].map(|cost| cost as f64);
    let coarse = costs[0] / (costs[0] + costs[1]).max(1.0) / guesses.len() as f64;
    let mut work = Work { progress, part: [0.0; 2], done: 0, expected: 0 };
    let mut starts = Vec::with_capacity(guesses.len());
    for guess in guesses {
        work.begin(coarse, COARSE + guess.numbers(&runs.sensors).len());
        let mut search = Search::new(&beginnings, guess, &mut work)?;
        search.run(COARSE, &mut work)?;
        starts.push(search.on(runs, &mut work)?);
    }
    work.begin(1.0, USUAL);
    let best = starts.into_iter().max_by(|a, b| a.value.total_cmp(&b.value));
    let mut search = best.expect("a first guess");
    search.run(STEPS, &mut work)?;
    if guesses.len() > 1 {
        // First steps with a wrong guess may have led the constants to another maximum: they begin again with the statistics
        // that were found.
        let mut again = search.again(&mut work)?;
        again.run(STEPS, &mut work)?;
        if again.value > search.value {
            search = again;
        }
    }
    let (statistics, constants) = search.read(&search.at);
    Ok(Fitted { statistics, constants, log_likelihood: search.value, steps: search.steps })
}

/// Number of measurements.
pub(super) fn count(runs: &Runs) -> usize {
    runs.runs.iter().map(|run| run.events.len()).sum()
}

/// Progress of a search, by evaluations of the likelihood.
struct Work<'p> {
    progress: Progress<'p>,
    /// Fractions at which the present part begins and ends.
    part: [f64; 2],
    done: usize,
    /// Evaluations of a usual part.
    expected: usize,
}

impl Work<'_> {
    /// Begins the next part, of this length at most.
    fn begin(&mut self, length: f64, expected: usize) {
        let [_, from] = self.part;
        (self.part, self.done, self.expected) = ([from, (from + length).min(1.0)], 0, expected);
    }

    /// Reports an evaluation.
    fn report(&mut self) -> Result<(), Cancelled> {
        let [from, to] = self.part;
        let share = (self.done as f64 / self.expected as f64).min(1.0);
        self.done += 1;
        progress::report(self.progress, from + (to - from) * share)
    }
}

/// Method of Broyden, Fletcher, Goldfarb and Shanno (Nocedal and Wright, *Numerical Optimization*, 2nd ed., section 6.1).
#[derive(Clone)]
struct Search<'a> {
    runs: &'a Runs,
    start: Statistics,
    /// Number of statistics; the constants follow.
    statistics: usize,
    /// Processes whose standard deviation is replaced by the intensity of the driving noise: a slow process has the same
    /// likelihood for all rates then.
    processes: Vec<(usize, usize, f64)>,
    /// Logarithms of the statistics, and constants over their standard deviations, at the start.
    from: Vec<f64>,
    at: Vec<f64>,
    value: f64,
    slope: Vec<f64>,
    inverse: Inverse,
    steps: usize,
}

impl<'a> Search<'a> {
    fn new(runs: &'a Runs, start: &Statistics, work: &mut Work<'_>) -> Result<Self, Cancelled> {
        let prior = Prior::default();
        let mut from: Vec<f64> = start.numbers(&runs.sensors).into_iter().map(f64::ln).collect();
        let statistics = from.len();
        let processes = start.processes(&runs.sensors);
        for (rate, deviation, power) in &processes {
            from[*deviation] += power * from[*rate];
        }
        from.extend(CONSTANTS.map(|state| prior.mean[state as usize] / prior.deviation[state as usize]));
        let mut search = Self {
            runs,
            start: start.clone(),
            statistics,
            processes,
            at: from.clone(),
            inverse: Inverse { rows: Vec::new() },
            from,
            value: f64::NEG_INFINITY,
            slope: Vec::new(),
            steps: 0,
        };
        (search.value, search.slope) = search.evaluate(&search.at, work)?;
        search.inverse = Inverse::of_diagonal(&search.curvatures(work)?);
        Ok(search)
    }

    /// The search with the constants at their first values.
    fn again(&self, work: &mut Work<'_>) -> Result<Self, Cancelled> {
        let mut at = self.at.clone();
        at[self.statistics..].clone_from_slice(&self.from[self.statistics..]);
        let mut search = Self { at, inverse: Inverse { rows: Vec::new() }, ..self.clone() };
        (search.value, search.slope) = search.evaluate(&search.at, work)?;
        search.inverse = Inverse::of_diagonal(&search.curvatures(work)?);
        Ok(search)
    }

    /// The search with other measurements of the same sensors.
    fn on(self, runs: &'a Runs, work: &mut Work<'_>) -> Result<Self, Cancelled> {
        let mut search = Self { runs, ..self };
        (search.value, search.slope) = search.evaluate(&search.at, work)?;
        Ok(search)
    }

    /// Statistics and constants at a place.
    fn read(&self, at: &[f64]) -> (Statistics, [f64; CONSTANTS.len()]) {
        let (statistics, constants) = at.split_at(self.statistics);
        let mut logarithms = statistics.to_vec();
        for (rate, deviation, power) in &self.processes {
            logarithms[*deviation] -= power * logarithms[*rate];
        }
        let numbers: Vec<f64> = logarithms.iter().map(|x| x.exp()).collect();
        let widths = Prior::default().deviation;
        let constants = std::array::from_fn(|i| constants[i] * widths[CONSTANTS[i] as usize]);
        (self.start.with_numbers(&self.runs.sensors, &numbers), constants)
    }

    /// Logarithm of the likelihood and the prior, and its gradient.
    fn evaluate(&self, at: &[f64], work: &mut Work<'_>) -> Result<(f64, Vec<f64>), Cancelled> {
        work.report()?;
        let (statistics, constants) = self.read(at);
        let (mut value, mut slope) = self.runs.log_likelihood(&statistics, &constants);
        for (rate, deviation, power) in &self.processes {
            slope[*rate] -= power * slope[*deviation];
        }
        let widths = Prior::default().deviation;
        for (i, slope) in slope.iter_mut().enumerate() {
            let width = match i.checked_sub(self.statistics) {
                None => WIDE,
                Some(i) => {
                    *slope *= widths[CONSTANTS[i] as usize];
                    1.0
                }
            };
            let away = (at[i] - self.from[i]) / width;
            value -= 0.5 * away * away;
            *slope -= away / width;
        }
        Ok((value, slope))
    }

    /// Magnitudes of the second derivatives.
    fn curvatures(&self, work: &mut Work<'_>) -> Result<Vec<f64>, Cancelled> {
        let step = 1e-3;
        let of = |i: usize| {
            let mut at = self.at.clone();
            at[i] += step;
            let (_, slope) = self.evaluate(&at, work)?;
            Ok(((slope[i] - self.slope[i]) / step).abs())
        };
        (0..self.at.len()).map(of).collect()
    }

    fn run(&mut self, steps: usize, work: &mut Work<'_>) -> Result<(), Cancelled> {
        let mut small = 0;
        for _ in 0..steps {
            self.steps += 1;
            let before = self.value;
            let moved = self.step(work)?;
            small = if self.value - before < ENOUGH { small + 1 } else { 0 };
            if !moved || small == 3 {
                break;
            }
        }
        Ok(())
    }

    /// A step along the quasi-Newton direction, shortened until the function increases. Whether it did.
    fn step(&mut self, work: &mut Work<'_>) -> Result<bool, Cancelled> {
        let direction = self.inverse.times(&self.slope);
        let largest = direction.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        let rise = dot(&direction, &self.slope);
        let mut size = if largest > FARTHEST { FARTHEST / largest } else { 1.0 };
        while size * rise > 0.01 * ENOUGH {
            let next: Vec<f64> = self.at.iter().zip(&direction).map(|(x, d)| x + size * d).collect();
            let (value, slope) = self.evaluate(&next, work)?;
            if value >= self.value + 1e-4 * size * rise {
                let step: Vec<f64> = direction.iter().map(|d| size * d).collect();
                let change: Vec<f64> = self.slope.iter().zip(&slope).map(|(a, b)| a - b).collect();
                self.inverse.update(&step, &change);
                (self.at, self.value, self.slope) = (next, value, slope);
                return Ok(true);
            }
            size *= 0.3;
        }
        Ok(false)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Estimate of the inverse of the negative Hessian.
#[derive(Clone)]
struct Inverse {
    rows: Vec<Vec<f64>>,
}

impl Inverse {
    fn of_diagonal(curvatures: &[f64]) -> Self {
        let row = |i: usize| {
            (0..curvatures.len()).map(|j| if i == j { 1.0 / curvatures[i] } else { 0.0 }).collect()
        };
        Self { rows: (0..curvatures.len()).map(row).collect() }
    }

    fn times(&self, vector: &[f64]) -> Vec<f64> {
        self.rows.iter().map(|row| dot(row, vector)).collect()
    }

    /// Step and decrease of the gradient. A step along which the function is not concave says nothing.
    fn update(&mut self, step: &[f64], change: &[f64]) {
        let curvature = dot(step, change);
        if curvature <= 0.0 {
            return;
        }
        let product = self.times(change);
        let factor = (1.0 + dot(change, &product) / curvature) / curvature;
        for (i, row) in self.rows.iter_mut().enumerate() {
            for (j, x) in row.iter_mut().enumerate() {
                *x += factor * step[i] * step[j] - (product[i] * step[j] + step[i] * product[j]) / curvature;
            }
        }
    }
}
