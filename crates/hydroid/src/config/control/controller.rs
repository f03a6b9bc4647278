//! Limits of the commands, and options of controller and adaptation.

use std::time::Duration;

use hydroid_core::actuator::Limits;
use hydroid_core::control::AdaptiveAugmentationOptions;
use hydroid_core::control::cem::PlannerOptions;

use super::error::{SetupError, ensure};
use super::options::ClosedLoopOptions;
use crate::adapt::{self, Method};
use crate::closed_loop::{ControllerOptions, Scale, Scenario, Timing};
use crate::log::units::Unit;
use crate::model::Model;
use crate::plant::InputMap;
use crate::toml_file::nearest;

/// Largest product of candidates and horizon: 80 MB for each command.
const MAX_SAMPLES: usize = 10_000_000;

impl ClosedLoopOptions {
    /// Sets the limits, the values at rest and the limits of the rates that are stated.
    pub(super) fn state_limits(&self, scene: &mut Scenario) -> Result<(), SetupError> {
        let commands = scene.plant.commands();
        let place = |option: &str, name: &str| {
            let known = || commands.iter().map(|channel| channel.name.as_str());
            commands.iter().position(|channel| channel.name == name).ok_or_else(|| {
                let nearest =
                    nearest(name, known()).map(|n| format!(", did you mean '{n}'?")).unwrap_or_default();
                let known = known().collect::<Vec<_>>().join(", ");
                SetupError::option(format!(
                    "{option}: the plant has no command '{name}'{nearest}; its commands are {known}"
                ))
            })
        };
        for (name, range) in &self.limit {
            let index = place("--limit", name)?;
            let scale = match &range.unit {
                None => 1.0,
                Some(unit) => Unit::parse(&commands[index].unit)
                    .and_then(|own| Unit::parse(unit)?.to(&own))
                    .map_err(|source| SetupError::Unit { name: name.clone(), unit: unit.clone(), source })?,
            };
            let (low, high) = (scale * range.low, scale * range.high);
            let limits = &mut scene.limits[index];
            ensure(!limits.are_held(), || {
                format!(
                    "--limit {name}: this input is not commanded; state its value with --neutral {name}=X, or make it an actuator, as in --role {name}=thruster"
                )
            })?;
            (limits.low, limits.high, limits.rest) = (low, high, limits.rest.clamp(low, high));
        }
        for (name, number) in &self.neutral {
            let index = place("--neutral", name)?;
            let Limits { low, high, .. } = scene.limits[index];
            // A disturbance or a setting has the value that is stated.
            if scene.limits[index].are_held() && number.is_finite() {
                scene.limits[index] = Limits::held(*number);
                continue;
            }
            ensure((low..=high).contains(number), || {
                format!(
                    "--neutral {name}={number}: the limits of '{name}' are {low} and {high}; give a value between them, or other limits with --limit"
                )
            })?;
            scene.limits[index].rest = *number;
        }
        for (name, number) in &self.rate_limit {
            let index = place("--rate-limit", name)?;
            ensure(*number > 0.0, || {
                format!("--rate-limit {name}={number}: the limit of a rate must be greater than 0")
            })?;
            scene.limits[index].rate = *number;
        }
        Ok(())
    }

    /// The inputs that push and turn a vessel, within the limits of a scenario.
    pub(super) fn input_map(&self, model: &Model, scene: &Scenario) -> Result<InputMap, SetupError> {
        let mut model = model.clone();
        for (port, limits) in model.description.inputs.iter_mut().zip(&scene.limits) {
            (port.range.low, port.range.high) = (limits.low, limits.high);
        }
        let mut inputs = InputMap::with(&model, &self.push, &self.turn)?;
        for ((neutral, range), limits) in inputs.neutral.iter_mut().zip(&mut inputs.limits).zip(&scene.limits)
        {
            *neutral = limits.rest;
            if limits.are_held() {
                *range = [limits.low, limits.high];
            }
        }
        Ok(inputs)
    }

