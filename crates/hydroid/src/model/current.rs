//! Estimate of the current by the sessions of a model of the motion through the water.

use hydroid_core::current::CurrentOptions;
use serde::{Deserialize, Serialize};

use super::{Model, Port};
use crate::evaluate::BAND_80;
use crate::key::key;

/// Share of the horizon of the windows from whose errors sessions estimate the current.
const WINDOW: f64 = 0.25;

/// Horizon without prediction bands \[samples\].
const DEFAULT_HORIZON: usize = 100;

/// Time in which the current changes by its standard deviation \[s\].
const CHANGE_S: f64 = 3_600.0;

/// Options of the estimate of the current, as in the model file; see [`CurrentOptions`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurrentEstimate {
    /// Indices of surge, sway and yaw rate among the outputs.
    pub motion: [usize; 3],
    /// Length of a window \[samples\].
    pub window: usize,
    /// Standard deviations of the errors at the end of a window: surge and sway \[m/s\], yaw rate \[rad/s\].
    pub deviations: [f64; 3],
    /// Standard deviation of each component at the start of a run \[m/s\].
    pub initial_m_s: f64,
    /// Standard deviation of the change of each component in a second \[m/s\].
    pub walk_m_s: f64,
}

impl CurrentEstimate {
    /// For the outputs of the model that has this estimate.
    pub(super) fn options(&self, outputs: &[Port], dt: f64) -> CurrentOptions {
        CurrentOptions {
            motion: self.motion,
            dt,
            window: self.window,
            deviations: self.deviations,
            noise: self.motion.map(|c| outputs.get(c).and_then(|port| port.noise).unwrap_or(0.0)),
            initial: self.initial_m_s,
            walk: self.walk_m_s,
        }
    }
}

/// Reason why a model cannot estimate a current.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum CurrentError {
    #[error("to estimate a current, a model needs the outputs u, v and r; it has no output '{name}'")]
    NoMotion { name: &'static str },
    #[error(
        "to estimate a current, the model needs its prediction bands, which `hydroid identify` writes for the methods sindy and committee; this model has none, and no noise of '{name}' either. State the noise in a vessel file, or identify the model again"
    )]
    NoErrors { name: &'static str },
    #[error(
        "the standard deviation of the current is {given} m/s: give a positive number, as in {}",
        key("estimate_current").is(0.3)
    )]
    Deviation { given: f64 },
}

/// Outputs that a current acts on, and the yaw rate.
pub(crate) const MOTION: [&str; 3] = ["u", "v", "r"];

impl CurrentEstimate {
    /// The estimate with windows for predictions over `horizon` samples: `deviations` are the standard deviations of the
    /// errors at their end, `initial_m_s` that of a component of the current.
    pub(crate) fn new(motion: [usize; 3], window: usize, deviations: [f64; 3], initial_m_s: f64) -> Self {
        Self { motion, window, deviations, initial_m_s, walk_m_s: initial_m_s / CHANGE_S.sqrt() }
    }

    /// Length of a window \[samples\] for predictions over `horizon` samples.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the horizon")]
    pub(crate) fn window(horizon: usize) -> usize {
        ((horizon as f64 * WINDOW) as usize).max(1)
    }
}

impl Model {
    /// The model as one of the motion through the water: its sessions estimate the current, with the standard deviation
    /// `initial_m_s` \[m/s\] of a component at the start of a run. In still water, the motions over ground and through the
    /// water are the same, so that any model from still water may be taken. A model of the motion through the water gets
    /// the new standard deviation.
    ///
    /// The errors of a window are those of the prediction bands; without bands, they are taken as measurement noise at its
    /// start and its end.
    ///
    /// # Errors
    /// If an output of the motion is missing, or the errors of the model are unknown.
    pub fn with_current(&self, initial_m_s: f64) -> Result<Self, CurrentError> {
        if !(initial_m_s.is_finite() && initial_m_s > 0.0) {
            return Err(CurrentError::Deviation { given: initial_m_s });
        }
        let own = self.description.current.as_ref();
        let own = own.map(|own| (own.motion, own.window, own.deviations));
        let (motion, window, deviations) = own.map_or_else(|| self.window_errors(), Ok)?;
        let estimate = CurrentEstimate::new(motion, window, deviations, initial_m_s);
        let mut model = self.clone();
        model.description.current = Some(estimate);
        Ok(model)
    }

    /// Outputs of the motion, a window \[samples\], and the standard deviations of the errors at its end.
    fn window_errors(&self) -> Result<([usize; 3], usize, [f64; 3]), CurrentError> {
        let d = &self.description;
        let mut motion = [0; 3];
        for (place, name) in motion.iter_mut().zip(MOTION) {
            let found = d.outputs.iter().position(|port| port.channel.name == name);
            *place = found.ok_or(CurrentError::NoMotion { name })?;
        }
        let positive = |x: &f64| x.is_finite() && *x > 0.0;
        if let Some(bands) = &d.bands
            && let Some(&horizon) = bands.horizons.last()
            && let Some(level) = bands.levels.iter().position(|level| *level == 0.8)
        {
            let window = CurrentEstimate::window(horizon);
            let deviations = motion.map(|c| bands.half_width(level, window, c) / BAND_80);
            if deviations.iter().all(positive) {
                return Ok((motion, window, deviations));
            }
        }
        let mut deviations = [0.0; 3];
        for ((deviation, c), name) in deviations.iter_mut().zip(motion).zip(MOTION) {
            let noise = d.outputs[c].noise.filter(positive).ok_or(CurrentError::NoErrors { name })?;
            *deviation = std::f64::consts::SQRT_2 * noise;
        }
        Ok((motion, CurrentEstimate::window(DEFAULT_HORIZON), deviations))
    }
}
