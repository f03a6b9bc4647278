//! Arguments of `hydroid manoeuvre`.

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};
use hydroid::config::{self, ZigzagAngles};

use super::Duration;
use super::LogArgs;
use super::Pair;
use super::{RoleArgs, ValueArgs};

/// Trials.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TrialName {
    /// Turning circles to starboard and to port
    TurningCircle,
    /// Zigzags, first to starboard and first to port
    Zigzag,
    /// Pull-outs from turns to both sides: is the vessel directionally stable?
    PullOut,
    /// Direct spiral (Dieudonné): yaw rate against steering, with the width of a loop
    Spiral,
    /// Acceleration from rest
    Acceleration,
    /// Stopping: full astern if the propulsion can be reversed
    Stopping,
}

impl From<TrialName> for config::TrialName {
    fn from(trial: TrialName) -> Self {
        match trial {
            TrialName::TurningCircle => Self::TurningCircle,
            TrialName::Zigzag => Self::Zigzag,
            TrialName::PullOut => Self::PullOut,
            TrialName::Spiral => Self::Spiral,
            TrialName::Acceleration => Self::Acceleration,
            TrialName::Stopping => Self::Stopping,
        }
    }
}

/// Run manoeuvring trials of a vessel or of an identified model
///
/// Turning circle, zigzag, pull-out, spiral, acceleration and stopping, as defined by IMO resolution MSC.137(76) and ITTC
/// procedure 7.5-04-02-01. Each trial begins on a straight course at a steady speed. The roles of the inputs say which
/// ones push and turn the vessel; the wind is 0. A vessel that no input pushes, as one with a constant shaft speed in its
/// logs, has its own speed, and no trials of acceleration and stopping. Steering is stated in degrees if one input turns the vessel and is an angle, otherwise
/// in percent of its range. Intervals are the 5 % and 95 % quantiles over the members of the model's ensemble or committee.
#[derive(Debug, ClapArgs)]
#[command(after_help = include_str!("help/manoeuvre.txt"))]
pub struct Manoeuvre {
    /// The vessel: an identified model (.safetensors), a vessel file (.toml), or hydrofoil, hydrofoil-low-speed, simple
    #[arg(value_name = "PLANT")]
    pub plant: PathBuf,
    /// Logs: their turns and zigzags are set beside the predictions of the model from their first samples
    #[arg(value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Trials, separated by commas (default: all)
    #[arg(long, alias = "trial", value_enum, value_delimiter = ',', value_name = "TRIAL")]
    pub trials: Vec<TrialName>,
    /// Steering of turning circle, pull-out and spiral: degrees, or percent of hard over (default: 35 deg, or hard over)
    #[arg(long, value_name = "DEG|PERCENT", allow_negative_numbers = true)]
    pub steering: Option<f64>,
    /// Zigzags: steering (degrees or percent) and change of heading [deg] (default: 10/10,20/20, where the steering suffices)
    #[arg(long, value_delimiter = ',', value_name = "STEERING/HEADING")]
    pub zigzag: Vec<ZigzagAngles>,
    /// Steady speed of the approach through the water [m/s] (default: that of 85 % propulsion; a vessel that no input pushes has one speed)
    #[arg(long, value_name = "M_S", conflicts_with = "propulsion", allow_negative_numbers = true)]
    pub speed: Option<f64>,
    /// Propulsion of the approach, in percent of full ahead (default: 85, the test speed of the IMO)
    #[arg(long, value_name = "PERCENT", allow_negative_numbers = true)]
    pub propulsion: Option<f64>,
    #[command(flatten)]
    pub roles: RoleArgs,
    #[command(flatten)]
    pub values: ValueArgs,
    /// Inputs that push the vessel, separated by commas; -NAME pushes astern (default: by the roles of the inputs)
    #[arg(long, value_delimiter = ',', value_name = "INPUTS", allow_hyphen_values = true)]
    pub push: Vec<String>,
    /// Inputs that turn the vessel to starboard; -NAME turns to port (default: by the roles of the inputs)
    #[arg(long, value_delimiter = ',', value_name = "INPUTS", allow_hyphen_values = true)]
    pub turn: Vec<String>,
    /// Velocity of a constant current: north,east [m/s]; the approach heads north
    #[arg(long, default_value = "0,0", value_name = "N,E", allow_hyphen_values = true)]
    pub current: Pair,
    /// Length of the ship [m]: adds the criteria of IMO resolution MSC.137(76)
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub length: Option<f64>,
    /// Longest trial
    #[arg(long, value_name = "TIME", default_value = "1h")]
    pub longest: Duration,
    /// Folder for trials.json (comparisons.json with logs), tracks.csv and report.html
    #[arg(long, short, value_name = "DIR")]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub log: LogArgs,
}

impl Manoeuvre {
    /// The settings of the trials.
    pub fn settings(&self) -> config::Manoeuvre {
        config::Manoeuvre {
            trials: self.trials.iter().map(|trial| (*trial).into()).collect(),
            steering: self.steering,
            zigzag: self.zigzag.clone(),
            speed: self.speed,
            propulsion: self.propulsion,
            role: self.roles.roles(),
            limit: self.values.limits(),
            neutral: self.values.neutrals(),
            push: self.push.clone(),
            turn: self.turn.clone(),
            current: self.current.0,
            length: self.length,
            longest: Some(self.longest),
        }
    }
}
