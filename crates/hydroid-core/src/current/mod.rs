//! Predictions over ground by a model of the motion through the water, with an estimate of the current.
//!
//! Hull, propellers and rudders act on the motion through the water, and most sensors measure the motion over ground. With
//! the heading `psi` and the current `(c_n, c_e)` \[m/s\], north and east, surge and sway through the water are
//!
//! ```text
//! u_w = u - c_n cos psi - c_e sin psi
//! v_w = v + c_n sin psi - c_e cos psi
//! ```
//!
//! and the yaw rate is the same (T. I. Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*, 2nd edition,
//! 2021, section 10.3). [`ThroughWater`] is a predictor of the motion over ground around a predictor of the motion through
//! the water.

mod jump;
mod past;
mod symmetric;
mod window;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use crate::adapt::{Adapter, Learning, Rehearsing, SaveState, are_variances};
use crate::memory::{MOST_COUNTED, Memory};
use crate::predict::{Current, Predictor, Workspace, delegate, plain, rollout_steps};
use jump::Jump;
use past::Past;
use symmetric::quadratic;
use window::CURRENTS;

/// Options of the estimate of the current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentOptions {
    /// Indices of surge, sway and yaw rate among the outputs.
    pub motion: [usize; 3],
    /// Sample time \[s\].
    pub dt: f64,
    /// Length of a window \[samples\]: the current is estimated from the errors of predictions over it.
    pub window: usize,
    /// Standard deviations of the errors at the end of a window under the right current: surge and sway \[m/s\], yaw rate
    /// \[rad/s\].
    pub deviations: [f64; 3],
    /// Standard deviations of the white noise of the measurements that these errors contain. A run with more noise has
    /// larger errors.
    pub noise: [f64; 3],
    /// Standard deviation of each component of the current at the start of a run \[m/s\].
    pub initial: f64,
    /// Standard deviation of the change of each component in a second \[m/s\], a random walk; 0 for a constant current.
    pub walk: f64,
}

/// Longest window \[samples\].
pub const LONGEST_WINDOW: usize = 1_000_000;

impl CurrentOptions {
    /// Whether the options are valid for a model with this number of outputs.
    pub fn are_valid(&self, outputs: usize) -> bool {
        let [u, v, r] = self.motion;
        let positive = |x: f64| x.is_finite() && x > 0.0;
        self.motion.iter().all(|&c| c < outputs)
            && u != v
            && v != r
            && r != u
            && (1..=LONGEST_WINDOW).contains(&self.window)
            && self.deviations.into_iter().all(positive)
            && self.noise.into_iter().all(|x| x.is_finite() && x >= 0.0)
            && positive(self.dt)
            && positive(self.initial)
            && self.walk.is_finite()
            && self.walk >= 0.0
    }
}

/// Surge and sway \[m/s\] of a current (north, east) in the body frame at a heading \[rad\].
pub fn in_body([north, east]: [f64; 2], heading: f64) -> [f64; 2] {
    let (sin, cos) = Float::sin_cos(heading);
    [north * cos + east * sin, east * cos - north * sin]
}

/// Variance of a current that does not matter, relative to the other errors of a window: half their standard deviation.
const NEGLIGIBLE: f64 = 0.25;

/// Variance of a current that is as well known as its random walk permits, relative to the stationary variance.
const SETTLED: f64 = 2.0;

/// A model of the motion through the water: a predictor or an adapter.
pub trait Inner: Predictor {
    /// Multiplies the noise variance of the next measurement of a model that learns, and says whether it learns from it.
    fn prepare_learning(&mut self, noise: f64, learns: bool);
}

impl Inner for dyn Predictor {
    fn prepare_learning(&mut self, _: f64, _: bool) {}
}

impl Inner for dyn Adapter {
    fn prepare_learning(&mut self, noise: f64, learns: bool) {
        self.scale_noise(noise);
        self.freeze(!learns);
    }
}

