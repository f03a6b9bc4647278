//! Construction of controllers.

use std::sync::Arc;
use std::time::Duration;

use hydroid_core::actuator::Limits;
use hydroid_core::control::cem::{Cost, Planner, PlannerOptions};
use hydroid_core::control::{
    AdaptiveAugmentation, AdaptiveAugmentationOptions, Backstepping, BacksteppingOptions,
    FeedbackLinearization, FeedbackLinearizationOptions, longest_age_s,
};
use serde::{Deserialize, Serialize};

use super::autopilot::{AutopilotController, AutopilotGains};
use super::channel_map::ChannelMap;
use super::controller::ClosedLoopController;
use super::error::ClosedLoopError;
use super::inversion::{InvertingController, InvertingLaw};
use super::plant::TruePlant;
use super::predictive::PredictiveController;
use super::reference::Timing;
use super::scale::{RADIUS_M, Scale};
use super::session_model::{SessionModel, WithSession};
use crate::adapt;
use crate::key::key;
use crate::log::{Channel, Trajectory};
use crate::model::Model;
use crate::plant::find_roles;

/// Horizon of the planner for a vessel of another size \[commands\], and the time of one for the boat \[s\].
const COMMANDS: usize = 40;
const COMMAND_S: f64 = 0.025;

/// Natural frequency \[rad/s\] and damping ratio of the feedback linearization.
const BANDWIDTH: [f64; 2] = [1.5, 0.7];

/// Turns on the way to a task, relative to those with the steering hard over: half of the steering is left to the controller.
const TURNING: f64 = 2.0;

/// Rate of the backstepping \[1/s\].
const RATE_PER_S: f64 = 1.0;

/// Control method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "arguments", derive(clap::ValueEnum))]
pub enum ControlMethod {
    /// Feedback linearization of a point ahead of the vessel: equations, vessels and control-affine networks
    #[serde(rename = "fl")]
    #[cfg_attr(feature = "arguments", value(name = "fl"))]
    FeedbackLinearization,
    /// Adaptive backstepping of the same point, which rejects constant disturbances: the same models
    #[serde(rename = "backstepping")]
    Backstepping,
    /// Model predictive control by the cross-entropy method: any model
    #[default]
    #[serde(rename = "cem")]
    #[cfg_attr(feature = "arguments", value(name = "cem"))]
    CrossEntropy,
    /// Line of sight, PID on the heading, PI on the speed: any model; the gains are found by a grid search on it first
    #[serde(rename = "pid")]
    #[cfg_attr(feature = "arguments", value(name = "pid"))]
    Autopilot,
}

impl ControlMethod {
    /// Name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::FeedbackLinearization => "fl",
            Self::Backstepping => "backstepping",
            Self::CrossEntropy => "cem",
            Self::Autopilot => "pid",
        }
    }
}

/// What can be commanded and what is measured on a vessel.
#[derive(Clone, Debug, PartialEq)]
pub struct Instruments {
    /// Name of the vessel.
    pub name: String,
    /// Commands.
    pub commands: Vec<Channel>,
    /// Measured outputs.
    pub measured: Vec<Channel>,
}

impl Instruments {
    /// Those of a plant.
    pub fn of(plant: &TruePlant) -> Self {
        Self { name: plant.name().to_owned(), commands: plant.commands(), measured: plant.measured() }
    }
}

