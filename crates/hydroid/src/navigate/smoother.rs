//! Fixed-interval smoother: the modified Bryson-Frazier method (Bierman, Factorization Methods for Discrete Sequential
//! Estimation, 1977, section X.2), which inverts no covariance.
//!
//! The forward pass is repeated between checkpoints during the backward pass: the memory contains what the backward pass
//! needs of 2,000 measurements, and one estimate for each 2,000 of them.

use hydroid_core::navigation::{Estimate, Filter, Innovation, STATES, State, Transition, Update};

use super::fit::CONSTANTS;
use super::measurements::{Runs, Statistics};
use crate::progress::{self, Cancelled, Progress};

/// Smoothed pose and velocities at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Time \[s\].
    pub t: f64,
    /// North, east \[m\], heading \[rad\].
    pub pose: [f64; 3],
    /// Surge, sway \[m/s\] and yaw rate \[rad/s\] over ground.
    pub ground: [f64; 3],
    /// Standard deviations of `ground`.
    pub ground_deviation: [f64; 3],
    /// Surge and sway through the water \[m/s\].
    pub water: [f64; 2],
    /// Standard deviations of `water`.
    pub water_deviation: [f64; 2],
}

/// A smoothed run.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoothed {
    /// Rows at the chosen times.
    pub rows: Vec<Row>,
    /// Means and standard deviations of all states at the end of the run.
    pub end: [(f64, f64); STATES],
    /// Mean squared normalized innovation of each sensor, without outliers.
    pub nis: Vec<f64>,
    /// Share of outliers of each sensor.
    pub outliers: Vec<f64>,
    /// Number of measurements of each sensor.
    pub counts: Vec<f64>,
}

/// Pose and velocities of an estimate of the filter, which knows nothing of later measurements.
pub fn filtered(t: f64, estimate: &Estimate) -> Row {
    Adjoint { vector: [0.0; STATES], matrix: [[0.0; STATES]; STATES] }.row(t, estimate)
}

enum Step {
    Predict(Box<Transition>),
    Update(Box<Update>),
    Output(usize, Box<Estimate>),
    Restart,
}

/// Measurements between checkpoints.
const SEGMENT: usize = 2_000;

/// One place in the sequence of all runs.
#[derive(Clone, Copy)]
enum Item {
    Restart(usize),
    Event(usize, usize),
    Output(usize, usize),
}

/// Share of the forward pass in the time, for the progress.
const FORWARD: f64 = 0.2;

/// Smooths all runs at the times `outputs` of each \[s\].
///
/// # Errors
/// If the callback cancels.
pub fn smooth(
    runs: &Runs,
    statistics: &Statistics,
    outputs: &[Vec<f64>],
    progress: Progress<'_>,
) -> Result<Vec<Smoothed>, Cancelled> {
    let items = sequence(runs, outputs);
    let Some(first) = runs.runs.first() else { return Ok(Vec::new()) };
    let start = Filter::new(statistics.noise, &first.prior, Filter::OUTLIER);
    let mut forward = Forward { runs, statistics, outputs, filter: start, t: 0.0 };

    let mut checkpoints = Vec::new();
    let mut counts = vec![vec![[0.0; 3]; runs.sensors.len()]; runs.runs.len()];
    let parts = items.chunks(SEGMENT).len() as f64;
    for (i, part) in items.chunks(SEGMENT).enumerate() {
        progress::report(progress, FORWARD * i as f64 / parts)?;
        checkpoints.push((forward.filter.clone(), forward.t));
        for item in part {
            forward.step(*item, |step| {
                if let (Item::Event(run, event), Step::Update(update)) = (*item, step) {
                    let count = &mut counts[run][runs.runs[run].events[event].sensor];
                    count[0] += 1.0;
                    if update.innovation.is_outlier() {
                        count[2] += 1.0;
                    } else {
                        count[1] += update.innovation.nis();
                    }
                }
            });
        }
    }

    let mut smoothed: Vec<Smoothed> = counts
        .iter()
        .map(|counts| Smoothed {
            rows: Vec::new(),
            end: [(0.0, 0.0); STATES],
            nis: counts.iter().map(|c| c[1] / (c[0] - c[2]).max(1.0)).collect(),
            outliers: counts.iter().map(|c| c[2] / c[0].max(1.0)).collect(),
            counts: counts.iter().map(|c| c[0]).collect(),
        })
        .collect();
    let mut adjoint = Adjoint { vector: [0.0; STATES], matrix: [[0.0; STATES]; STATES] };
    for (i, (part, (filter, t))) in items.chunks(SEGMENT).zip(checkpoints).rev().enumerate() {
        progress::report(progress, FORWARD + (1.0 - FORWARD) * i as f64 / parts)?;
        forward.filter = filter;
        forward.t = t;
        let mut steps = Vec::with_capacity(3 * part.len());
        for item in part {
            forward.step(*item, |step| steps.push((*item, step)));
        }
        for (item, step) in steps.iter().rev() {
            match step {
                Step::Predict(transition) => {
                    transition.transpose(&mut adjoint.vector);
                    transition.transpose_both(&mut adjoint.matrix);
                }
                Step::Update(update) => adjoint.update(update),
                Step::Restart => adjoint.restart(),
                Step::Output(run, estimate) => {
                    let Item::Output(_, index) = *item else { continue };
                    let out = &mut smoothed[*run];
                    if out.rows.is_empty() {
                        out.end = std::array::from_fn(|i| {
                            let mut unit = [0.0; STATES];
                            unit[i] = 1.0;
                            let (shift, variance) = adjoint.functional(estimate, &unit);
                            (estimate.mean[i] + shift, variance.max(0.0).sqrt())
                        });
                    }
                    out.rows.push(adjoint.row(outputs[*run][index], estimate));
                }
            }
        }
    }
    for run in &mut smoothed {
        run.rows.reverse();
    }
    Ok(smoothed)
}

