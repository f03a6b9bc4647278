//! Keeping to a time.

use std::time::{Duration, Instant};

use hydroid_core::math::Scalar;

use super::TrainError;
use super::team::Team;

/// How often the caller hears of the training.
const TELL: Duration = Duration::from_millis(50);

/// Steps by which the time of an epoch is told, after one that warms caches.
const TRIALS: usize = 4;

/// How much longer than others the first step may take.
const COLD: f64 = 10.0;

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
    /// Time that an epoch takes \[s\], likewise.
    epoch: f64,
}

impl Clock {
    pub(super) fn start(budget: Option<f64>) -> Self {
        let start = Instant::now();
        Self { start, epochs: start, told: start, budget, judging: 0.0, epoch: 0.0 }
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
    pub(super) fn epochs<T: Scalar>(
        &mut self,
        team: &mut Team<T>,
        mut watch: impl FnMut(&Team<T>) -> Result<(), TrainError>,
    ) -> Result<usize, TrainError> {
        let most = team.plan.epochs;
        let Some(budget) = self.budget else { return Ok(most) };
        let batches = team.begin(0);
        let trials = TRIALS.min(batches);
        let mut step = 0.0;
        for trial in 0..=trials {
            let begun = Instant::now();
            team.gradients(trial.saturating_sub(1));
            let took = begun.elapsed().as_secs_f64();
            // The first one warms caches; it tells only of what is far too long.
            step = if trial == 0 { took } else { (step * (trial - 1) as f64 + took) / trial as f64 };
            self.epoch = step * batches as f64;
            let margin = if trial == 0 { COLD } else { 1.0 };
            if self.seconds() > OVER * budget || self.epoch > margin * budget {
                return Err(self.no_time());
            }
            watch(team)?;
        }
        let begun = Instant::now();
        team.judge();
        self.judging = begun.elapsed().as_secs_f64();
        self.epoch += self.judging;
        if self.seconds() + self.epoch > OVER * budget {
            return Err(self.no_time());
        }
        let left = PLANNED * budget - self.seconds();
        self.epochs = Instant::now();
        // The cast saturates: a negative number of epochs becomes 0, and then 1.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let fit = (left / self.epoch) as usize;
        Ok(fit.clamp(1, most))
    }

    /// The budget is less than an epoch.
    pub(super) fn no_time(&self) -> TrainError {
        TrainError::NoTime { budget_s: self.budget.unwrap_or(0.0), epoch_s: self.epoch.max(self.seconds()) }
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
