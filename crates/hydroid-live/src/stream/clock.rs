//! Assignment of samples to the time grid of the model.

use hydroid::log::LogError;

/// Largest number of consecutive grid points without a sample.
const MAX_SKIPPED: f64 = 1e6;
/// Gain of the grid on deviations of the samples, and weight of an interval in the mean.
const TRACKING_GAIN: f64 = 1.0 / 16.0;
/// Below this share of the sample time, the mean interval marks a stream faster than the model.
const FASTER_SHARE: f64 = 0.75;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Arrival {
    /// First of a session.
    First,
    /// Number of steps after the previous one.
    Next(usize),
    /// After a gap \[s\] longer than the limit: a new run begins.
    Gap(f64),
    /// Not after the last sample, but this much \[s\] earlier.
    Late(f64),
    /// Between two grid points, or a second sample at the last one.
    Between,
}

/// A time grid with spacing `dt`, whose origin is the first sample. A later sample is assigned to the grid point within
/// half a step, and the grid slowly follows the samples, so that clocks of different rates do not drift apart.
///
/// Of several samples in a step the nearest to the grid point is used: for a stream faster than the model, half of the
/// mean interval is the limit before a grid point.
#[derive(Clone, Debug)]
pub(super) struct Clock {
    dt: f64,
    max_gap: f64,
    /// Times of the last grid point, of its sample, and of the last line \[s\].
    place: f64,
    taken: f64,
    seen: f64,
    /// Mean interval of the lines, each at most one step \[s\].
    interval: f64,
}

impl Clock {
    pub(super) fn new(dt: f64, max_gap: f64) -> Result<Self, LogError> {
        let bad =
            |reason: String| LogError::BadOption { what: "a gap limit", value: max_gap.to_string(), reason };
        if !(max_gap > 0.0 && max_gap.is_finite()) {
            return Err(bad("it must be a positive number of seconds".to_owned()));
        }
        if max_gap / dt > MAX_SKIPPED {
            return Err(bad(format!(
                "it must be at most a million steps of the model, which are {dt} s long"
            )));
        }
        Ok(Self { dt, max_gap, place: f64::NAN, taken: f64::NAN, seen: f64::NAN, interval: dt })
    }

    pub(super) fn is_new(&self) -> bool {
        self.taken.is_nan()
    }

    pub(super) fn taken(&self) -> f64 {
        self.taken
    }

    /// Position of a sample; advances to a used sample.
    pub(super) fn arrive(&mut self, t: f64) -> Arrival {
        if self.is_new() {
            self.begin(t);
            return Arrival::First;
        }
        if t <= self.seen {
            // A sample after the last used one is not late, even if it precedes the last line.
            return if t > self.taken { Arrival::Between } else { Arrival::Late(self.taken - t) };
        }
        self.interval += TRACKING_GAIN * 2.0 * ((t - self.seen).min(self.dt) - self.interval);
        self.seen = t;
        let gap = t - self.taken;
        if gap > self.max_gap * (1.0 + 1e-9) {
            self.begin(t);
            return Arrival::Gap(gap);
        }
        let steps = ((t - self.place) / self.dt).round();
        let late = t - self.place - steps * self.dt;
        let fast = self.interval < FASTER_SHARE * self.dt;
        // More steps than a gap allows result from an invalid state.
        if !(1.0..=MAX_SKIPPED + 1.0).contains(&steps) || fast && late < -0.5 * self.interval {
            return Arrival::Between;
        }
        self.place += steps * self.dt;
        self.place += TRACKING_GAIN * late;
        self.taken = t;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        Arrival::Next(steps as usize)
    }

    fn begin(&mut self, t: f64) {
        (self.place, self.taken, self.seen) = (t, t, t);
    }

    pub(super) fn memory(&self) -> [f64; 4] {
        [self.place, self.taken, self.seen, self.interval]
    }

    /// Restores the values of [`memory`](Self::memory). Invalid values do not panic.
    pub(super) fn restore(&mut self, memory: [f64; 4]) {
        [self.place, self.taken, self.seen, self.interval] = memory;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock() -> Clock {
        Clock::new(0.1, 1.0).unwrap()
    }

    fn arrivals(times: impl IntoIterator<Item = f64>) -> Vec<Arrival> {
        let mut clock = clock();
        times.into_iter().map(|t| clock.arrive(t)).collect()
    }

    #[test]
    fn samples_near_a_place_are_at_it_and_places_may_be_left_out() {
        use Arrival::{Between, First, Next};
        let found = arrivals([5.0, 5.1, 5.24, 5.26, 5.5, 5.53]);
        assert_eq!(found, [First, Next(1), Next(1), Next(1), Next(2), Between]);
    }

    #[test]
    fn what_comes_too_late_is_late_and_a_long_gap_begins_anew() {
        let found = arrivals([5.0, 5.1, 5.1, 5.05, 6.2]);
        assert_eq!(found[..3], [Arrival::First, Arrival::Next(1), Arrival::Late(0.0)]);
        assert!(matches!(found[3], Arrival::Late(by) if (by - 0.05).abs() < 1e-9), "{found:?}");
        assert!(matches!(found[4], Arrival::Gap(by) if (by - 1.1).abs() < 1e-9), "{found:?}");
        assert_eq!(arrivals([5.0, 6.0])[1], Arrival::Next(10), "as long as the limit");
    }

    #[test]
    fn of_a_faster_stream_the_sample_nearest_to_the_place_is_taken() {
        let mut clock = clock();
        for k in 0..1000 {
            let t = f64::from(k) * 0.01;
            let taken = matches!(clock.arrive(t), Arrival::Next(_));
            assert!(k < 30 || taken == (k % 10 == 0), "{k}");
        }
    }

    #[test]
    fn a_clock_that_runs_fast_or_slow_and_jitters_is_followed_sample_by_sample() {
        for step in [0.099, 0.1, 0.101] {
            let times = (0..5000).map(|k| {
                let x = f64::from(k);
                x * step + 0.02 * (x * 12.9898).sin()
            });
            assert!(arrivals(times).iter().skip(1).all(|a| *a == Arrival::Next(1)), "{step}");
        }
    }

    #[test]
    fn gap_limits_that_make_no_sense_are_refused() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e9] {
            assert!(Clock::new(0.1, bad).is_err(), "{bad}");
        }
    }
}
