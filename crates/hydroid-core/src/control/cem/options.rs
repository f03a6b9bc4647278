//! Options of the planner.

use crate::control::error::{ControlError, positive};

/// Options of a [`Planner`](super::Planner). The defaults suit a boat with samples of 0.1 s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannerOptions {
    /// Horizon of a plan \[commands\].
    pub horizon: usize,
    /// Samples for which a command of a plan is held. A new plan is made when it ends.
    pub hold: usize,
    /// Number of candidates in each iteration.
    pub candidates: usize,
    /// Number of elites, which determine the next iteration.
    pub elites: usize,
    /// Largest number of iterations.
    pub iterations: usize,
    /// Share of the previous mean and deviations in an update, 0 to 1 (smoothing of de Boer et al.).
    pub momentum: f64,
    /// Initial deviation, relative to half of the range of each command.
    pub deviation: f64,
    /// Minimum deviation, on the same scale.
    pub least_deviation: f64,
    /// Correlation time of the random commands \[s\]. White noise changes sign too fast to move a vessel.
    pub correlation_s: f64,
    /// Largest number of Gauss-Newton steps from the best candidate; 0 for none.
    pub gauss_newton_steps: usize,
    /// Seed of the random numbers.
    pub seed: u64,
}

impl PlannerOptions {
    /// Largest number of commands of a plan (horizon times inputs) for Gauss-Newton steps, whose work is cubic in it.
    pub const MAX_GAUSS_NEWTON_COMMANDS: usize = 400;

    /// A horizon of 20 samples, a plan in each sample, 60 candidates, 6 elites, 2 iterations, and 2 Gauss-Newton steps. More
    /// candidates matter without Gauss-Newton steps.
    pub const fn new(seed: u64) -> Self {
        Self {
            horizon: 20,
            hold: 1,
            candidates: 60,
            elites: 6,
            iterations: 2,
            momentum: 0.1,
            deviation: 0.5,
            least_deviation: 0.02,
            correlation_s: 0.5,
            gauss_newton_steps: 2,
            seed,
        }
    }

    pub(super) fn check(&self) -> Result<(), ControlError> {
        let least = |what, value: usize, least: usize, needed| {
            if value >= least {
                Ok(())
            } else {
                Err(ControlError::Setting { what, value: value as f64, needed })
            }
        };
        least("the horizon", self.horizon, 1, "a sample or more is needed")?;
        least("the number of samples of a command", self.hold, 1, "a sample or more is needed")?;
        least("the number of elites", self.elites, 2, "2 or more are needed")?;
        least("the number of candidates", self.candidates, self.elites + 2, "2 more than elites are needed")?;
        least("the number of iterations", self.iterations, 1, "1 or more is needed")?;
        if !(0.0..1.0).contains(&self.momentum) {
            let needed = "0 or more and less than 1 is needed";
            return Err(ControlError::Setting { what: "the momentum", value: self.momentum, needed });
        }
        positive("the deviation of the first iteration", self.deviation)?;
        positive("the least deviation", self.least_deviation)?;
        if !(self.correlation_s.is_finite() && self.correlation_s >= 0.0) {
            let needed = "0 seconds or more are needed";
            return Err(ControlError::Setting { what: "the correlation", value: self.correlation_s, needed });
        }
        Ok(())
    }
}
