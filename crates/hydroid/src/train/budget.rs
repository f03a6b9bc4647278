//! Time budget of a training.

use std::time::Duration;

use hydroid_core::math::Scalar;
use web_time::Instant;

use super::TrainError;
use super::restarts::Restarts;

const TELL: Duration = Duration::from_millis(50);

/// Steps that measure the time of an epoch, after one warm-up step.
const TRIALS: usize = 4;

/// Largest ratio of the first step to the others.
const COLD: f64 = 10.0;

/// Planned share of a budget; the rest is a reserve.
const PLANNED: f64 = 0.94;

/// Share of a budget after which no step begins.
const OVER: f64 = 0.995;

#[derive(Debug)]
pub(super) struct Clock {
    start: Instant,
    /// Start of the first epoch.
    epochs: Instant,
    told: Instant,
    budget: Option<f64>,
    /// Estimated time of a validation \[s\].
    judging: f64,
    /// Estimated time of an epoch \[s\].
    epoch: f64,
}

impl Clock {
    pub(super) fn start(budget: Option<f64>) -> Self {
        let start = Instant::now();
        Self { start, epochs: start, told: start, budget, judging: 0.0, epoch: 0.0 }
    }

    pub(super) fn seconds(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// Whether the time is over, the pending validation included.
    pub(super) fn is_over(&self) -> bool {
        self.budget.is_some_and(|budget| self.seconds() + self.judging > OVER * budget)
    }

    /// Number of epochs that fit the budget, estimated from trial steps before the schedule is fixed.
    pub(super) fn epochs<T: Scalar>(
        &mut self,
        restarts: &mut Restarts<T>,
        mut watch: impl FnMut(&Restarts<T>) -> Result<(), TrainError>,
    ) -> Result<usize, TrainError> {
        let most = restarts.plan.epochs;
        let Some(budget) = self.budget else { return Ok(most) };
        let batches = restarts.begin(0);
        let trials = TRIALS.min(batches);
        let mut step = 0.0;
        for trial in 0..=trials {
            let begun = Instant::now();
            restarts.gradients(trial.saturating_sub(1));
            let took = begun.elapsed().as_secs_f64();
            // The first step warms caches; it only detects a budget that is far too small.
            step = if trial == 0 { took } else { (step * (trial - 1) as f64 + took) / trial as f64 };
            self.epoch = step * batches as f64;
            let margin = if trial == 0 { COLD } else { 1.0 };
            if self.seconds() > OVER * budget || self.epoch > margin * budget {
                return Err(self.no_time());
            }
            watch(restarts)?;
        }
        let begun = Instant::now();
        restarts.judge();
        self.judging = begun.elapsed().as_secs_f64();
        self.epoch += self.judging;
        if self.seconds() + self.epoch > OVER * budget {
            return Err(self.no_time());
        }
        let left = PLANNED * budget - self.seconds();
        self.epochs = Instant::now();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let fit = (left / self.epoch) as usize;
        Ok(fit.clamp(1, most))
    }

    pub(super) fn no_time(&self) -> TrainError {
        TrainError::NoTime { budget_s: self.budget.unwrap_or(0.0), epoch_s: self.epoch.max(self.seconds()) }
    }

    /// Remaining time after `done` of `epochs` epochs, if a progress callback is due.
    pub(super) fn tell(&mut self, done: f64, epochs: usize) -> Option<f64> {
        if self.told.elapsed() < TELL {
            return None;
        }
        self.told = Instant::now();
        let left = self.epochs.elapsed().as_secs_f64() * (epochs as f64 / done - 1.0);
        Some(left.max(0.0))
    }
}
