//! Which measurements of a sample are used, and how a hold ends.

use super::Guard;
use super::event::{Action, Cause};
use super::hold::{CONSISTENT, Evidence};
use super::options::GuardOptions;
use super::sensor::Verdict;

impl Guard {
    /// Screens a measurement into `measured`; whether measurements are trusted against the gate.
    pub(super) fn screen(&mut self, y: &[f64]) -> bool {
        self.measured.copy_from_slice(y);
        if !self.options.sensors {
            return false;
        }
        self.learner.output(&mut self.expected);
        let permitted = self.budget.permits(&self.options);
        let (mut stuck, mut held) = (false, false);
        for (output, &value) in y.iter().enumerate() {
            let sensor = &mut self.sensors[output];
            let (before, expected) = (sensor.unused(), self.expected[output]);
            let motion = expected - self.estimated[output];
            let verdict = sensor.judge(value, expected, motion, permitted, &self.options);
            held |= sensor.unused().is_some();
            let action = match (before, verdict) {
                (None, Verdict::Unused { deviations }) => Some(Action::Spike { output, deviations }),
                (None, Verdict::Stuck { repeats }) => Some(Action::Stuck { output, repeats }),
                (Some(missing), Verdict::Used) if sensor.unused().is_none() => {
                    Some(Action::Back { output, missing })
                }
                _ => None,
            };
            stuck |= matches!(verdict, Verdict::Stuck { .. });
            if verdict != Verdict::Used {
                self.measured[output] = f64::NAN;
            }
            if let Some(action) = action {
                self.record_event(action);
            }
        }
        self.held = if held { self.held.saturating_add(1) } else { 0 };
        if held || y.iter().any(|y| y.is_infinite()) {
            self.separate();
        }
        let cause = if held && self.budget.is_empty() {
            Some(Cause::Budget)
        } else if held && self.shadow_test.is_due() {
            let consistent = !stuck && self.is_consistent(y);
            self.evidence.add(consistent).then_some(Cause::Evidence)
        } else {
            None
        };
        if let Some(cause) = cause {
            self.trust(y, cause);
        }
        if !self.is_held() {
            self.evidence.reset();
        }
        self.budget.add(self.is_held(), &self.options);
        cause.is_some()
    }

    /// Whether the measurements that are held back are those that the unguarded learner predicted within the hold.
    fn is_consistent(&mut self, y: &[f64]) -> bool {
        let GuardOptions { horizon, stride, .. } = self.options;
        let tests = Evidence::tests(&self.options);
        if self.held <= tests * stride {
            return false;
        }
        let Some(predicted) = self.shadow_test.unguarded(tests) else { return false };
        let share = (tests * stride) as f64 / horizon as f64;
        let (mut error, mut limit) = (0.0, 0.0);
        for (output, (&y, &p)) in y.iter().zip(predicted).enumerate() {
            if y.is_finite() && self.measured[output].is_nan() {
                error += self.metric.error(output, p, y);
                limit += CONSISTENT * self.sensors[output].spread(share) / self.metric.scale[output];
            }
        }
        limit > 0.0 && error <= limit
    }

    /// All holds end, and the measurements are used.
    fn trust(&mut self, y: &[f64], cause: Cause) {
        for output in 0..y.len() {
            if self.sensors[output].unused().is_some() {
                self.record_event(Action::Trusted { output, cause });
                if y[output].is_finite() {
                    self.measured[output] = y[output];
                }
            }
            self.sensors[output].release();
        }
        self.held = 0;
    }
}
