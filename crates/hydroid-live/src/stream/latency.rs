//! Histogram of the response times of a session, in constant memory.

use hydroid::adapt::Times;

/// Ratio of the bounds of a bin, and number of bins: 0.1 us to 20 minutes.
const RATIO: f64 = 1.02;
const BINS: usize = 1200;
const SHORTEST_US: f64 = 0.1;

#[derive(Clone, Debug)]
pub struct Latency {
    bins: Vec<u64>,
    longest_us: f64,
}

impl Default for Latency {
    fn default() -> Self {
        Self { bins: vec![0; BINS], longest_us: 0.0 }
    }
}

impl Latency {
    pub fn add(&mut self, us: f64) {
        let bin = ((us / SHORTEST_US).ln() / RATIO.ln()).clamp(0.0, (BINS - 1) as f64);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped to the bins
        let bin = bin as usize;
        self.bins[bin] += 1;
        self.longest_us = self.longest_us.max(us);
    }

    /// Quantiles within 2 %, and the exact maximum; NaN without samples.
    pub fn times(&self) -> Times {
        let all: u64 = self.bins.iter().sum();
        let at = |share: f64| {
            let mut below = 0;
            let bin = self.bins.iter().position(|count| {
                below += count;
                below as f64 >= share * all as f64
            });
            let bound = bin.map_or(f64::NAN, |bin| SHORTEST_US * RATIO.powf(bin as f64 + 1.0));
            if all == 0 { f64::NAN } else { bound.min(self.longest_us) }
        };
        let max = if all == 0 { f64::NAN } else { self.longest_us };
        Times { median: at(0.5), p99: at(0.99), max }
    }
}
