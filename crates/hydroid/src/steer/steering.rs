//! A helm for a model.

use std::sync::Arc;
use std::time::Duration;

use hydroid_core::control::cem::{Cost, Planner, PlannerSettings};
use hydroid_core::control::{
    AffinePlant, Autopilot, AutopilotSettings, Backstepping, BacksteppingSettings, FeedbackLinearization,
    FeedbackLinearizationSettings, LearnedCorrection, LearnedCorrectionSettings, Limits,
};
use hydroid_core::vessel::VesselParams;
use serde::Serialize;

use super::channels::Channels;
use super::error::SteerError;
use super::guide::Timing;
use super::helm::{Helm, Law};
use super::inverted::{Inverted, Invertible, Inverting};
use super::mind::Mind;
use super::planned::Planned;
use crate::adapt;
use crate::log::Trajectory;
use crate::model::Model;

/// Which controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Kind {
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

impl Kind {
    /// Its name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::FeedbackLinearization => "fl",
            Self::Backstepping => "backstepping",
            Self::CrossEntropy => "cem",
            Self::Autopilot => "pid",
        }
    }
}

/// All that makes a helm: a new one can be made for each voyage, on any thread.
#[derive(Clone, Debug)]
pub struct Steering {
    /// Which controller.
    pub kind: Kind,
    /// What it steers by; none for the autopilot.
    pub model: Option<Arc<Model>>,
    /// How the model learns on the way; none if it stays as it is.
    pub adapt: Option<adapt::Options>,
    /// Beginnings of logs that the learner walks through before each voyage.
    pub shore: Arc<[Trajectory]>,
    /// Distance of the point that is to be on the path ahead of the origin \[m\]. The autopilot brings the origin there.
    pub lead: f64,
    /// What moves the reference of a plan. Laws are given the clock's, the autopilot that of its foot.
    pub timing: Timing,
    /// Gains of the feedback linearization: natural frequency \[rad/s\] and damping; none for its own.
    pub bandwidth: Option<[f64; 2]>,
    /// Integral gain of the feedback linearization \[1/s^3\]; 0 for none.
    pub integral: f64,
    /// Around the feedback linearization a network that learns under way what its model misses, its first weights drawn from
    /// the seed of the voyage; none for the law as it is.
    pub learned: Option<LearnedCorrectionSettings>,
    /// Rate of the backstepping \[1/s\]; none for its own.
    pub rate: Option<f64>,
    /// How plans are looked for; the seed is that of the voyage.
    pub planner: PlannerSettings,
    /// What plans cost.
    pub cost: Cost,
    /// Time for a plan; none to finish each.
    pub budget: Option<Duration>,
    /// Gains of the autopilot ([`tune`](super::tune())).
    pub autopilot: Option<AutopilotSettings>,
    /// The vessel as its builder has it: names and limits of the commands, what is measured.
    pub vessel: VesselParams,
    /// Limits of the commands.
    pub limits: [Limits; 2],
    /// Sample time \[s\].
    pub dt_s: f64,
    /// Farther than this from its reference a vessel is lost \[m\].
    pub tolerance: f64,
}

impl Steering {
    /// A controller with its own gains, without a model yet.
    pub fn new(kind: Kind, vessel: &VesselParams, dt_s: f64) -> Self {
        let by_law = matches!(kind, Kind::FeedbackLinearization | Kind::Backstepping);
        Self {
            kind,
            model: None,
            adapt: None,
            shore: Arc::new([]),
            lead: if by_law { 1.5 } else { 0.0 },
            timing: if kind == Kind::Autopilot { Timing::Foot } else { Timing::Clock },
            bandwidth: None,
            integral: 0.0,
            learned: None,
            rate: None,
            planner: PlannerSettings::new(0),
            cost: Cost::tracking(2),
            budget: None,
            autopilot: None,
            vessel: vessel.clone(),
            limits: AffinePlant::limits(vessel),
            dt_s,
            tolerance: 2.0,
        }
    }

    /// A helm; what a plan draws comes from the seed.
    ///
    /// # Errors
    /// If the law has no model, or cannot steer by the one that it has.
    pub fn helm(&self, seed: u64) -> Result<Box<dyn Helm>, SteerError> {
        let law = self.kind.name();
        if self.kind == Kind::Autopilot {
            return self.autopilot();
        }
        let model = self.model.as_deref().ok_or(SteerError::NoModel { law })?;
        let channels = Channels::of(&model.description, &self.vessel)?;
        let mind = || match &self.adapt {
            Some(options) => Mind::learning(model, options, &self.shore).map(Some),
            None => Ok(None),
        };
        match self.kind {
            Kind::FeedbackLinearization => {
                let settings = FeedbackLinearizationSettings {
                    tolerance: self.tolerance,
                    ..FeedbackLinearizationSettings::new(self.lead)
                };
                let settings =
                    self.bandwidth.map_or(settings, |[omega, zeta]| settings.with_bandwidth(omega, zeta));
                let settings = FeedbackLinearizationSettings { integral: self.integral, ..settings };
                let inverse = Invertible::of(model, channels.motion, law)?;
                let law = FeedbackLinearization::new(inverse, &self.limits, self.dt_s, settings)?;
                match self.learned {
                    Some(learned) => {
                        let law = LearnedCorrection::new(law, learned, seed)?;
                        self.inverted(law, channels, model, mind()?)
                    }
                    None => self.inverted(law, channels, model, mind()?),
                }
            }
            Kind::Backstepping => {
                let settings = BacksteppingSettings {
                    tolerance: self.tolerance,
                    ..BacksteppingSettings::new(self.lead)
                };
                let settings = self.rate.map_or(settings, |rate| settings.with_rate(rate));
                let inverse = Invertible::of(model, channels.motion, law)?;
                let law = Backstepping::new(inverse, &self.limits, self.dt_s, settings)?;
                self.inverted(law, channels, model, mind()?)
            }
            Kind::CrossEntropy | Kind::Autopilot => {
                if channels.motion != [0, 1, 2] {
                    let why = "its outputs begin with other ones than u, v, r: identify with --outputs u,v,r";
                    return Err(SteerError::Channels(String::from(why)));
                }
                let settings = PlannerSettings { seed, ..self.planner };
                let cost = Cost { ahead: self.lead, ..self.cost.clone() };
                let outputs = channels.len();
                let planner = Planner::new(settings, cost, &self.limits, outputs, self.dt_s, self.tolerance)?;
                Ok(Box::new(Planned {
                    planner,
                    mind: mind()?.unwrap_or_else(|| Mind::frozen(model)),
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

    fn inverted<L: Inverting + 'static>(
        &self,
        law: L,
        channels: Channels,
        model: &Model,
        mind: Option<Mind>,
    ) -> Result<Box<dyn Helm>, SteerError> {
        Ok(Box::new(Inverted::new(law, self.lead, channels, model, mind)?))
    }

    fn autopilot(&self) -> Result<Box<dyn Helm>, SteerError> {
        if self.model.is_some() || self.adapt.is_some() {
            return Err(SteerError::NeedlessModel);
        }
        let gains = self.autopilot.ok_or(SteerError::Untunable)?;
        let gains = AutopilotSettings { tolerance: self.tolerance, ..gains };
        let controller = Autopilot::new(&self.limits, self.dt_s, gains)?;
        Ok(Box::new(Law { controller, lead: 0.0, timing: Timing::Foot, force: false }))
    }
}
