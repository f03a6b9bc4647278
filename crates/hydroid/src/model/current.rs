//! Estimate of the current by the sessions of a model of the motion through the water.

use hydroid_core::current::CurrentOptions;
use serde::{Deserialize, Serialize};

/// Options of the estimate of the current, as in the model file; see [`CurrentOptions`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurrentEstimate {
    /// Indices of surge, sway and yaw rate among the outputs.
    pub motion: [usize; 3],
    /// Length of a window \[samples\].
    pub window: usize,
    /// Samples between the ends of two windows.
    pub stride: usize,
    /// Standard deviations of the errors at the end of a window: surge and sway \[m/s\], yaw rate \[rad/s\].
    pub deviations: [f64; 3],
    /// Standard deviation of each component at the start of a run \[m/s\].
    pub initial_m_s: f64,
    /// Standard deviation of the change of each component in a second \[m/s\].
    pub walk_m_s: f64,
}

impl CurrentEstimate {
    pub(super) fn options(&self, dt: f64) -> CurrentOptions {
        CurrentOptions {
            motion: self.motion,
            dt,
            window: self.window,
            stride: self.stride,
            deviations: self.deviations,
            initial: self.initial_m_s,
            walk: self.walk_m_s,
        }
    }
}
