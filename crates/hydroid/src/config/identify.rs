//! Options of an identification.
// Help texts come from the comments of the options; brackets are units.
#![expect(rustdoc::broken_intra_doc_links, reason = "the comments are help texts, too")]

use serde::{Deserialize, Serialize};

use super::{Duration, Horizon};
use crate::boat::{Boat, BoatError, StatedRoles};
#[cfg(feature = "arguments")]
use crate::config::value::named;
use crate::identify::{GivenRange, Method, MotionOption, RateLimitOption};
use crate::log::Channel;
use crate::written;

/// Options of an identification, of the command, of the section `[identify]` of a file, and of Python.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[cfg_attr(feature = "arguments", derive(clap::Args), group(skip))]
pub struct Identify {
    /// Methods, separated by commas (default: sindy,committee)
    #[cfg_attr(feature = "arguments", arg(long, value_enum, value_delimiter = ','))]
    #[serde(deserialize_with = "written::list", skip_serializing_if = "Vec::is_empty")]
    pub methods: Vec<Method>,
    /// Motion that the models predict: over ground, or through the water with a current for each run, which needs a heading
    /// (default: auto, if the logs have a heading the better one of the cross-validation)
    #[cfg_attr(
        feature = "arguments",
        arg(long, value_enum, value_name = "auto|over-ground|through-water", hide_possible_values = true)
    )]
    pub motion: Option<MotionOption>,
    /// Rates at which actuators follow their commands, per second: auto, none, or 'delta=4 [deg],n=10' (default: auto, in a
    /// cross-validation those that reduce its error significantly). The models contain them
    #[cfg_attr(feature = "arguments", arg(long, value_name = "auto|none|LIST"))]
    #[serde(deserialize_with = "written::optional")]
    pub rate_limit: Option<RateLimitOption>,
    /// Roles of inputs: propulsion, steering, thruster, disturbance or setting, as in delta=steering,wind=disturbance
    /// (default: those of the boat, found from names, units and the response of the model)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "INPUT=ROLE,.."))]
    #[serde(deserialize_with = "written::optional")]
    pub role: Option<StatedRoles>,
    /// Limits of a command, in the unit of the input in the boat, else of the model (default: those of the boat, 35 deg for a
    /// steering angle, or in simulations the range of the log). May be repeated
    #[cfg_attr(feature = "arguments", arg(long, value_name = "NAME=LOW:HIGH", value_delimiter = ',', value_parser = named::<GivenRange>))]
    #[serde(with = "written::by_name", skip_serializing_if = "Vec::is_empty")]
    pub limit: Vec<(String, GivenRange)>,
    /// Value of a command without effect, in the same unit (default: that of the boat, 1500 for pulses in us, 0 for physical
    /// quantities). May be repeated
    #[cfg_attr(feature = "arguments", arg(long, value_name = "NAME=VALUE", value_delimiter = ',', value_parser = named::<f64>))]
    #[serde(with = "written::by_name", skip_serializing_if = "Vec::is_empty")]
    pub neutral: Vec<(String, f64)>,
    /// Inputs that may follow the motion. Without it, an input is refused that is a scaled, delayed, noisy or rounded copy of an
    /// output, of its rate of change or of its integral
    #[cfg_attr(feature = "arguments", arg(long, value_name = "INPUT", value_delimiter = ','))]
    #[serde(deserialize_with = "written::list", skip_serializing_if = "Vec::is_empty")]
    pub allow_feedback: Vec<String>,
    /// Longest prediction horizon: samples (100) or seconds (10s) (default: 100 samples, fewer in a short log)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N|Ns"))]
    pub horizon: Option<Horizon>,
    /// Distance between the origins of the final evaluation [samples] (default: 1; about 10,000 origins in a cross-validation)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N"))]
    pub origin_stride: Option<usize>,
    /// Seed of all random numbers (default: 0)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N"))]
    pub seed: Option<u64>,
    /// Time limit for the training of all networks: 90, 90s, 5m; the result then depends on the machine (default: none)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "TIME", help_heading = "Networks"))]
    pub budget: Option<Duration>,
}

impl Identify {
    /// States roles, neutral values, and limits without a unit.
    pub(super) fn state(&self, boat: &mut Boat) -> Result<(), BoatError> {
        for (name, role) in StatedRoles::given(&self.role) {
            boat.inputs.entry(name).or_default().role = Some(role);
        }
        for (name, range) in self.limit.iter().filter(|(_, range)| range.unit.is_none()) {
            let limits = Some(([range.low, range.high], None));
            boat.state_values(&Channel::new(name.as_str(), ""), None, limits)?;
        }
        for (name, neutral) in &self.neutral {
            boat.state_values(&Channel::new(name.as_str(), ""), Some(*neutral), None)?;
        }
        Ok(())
    }

    /// The methods.
    pub(super) fn methods(&self) -> Vec<Method> {
        if self.methods.is_empty() { vec![Method::Sindy, Method::Committee] } else { self.methods.clone() }
    }
}
