//! Maximum likelihood of the statistics.

use hydroid_core::navigation::{Prior, State};

use super::measurements::{Run, Runs, Statistics};

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
/// runs, and continues with all measurements from what explains them best. `proceed` is asked before each step.
///
/// # Panics
/// Without a first guess.
pub fn fit(runs: &Runs, guesses: &[Statistics], mut proceed: impl FnMut() -> bool) -> Fitted {
    let share = FEW / runs.runs.len().max(1);
    let beginning = |run: &Run| Run {
        events: run.events[..run.events.len().min(share)].to_vec(),
        prior: run.prior.clone(),
    };
    let beginnings = Runs { sensors: runs.sensors.clone(), runs: runs.runs.iter().map(beginning).collect() };
    let starts = guesses.iter().map(|guess| {
        let mut search = Search::new(&beginnings, guess);
        search.run(COARSE, &mut proceed);
        search.on(runs)
    });
    let mut search = starts.max_by(|a, b| a.value.total_cmp(&b.value)).expect("a first guess");
    search.run(STEPS, &mut proceed);
    let (statistics, constants) = search.read(&search.at);
    Fitted { statistics, constants, log_likelihood: search.value, steps: search.steps }
}

/// Method of Broyden, Fletcher, Goldfarb and Shanno (Nocedal and Wright, *Numerical Optimization*, 2nd ed., section 6.1).
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
    fn new(runs: &'a Runs, start: &Statistics) -> Self {
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
        (search.value, search.slope) = search.evaluate(&search.at);
        search.inverse = Inverse::of_diagonal(&search.curvatures());
        search
    }

    /// The search with other measurements of the same sensors.
    fn on(self, runs: &'a Runs) -> Self {
        let mut search = Self { runs, ..self };
        (search.value, search.slope) = search.evaluate(&search.at);
        search
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
    fn evaluate(&self, at: &[f64]) -> (f64, Vec<f64>) {
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
        (value, slope)
    }

    /// Magnitudes of the second derivatives.
    fn curvatures(&self) -> Vec<f64> {
        let step = 1e-3;
        let of = |i: usize| {
            let mut at = self.at.clone();
            at[i] += step;
            ((self.evaluate(&at).1[i] - self.slope[i]) / step).abs()
        };
        (0..self.at.len()).map(of).collect()
    }

    fn run(&mut self, steps: usize, proceed: &mut dyn FnMut() -> bool) {
        let mut small = 0;
        for _ in 0..steps {
            if !proceed() {
                break;
            }
            self.steps += 1;
            let before = self.value;
            let moved = self.step();
            small = if self.value - before < ENOUGH { small + 1 } else { 0 };
            if !moved || small == 3 {
                break;
            }
        }
    }

    /// A step along the quasi-Newton direction, shortened until the function increases. Whether it did.
    fn step(&mut self) -> bool {
        let direction = self.inverse.times(&self.slope);
        let largest = direction.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        let rise = dot(&direction, &self.slope);
        let mut size = if largest > FARTHEST { FARTHEST / largest } else { 1.0 };
        while size * rise > 0.01 * ENOUGH {
            let next: Vec<f64> = self.at.iter().zip(&direction).map(|(x, d)| x + size * d).collect();
            let (value, slope) = self.evaluate(&next);
            if value >= self.value + 1e-4 * size * rise {
                let step: Vec<f64> = direction.iter().map(|d| size * d).collect();
                let change: Vec<f64> = self.slope.iter().zip(&slope).map(|(a, b)| a - b).collect();
                self.inverse.update(&step, &change);
                (self.at, self.value, self.slope) = (next, value, slope);
                return true;
            }
            size *= 0.3;
        }
        false
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Estimate of the inverse of the negative Hessian.
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
