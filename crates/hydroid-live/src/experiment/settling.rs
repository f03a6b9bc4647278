//! Detection of a settled step response without a known time scale.

/// Samples of a response that are kept; the sampling interval doubles when they are full.
const KEPT: usize = 256;
/// A response has settled when its third and fourth quarter differ by less than this share of its change.
const SETTLED: f64 = 0.05;
/// Multiple of the time to the first sign of it for which a response must stay settled, against noise.
const CONFIRMED: f64 = 1.25;
/// Share of the change at which a first-order response has lasted one time constant.
const ONE_TIME_CONSTANT: f64 = 0.632_120_558_828_557_7;

/// Response of a quantity to a step of a command.
///
/// The rule needs no time scale, because it compares parts of the time passed so far: a first-order response has settled
/// by it after 4.2 time constants.
#[derive(Clone, Debug)]
pub(super) struct Settling {
    initial: f64,
    /// Smallest change that counts as a response.
    smallest: f64,
    /// Shortest time \[s\].
    shortest_s: f64,
    elapsed_s: f64,
    /// Time and value of the kept samples.
    samples: Vec<(f64, f64)>,
    stride: usize,
    skipped: usize,
    /// Time since which the response has been settled \[s\].
    settled_since_s: Option<f64>,
}

/// A settled response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settled {
    /// Final value less the initial one.
    pub(super) change: f64,
    /// Time to 63 % of the change \[s\].
    pub(super) time_s: f64,
}

impl Settling {
    pub(super) fn new(initial: f64, smallest: f64, shortest_s: f64) -> Self {
        Self {
            initial,
            smallest,
            shortest_s,
            elapsed_s: 0.0,
            samples: Vec::new(),
            stride: 1,
            skipped: 0,
            settled_since_s: None,
        }
    }

    /// Adds a sample; returns the result when the response has settled.
    pub(super) fn add(&mut self, dt: f64, value: f64) -> Option<Settled> {
        self.elapsed_s += dt;
        self.skipped += 1;
        if self.skipped < self.stride {
            return None;
        }
        self.skipped = 0;
        self.samples.push((self.elapsed_s, value));
        if self.samples.len() >= KEPT {
            let mut odd = false;
            self.samples.retain(|_| {
                odd = !odd;
                !odd
            });
            self.stride *= 2;
        }
        if self.elapsed_s < self.shortest_s {
            return None;
        }
        let third = self.mean(0.5, 0.75)?;
        let change = self.mean(0.75, 1.0)? - self.initial;
        let settled = change.abs() >= self.smallest
            && (change + self.initial - third).abs() < SETTLED * change.abs().max(self.smallest);
        if !settled {
            self.settled_since_s = None;
            return None;
        }
        let since_s = *self.settled_since_s.get_or_insert(self.elapsed_s);
        (self.elapsed_s >= CONFIRMED * since_s)
            .then(|| Settled { change, time_s: self.crossing(ONE_TIME_CONSTANT * change) })
    }

    /// Change so far, as the mean over the last quarter of the time.
    pub(super) fn change(&self) -> f64 {
        self.mean(0.75, 1.0).map_or(0.0, |last| last - self.initial)
    }

    /// The response so far, taken as settled.
    pub(super) fn so_far(&self) -> Settled {
        let change = self.change();
        Settled { change, time_s: self.crossing(ONE_TIME_CONSTANT * change) }
    }

    fn mean(&self, from: f64, to: f64) -> Option<f64> {
        let (mut sum, mut count) = (0.0, 0);
        for &(t, value) in &self.samples {
            if t > from * self.elapsed_s && t <= to * self.elapsed_s {
                sum += value;
                count += 1;
            }
        }
        (count > 0).then(|| sum / f64::from(count))
    }

    /// Time at which the change exceeds a value: the mean of the first time above and, within the first half, the last time
    /// below it, which noise separates.
    fn crossing(&self, change: f64) -> f64 {
        let reached = |value: f64| (value - self.initial) / change >= 1.0;
        let above = self.samples.iter().find(|(_, value)| reached(*value)).map(|(t, _)| *t);
        let below = self
            .samples
            .iter()
            .rev()
            .find(|(t, value)| *t <= 0.5 * self.elapsed_s && !reached(*value))
            .map_or(0.0, |(t, _)| *t);
        above.map_or(self.elapsed_s, |above| 0.5 * (above + below.max(0.0)))
    }
}
