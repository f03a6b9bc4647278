//! What is to be said of a box as a whole.

use serde::Serialize;

use super::{BlackBox, Head};
use hydroid::adapt::LoggedEvent;

/// How many samples became what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[expect(missing_docs, reason = "the words of the stream's answers")]
pub struct Outcomes {
    pub waiting: usize,
    pub accepted: usize,
    pub inflated: usize,
    pub rejected: usize,
    pub rolled_back: usize,
}

/// A box in short.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Model, settings, names and sizes.
    pub head: Head,
    /// Times of the first and of the last sample \[s\]; NaN where there is none.
    pub t: [f64; 2],
    /// Samples observed.
    pub samples: usize,
    /// Stretches that do not go on where the one before ended: a start of the service is one.
    pub stretches: usize,
    /// What became of the samples.
    pub outcomes: Outcomes,
    /// Samples from which the learner, its snapshot and the model from shore predicted; zeros without a guard.
    pub predicted_by: [usize; 3],
    /// The smallest variance of a weight, and the smallest `S_ii / R_ii`; NaN where they were not known.
    pub least_variance: f64,
    /// See [`least_variance`](Self::least_variance).
    pub min_s_over_r: f64,
    /// The largest sum of squared innovations, and its time \[s\].
    pub largest_nis: [f64; 2],
    /// What the guard did.
    pub events: Vec<LoggedEvent>,
    /// Segments that were left out: torn by a kill, or damaged.
    pub torn: usize,
    /// Whether steps in the middle could not be read.
    pub damaged: bool,
}

impl BlackBox {
    /// In short.
    pub fn summary(&self) -> Summary {
        let mut own = Summary {
            head: self.head.clone(),
            t: [f64::NAN; 2],
            samples: 0,
            stretches: self.stretches(),
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
            // The smaller of a number and NaN is the number.
            let [variance, min_s_over_r] = step.health();
            own.least_variance = own.least_variance.min(variance);
            own.min_s_over_r = own.min_s_over_r.min(min_s_over_r);
            let nis = step.nis();
            if nis > own.largest_nis[0] || (own.largest_nis[0].is_nan() && !nis.is_nan()) {
                own.largest_nis = [nis, t];
            }
            let happened = step.worded(&names).map(|(action, text)| LoggedEvent {
                run: step.run().to_owned(),
                t,
                action,
                text,
            });
            own.events.extend(happened);
        }
        own
    }

    fn stretches(&self) -> usize {
        let mut pairs = 1;
        for pair in self.segments.windows(2) {
            pairs +=
                usize::from(!(pair[1].goes_on && pair[0].sequence.checked_add(1) == Some(pair[1].sequence)));
        }
        pairs.min(self.segments.len())
    }
}
