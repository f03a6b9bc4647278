//! Metrics of an adapter along a log: outcomes of samples, coverage of its bands, computing time.

use hydroid_core::adapt::guard::Event;
use hydroid_core::adapt::{Adapter, Outcome};
use hydroid_core::predict::{Predictor, delegate, plain};
use serde::Serialize;
use web_time::Instant;

/// Number of samples by outcome.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Used with full weight.
    pub accepted: usize,
    /// Used with reduced weight.
    pub inflated: usize,
    /// Rejected.
    pub rejected: usize,
    /// Rolled back.
    pub rolled_back: usize,
    /// Samples at which the guard held back a measurement.
    pub touched: usize,
    /// Samples predicted by the adapted model, by the reference model and by the unguarded learner.
    pub predicted_by: [usize; 3],
}

/// Time for one sample, observed and advanced \[microseconds\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Times {
    /// Median.
    pub median: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Maximum.
    pub max: f64,
}

/// Share of innovations inside their predicted band, over all outputs; NaN (`null`) without bands.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Coverage {
    /// Inside the 80 % band.
    #[serde(rename = "80")]
    pub of_80: f64,
    /// Inside the 95 % band.
    #[serde(rename = "95")]
    pub of_95: f64,
}

pub use crate::evaluate::BAND_80;
/// Half-width of the 95 % band of a normal distribution \[standard deviations\].
pub const BAND_95: f64 = 1.959_96;

/// An adapter whose outcomes are counted and whose calls are timed.
pub struct MeteredAdapter<'a> {
    adapter: &'a mut dyn Adapter,
    counts: Counts,
    events: Vec<Event>,
    /// Number of innovations, of those inside the 80 % band, and of those inside the 95 % band.
    banded: [usize; 3],
    /// Computing time of each sample \[microseconds\].
    times: Vec<f32>,
    observing_us: f64,
}

impl<'a> MeteredAdapter<'a> {
    /// Counts and measures the calls of an adapter.
    pub fn new(adapter: &'a mut dyn Adapter) -> Self {
        Self {
            adapter,
            counts: Counts::default(),
            events: Vec::new(),
            banded: [0; 3],
            times: Vec::new(),
            observing_us: 0.0,
        }
    }

    pub(super) fn counts(&self) -> Counts {
        self.counts
    }

    pub(super) fn coverage(&self) -> Coverage {
        let [all, of_80, of_95] = self.banded.map(|n| n as f64);
        Coverage { of_80: of_80 / all, of_95: of_95 / all }
    }

    pub(super) fn weights(&self) -> &[f64] {
        self.adapter.weights()
    }

    pub(super) fn times(&self) -> Times {
        let mut sorted = self.times.clone();
        sorted.sort_unstable_by(f32::total_cmp);
        let at = |per_mille: usize| {
            let index = (sorted.len().saturating_sub(1) * per_mille).div_ceil(1000);
            sorted.get(index).map_or(f64::NAN, |&t| f64::from(t))
        };
        Times { median: at(500), p99: at(990), max: at(1000) }
    }

    /// Events of the guard.
    pub(super) fn events(&self) -> &[Event] {
        &self.events
    }

    fn record(&mut self) {
        if let Some(guard) = self.adapter.guard() {
            self.counts.touched += usize::from(guard.is_held());
            self.counts.predicted_by[guard.active().index()] += 1;
            self.events.extend(guard.events());
        }
        match self.adapter.outcome() {
            Outcome::Waiting => {}
            Outcome::Accepted => self.counts.accepted += 1,
            Outcome::Inflated { .. } => self.counts.inflated += 1,
            Outcome::Rejected(_) => self.counts.rejected += 1,
            Outcome::RolledBack => self.counts.rolled_back += 1,
        }
        for innovation in self.adapter.innovations().iter().filter(|i| i.deviation.is_finite()) {
            self.banded[0] += 1;
            for (count, band) in self.banded[1..].iter_mut().zip([BAND_80, BAND_95]) {
                *count += usize::from(innovation.value.abs() <= band * innovation.deviation);
            }
        }
    }
}

impl Predictor for MeteredAdapter<'_> {
    plain!(advance_observe);
    delegate!(adapter: outputs inputs warm_up reset observe_heading current output output_through_water rollout);
    delegate!(adapter: rollout_batch rollout_snapshots snapshot_len snapshot restore fork);

    fn observe(&mut self, y: &[f64]) {
        let start = Instant::now();
        self.adapter.observe(y);
        self.observing_us = start.elapsed().as_secs_f64() * 1e6;
        self.record();
    }

    fn advance(&mut self, c: &[f64]) {
        let start = Instant::now();
        self.adapter.advance(c);
        let us = self.observing_us + start.elapsed().as_secs_f64() * 1e6;
        #[allow(clippy::cast_possible_truncation)] // times need no more digits
        self.times.push(us as f32);
    }
}