/// A session that predicts the motion over ground.
///
/// [`observe_heading`](Predictor::observe_heading) takes the heading of the sample that is observed next. Without a
/// heading, the session predicts it from the yaw rate; before the first one, it takes the water as still. A missing output
/// counts as predicted in the past of a window, and gives no error at its end.
///
/// The current is a random walk, estimated by an iterated extended Kalman filter (B. M. Bell and F. W. Cathey, *IEEE
/// Transactions on Automatic Control* 38 (1993) 294). Its measurements are the errors of predictions over windows: under
/// a current, the model observes the past of the window, another window at most, and predicts its end. Huber weights limit
/// the effect of a window that the model cannot explain. Each window begins where the last one ended. When the estimate has moved by more than its standard deviation, the model observes its past again, so that all its memory
/// belongs to one current.
///
/// A random walk of variance `q` per second has the variance of jumps of the initial variance at the rate `q` over it. After
/// an outlier, the hypothesis of a jump stands beside the present estimate, if the ratio of the evidences exceeds the inverse
/// of the probability of a jump within a window (A. S. Willsky and H. L. Jones, *IEEE Transactions on Automatic Control* 21
/// (1976) 108). It is accepted when the ratio exceeds this number again on later windows, and rejected when the ratio falls below one. With a walk of zero, the current cannot jump.
///
/// A run may have more noise than the errors of the options contain: a model is identified from smoothed logs, and used on
/// the sensors themselves. The variance `s^2` of the white noise of an output follows from the median of its third
/// differences over the past of a window, which cancel a parabola; it is the mean over the windows of the run so far.
/// Both ends of a window contain the noise, so that the variance of the error is
/// `deviations^2 + 2 max(s^2 - noise^2, 0)`.
///
/// Around an [`Adapter`], the session is an adapter, and current and weights are estimated in turn. What is unknown about
/// the current is noise to the model that learns. With the covariance `P` of the current and the derivatives `h_i` of the
/// standardized errors of a window, it adds the variance `a = max_i h_i' P h_i`. The noise variance of a measurement is
/// multiplied by `1 + a`. While the current is being found, its error is not random: weights with little prior information
/// would take it as their own at any noise variance. The model therefore learns only where `a` is small, or near the
/// stationary variance of the filter: `a <= max(1/4, 2 a_s)`, `a_s^2 = max_i h_i' Q h_i`, with the variance `Q` of the
/// random walk over a window. Windows are predicted with the weights at their start. After a jump, the weights are those
/// before the window that suggested it.
pub struct ThroughWater<P: Inner + ?Sized = dyn Predictor> {
    inner: Box<P>,
    /// A session of the same model that observes the past again, and does not learn.
    replay: Box<dyn Predictor>,
    options: CurrentOptions,
    current: Current,
    /// Current of the memory of the model.
    remembered: [f64; 2],
    /// Variances of the white noise of the run so far, and the number of windows that they are means of.
    noise: [f64; 3],
    windows: usize,
    /// Derivatives of the standardized errors of the last window by the current.
    slopes: [[f64; 2]; 3],
    /// Heading at the present sample; NaN before the first one.
    heading: f64,
    /// Heading of the sample that is observed next; NaN if there is none.
    next_heading: f64,
    /// Yaw rate at the present sample.
    rate: f64,
    past: Past,
    /// Third differences of an output over the past.
    differences: Vec<f64>,
    /// Snapshot of the model at the start of the window; not known before the first one.
    start: Vec<f64>,
    has_start: bool,
    jump: Jump,
    /// Samples since the last window, and since the last heading.
    since: usize,
    blind: usize,
    /// Factor of the noise variance of the next measurement.
    inflation: f64,
    /// Whether learning is stopped by [`Learning::freeze`].
    frozen: bool,
    row: Vec<f64>,
    measured: Vec<f64>,
    state: Vec<f64>,
    commands: Vec<f64>,
    starts: Vec<f64>,
    predicted: Vec<f64>,
    work: Workspace,
}

impl<P: Inner + ?Sized> ThroughWater<P> {
    /// A session around a model of the motion through the water, at the start of a run; `None` if the options are not
    /// [valid](CurrentOptions::are_valid).
    pub fn new(inner: Box<P>, options: CurrentOptions) -> Option<Self> {
        let (outputs, inputs, window) = (inner.outputs(), inner.inputs(), options.window);
        // Lag and hidden states settle over a window before the first prediction.
        let least = inner.warm_up().max(1);
        let most = least.max(window.min(LONGEST_WINDOW));
        options.are_valid(outputs).then(|| Self {
            replay: inner.fork(),
            options,
            current: initial_estimate(&options),
            remembered: [0.0; 2],
            noise: [0.0; 3],
            windows: 0,
            slopes: initial_slopes(&options),
            heading: f64::NAN,
            next_heading: f64::NAN,
            rate: f64::NAN,
            differences: Vec::with_capacity(most + window),
            past: Past::new(outputs, inputs, [least + window, most + window]),
            start: vec![0.0; inner.snapshot_len()],
            has_start: false,
            jump: Jump::new(inner.snapshot_len()),
            since: 0,
            blind: 0,
            inflation: 1.0,
            frozen: false,
            row: vec![0.0; outputs],
            measured: vec![f64::NAN; outputs],
            state: vec![0.0; inner.snapshot_len()],
            commands: Vec::with_capacity(CURRENTS * inputs * window),
            starts: vec![0.0; CURRENTS * inner.snapshot_len()],
            predicted: vec![0.0; CURRENTS * outputs * window],
            work: Workspace::new(),
            inner,
        })
    }

