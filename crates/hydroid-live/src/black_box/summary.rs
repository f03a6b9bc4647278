//! Summary of a black box.

use serde::Serialize;

use super::{BlackBox, Head};
use hydroid::adapt::LoggedEvent;

/// Number of samples with each status.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[expect(missing_docs, reason = "the words of the stream's answers")]
pub struct Outcomes {
    pub waiting: usize,
    pub accepted: usize,
    pub inflated: usize,
    pub rejected: usize,
    pub rolled_back: usize,
}

/// Summary of a black box.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Model, settings, names and sizes.
    pub head: Head,
    /// Times of the first and of the last sample \[s\]; NaN if empty.
    pub t: [f64; 2],
    /// Samples observed.
    pub samples: usize,
    /// Sessions: parts that do not continue the previous one, as after a restart.
    pub sessions: usize,
    /// Number of samples with each status.
    pub outcomes: Outcomes,
    /// Samples at which the adapted model, the reference model and the unguarded learner predicted; zeros without a guard.
    pub predicted_by: [usize; 3],
    /// Smallest variance of a weight; NaN if unknown.
    pub least_variance: f64,
    /// Smallest `min_s_over_r` of [`Health`](hydroid_core::adapt::Health); NaN if unknown.
    pub min_s_over_r: f64,
    /// Largest NIS, and its time \[s\].
    pub largest_nis: [f64; 2],
    /// Events of the guard.
    pub events: Vec<LoggedEvent>,
    /// Incomplete or damaged segments.
    pub torn: usize,
    /// Whether steps in the middle cannot be read.
    pub damaged: bool,
}

impl BlackBox {
    /// Summary of all steps.
    pub fn summary(&self) -> Summary {
        let mut own = Summary {
            head: self.head.clone(),
            t: [f64::NAN; 2],
            samples: 0,
            sessions: self.sessions(),
            outcomes: Outcomes::default(),
            predicted_by: [0; 3],
            least_variance: f64::NAN,
            min_s_over_r: f64::NAN,
            largest_nis: [f64::NAN; 2],
            events: Vec::new(),
            torn: self.torn,
            damaged: self.is_damaged(),
        };
        let names = self.head.names();
        for step in self.steps().filter(|step| step.is_sample()) {
            let t = step.t();
            own.t = if own.samples == 0 { [t, t] } else { [own.t[0], t] };
            own.samples += 1;
            *match step.status() {
                "accepted" => &mut own.outcomes.accepted,
                "inflated" => &mut own.outcomes.inflated,
                "rejected" => &mut own.outcomes.rejected,
                "rolled_back" => &mut own.outcomes.rolled_back,
                _ => &mut own.outcomes.waiting,
            } += 1;
            if let Some(active) = step.active() {
                own.predicted_by[active.index()] += 1;
            }
            // `min` ignores NaN.
            let [variance, min_s_over_r] = step.health();
            own.least_variance = own.least_variance.min(variance);
            own.min_s_over_r = own.min_s_over_r.min(min_s_over_r);
            let nis = step.nis();
            if nis > own.largest_nis[0] || (own.largest_nis[0].is_nan() && !nis.is_nan()) {
                own.largest_nis = [nis, t];
            }
            let happened = step.described(&names).map(|(action, text)| LoggedEvent {
                run: step.run().to_owned(),
                t,
                action,
                text,
            });
            own.events.extend(happened);
        }
        own
    }

    fn sessions(&self) -> usize {
        let mut pairs = 1;
        for pair in self.segments.windows(2) {
            pairs += usize::from(
                !(pair[1].continues && pair[0].sequence.checked_add(1) == Some(pair[1].sequence)),
            );
        }
        pairs.min(self.segments.len())
    }
}
