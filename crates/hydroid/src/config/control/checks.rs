//! Options without effect are refused.

use super::error::{SetupError, ensure};
use super::options::{ClosedLoopOptions, TaskKind};
use crate::closed_loop::{ControlMethod, Timing};
use crate::key::key;

/// Largest number of Monte Carlo trials.
const MAX_RUNS: usize = 1_000_000;

impl ClosedLoopOptions {
    /// Checks that every option that is given belongs to the controller, the task, and the kind of run.
    ///
    /// # Errors
    /// If one has no effect; the message names it.
    pub fn check(&self) -> Result<(), SetupError> {
        self.check_controller()?;
        self.check_adaptation()?;
        self.check_trials()?;
        self.check_task()
    }

    /// Checks that no option belongs to a simulation, for a controller on board.
    ///
    /// # Errors
    /// If one does; the message names it.
    pub fn check_on_board(&self) -> Result<(), SetupError> {
        none(self.of_simulation(), |option| {
            format!("{option} belongs to a simulated run: leave it out for a controller on board")
        })
    }

    /// Checks that no option belongs to a controller on board, for a simulated run.
    ///
    /// # Errors
    /// If one does; the message names it.
    pub fn check_simulated(&self) -> Result<(), SetupError> {
        none(first!(self, max_age), |option| {
            format!("{option} belongs to a controller on board: leave it out of a simulated run")
        })
    }

    fn check_controller(&self) -> Result<(), SetupError> {
        use ControlMethod::{Autopilot, CrossEntropy};
        let law = |law: ControlMethod| key("controller").is(law.name());
        for (owner, given) in self.of_laws() {
            none(given.filter(|_| self.controller != owner), |option| {
                format!("{option} needs {}: leave it out", law(owner))
            })?;
        }
        let is_predictive = self.controller == CrossEntropy;
        ensure(is_predictive || self.task != TaskKind::Station, || {
            let task = key("task").is("station");
            format!("{task} needs {}: fl, backstepping and pid steer along a path", law(CrossEntropy))
        })?;
        ensure(is_predictive || self.reference.is_none_or(|timing| timing == Timing::Clock), || {
            format!(
                "{} needs {}: fl and backstepping track a trajectory in time, pid follows the path",
                key("reference"),
                law(CrossEntropy)
            )
        })?;
        let is_pid = self.controller == Autopilot;
        ensure(!is_pid || self.lead.is_none_or(|lead| lead == 0.0), || {
            format!("{}: pid controls the vessel's origin; leave it out", key("lead"))
        })?;
        none(first!(self, estimate_current adapt).filter(|_| is_pid), |option| {
            format!(
                "{option} needs a controller that predicts with a model; pid does not: leave {option} out"
            )
        })
    }

    fn check_adaptation(&self) -> Result<(), SetupError> {
        let adapt = key("adapt");
        none(first!(self, learner no_guard).filter(|_| !self.adapt), |option| {
            format!("{option} is an option of the adaptation: set {adapt} too, or leave it out")
        })?;
        none(first!(self, adaptive_augmentation).filter(|_| self.adapt), |option| {
            format!("{option} and {adapt} both learn the error of the model: leave one of them out")
        })
    }

    fn check_trials(&self) -> Result<(), SetupError> {
        let runs = self.runs();
        none(
            first!(self, mass_variation current_variation wind_variation).filter(|_| runs == 1),
            |option| {
                format!(
                    "{option} applies to Monte Carlo trials: add {}, or state the value of a single run by {}, {}, {}",
                    key("runs"),
                    key("mass"),
                    key("current"),
                    key("wind")
                )
            },
        )?;
        ensure(runs <= MAX_RUNS, || format!("{}: the largest number is {MAX_RUNS}", key("runs").is(runs)))
    }

    fn check_task(&self) -> Result<(), SetupError> {
        let is_station = self.task == TaskKind::Station;
        let by_points = matches!(self.task, TaskKind::Waypoints | TaskKind::Legs);
        let task = |name: &'static str| key("task").is(name);
        none(first!(self, leg spacing legs).filter(|_| self.task != TaskKind::LawnMower), |option| {
            format!("{option} needs {}", task("lawn-mower"))
        })?;
        none(first!(self, points).filter(|_| !by_points && !is_station), |option| {
            format!("{option} needs {}, {} or {}", task("waypoints"), task("legs"), task("station"))
        })?;
        none(first!(self, waypoints).filter(|_| !by_points), |option| {
            format!("{option} needs {} or {}", task("waypoints"), task("legs"))
        })?;
        none(first!(self, waypoints).filter(|_| self.points.is_some()), |option| {
            format!("{} and {option} both state the points: leave one of them out", key("points"))
        })?;
        ensure(self.heading.is_none_or(f64::is_finite), || {
            format!("{}: give degrees, clockwise from north", key("heading"))
        })?;
        none(first!(self, heading).filter(|_| !is_station), |option| {
            format!("{option} needs {}", task("station"))
        })?;
        none(first!(self, radius).filter(|_| self.task == TaskKind::Legs), |option| {
            format!("{} has sharp corners: leave {option} out, or set {}", task("legs"), task("waypoints"))
        })?;
        none(first!(self, speed turn_speed radius acceleration).filter(|_| is_station), |option| {
            format!("{option}: a station has no speed and no turns: leave it out")
        })?;
        ensure(self.turn_speed.is_none() || self.task != TaskKind::Circle, || {
            let [speed, turn] = [key("speed"), key("turn_speed")];
            format!("{} has one speed: set {speed}, and leave {turn} out", task("circle"))
        })
    }
}

/// An error if an option is given.
fn none(given: Option<&str>, message: impl FnOnce(String) -> String) -> Result<(), SetupError> {
    given.map_or(Ok(()), |name| Err(SetupError::Option(message(key(name).to_string()))))
}
