//! Limits of the commands, and options of controller and adaptation.

use std::time::Duration;

use hydroid_core::control::AdaptiveAugmentationOptions;
use hydroid_core::control::cem::PlannerOptions;

use super::error::{SetupError, ensure};
use super::options::ClosedLoopOptions;
use super::setup::NamedModel;
use crate::adapt;
use crate::boat::{Role, Roles, StatedRoles};
use crate::closed_loop::{ControllerOptions, Scale, Scenario, Timing};
use crate::config::Adapt;
use crate::config::value::by_name;
use crate::config::with_values;
use crate::identify::GivenRanges;
use crate::key::key;
use crate::model::Model;
use crate::plant::{find_roles, input_values};
use crate::toml_file::nearest;

/// Largest product of candidates and horizon: 80 MB for each command.
const MAX_SAMPLES: usize = 10_000_000;

/// The roles of inputs that a vessel has.
fn known(roles: &Roles, inputs: &[&str]) -> Roles {
    roles
        .iter()
        .filter(|(name, _)| inputs.contains(&name.as_str()))
        .map(|(n, role)| (n.clone(), *role))
        .collect()
}

/// The place of a command of the plant.
fn place(option: &str, name: &str, commands: &[&str]) -> Result<usize, SetupError> {
    commands.iter().position(|command| *command == name).ok_or_else(|| {
        let nearest = nearest(name, commands.iter().copied());
        let nearest = nearest.map(|n| format!(", did you mean '{n}'?")).unwrap_or_default();
        let known = commands.join(", ");
        SetupError::option(format!(
            "{}: the plant has no command '{name}'{nearest}; its commands are {known}",
            key(option)
        ))
    })
}

/// Refuses limits that are beyond those that the model states for an actuator of the boat.
fn check_within_stated(before: &Model, after: &Model, limits: &GivenRanges) -> Result<(), SetupError> {
    let pairs = input_values(before)?.into_iter().zip(input_values(after)?);
    for (stated, given) in pairs.filter(|(stated, _)| limits.contains_key(&stated.name)) {
        let ([least, most], [low, high]) = (stated.limits, given.limits);
        let room = 1e-9 * (most - least);
        ensure(stated.limits_found.is_some() || (least - room <= low && high <= most + room), || {
            format!(
                "{}: the model states that the actuator takes {least} to {most} {}, and {low} to {high} are given: limits may be closer, and not wider. If it takes more, correct the file of the vessel, or identify with its true limits",
                key("limit").is(&stated.name),
                stated.unit
            )
        })?;
    }
    Ok(())
}

impl ClosedLoopOptions {
    /// A model with the roles, neutral values and limits of the options. Beside another vessel, it may lack an input.
    pub(super) fn overlaid(
        &self,
        NamedModel { name, model }: NamedModel,
        is_beside_another: bool,
    ) -> Result<NamedModel, SetupError> {
        let inputs: Vec<String> =
            model.description.inputs.iter().map(|port| port.channel.name.clone()).collect();
        let keep = |name: &String| !is_beside_another || inputs.contains(name);
        let (mut roles, mut neutral, mut limits) =
            (StatedRoles::given(&self.role), by_name(&self.neutral), by_name(&self.limit));
        roles.retain(|name, _| keep(name));
        neutral.retain(|name, _| keep(name));
        limits.retain(|name, _| keep(name));
        let before = model.with_roles(&roles)?;
        let model = with_values(before.clone(), &neutral, &limits)?;
        check_within_stated(&before, &model, &limits)?;
        Ok(NamedModel { name, model })
    }

    /// Checks that the inputs of `limit` and `neutral` are commands of the plant.
    pub(super) fn check_commands(&self, plant: &Model) -> Result<(), SetupError> {
        let inputs = &plant.description.inputs;
        let commands: Vec<&str> = inputs.iter().map(|port| port.channel.name.as_str()).collect();
        let boat = find_roles(&plant.clone().with_roles(&known(&StatedRoles::given(&self.role), &commands))?);
        for (name, _) in &self.limit {
            place("limit", name, &commands)?;
            ensure(boat.role(name).is_none_or(Role::is_commanded), || {
                format!(
                    "{}: the input {name} is not commanded; state its value, as in {}, or make it an actuator, as in {}",
                    key("limit"),
                    key("neutral").is(format_args!("{name}=0")),
                    key("role").is(format_args!("{name}=thruster"))
                )
            })?;
        }
        self.neutral.iter().try_for_each(|(name, _)| place("neutral", name, &commands).map(|_| ()))
    }

