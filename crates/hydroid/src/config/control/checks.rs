//! Options without effect are refused.

use super::error::{SetupError, ensure};
use super::options::{ClosedLoopOptions, TaskKind};
use crate::closed_loop::{ControlMethod, Timing};

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
        for (option, is_given) in [
            ("--runs", self.runs != 1),
            ("--duration", self.duration.is_some()),
            ("--start", self.start.is_some()),
            ("--evaluate-from", self.evaluate_from.is_some()),
            ("--noise", self.noise != 1.0),
            ("--process-noise", self.process_noise != 0.0),
            ("--current", self.current != [0.0; 2]),
            ("--wind", self.wind != [0.0; 2]),
            ("--gusts", self.gusts[0] != 0.0),
            ("--mass", self.mass != 1.0),
            ("--delay", self.delay != 0.0),
            ("--onset", self.onset.is_some()),
        ] {
            ensure(!is_given, || {
                format!("{option} belongs to a simulated run: leave it out for a controller on board")
            })?;
        }
        Ok(())
    }

    fn check_controller(&self) -> Result<(), SetupError> {
        use ControlMethod::{Autopilot, Backstepping, CrossEntropy, FeedbackLinearization};
        for (option, is_given, owner) in [
            ("--bandwidth", self.bandwidth.is_some(), FeedbackLinearization),
            ("--integral", self.integral.is_some(), FeedbackLinearization),
            ("--adaptive-augmentation", self.adaptive_augmentation, FeedbackLinearization),
            ("--rate", self.rate.is_some(), Backstepping),
            ("--horizon", self.horizon.is_some(), CrossEntropy),
            ("--hold", self.hold.is_some(), CrossEntropy),
            ("--candidates", self.candidates.is_some(), CrossEntropy),
            ("--iterations", self.iterations.is_some(), CrossEntropy),
            ("--gauss-newton-steps", self.gauss_newton_steps.is_some(), CrossEntropy),
            ("--cost-weights", self.cost_weights.is_some(), CrossEntropy),
            ("--plan-time", self.plan_time.is_some(), CrossEntropy),
        ] {
            let owner_name = owner.name();
            ensure(!is_given || self.controller == owner, || {
                format!("{option} needs --controller {owner_name}: leave it out")
            })?;
        }
        let is_predictive = self.controller == CrossEntropy;
        ensure(is_predictive || self.task != TaskKind::Station, || {
            "--task station needs --controller cem: fl, backstepping and pid steer along a path".to_owned()
        })?;
        ensure(is_predictive || self.reference.is_none_or(|timing| timing == Timing::Clock), || {
            "--reference needs --controller cem: fl and backstepping track a trajectory in time, pid follows the path".to_owned()
        })?;
        ensure(self.controller != Autopilot || self.lead.is_none_or(|lead| lead == 0.0), || {
            "--lead: pid controls the vessel's origin; leave --lead out".to_owned()
        })?;
        ensure(self.controller != Autopilot || self.estimate_current.is_none(), || {
            "--estimate-current needs a controller that predicts with a model; pid does not: leave it out"
                .to_owned()
        })?;
        ensure(self.controller != Autopilot || !self.adapt, || {
            "--adapt needs a controller that predicts with a model; pid does not: leave --adapt out"
                .to_owned()
        })
    }

    fn check_adaptation(&self) -> Result<(), SetupError> {
        for (option, is_given) in [("--learner", self.learner.is_some()), ("--no-guard", self.no_guard)] {
            ensure(!is_given || self.adapt, || {
                format!("{option} is an option of the adaptation: add --adapt, or leave it out")
            })?;
        }
        ensure(!(self.adaptive_augmentation && self.adapt), || {
            "--adaptive-augmentation and --adapt both learn the error of the model: leave one of them out"
                .to_owned()
        })
    }

    fn check_trials(&self) -> Result<(), SetupError> {
        for (option, is_given) in [
            ("--mass-variation", self.mass_variation.is_some()),
            ("--current-variation", self.current_variation.is_some()),
            ("--wind-variation", self.wind_variation.is_some()),
        ] {
            ensure(!is_given || self.runs != 1, || {
                format!(
                    "{option} applies to Monte Carlo trials: add --runs, or set the value of a single run by --mass, --current, --wind"
                )
            })?;
        }
        ensure(self.runs <= MAX_RUNS, || format!("--runs {}: the largest number is {MAX_RUNS}", self.runs))
    }

    fn check_task(&self) -> Result<(), SetupError> {
        let is_lawn = self.leg.is_some() || self.spacing.is_some() || self.legs.is_some();
        let is_station = self.task == TaskKind::Station;
        let by_points = matches!(self.task, TaskKind::Waypoints | TaskKind::Legs);
        for (holds, message) in [
            (
                !is_lawn || self.task == TaskKind::LawnMower,
                "--leg, --spacing and --legs need --task lawn-mower",
            ),
            (
                self.points.is_none() || by_points || is_station,
                "--points needs --task waypoints, --task legs or --task station",
            ),
            (self.waypoints.is_none() || by_points, "--waypoints needs --task waypoints or --task legs"),
            (
                self.points.is_none() || self.waypoints.is_none(),
                "--points and --waypoints both state the points: leave one of them out",
            ),
            (self.heading.is_none_or(f64::is_finite), "--heading: give degrees, clockwise from north"),
            (self.heading.is_none() || is_station, "--heading needs --task station"),
            (
                self.radius.is_none() || self.task != TaskKind::Legs,
                "--task legs has sharp corners: leave --radius out, or use --task waypoints",
            ),
        ] {
            ensure(holds, || message.to_owned())?;
        }
        for (option, is_given) in [
            ("--speed", self.speed.is_some()),
            ("--turn-speed", self.turn_speed.is_some()),
            ("--radius", self.radius.is_some()),
            ("--acceleration", self.acceleration.is_some()),
        ] {
            ensure(!(is_given && is_station), || {
                format!("{option}: a station has no speed and no turns: leave it out")
            })?;
        }
        match (self.turn_speed, self.task) {
            (Some(turn), TaskKind::Circle) => Err(SetupError::option(format!(
                "--task circle has one speed: use --speed {turn} and leave --turn-speed out"
            ))),
            _ => Ok(()),
        }
    }
}