    /// Heading \[rad\] at the present sample, measured or predicted; NaN before the first one.
    pub fn heading(&self) -> f64 {
        self.heading
    }

    /// Variance that a covariance of the current adds to the standardized errors of a window: the largest of them.
    fn added_variance(&self, covariance: [f64; 3]) -> f64 {
        self.slopes.into_iter().map(|slope| quadratic(covariance, slope)).fold(0.0, f64::max)
    }

    /// Sets the noise and the learning of a model that learns, for the next measurement.
    fn prepare_learning(&mut self) {
        let CurrentOptions { walk, dt, window, .. } = self.options;
        let added = self.added_variance(self.current.covariance);
        let change = walk * walk * dt * window as f64;
        let stationary = Float::sqrt(self.added_variance([change, 0.0, change]));
        let known = added <= NEGLIGIBLE.max(SETTLED * stationary);
        let noise = if known { 1.0 + added } else { 1.0 };
        self.inner.prepare_learning(self.inflation * noise, known && !self.frozen);
        self.inflation = 1.0;
    }

    /// Adds `sign` times a current to outputs.
    fn add_current(&self, current: [f64; 2], heading: f64, sign: f64, y: &mut [f64]) {
        if heading.is_finite() {
            let [surge, sway] = in_body(current, heading);
            y[self.options.motion[0]] += sign * surge;
            y[self.options.motion[1]] += sign * sway;
        }
    }

    /// Puts the outputs through the water into `row`.
    fn take_measurement(&mut self, y: &[f64]) {
        self.blind = self.blind.saturating_add(1);
        if self.next_heading.is_finite() {
            if self.heading.is_nan() || self.blind > self.options.window {
                // The headings of the past are unknown, or predicted for too long.
                self.past.clear();
            }
            self.heading = self.next_heading;
            self.blind = 0;
        }
        self.next_heading = f64::NAN;
        self.measured.copy_from_slice(y);
        let mut row = core::mem::take(&mut self.row);
        row.copy_from_slice(y);
        self.add_current(self.current.velocity, self.heading, -1.0, &mut row);
        self.row = row;
    }

    fn update_estimate(&mut self) {
        // A missing output is the prediction that the model keeps.
        let mut row = core::mem::take(&mut self.row);
        self.inner.output(&mut row);
        self.add_current(self.current.velocity, self.heading, 1.0, &mut row);
        for (y, measured) in row.iter_mut().zip(&self.measured) {
            if !measured.is_nan() {
                *y = *measured;
            }
        }
        self.past.push(&row, self.heading);
        self.row = row;
        let variance = self.options.walk * self.options.walk * self.options.dt;
        self.current.covariance[0] += variance;
        self.current.covariance[2] += variance;
        self.since = self.since.saturating_add(1);
        let CurrentOptions { motion, window, .. } = self.options;
        // Outputs at several rates: the window ends where the whole motion is measured, if it ever is.
        let complete = motion.iter().all(|&c| self.measured[c].is_finite());
        let due = self.since >= window && (complete || self.since >= window.saturating_mul(2));
        if due && self.past.is_full() && self.blind <= window {
            self.since = 0;
            self.update_by_window();
        }
        self.update_rate();
    }

    fn update_rate(&mut self) {
        self.inner.output(&mut self.row);
        self.rate = self.row[self.options.motion[2]];
    }

