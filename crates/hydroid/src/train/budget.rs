//! Keeping to a time.

use std::time::{Duration, Instant};

use hydroid_core::math::Scalar;

use super::team::Team;

/// How often the caller hears of the training.
const TELL: Duration = Duration::from_millis(50);

/// Steps by which the time of an epoch is told, after one that warms caches.
const TRIALS: usize = 4;

/// Share of a budget that is planned: the rest is for a machine that turns out slower.
const PLANNED: f64 = 0.94;

/// Share of a budget after which no step begins.
const OVER: f64 = 0.995;

/// The clock of a training.
#[derive(Debug)]
pub(super) struct Clock {
    start: Instant,
    /// When epochs began.
    epochs: Instant,
    told: Instant,
    budget: Option<f64>,
    /// Time that an epoch's judgement takes \[s\], as far as it was looked at.
    judging: f64,
}

impl Clock {
    pub(super) fn start(budget: Option<f64>) -> Self {
        let start = Instant::now();
        Self { start, epochs: start, told: start, budget, judging: 0.0 }
    }

    /// Time since the start \[s\].
    pub(super) fn seconds(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// Whether the time is over, or would be when what was learned is judged.
    pub(super) fn is_over(&self) -> bool {
        self.budget.is_some_and(|budget| self.seconds() + self.judging > OVER * budget)
    }

    /// How many epochs fit the budget, by steps that are made and not taken: the schedule must know its end, and may
    /// not look at the clock on its way there.
    pub(super) fn epochs<T: Scalar>(&mut self, team: &mut Team<T>) -> usize {
        let most = team.plan.epochs;
        let Some(budget) = self.budget else { return most };
        let batches = team.begin(0);
        team.gradients(0);
        let trials = TRIALS.min(batches);
        let begun = Instant::now();
        (0..trials).for_each(|batch| team.gradients(batch));
        let step = begun.elapsed().as_secs_f64() / trials as f64;
        let begun = Instant::now();
        team.judge();
        self.judging = begun.elapsed().as_secs_f64();
        let epoch = step * batches as f64 + self.judging;
        let left = PLANNED * budget - self.seconds();
        self.epochs = Instant::now();
        // The cast saturates: a negative number of epochs becomes 0, and then 1.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let fit = (left / epoch) as usize;
        fit.clamp(1, most)
    }

    /// The time that is left when `done` of `epochs` epochs are done, if it is time to tell.
    pub(super) fn tell(&mut self, done: f64, epochs: usize) -> Option<f64> {
        if self.told.elapsed() < TELL {
            return None;
        }
        self.told = Instant::now();
        let left = self.epochs.elapsed().as_secs_f64() * (epochs as f64 / done - 1.0);
        Some(left.max(0.0))
    }
}
