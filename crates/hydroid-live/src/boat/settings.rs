//! Settings of a session on board.

use std::collections::BTreeMap;
use std::path::PathBuf;

use hydroid::config::control::ClosedLoopOptions;
use hydroid::log::Selection;

/// Settings of a session on board.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Address of the link, for people.
    pub address: String,
    /// Sensors, commands and outputs, by the topics of the link.
    pub selection: Selection,
    /// Folder of the recordings and of identified models.
    pub folder: PathBuf,
    /// Whether a recording begins with the link.
    pub records: bool,
    /// Horizons of the predictions \[s\].
    pub horizons_s: Vec<f64>,
    /// Whether commands are computed and not sent.
    pub is_dry_run: bool,
    /// What the inputs are.
    pub boat: hydroid::boat::Boat,
    /// Limits of commands by name, in the units of the model, in place of those of the boat.
    pub limits: BTreeMap<String, [f64; 2]>,
    /// Neutral commands by name, in the units of the model, in place of those of the boat.
    pub neutral: BTreeMap<String, f64>,
    /// Inputs that push the vessel ahead; `-NAME` pushes astern.
    pub push: Vec<String>,
    /// Inputs that turn the vessel to starboard; `-NAME` turns to port.
    pub turn: Vec<String>,
    pub experiment: ExperimentLimits,
    /// Seconds of the session in a second of the computer: 1, or more with a simulation.
    pub time_scale: f64,
    /// The closed loop of steering: path and controller.
    pub control: ClosedLoopOptions,
}

/// Limits of experiments and of steering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExperimentLimits {
    /// Radius of the geofence \[m\].
    pub fence_m: f64,
    /// Its centre, latitude and longitude \[deg\]; `None` for the first position.
    pub centre_deg: Option<[f64; 2]>,
    /// Largest speed over ground \[m/s\].
    pub max_speed_m_s: f64,
    /// Largest yaw rate \[rad/s\].
    pub max_yaw_rate_rad_s: f64,
    /// Longest duration \[s\].
    pub duration_s: f64,
    /// Seed of random signals.
    pub seed: u64,
}
