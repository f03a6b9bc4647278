//! How plans are looked for.

use crate::control::error::{ControlError, positive};

/// How plans are looked for. The defaults are those of a boat with samples of 0.1 s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannerOptions {
    /// Samples that a plan looks ahead.
    pub horizon: usize,
    /// Candidates in each iteration.
    pub candidates: usize,
    /// The best of them, which the next iteration is drawn around.
    pub elites: usize,
    /// Iterations at the most.
    pub iterations: usize,
    /// What is kept of the mean and deviation of the iteration before, 0 to 1 (momentum; the smoothing of de Boer et al.).
    pub momentum: f64,
    /// Deviation of the first iteration, in shares of half of the range of each command.
    pub deviation: f64,
    /// Deviation at the least, in the same shares: so that a plan can still move.
    pub least_deviation: f64,
    /// Time in which drawn commands are correlated \[s\]: noise that changes its sign with every sample moves no vessel.
    pub correlation_s: f64,
    /// Gauss-Newton steps from the best candidate at the most; 0 for what was drawn alone.
    pub gauss_newton_steps: usize,
    /// Seed of what is drawn.
    pub seed: u64,
}

impl PlannerOptions {
    /// Commands of a plan, samples times inputs, that steps downhill can solve for: their work grows with the cube.
    pub const MAX_GAUSS_NEWTON_COMMANDS: usize = 400;

    /// 20 samples ahead, 350 candidates, 35 elites, 5 iterations, and 2 steps downhill.
    pub const fn new(seed: u64) -> Self {
        Self {
            horizon: 20,
            candidates: 350,
            elites: 35,
            iterations: 5,
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