/// Standard deviations of the constants after all runs.
pub(super) fn constant_deviations(runs: &Runs, statistics: &Statistics) -> [f64; CONSTANTS.len()] {
    let Some(first) = runs.runs.first() else { return [f64::INFINITY; CONSTANTS.len()] };
    let outputs = vec![Vec::new(); runs.runs.len()];
    let filter = Filter::new(statistics.noise, &first.prior, Filter::OUTLIER);
    let mut forward = Forward { runs, statistics, outputs: &outputs, filter, t: 0.0 };
    for item in sequence(runs, &outputs) {
        forward.step(item, |_| {});
    }
    let end = forward.filter.estimate();
    CONSTANTS.map(|state| end.variance(state).max(0.0).sqrt())
}

/// All measurements and outputs in the order of time.
fn sequence(runs: &Runs, outputs: &[Vec<f64>]) -> Vec<Item> {
    let mut items = Vec::new();
    for (r, (run, times)) in runs.runs.iter().zip(outputs).enumerate() {
        items.push(Item::Restart(r));
        let mut next = 0;
        for (e, event) in run.events.iter().enumerate() {
            while next < times.len() && times[next] < event.t {
                items.push(Item::Output(r, next));
                next += 1;
            }
            items.push(Item::Event(r, e));
        }
        items.extend((next..times.len()).map(|index| Item::Output(r, index)));
    }
    items
}

struct Forward<'a> {
    runs: &'a Runs,
    statistics: &'a Statistics,
    outputs: &'a [Vec<f64>],
    filter: Filter,
    t: f64,
}

impl Forward<'_> {
    fn step(&mut self, item: Item, mut see: impl FnMut(Step)) {
        let to = match item {
            Item::Restart(run) => {
                let run_ = &self.runs.runs[run];
                if run > 0 {
                    self.filter.restart(&run_.prior, &CONSTANTS);
                }
                let first = run_.events.first().map(|event| event.t);
                let first = first.into_iter().chain(self.outputs[run].first().copied());
                self.t = first.fold(f64::INFINITY, f64::min);
                see(Step::Restart);
                return;
            }
            Item::Event(run, event) => self.runs.runs[run].events[event].t,
            Item::Output(run, index) => self.outputs[run][index],
        };
        if to > self.t {
            see(Step::Predict(Box::new(self.filter.predict(to - self.t))));
            self.t = to;
        }
        match item {
            Item::Event(run, event) => {
                let event = &self.runs.runs[run].events[event];
                let measurement = self.statistics.measurement(&self.runs.sensors, event);
                self.filter.update(&measurement, |update| see(Step::Update(Box::new(update.clone()))));
            }
            Item::Output(run, _) => see(Step::Output(run, Box::new(self.filter.estimate().clone()))),
            Item::Restart(_) => {}
        }
    }
}

