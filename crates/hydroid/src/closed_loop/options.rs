//! Construction of controllers.

use std::sync::Arc;
use std::time::Duration;

use hydroid_core::actuator::Limits;
use hydroid_core::control::cem::{Cost, Planner, PlannerOptions};
use hydroid_core::control::{
    AdaptiveAugmentation, AdaptiveAugmentationOptions, AffinePlant, Autopilot, AutopilotOptions,
    Backstepping, BacksteppingOptions, FeedbackLinearization, FeedbackLinearizationOptions,
};
use hydroid_core::vessel::VesselParams;
use serde::Serialize;

use super::channel_map::ChannelMap;
use super::controller::{ClosedLoopController, ControlLaw};
use super::error::ClosedLoopError;
use super::inversion::{InvertingController, InvertingLaw};
use super::predictive::PredictiveController;
use super::reference::Timing;
use super::session_model::SessionModel;
use crate::adapt;
use crate::log::Trajectory;
use crate::model::Model;

/// Control method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum ControlMethod {
    /// [`FeedbackLinearization`].
    #[serde(rename = "fl")]
    FeedbackLinearization,
    /// [`Backstepping`].
    #[serde(rename = "backstepping")]
    Backstepping,
    /// The cross-entropy method, [`Planner`].
    #[serde(rename = "cem")]
    CrossEntropy,
    /// [`Autopilot`].
    #[serde(rename = "pid")]
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
    /// Cross-entropy planner; its seed is the run's seed.
    pub planner: PlannerOptions,
    /// Cost of the planner.
    pub cost: Cost,
    /// Computing time of a plan; `None` for no limit.
    pub budget: Option<Duration>,
    /// Gains of the autopilot ([`tune_autopilot`](super::tune_autopilot)).
    pub autopilot: Option<AutopilotOptions>,
    /// Nominal vessel: names and limits of the commands, measured channels.
    pub vessel: VesselParams,
    /// Command limits.
    pub limits: [Limits; 2],
    /// Sample time \[s\].
    pub dt_s: f64,
    /// Distance from the reference beyond which the vessel is lost \[m\].
    pub tolerance: f64,
}

impl ControllerOptions {
    /// Default gains, no model.
    pub fn new(method: ControlMethod, vessel: &VesselParams, dt_s: f64) -> Self {
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
            planner: PlannerOptions::new(0),
            cost: Cost::tracking(2),
            budget: None,
            autopilot: None,
            vessel: vessel.clone(),
            limits: AffinePlant::limits(vessel),
            dt_s,
            tolerance: 2.0,
        }
    }

    /// Builds a controller; `seed` is the run's seed.
    ///
    /// # Errors
    /// If the model is missing, does not fit the vessel, or cannot be inverted by the control law.
    pub fn controller(&self, seed: u64) -> Result<Box<dyn ClosedLoopController>, ClosedLoopError> {
        let law = self.method.name();
        if self.method == ControlMethod::Autopilot {
            return self.autopilot();
        }
        let model = self.model.as_deref().ok_or(ClosedLoopError::NoModel { law })?;
        let refused = |error| ClosedLoopError::not_invertible(error, law);
        let channels = ChannelMap::of(&model.description, &self.vessel)?;
        let session = || match &self.adapt {
            Some(options) => SessionModel::learning(model, options, &self.rehearsal).map(Some),
            None if model.description.current.is_some() => Ok(Some(SessionModel::frozen(model))),
            None => Ok(None),
        };
        match self.method {
            ControlMethod::FeedbackLinearization => {
                let settings = FeedbackLinearizationOptions {
                    tolerance: self.tolerance,
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
                        self.inverted(law, channels, model, session()?)
                    }
                    None => self.inverted(law, channels, model, session()?),
                }
            }
            ControlMethod::Backstepping => {
                let settings =
                    BacksteppingOptions { tolerance: self.tolerance, ..BacksteppingOptions::new(self.lead) };
                let settings = self.rate.map_or(settings, |rate| settings.with_rate(rate));
                let inverse = model.invert(channels.motion).map_err(refused)?;
                let law = Backstepping::new(inverse, &self.limits, self.dt_s, settings)?;
                self.inverted(law, channels, model, session()?)
            }
            ControlMethod::CrossEntropy | ControlMethod::Autopilot => {
                if channels.motion != [0, 1, 2] {
                    let why = "its outputs do not begin with u, v, r; identify with --outputs u,v,r";
                    return Err(ClosedLoopError::Channels(String::from(why)));
                }
                let settings = PlannerOptions { seed, ..self.planner };
                let cost = Cost { lookahead: self.lead, ..self.cost.clone() };
                let outputs = channels.len();
                let planner = Planner::new(settings, cost, &self.limits, outputs, self.dt_s, self.tolerance)?;
                Ok(Box::new(PredictiveController {
                    planner,
                    session: session()?.unwrap_or_else(|| SessionModel::frozen(model)),
                    y: vec![f64::NAN; outputs],
                    channels,
                    lead: self.lead,
                    timing: self.timing,
                    tolerance: self.tolerance,
                    budget: self.budget,
                }))
            }
        }
    }

    fn inverted<L: InvertingLaw + 'static>(
        &self,
        law: L,
        channels: ChannelMap,
        model: &Model,
        session: Option<SessionModel>,
    ) -> Result<Box<dyn ClosedLoopController>, ClosedLoopError> {
        Ok(Box::new(InvertingController::new(law, self.lead, channels, model, session)?))
    }

    fn autopilot(&self) -> Result<Box<dyn ClosedLoopController>, ClosedLoopError> {
        if self.model.is_some() || self.adapt.is_some() {
            return Err(ClosedLoopError::UnexpectedModel);
        }
        let gains = self.autopilot.ok_or(ClosedLoopError::Untunable)?;
        let gains = AutopilotOptions { tolerance: self.tolerance, ..gains };
        let controller = Autopilot::new(&self.limits, self.dt_s, gains)?;
        Ok(Box::new(ControlLaw { controller, lead: 0.0, timing: Timing::Path, force: false }))
    }
}