/// Options of a controller. [`controller`](Self::controller) builds one for each run, on any thread.
#[derive(Clone, Debug)]
pub struct ControllerOptions {
    /// Control method.
    pub method: ControlMethod,
    /// Model; `None` for the autopilot.
    pub model: Option<Arc<Model>>,
    /// Adaptation of the model; `None` for a frozen model.
    pub adapt: Option<adapt::Options>,
    /// Runs that fill the adapter's rehearsal store before each run.
    pub rehearsal: Arc<[Trajectory]>,
    /// Distance of the controlled point ahead of the origin \[m\]. The autopilot controls the origin.
    pub lead: f64,
    /// Parameter that moves the reference of the planner. Control laws track time; the autopilot follows the path.
    pub timing: Timing,
    /// Feedback linearization: natural frequency \[rad/s\] and damping ratio; `None` for the defaults.
    pub bandwidth: Option<[f64; 2]>,
    /// Integral gain of the feedback linearization \[1/s^3\]; 0 for none.
    pub integral: f64,
    /// Adaptive network that corrects the model error of the feedback linearization, initialized from the run's seed.
    pub learned: Option<AdaptiveAugmentationOptions>,
    /// Rate of the backstepping \[1/s\]; `None` for the default.
    pub rate: Option<f64>,
    /// Largest closing speed of the control laws \[m/s\].
    pub closing_speed: f64,
    /// Control authority below which the control laws damp their demand \[m/s^2\].
    pub min_control_authority: f64,
    /// Cross-entropy planner; its seed is the run's seed.
    pub planner: PlannerOptions,
    /// Cost of the planner.
    pub cost: Cost,
    /// Computing time of a plan; `None` for no limit.
    pub budget: Option<Duration>,
    /// Gains of the autopilot ([`tune_autopilot`](super::tune_autopilot)).
    pub autopilot: Option<AutopilotGains>,
    /// Commands and measured outputs of the vessel.
    pub instruments: Instruments,
    /// Command limits.
    pub limits: Vec<Limits>,
    /// Sample time \[s\].
    pub dt_s: f64,
    /// Distance from the reference beyond which the vessel is lost \[m\].
    pub tolerance: f64,
    /// Whether control laws drive the vessel ahead only.
    pub ahead: bool,
    /// On board: radius of the turns on the way to the task \[m\], if those of the task are no smaller.
    pub turning_radius: f64,
    /// On board: age of position, heading and velocities beyond which the commands have their neutral values \[s\].
    pub max_age_s: f64,
}

impl ControllerOptions {
    /// Default gains, no model.
    pub fn new(method: ControlMethod, plant: &TruePlant, dt_s: f64) -> Self {
        let limits = plant.limits();
        let by_law = matches!(method, ControlMethod::FeedbackLinearization | ControlMethod::Backstepping);
        Self {
            method,
            model: None,
            adapt: None,
            rehearsal: Arc::new([]),
            lead: if by_law { 1.5 } else { 0.0 },
            timing: if method == ControlMethod::Autopilot { Timing::Path } else { Timing::Clock },
            bandwidth: None,
            integral: 0.0,
            learned: None,
            rate: None,
            closing_speed: 1.0,
            min_control_authority: 0.05,
            planner: PlannerOptions::new(0),
            cost: Cost::tracking(limits.len()),
            budget: None,
            autopilot: None,
            instruments: Instruments::of(plant),
            limits,
            dt_s,
            tolerance: 2.0,
            ahead: true,
            turning_radius: TURNING * RADIUS_M,
            max_age_s: longest_age_s(dt_s),
        }
    }

