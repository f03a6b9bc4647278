//! Shapes of a command over time, joined into a signal.

use std::f64::consts::TAU;

use super::prbs::Prbs;

/// Course of one command over one segment; `t` counts from the segment's start.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// No command.
    Zero,
    /// The levels one after the other, each for an equal part of the segment.
    Steps {
        /// Levels, in order; none is the same as [`Zero`](Self::Zero).
        levels: Vec<f64>,
    },
    /// A straight line over the whole segment.
    Ramp {
        /// Value at the start.
        from: f64,
        /// Value at the end.
        to: f64,
    },
    /// From `low` to `high` and back, at constant rate.
    Triangle {
        /// Lower corner, where it starts.
        low: f64,
        /// Upper corner.
        high: f64,
        /// Time from one lower corner to the next \[s\].
        period_s: f64,
    },
    /// `centre + amplitude sin(phase)` whose frequency grows (or falls) linearly in time.
    Chirp {
        /// Mean value.
        centre: f64,
        /// Amplitude.
        amplitude: f64,
        /// Frequency at the start \[Hz\].
        from_hz: f64,
        /// Frequency at the end \[Hz\].
        to_hz: f64,
    },
    /// A pseudo-random binary sequence between two levels.
    Prbs {
        /// Lower level.
        low: f64,
        /// Upper level.
        high: f64,
        /// Time for which a bit is held \[s\].
        hold_s: f64,
        /// Start in the sequence of 32,767 bits.
        start: u16,
    },
}

/// A shape and its duration.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// Course of the command.
    pub shape: Shape,
    /// Duration \[s\].
    pub duration_s: f64,
}

impl Segment {
    /// Value at `t` seconds after the start of the segment; `prbs` is the state of a PRBS.
    fn value(&self, t: f64, prbs: &mut PrbsState) -> f64 {
        match &self.shape {
            Shape::Zero => 0.0,
            Shape::Steps { levels } => {
                let part = index(t / self.duration_s * levels.len() as f64);
                levels.get(part.min(levels.len().saturating_sub(1))).copied().unwrap_or(0.0)
            }
            Shape::Ramp { from, to } => from + (to - from) * (t / self.duration_s),
            Shape::Triangle { low, high, period_s } => {
                let phase = (t / period_s).fract();
                low + (high - low) * (1.0 - (2.0 * phase - 1.0).abs())
            }
            Shape::Chirp { centre, amplitude, from_hz, to_hz } => {
                let rate = (to_hz - from_hz) / self.duration_s;
                centre + amplitude * (TAU * (from_hz + 0.5 * rate * t) * t).sin()
            }
            Shape::Prbs { low, high, hold_s, start } => {
                if prbs.bit_at(index(t / hold_s), *start) {
                    *high
                } else {
                    *low
                }
            }
        }
    }
}

/// State of a PRBS within a segment.
#[derive(Default)]
struct PrbsState(Option<(Prbs, usize, bool)>);

impl PrbsState {
    /// Bit number `wanted`, which does not decrease within a segment.
    fn bit_at(&mut self, wanted: usize, start: u16) -> bool {
        let (prbs, reached, bit) = self.0.get_or_insert_with(|| {
            let mut prbs = Prbs::new(start);
            let first = prbs.next_bit();
            (prbs, 0, first)
        });
        while *reached < wanted {
            *bit = prbs.next_bit();
            *reached += 1;
        }
        *bit
    }
}

/// Whole part of a non-negative ratio of times, with a tolerance for rounding at exact multiples.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // never negative, and `as` saturates
fn index(ratio: f64) -> usize {
    (ratio + 1e-9).floor() as usize
}

/// One command over a record: segments one after the other, zero after the last.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Signal {
    /// The segments, in order.
    pub segments: Vec<Segment>,
}

impl Signal {
    /// Length of all segments together \[s\].
    pub fn duration_s(&self) -> f64 {
        self.segments.iter().map(|segment| segment.duration_s).sum()
    }

    /// `n` samples at step `dt` \[s\].
    pub fn sample(&self, dt: f64, n: usize) -> Vec<f64> {
        let mut samples = Vec::with_capacity(n);
        let mut start = 0.0;
        for segment in &self.segments {
            let end = start + segment.duration_s;
            let mut prbs = PrbsState::default();
            while samples.len() < n {
                let t = samples.len() as f64 * dt;
                // A sample on the border, within rounding, belongs to the next segment.
                if t >= end - 1e-9 * dt {
                    break;
                }
                samples.push(segment.value((t - start).max(0.0), &mut prbs));
            }
            start = end;
        }
        samples.resize(n, 0.0);
        samples
    }
}