    /// Turns predictions through the water into predictions over ground, from a heading and a yaw rate on.
    fn put_over_ground(&self, current: [f64; 2], mut heading: f64, mut rate: f64, y: &mut [f64]) {
        let yaw = self.options.motion[2];
        for row in y.chunks_exact_mut(self.inner.outputs()) {
            let before = if rate.is_finite() { rate } else { row[yaw] };
            heading += 0.5 * self.options.dt * (before + row[yaw]);
            rate = row[yaw];
            self.add_current(current, heading, 1.0, row);
        }
    }
}

fn initial_estimate(options: &CurrentOptions) -> Current {
    let variance = options.initial * options.initial;
    Current { velocity: [0.0; 2], covariance: [variance, 0.0, variance] }
}

/// Before the first window: a current is an error of its size.
fn initial_slopes(options: &CurrentOptions) -> [[f64; 2]; 3] {
    let least = options.deviations[0].min(options.deviations[1]);
    [[1.0 / least, 0.0], [0.0, 1.0 / least], [0.0; 2]]
}

/// Numbers of a snapshot beside those of the model: current, its covariance, heading, yaw rate.
const OWN: usize = 7;

impl<P: Inner + ?Sized> Predictor for ThroughWater<P> {
    delegate!(inner: outputs inputs warm_up);

    /// The next run may have another current.
    fn reset(&mut self) {
        self.inner.reset();
        self.current = initial_estimate(&self.options);
        self.remembered = [0.0; 2];
        (self.noise, self.windows) = ([0.0; 3], 0);
        self.slopes = initial_slopes(&self.options);
        self.heading = f64::NAN;
        self.next_heading = f64::NAN;
        self.rate = f64::NAN;
        self.past.clear();
        self.has_start = false;
        self.jump.forget();
        self.since = 0;
        self.blind = 0;
        self.inflation = 1.0;
    }

    fn observe_heading(&mut self, heading: f64) {
        self.next_heading = heading;
    }

    fn current(&self) -> Option<&Current> {
        Some(&self.current)
    }

    fn observe(&mut self, y: &[f64]) {
        self.take_measurement(y);
        self.prepare_learning();
        self.inner.observe(&self.row);
        self.update_estimate();
    }

    fn advance(&mut self, c: &[f64]) {
        self.past.set_command(c);
        let before = self.rate;
        self.inner.advance(c);
        self.update_rate();
        let step = 0.5 * self.options.dt * (before + self.rate);
        if step.is_finite() {
            self.heading += step;
        }
    }

    fn advance_observe(&mut self, c: &[f64], y: &[f64]) {
        if self.next_heading.is_finite() && y.iter().all(|y| !y.is_nan()) {
            // A heading and a complete measurement replace the prediction.
            self.past.set_command(c);
            self.take_measurement(y);
            self.prepare_learning();
            self.inner.advance_observe(c, &self.row);
            self.update_estimate();
        } else {
            self.advance(c);
            self.observe(y);
        }
    }

    fn output_through_water(&self, y: &mut [f64]) {
        self.inner.output(y);
    }

    fn output(&self, y: &mut [f64]) {
        self.inner.output(y);
        self.add_current(self.current.velocity, self.heading, 1.0, y);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        rollout_steps(commands, self.inputs(), y, self.outputs());
        self.inner.rollout(commands, work, y);
        self.put_over_ground(self.current.velocity, self.heading, self.rate, y);
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.inner.rollout_batch(count, commands, work, y);
        for y in y.chunks_exact_mut((y.len() / count.max(1)).max(1)) {
            self.put_over_ground(self.current.velocity, self.heading, self.rate, y);
        }
    }

    fn snapshot_len(&self) -> usize {
        self.inner.snapshot_len() + OWN
    }

    fn snapshot(&self, into: &mut [f64]) {
        let (own, inner) = into.split_at_mut(OWN);
        let Current { velocity: [north, east], covariance: [p, q, r] } = self.current;
        own.copy_from_slice(&[north, east, p, q, r, self.heading, self.rate]);
        self.inner.snapshot(inner);
    }

    /// Restores state and current. Windows restart.
    fn restore(&mut self, from: &[f64]) {
        let (own, inner) = from.split_at(OWN);
        self.inner.restore(inner);
        self.current = Current { velocity: [own[0], own[1]], covariance: [own[2], own[3], own[4]] };
        self.remembered = self.current.velocity;
        self.heading = own[5];
        self.rate = own[6];
        self.past.clear();
        self.has_start = false;
        self.jump.forget();
    }

