//! From options, model and plant to a closed loop.

use std::path::Path;
use std::sync::Arc;

use hydroid_core::adapt::Adapter;
use hydroid_core::guidance::Border;

use super::error::{SetupError, ensure};
use super::options::ClosedLoopOptions;
use super::route::Route;
use crate::adapt::{self, ResolvedOptions};
use crate::boat::{Value, check_firm};
use crate::closed_loop::{
    ClosedLoopError, Conditions, ControlMethod, ControllerOptions, Pilot, Scale, Scenario, SpeedOptions,
    Task, Track, TunedAutopilot, limits_of, tune_autopilot,
};
use crate::excitation::PropellerRudder;
use crate::key::key;
use crate::manoeuvre::{Approach, Options, Response};
use crate::model::{self, MOTION, Model};
use crate::plant::{InputMap, Simulation, check_station, find_roles, input_values, values_by};
use crate::progress::Progress;

/// A model with the name under which documents and reports state it: that of its file.
#[derive(Clone, Debug)]
pub struct NamedModel {
    /// Name.
    pub name: String,
    /// Model.
    pub model: Model,
}

impl NamedModel {
    /// Reads a model file, a vessel file, or a built-in vessel.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(path: &Path) -> Result<Self, SetupError> {
        Ok(Self { name: path.display().to_string(), model: model::read(path)? })
    }
}

/// A closed loop that is ready to run.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The options.
    pub options: ClosedLoopOptions,
    /// Plant, track, limits and initial state.
    pub scenario: Scenario,
    /// Disturbances.
    pub conditions: Conditions,
    /// Start of the evaluation \[s\].
    pub from_s: f64,
    /// Options of the controller. The autopilot has no gains before [`tune`](Self::tune).
    pub controller: ControllerOptions,
    /// Path.
    pub task: Task,
    /// Speed.
    pub pace: SpeedOptions,
    /// Origin of the path, if its way-points are latitudes and longitudes \[deg\].
    pub origin_deg: Option<[f64; 2]>,
    /// Size of the vessel, from which the defaults follow.
    pub scale: Scale,
    /// Response of an identified model to its inputs, from which the size follows.
    pub response: Option<Response>,
    /// The model of the controller, of the tuning of the autopilot, or else the plant.
    pub model: Arc<Model>,
    /// The plant.
    pub plant: Arc<Model>,
    /// Name of the model, if one is given.
    pub model_name: Option<String>,
    /// Name of the plant.
    pub plant_name: String,
}

impl Setup {
    /// A closed loop of a controller with a model on a plant. Without `plant`, the model is the plant; the autopilot needs
    /// no `model`.
    ///
    /// # Errors
    /// If the options do not fit together, or do not fit model and plant.
    pub fn new(
        options: ClosedLoopOptions,
        model: Option<NamedModel>,
        plant: Option<NamedModel>,
    ) -> Result<Self, SetupError> {
        options.check()?;
        let method = options.controller;
        let model = match (model, options.estimate_current) {
            (Some(NamedModel { name, model }), Some(deviation)) => {
                Some(NamedModel { name, model: model.with_current(deviation)? })
            }
            (model, _) => model,
        };
        ensure(method == ControlMethod::Autopilot || model.is_some(), || no_model(method))?;
        if let Some(plant) = plant.as_ref().or(model.as_ref()) {
            options.check_commands(&plant.model)?;
        }
        let overlaid = |vessel: NamedModel, is_other: bool| options.overlaid(vessel, is_other);
        let model = match (model, plant.is_some()) {
            (Some(model), is_other) => Some(overlaid(model, is_other)?),
            (None, _) => None,
        };
        let plant = match plant {
            Some(plant) => Some(overlaid(plant, model.is_some())?),
            None => model.clone(),
        };
        let Some(plant) = plant else {
            return Err(SetupError::Option(no_model(method)));
        };
        let (model_name, plant_name) = (model.as_ref().map(|model| model.name.clone()), plant.name);
        let (model, plant) = (model.map(|model| model.model), plant.model);
        let dt_s = sample_time(&options, model.as_ref(), &plant)?;
        let model = model.map(|model| model.at_step(dt_s)).transpose()?;
        let plant = Arc::new(plant.at_step(dt_s)?);
        let response = response(&options, &plant, model.as_ref())?;
        let scale = response.as_ref().map_or(Scale::BOAT, Scale::of);
        let Route { task, pace, origin_deg } = Route::of(&options, scale, response.as_ref())?;
        let track = Track::new(&task, &pace)?.within(options.fence(origin_deg)?)?;
        let scenario = scenario(&options, &plant, track, scale, dt_s)?;
        if scenario.track.is_station {
            check_station(&plant, &scenario.limits)?;
        }
        let from_s = options.evaluate_from.map_or_else(|| scenario.default_from_s(), |from| from.0);
        scenario.check_from(from_s)?;
        let mut controller = options.controller(&scenario, scale)?;
        let model = match model {
            Some(model) => {
                if options.adapt {
                    controller.adapt = Some(options.adaptation(&model)?);
                }
                Arc::new(model)
            }
            None => Arc::clone(&plant),
        };
        if method == ControlMethod::Autopilot {
            let names = |model: &Model| {
                let names = model.description.inputs.iter().map(|port| port.channel.name.clone());
                names.collect::<Vec<_>>().join(", ")
            };
            let (tuned, steered) = (names(&model), names(&plant));
            ensure(tuned == steered, || {
                format!(
                    "the autopilot is tuned on a model with the inputs {tuned}, and those of the plant are {steered}"
                )
            })?;
        } else {
            controller.model = Some(Arc::clone(&model));
        }
        Ok(Self {
            conditions: options.conditions(),
            options,
            scenario,
            from_s,
            controller,
            task,
            pace,
            origin_deg,
            scale,
            response,
            model,
            plant,
            model_name,
            plant_name,
        })
    }