    /// Options of the controller without its model.
    pub(super) fn controller(&self, scene: &Scenario, scale: Scale) -> Result<ControllerOptions, SetupError> {
        let mut made = ControllerOptions::new(self.controller, &scene.plant, scene.dt_s).scaled(scale);
        (made.limits, made.tolerance) = (scene.limits.clone(), scene.tolerance);
        made.lead = self.lead.unwrap_or(made.lead);
        made.bandwidth = self.bandwidth.or(made.bandwidth);
        made.integral = self.integral.unwrap_or(0.0);
        made.learned = self.adaptive_augmentation.then(AdaptiveAugmentationOptions::default);
        made.rate = self.rate.or(made.rate);
        if self.reference == Some(Timing::Path) {
            made.timing = Timing::Path;
        }
        made.planner = self.planner(made.planner, scene.limits.len())?;
        if let Some(weights) = self.cost_weights {
            [made.cost.position, made.cost.heading, made.cost.speed] = weights;
        }
        if let Some(ms) = self.plan_time {
            ensure(ms > 0.0 && ms < 1e6, || {
                format!("--plan-time {ms}: the time limit in milliseconds must be greater than 0")
            })?;
            made.budget = Some(Duration::from_secs_f64(1e-3 * ms));
        }
        Ok(made)
    }

    fn planner(&self, default: PlannerOptions, commands: usize) -> Result<PlannerOptions, SetupError> {
        let candidates = self.candidates.unwrap_or(default.candidates);
        let horizon = self.horizon.unwrap_or(default.horizon);
        ensure(candidates > 0, || "--candidates 0: at least one candidate is needed".to_owned())?;
        ensure(candidates.saturating_mul(horizon) <= MAX_SAMPLES, || {
            format!(
                "--candidates {candidates} times --horizon {horizon} is more than {MAX_SAMPLES}: reduce one of them"
            )
        })?;
        let gauss_newton_steps = self.gauss_newton_steps.unwrap_or(default.gauss_newton_steps);
        let most = PlannerOptions::MAX_GAUSS_NEWTON_COMMANDS;
        ensure(gauss_newton_steps == 0 || horizon.saturating_mul(commands) <= most, || {
            format!(
                "--horizon {horizon}: Gauss-Newton steps solve for all commands of a plan, at most {most}; use a shorter horizon, or --gauss-newton-steps 0"
            )
        })?;
        let hold = self.hold.unwrap_or(default.hold);
        ensure(candidates.saturating_mul(horizon).saturating_mul(hold) <= 10 * MAX_SAMPLES, || {
            format!(
                "--candidates {candidates} times --horizon {horizon} times --hold {hold} is more than {}: reduce one of them",
                10 * MAX_SAMPLES
            )
        })?;
        Ok(PlannerOptions {
            horizon,
            hold,
            candidates,
            elites: (candidates / 10).max(2),
            iterations: self.iterations.unwrap_or(default.iterations),
            gauss_newton_steps,
            ..default
        })
    }

    /// Options of the online adaptation: the defaults of the kind of model.
    pub(super) fn adaptation(&self, model: &Model) -> Result<adapt::Options, SetupError> {
        adapt::adaptable(model)?;
        let mut options = adapt::Options::of(model);
        let (equations, direct) = (model.equations().is_some(), model.direct().is_some());
        ensure(!direct || self.learner != Some(Method::Kalman), || {
            "direct predictors adapt by least squares: leave --learner kalman out".to_owned()
        })?;
        ensure(equations || direct || self.learner != Some(Method::LeastSquares), || {
            format!(
                "--learner least-squares needs equations or a direct predictor: this is a model of kind '{}'; leave it out",
                model.kind()
            )
        })?;
        if self.learner == Some(Method::Kalman) {
            options.method = Method::Kalman;
        }
        Ok(if self.no_guard { options } else { options.guarded(model) })
    }
}