    /// Sets the limits of the rates that are stated, in the unit of the boat.
    pub(super) fn state_rates(&self, scene: &mut Scenario, plant: &Model) -> Result<(), SetupError> {
        let d = &plant.description;
        let commands: Vec<&str> = d.inputs.iter().map(|port| port.channel.name.as_str()).collect();
        for (name, number) in &self.rate_limit {
            let index = place("rate_limit", name, &commands)?;
            ensure(*number > 0.0, || {
                let option = key("rate_limit").is(format_args!("{name}={number}"));
                format!("{option}: the limit of a rate must be greater than 0")
            })?;
            let raw = d.boat.raw_input(&d.inputs[index].channel, None);
            scene.limits[index].rate = number * raw.map_or(1.0, |raw| raw.factor.abs());
        }
        Ok(())
    }

    /// Options of the controller without its model.
    pub(super) fn controller(&self, scene: &Scenario, scale: Scale) -> Result<ControllerOptions, SetupError> {
        let mut made = ControllerOptions::new(self.controller, &scene.plant, scene.dt_s).scaled(scale);
        (made.limits, made.tolerance) = (scene.limits.clone(), scene.tolerance);
        made.ahead = !scene.track.is_station;
        made.lead = self.lead.unwrap_or(made.lead);
        made.bandwidth = self.bandwidth.or(made.bandwidth);
        made.integral = self.integral.unwrap_or(0.0);
        made.learned = self.adaptive_augmentation.then(AdaptiveAugmentationOptions::default);
        made.rate = self.rate.or(made.rate);
        made.max_age_s = self.max_age.map_or(made.max_age_s, |age| age.0);
        if self.reference == Some(Timing::Path) {
            made.timing = Timing::Path;
        }
        made.planner = self.planner(made.planner, scene.limits.len())?;
        if let Some(weights) = self.cost_weights {
            [made.cost.position, made.cost.heading, made.cost.speed] = weights;
        }
        if let Some(weight) = self.change_weight {
            made.cost.rate.fill(weight);
        }
        if let Some(ms) = self.plan_time {
            ensure(ms > 0.0 && ms < 1e6, || {
                format!("{}: the time limit in milliseconds must be greater than 0", key("plan_time").is(ms))
            })?;
            made.budget = Some(Duration::from_secs_f64(1e-3 * ms));
        }
        Ok(made)
    }

    fn planner(&self, default: PlannerOptions, commands: usize) -> Result<PlannerOptions, SetupError> {
        let candidates = self.candidates.unwrap_or(default.candidates);
        let horizon = self.horizon.unwrap_or(default.horizon);
        let of = |name, value: usize| key(name).is(value);
        ensure(candidates > 0, || format!("{}: at least one candidate is needed", of("candidates", 0)))?;
        ensure(candidates.saturating_mul(horizon) <= MAX_SAMPLES, || {
            let [candidates, horizon] = [of("candidates", candidates), of("horizon", horizon)];
            format!("{candidates} times {horizon} is more than {MAX_SAMPLES}: reduce one of them")
        })?;
        let gauss_newton_steps = self.gauss_newton_steps.unwrap_or(default.gauss_newton_steps);
        let most = PlannerOptions::MAX_GAUSS_NEWTON_COMMANDS;
        ensure(gauss_newton_steps == 0 || horizon.saturating_mul(commands) <= most, || {
            format!(
                "{}: Gauss-Newton steps solve for all commands of a plan, at most {most}; use a shorter horizon, or {}",
                of("horizon", horizon),
                of("gauss_newton_steps", 0)
            )
        })?;
        let hold = self.hold.unwrap_or(default.hold);
        ensure(candidates.saturating_mul(horizon).saturating_mul(hold) <= 10 * MAX_SAMPLES, || {
            format!(
                "{} times {} times {} is more than {}: reduce one of them",
                of("candidates", candidates),
                of("horizon", horizon),
                of("hold", hold),
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
        let adaptation = Adapt { learner: self.learner, no_guard: self.no_guard, ..Adapt::default() };
        adaptation.options(model).map_err(|error| SetupError::Option(error.to_string()))
    }
}