    /// Neutral value and limits of each input of the plant, with their evidence.
    ///
    /// # Errors
    /// If the boat contradicts itself.
    pub fn values(&self) -> Result<Vec<Value>, SetupError> {
        Ok(input_values(&self.plant)?)
    }

    /// Checks that no command to a real vessel rests on the logs alone: the role of every input is known, by `push` and `turn`
    /// too, and neutral value and limits of those that are commanded are stated, found or by convention.
    ///
    /// # Errors
    /// The first input of which one is not known, with the line or option that states it.
    pub fn check_firm(&self) -> Result<(), SetupError> {
        if let Some(reason) = self.model.not_identified(&[MOTION[0], MOTION[2]]) {
            return Err(SetupError::option(format!(
                "{reason}: a controller on board needs a model that predicts it; identify one from more logs, or take another method"
            )));
        }
        if let Some(reason) = self.model.moves_together() {
            return Err(SetupError::option(format!(
                "{reason}: log a run in which each moves independently, or identify without one of them, and command it with the other"
            )));
        }
        let boat = find_roles(&self.plant);
        let directions: Vec<&str> =
            self.options.push.iter().chain(&self.options.turn).map(|name| bare(name)).collect();
        for port in &self.plant.description.inputs {
            let name = port.channel.name.as_str();
            if !directions.contains(&name) {
                boat.check_role(name)?;
            }
        }
        Ok(check_firm(&values_by(&boat, &self.plant)?)?)
    }

    /// Options of the learning on board: of a model that adapts, or those with which a constant model is followed.
    pub fn learning(&self) -> adapt::Options {
        self.controller.adapt.clone().unwrap_or_else(|| adapt::Options::of(&self.model))
    }

    /// The session of the model on board, frozen unless the model adapts.
    ///
    /// # Errors
    /// If the model cannot be adapted.
    pub fn adapter(&self) -> Result<(Box<dyn Adapter>, ResolvedOptions), SetupError> {
        let (mut adapter, used) = adapt::adapter(&self.model, &self.learning(), &[])?;
        if self.controller.adapt.is_none() {
            adapter.freeze(true);
        }
        Ok((adapter, used))
    }