    fn rollout_snapshots(
        &mut self,
        count: usize,
        snapshots: &[f64],
        commands: &[f64],
        work: &mut Workspace,
        y: &mut [f64],
    ) {
        let (all, inner) = (self.snapshot_len(), self.inner.snapshot_len());
        assert_eq!(snapshots.len(), count * all, "whole snapshots");
        let (numbers, [work, _]) = work.take_pair(count * inner);
        for (place, from) in numbers.chunks_exact_mut(inner.max(1)).zip(snapshots.chunks_exact(all)) {
            place.copy_from_slice(&from[OWN..]);
        }
        self.inner.rollout_snapshots(count, &numbers[..count * inner], commands, work, y);
        let size = (y.len() / count.max(1)).max(1);
        for (y, own) in y.chunks_exact_mut(size).zip(snapshots.chunks_exact(all)) {
            self.put_over_ground([own[0], own[1]], own[5], own[6], y);
        }
        if let Some(last) = snapshots.chunks_exact(all).last() {
            self.restore(last);
        }
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(ThroughWater::<dyn Predictor> {
            inner: self.inner.fork(),
            replay: self.replay.fork(),
            options: self.options,
            current: self.current,
            remembered: self.remembered,
            noise: self.noise,
            windows: self.windows,
            slopes: self.slopes,
            heading: self.heading,
            next_heading: self.next_heading,
            rate: self.rate,
            past: self.past.clone(),
            differences: Vec::with_capacity(self.differences.capacity()),
            start: self.start.clone(),
            has_start: self.has_start,
            jump: self.jump.clone(),
            since: self.since,
            blind: self.blind,
            inflation: self.inflation,
            frozen: true,
            row: self.row.clone(),
            measured: self.measured.clone(),
            state: self.state.clone(),
            commands: self.commands.clone(),
            starts: self.starts.clone(),
            predicted: self.predicted.clone(),
            work: Workspace::new(),
        })
    }
}

impl Learning for ThroughWater<dyn Adapter> {
    delegate!(inner: outcome innovations weights restart health guard);

    fn freeze(&mut self, frozen: bool) {
        self.frozen = frozen;
        self.inner.freeze(frozen);
    }

    fn scale_noise(&mut self, factor: f64) {
        self.inflation = factor;
    }

    /// Those of the model, with the uncertainty of the current. The effect of the current grows over a window, and stays.
    fn deviations(
        &mut self,
        commands: &[f64],
        horizons: &[usize],
        work: &mut Workspace,
        deviations: &mut [f64],
    ) {
        self.inner.deviations(commands, horizons, work, deviations);
        let outputs = self.inner.outputs();
        let window = self.options.window as f64;
        for ((c, scale), slope) in
            self.options.motion.into_iter().zip(self.error_deviations()).zip(self.slopes)
        {
            let variance = quadratic(self.current.covariance, slope) * scale * scale;
            for (row, horizon) in deviations.chunks_exact_mut(outputs).zip(horizons) {
                let share = (*horizon as f64 / window).min(1.0);
                row[c] = Float::sqrt(row[c] * row[c] + share * share * variance);
            }
        }
    }
}

impl SaveState for ThroughWater<dyn Adapter> {
    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.numbers(&mut self.current.velocity);
        memory.numbers(&mut self.current.covariance);
        memory.number(&mut self.heading);
        memory.number(&mut self.rate);
        memory.numbers(&mut self.remembered);
        memory.numbers(&mut self.noise);
        memory.count(&mut self.windows, MOST_COUNTED);
        memory.numbers(self.slopes.as_flattened_mut());
        memory.number(&mut self.inflation);
        self.past.visit_state(memory);
        memory.numbers(&mut self.start);
        memory.flag(&mut self.has_start);
        self.jump.visit_state(memory);
        memory.count(&mut self.since, MOST_COUNTED);
        memory.count(&mut self.blind, MOST_COUNTED);
        memory.flag(&mut self.frozen);
        memory.number(&mut self.next_heading);
        self.inner.visit_state(memory);
    }

    fn is_sound(&self) -> bool {
        let Current { velocity, covariance: [north, _, east] } = self.current;
        velocity.iter().all(|x| x.is_finite())
            && are_variances(&[north, east])
            && are_variances(&self.noise)
            && self.inner.is_sound()
    }
}

/// Without rehearsal: the currents of the training runs are not known to the session.
impl Rehearsing for ThroughWater<dyn Adapter> {
    plain!(no_rehearsal);
}