/// Adjoint variables: the smoothed mean is `x - P l`, its covariance `P - P L P`.
struct Adjoint {
    vector: [f64; STATES],
    matrix: [[f64; STATES]; STATES],
}

impl Adjoint {
    fn update(&mut self, update: &Update) {
        let Innovation { value, variance, weight } = update.innovation;
        let variance = variance / weight;
        let (h, k) = (&update.gradient, &update.gain);
        let dot = |a: &[f64; STATES], b: &[f64; STATES]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let along = dot(k, &self.vector) + value / variance;
        let product: [f64; STATES] = std::array::from_fn(|i| dot(&self.matrix[i], k));
        let square = dot(&product, k) + 1.0 / variance;
        for i in 0..STATES {
            self.vector[i] -= h[i] * along;
            for j in 0..STATES {
                self.matrix[i][j] += square * h[i] * h[j] - h[i] * product[j] - product[i] * h[j];
            }
        }
    }

    fn restart(&mut self) {
        let kept = |i: usize| CONSTANTS.iter().any(|state| *state as usize == i);
        for i in 0..STATES {
            if !kept(i) {
                self.vector[i] = 0.0;
            }
            for j in 0..STATES {
                if !kept(i) || !kept(j) {
                    self.matrix[i][j] = 0.0;
                }
            }
        }
    }

    /// Shift of the mean of a linear functional of the state, and its smoothed variance.
    fn functional(&self, estimate: &Estimate, g: &[f64; STATES]) -> (f64, f64) {
        let mut p = [0.0; STATES];
        for (line, g) in estimate.covariance.iter().zip(g).filter(|(_, g)| **g != 0.0) {
            for (p, x) in p.iter_mut().zip(line) {
                *p += g * x;
            }
        }
        let dot = |a: &[f64; STATES], b: &[f64; STATES]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let shift = -dot(&p, &self.vector);
        let gained: f64 = p.iter().zip(&self.matrix).map(|(x, line)| x * dot(line, &p)).sum();
        (shift, dot(&p, g) - gained)
    }

    fn row(&self, t: f64, estimate: &Estimate) -> Row {
        let functional = |entries: &[(State, f64)]| {
            let mut g = [0.0; STATES];
            for (state, value) in entries {
                g[*state as usize] = *value;
            }
            let (shift, variance) = self.functional(estimate, &g);
            (shift, variance.max(0.0).sqrt())
        };
        let value = |state: State| {
            let (shift, deviation) = functional(&[(state, 1.0)]);
            (estimate.get(state) + shift, deviation)
        };
        let (surge, surge_deviation) = value(State::Surge);
        let (yaw, yaw_deviation) = value(State::YawRate);
        let [pivot, shift, slope, lagged] =
            [State::Pivot, State::PivotShift, State::PivotSlope, State::LaggedYawRate]
                .map(|state| value(state).0);
        let way = shift + slope * surge;
        let sway = value(State::Sway).0 - pivot * yaw - way * lagged;
        let of_sway = [
            (State::Sway, 1.0),
            (State::YawRate, -pivot),
            (State::Pivot, -yaw),
            (State::LaggedYawRate, -way),
            (State::PivotShift, -lagged),
            (State::PivotSlope, -surge * lagged),
            (State::Surge, -slope * lagged),
        ];
        let sway_deviation = functional(&of_sway).1;
        let (north, east) = (value(State::CurrentNorth).0, value(State::CurrentEast).0);
        let heading = value(State::Heading).0;
        let (sine, cosine) = heading.sin_cos();
        let current = [cosine * north + sine * east, -sine * north + cosine * east];
        let surge_ground = [
            (State::Surge, 1.0),
            (State::CurrentNorth, cosine),
            (State::CurrentEast, sine),
            (State::Heading, current[1]),
        ];
        let current_in_sway =
            [(State::CurrentNorth, -sine), (State::CurrentEast, cosine), (State::Heading, -current[0])];
        let sway_ground: Vec<_> = of_sway.into_iter().chain(current_in_sway).collect();
        Row {
            t,
            pose: [value(State::North).0, value(State::East).0, heading],
            ground: [surge + current[0], sway + current[1], yaw],
            ground_deviation: [functional(&surge_ground).1, functional(&sway_ground).1, yaw_deviation],
            water: [surge, sway],
            water_deviation: [surge_deviation, sway_deviation],
        }
    }
}