    /// The controller on board at the start of its track, for the session of [`adapter`](Self::adapter). `border` is one that
    /// the vessel must not leave, beside those of the options.
    ///
    /// # Errors
    /// If the controller does not fit the model, or the track is not within the border.
    pub fn pilot(&self, adapter: &dyn Adapter, border: Option<Border>) -> Result<Pilot, SetupError> {
        let weights = self.controller.adapt.is_some().then(|| active_weights(adapter).len());
        let mut track = self.scenario.track.clone();
        if let Some(border) = border {
            let mut fence = track.fence.clone();
            fence
                .keep_in(border)
                .map_err(|error| SetupError::option(format!("{}: {error}", key("fence"))))?;
            track = track.within(fence)?;
        }
        Ok(Pilot::new(&self.controller, track, self.conditions.seed, weights)?)
    }

    /// Tunes the autopilot on the model, and sets its gains; `None` for other controllers.
    ///
    /// # Errors
    /// If no inputs push and turn the vessel, no gains hold the track, or `progress` cancels.
    pub fn tune(&mut self, progress: Progress<'_>) -> Result<Option<TunedAutopilot>, SetupError> {
        if self.controller.method != ControlMethod::Autopilot {
            return Ok(None);
        }
        let inputs = InputMap::with(&self.model, &self.options.push, &self.options.turn)?;
        let own = Scenario { plant: Arc::clone(&self.model).into(), ..self.scenario.clone() };
        let found = tune_autopilot(&own, &inputs, self.pace.cruise, self.from_s, progress)?;
        self.controller.autopilot = Some(found.gains.clone());
        Ok(Some(found))
    }
}

/// The input of a direction, `-NAME` or `NAME`.
fn bare(direction: &str) -> &str {
    direction.strip_prefix('-').unwrap_or(direction)
}

/// Weights with which an adapter predicts: its own, or those that its guard selected.
pub fn active_weights(adapter: &dyn Adapter) -> &[f64] {
    adapter.guard().map_or_else(|| adapter.weights(), |guard| guard.active_weights())
}

fn no_model(method: ControlMethod) -> String {
    let law = method.name();
    format!(
        "the model is missing: {law} needs a .safetensors file of `hydroid identify`, a vessel file (.toml), or hydrofoil, hydrofoil-low-speed, simple"
    )
}

/// Sample time of the loop \[s\].
fn sample_time(given: &ClosedLoopOptions, model: Option<&Model>, plant: &Model) -> Result<f64, SetupError> {
    let identified = model.into_iter().chain([plant]).find(|model| !model.is_vessel());
    let Some(identified) = identified else { return Ok(given.dt.unwrap_or(0.1)) };
    let own = identified.description.dt;
    if let Some(dt) = given.dt {
        ensure((dt / own - 1.0).abs() < 1e-3, || {
            format!(
                "the sample time of the model is {own} s, and the controller has the same: leave {} out",
                key("dt").is(dt)
            )
        })?;
    }
    Ok(own)
}

/// The response of a model, from simulated tests at the speed of the task. The defaults were chosen for vessels with one
/// propeller and one rudder.
fn response(
    given: &ClosedLoopOptions,
    plant: &Model,
    model: Option<&Model>,
) -> Result<Option<Response>, SetupError> {
    if plant.craft().is_some_and(|craft| PropellerRudder::new(craft).is_ok()) {
        return Ok(None);
    }
    let model = model.unwrap_or(plant);
    let tests = || -> Result<Response, ClosedLoopError> {
        let inputs = InputMap::with(model, &given.push, &given.turn)?;
        let options = Options { propulsion: 0.5, speed_m_s: given.speed };
        let approach = Approach::new(model, &inputs, Simulation::new(model)?, &options)?;
        Ok(Response::about(&approach, &inputs)?)
    };
    tests().map(Some).map_err(|error| SetupError::Defaults(Box::new(error)))
}

fn scenario(
    given: &ClosedLoopOptions,
    plant: &Arc<Model>,
    track: Track,
    scale: Scale,
    dt_s: f64,
) -> Result<Scenario, SetupError> {
    let limits = limits_of(plant)?;
    let mut scenario = Scenario { limits, ..Scenario::new(Arc::clone(plant), track) };
    given.state_rates(&mut scenario, plant)?;
    scenario.dt_s = dt_s;
    scenario.start = given.start.unwrap_or([0.0, -0.5 * scale.radius]);
    scenario.tolerance = given.tolerance.unwrap_or(2.0 * scale.radius);
    scenario.duration_s = given.duration.map_or(scenario.duration_s, |duration| duration.0);
    Ok(scenario)
}