    /// These options for a vessel of another size. `dt_s` stays; the planner holds its commands for several samples.
    #[must_use]
    pub fn scaled(self, scale: Scale) -> Self {
        let Scale { length, time, radius } = scale;
        let [omega, zeta] = self.bandwidth.unwrap_or(BANDWIDTH);
        let hold = (COMMAND_S * time / self.dt_s).round().max(1.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive, saturates")]
        let hold = hold as usize;
        Self {
            lead: self.lead * length,
            bandwidth: Some([omega / time, zeta]),
            integral: self.integral / time.powi(3),
            rate: Some(self.rate.unwrap_or(RATE_PER_S) / time),
            closing_speed: self.closing_speed * length / time,
            min_control_authority: self.min_control_authority * length / time.powi(2),
            tolerance: self.tolerance * radius,
            turning_radius: self.turning_radius * radius,
            planner: PlannerOptions {
                hold,
                horizon: COMMANDS,
                correlation_s: self.planner.correlation_s * time,
                ..self.planner
            },
            cost: Cost {
                position: self.cost.position / length.powi(2),
                speed: self.cost.speed * (time / length).powi(2),
                ..self.cost
            },
            ..self
        }
    }

    /// Builds a controller with the session of its model; `seed` is the run's seed.
    ///
    /// # Errors
    /// If the model is missing, does not fit the vessel, or cannot be inverted by the control law.
    pub fn controller(&self, seed: u64) -> Result<Box<dyn ClosedLoopController>, ClosedLoopError> {
        let Some(model) = self.model.as_deref().filter(|_| self.method != ControlMethod::Autopilot) else {
            return self.law(seed, None);
        };
        let channels = ChannelMap::of(&model.description, &self.instruments)?;
        let session = match &self.adapt {
            Some(options) => SessionModel::learning(model, options, &self.rehearsal)?,
            None if self.method == ControlMethod::CrossEntropy || model.description.current.is_some() => {
                SessionModel::frozen(model)
            }
            None => return self.law(seed, None),
        };
        let law = self.law(seed, session.weights())?;
        let y = vec![f64::NAN; channels.len()];
        Ok(Box::new(WithSession { law, session, channels, y }))
    }

    /// Builds a controller whose observations have a session of the model ([`Observation::session`](super::Observation)).
    /// `seed` is the run's seed, `weights` the number of weights of an adapter.
    ///
    /// # Errors
    /// If the model is missing, does not fit the vessel, or cannot be inverted by the control law.
    pub fn law(
        &self,
        seed: u64,
        weights: Option<usize>,
    ) -> Result<Box<dyn ClosedLoopController>, ClosedLoopError> {
        let law = self.method.name();
        if self.method == ControlMethod::Autopilot {
            return self.autopilot();
        }
        let model = self.model.as_deref().ok_or(ClosedLoopError::NoModel { law })?;
        let refused = |error| ClosedLoopError::not_invertible(error, law);
        let channels = ChannelMap::of(&model.description, &self.instruments)?;
        if self.method != ControlMethod::CrossEntropy {
            let boat = find_roles(model);
            let mut roles = boat.inputs.iter().filter_map(|(name, input)| Some((name, input.role?)));
            if let Some((name, role)) = roles.find(|(_, role)| !role.is_commanded()) {
                return Err(ClosedLoopError::NotCommanded { law, input: name.clone(), role });
            }
        }
        match self.method {
            ControlMethod::FeedbackLinearization => {
                let settings = FeedbackLinearizationOptions {
                    tolerance: self.tolerance,
                    closing_speed: self.closing_speed,
                    min_control_authority: self.min_control_authority,
                    ahead: self.ahead,
                    ..FeedbackLinearizationOptions::new(self.lead)
                };
                let settings =
                    self.bandwidth.map_or(settings, |[omega, zeta]| settings.with_bandwidth(omega, zeta));
                let settings = FeedbackLinearizationOptions { integral: self.integral, ..settings };
                let inverse = model.invert(channels.motion).map_err(refused)?;
                let law = FeedbackLinearization::new(inverse, &self.limits, self.dt_s, settings)?;
                match self.learned {
                    Some(learned) => {
                        let law = AdaptiveAugmentation::new(law, learned, seed)?;
                        self.inverted(law, channels, model, weights)
                    }
                    None => self.inverted(law, channels, model, weights),
                }
            }
            ControlMethod::Backstepping => {
                let default = BacksteppingOptions::new(self.lead);
                let settings = BacksteppingOptions {
                    tolerance: self.tolerance,
                    closing_speed: self.closing_speed,
                    min_control_authority: self.min_control_authority,
                    ahead: self.ahead,
                    // The default estimate is six times the least authority.
                    most: default.most * self.min_control_authority / default.min_control_authority,
                    ..default
                };
                let settings = self.rate.map_or(settings, |rate| settings.with_rate(rate));
                let inverse = model.invert(channels.motion).map_err(refused)?;
                let law = Backstepping::new(inverse, &self.limits, self.dt_s, settings)?;
                self.inverted(law, channels, model, weights)
            }
            ControlMethod::CrossEntropy | ControlMethod::Autopilot => {
                if channels.motion != [0, 1, 2] {
                    let outputs = key("outputs").is("u,v,r");
                    let why = format!("its outputs do not begin with u, v, r; identify with {outputs}");
                    return Err(ClosedLoopError::Channels(why));
                }
                let settings = PlannerOptions { seed, ..self.planner };
                let cost = Cost { lookahead: self.lead, ..self.cost.clone() };
                let outputs = channels.len();
                let planner = Planner::new(settings, cost, &self.limits, outputs, self.dt_s, self.tolerance)?;
                Ok(Box::new(PredictiveController {
                    planner,
                    lead: self.lead,
                    timing: self.timing,
                    tolerance: self.tolerance,
                    budget: self.budget,
                }))
            }
        }
    }

    fn inverted<L: InvertingLaw + Send + Sync + 'static>(
        &self,
        law: L,
        channels: ChannelMap,
        model: &Model,
        weights: Option<usize>,
    ) -> Result<Box<dyn ClosedLoopController>, ClosedLoopError> {
        Ok(Box::new(InvertingController::new(law, self.lead, channels, model, weights)?))
    }

    fn autopilot(&self) -> Result<Box<dyn ClosedLoopController>, ClosedLoopError> {
        if self.model.is_some() || self.adapt.is_some() {
            return Err(ClosedLoopError::UnexpectedModel);
        }
        let mut gains = self.autopilot.clone().ok_or(ClosedLoopError::Untunable)?;
        gains.options.tolerance = self.tolerance;
        Ok(Box::new(AutopilotController::new(&gains, &self.limits, self.dt_s)?))
    }
}
