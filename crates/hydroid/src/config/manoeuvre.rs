//! Settings of manoeuvring trials.
// Help texts come from the comments of the options; brackets are units.
#![expect(rustdoc::broken_intra_doc_links, reason = "the comments are help texts, too")]

use std::str::FromStr;

use serde::de::IntoDeserializer;
use serde::{Deserialize, Deserializer};

use super::error::SettingError;
use super::value::by_name;
#[cfg(feature = "arguments")]
use super::value::{named, numbers};
use super::{Duration, with_values};
use crate::boat::{HARD_OVER_DEG, Particulars, StatedRoles};
use crate::identify::GivenRange;
use crate::key::key;
use crate::manoeuvre::{
    LeftOut, ManoeuvreError, Options, TrialKind, TrialOptions, Trials, not_identified, trials,
};
use crate::model::Model;
use crate::plant::InputMap;
use crate::progress::Progress;
use crate::written;

/// Trials of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "arguments", derive(clap::ValueEnum))]
pub enum TrialName {
    /// Turning circles to both sides
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

impl TrialName {
    /// All trials.
    pub const ALL: [Self; 6] =
        [Self::TurningCircle, Self::Zigzag, Self::PullOut, Self::Spiral, Self::Acceleration, Self::Stopping];
}

impl FromStr for TrialName {
    type Err = serde::de::value::Error;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::deserialize(text.into_deserializer())
    }
}

/// A zigzag: steering and change of heading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZigzagAngles {
    /// In the unit of the steering.
    pub steering: f64,
    /// In degrees.
    pub heading_deg: f64,
}

impl FromStr for ZigzagAngles {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("'{text}' is not STEERING/HEADING, as in 10/10 or 20/15");
        let (steering, heading) = text.split_once('/').ok_or_else(wrong)?;
        let positive = |text: &str| text.trim().parse().ok().filter(|x: &f64| x.is_finite() && *x > 0.0);
        match (positive(steering), positive(heading)) {
            (Some(steering), Some(heading_deg)) if heading_deg <= 180.0 => Ok(Self { steering, heading_deg }),
            _ => Err(wrong()),
        }
    }
}

impl<'de> Deserialize<'de> for ZigzagAngles {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged, expecting = "a zigzag STEERING/HEADING (\"10/10\")")]
        enum Written {
            Text(String),
            Pair([f64; 2]),
        }
        let text = match Written::deserialize(deserializer)? {
            Written::Text(text) => text,
            Written::Pair([steering, heading]) => format!("{steering}/{heading}"),
        };
        text.parse().map_err(serde::de::Error::custom)
    }
}

/// Options of manoeuvring trials, of the command and of Python.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[cfg_attr(feature = "arguments", derive(clap::Args), group(skip))]
pub struct Manoeuvre {
    /// Trials, separated by commas (default: all)
    #[cfg_attr(
        feature = "arguments",
        arg(long, alias = "trial", value_enum, value_delimiter = ',', value_name = "TRIAL")
    )]
    #[serde(deserialize_with = "written::list")]
    pub trials: Vec<TrialName>,
    /// Steering of turning circle, pull-out and spiral: degrees, or percent of hard over (default: 35 deg, or hard over)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "DEG|PERCENT", allow_negative_numbers = true))]
    pub steering: Option<f64>,
    /// Zigzags: steering (degrees or percent) and change of heading [deg] (default: 10/10,20/20, where the steering suffices)
    #[cfg_attr(feature = "arguments", arg(long, value_delimiter = ',', value_name = "STEERING/HEADING"))]
    #[serde(deserialize_with = "written::list")]
    pub zigzag: Vec<ZigzagAngles>,
    /// Steady speed of the approach through the water [m/s] (default: that of 85 % propulsion; a vessel that no input pushes has
    /// one speed)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M_S", allow_negative_numbers = true))]
    pub speed: Option<f64>,
    /// Propulsion of the approach, in percent of full ahead (default: 85, the test speed of the IMO)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "PERCENT", allow_negative_numbers = true))]
    pub propulsion: Option<f64>,
    /// Roles of inputs: propulsion, steering, thruster, disturbance or setting, as in delta=steering,wind=disturbance
    /// (default: those of the model, found from names, units and its response)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "INPUT=ROLE,.."))]
    #[serde(deserialize_with = "written::optional")]
    pub role: Option<StatedRoles>,
    /// Limits of a command, in the unit of the input in the boat, else of the model (default: those of the boat, 35 deg for a
    /// steering angle, or in simulations the range of the log). May be repeated
    #[cfg_attr(feature = "arguments", arg(long, value_name = "NAME=LOW:HIGH", value_delimiter = ',', value_parser = named::<GivenRange>))]
    #[serde(deserialize_with = "written::named")]
    pub limit: Vec<(String, GivenRange)>,
    /// Value of a command without effect, in the same unit (default: that of the boat, 1500 for pulses in us, 0 for physical
    /// quantities); value of an input that is not commanded, as of the wind (default: 0). May be repeated
    #[cfg_attr(feature = "arguments", arg(long, value_name = "NAME=VALUE", value_delimiter = ',', value_parser = named::<f64>))]
    #[serde(deserialize_with = "written::named")]
    pub neutral: Vec<(String, f64)>,
    /// Inputs that push the vessel, separated by commas; -NAME pushes astern (default: by the roles of the inputs)
    #[cfg_attr(
        feature = "arguments",
        arg(long, value_delimiter = ',', value_name = "INPUTS", allow_hyphen_values = true)
    )]
    #[serde(deserialize_with = "written::list")]
    pub push: Vec<String>,
    /// Inputs that turn the vessel to starboard; -NAME turns to port (default: by the roles of the inputs)
    #[cfg_attr(
        feature = "arguments",
        arg(long, value_delimiter = ',', value_name = "INPUTS", allow_hyphen_values = true)
    )]
    #[serde(deserialize_with = "written::list")]
    pub turn: Vec<String>,
    /// Velocity of a constant current: north,east [m/s]; the approach heads north (default: still water)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N,E", value_parser = numbers::<2>, allow_hyphen_values = true))]
    #[serde(deserialize_with = "crate::config::value::read_numbers")]
    pub current: Option<[f64; 2]>,
    /// Length of the ship [m]: adds the criteria of IMO resolution MSC.137(76) (default: that of the boat)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M", allow_negative_numbers = true))]
    pub length: Option<f64>,
    /// Scale of the model in the logs, as 45.7 for a model of 1 : 45.7: figures, tracks and criteria are those of the ship, by
    /// Froude's law; speed and longest trial are those of the model (default: that of the boat, else 1)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "LAMBDA", allow_negative_numbers = true))]
    pub scale: Option<f64>,
    /// Longest trial (default: 1h)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "TIME"))]
    pub longest: Option<Duration>,
}

/// The trials that settings ask for.
#[derive(Clone, Debug, PartialEq)]
pub struct TrialPlan {
    /// Which inputs push and turn the vessel.
    pub map: InputMap,
    /// The trials.
    pub kinds: Vec<TrialKind>,
    /// Options.
    pub options: TrialOptions,
    /// Trials that the vessel cannot do.
    pub left_out: Vec<LeftOut>,
}

impl TrialPlan {
    /// Runs the trials; `None` if `progress` cancels.
    ///
    /// # Errors
    /// See [`trials`].
    pub fn run(&self, model: &Model, progress: Progress<'_>) -> Result<Option<Trials>, ManoeuvreError> {
        let found = trials(model, &self.map, &self.kinds, &self.options, progress)?;
        Ok(found.map(|found| Trials { left_out: self.left_out.clone(), ..found }))
    }
}

fn wrong<T>(message: String) -> Result<T, SettingError> {
    Err(SettingError::Option(message))
}

impl Manoeuvre {
    /// The trials of a model.
    ///
    /// # Errors
    /// If the inputs of the model cannot be found, or an option is out of range.
    pub fn plan(&self, model: &Model) -> Result<TrialPlan, SettingError> {
        let model = with_values(
            model.clone().with_roles(&StatedRoles::given(&self.role))?,
            &by_name(&self.neutral),
            &by_name(&self.limit),
        )?;
        let map = InputMap::with(&model, &self.push, &self.turn)
            .map_err(|error| not_identified(&model).map_or_else(|| error.into(), SettingError::from))?;
        let kinds = self.kinds(&map)?;
        let options = self.options(&model.description.boat.particulars)?;
        let no_propulsion = map.no_propulsion();
        if let (Some(reason), Some(percent)) = (&no_propulsion, self.propulsion) {
            return wrong(format!("{}: {reason}; leave it out", key("propulsion").is(percent)));
        }
        let left_out = match no_propulsion {
            Some(reason) if self.trials.is_empty() => {
                let left_out = |trial| LeftOut { trial, reason: reason.clone() };
                ["acceleration", "stopping"].map(left_out).to_vec()
            }
            _ => Vec::new(),
        };
        Ok(TrialPlan { map, kinds, options, left_out })
    }

    fn kinds(&self, map: &InputMap) -> Result<Vec<TrialKind>, SettingError> {
        let full = map.steering().full;
        let unit = map.steering().unit;
        // Hard over to starboard and to port, in the unit of the steering.
        let hard_over = [1.0, -1.0].map(|side| full * map.hard_over(side));
        let least = hard_over[0].min(hard_over[1]);
        let relative = |stated: f64, option: &str| {
            if stated.is_nan() || stated <= 0.0 {
                return wrong(format!(
                    "{}: the steering must be greater than 0; both sides are tried",
                    key(option).is(stated)
                ));
            }
            if stated > least * (1.0 + 1e-9) {
                let [starboard, port] = hard_over;
                let sides = if (starboard / port - 1.0).abs() < 1e-9 {
                    format!("{least:.4} {unit}")
                } else {
                    format!("{starboard:.4} {unit} to starboard and {port:.4} {unit} to port")
                };
                return wrong(format!(
                    "{}: hard over is {sides} for this vessel: give at most that, or state the limits of the input that turns it, as in {}",
                    key(option).is(stated),
                    key("limit").is("NAME=LOW:HIGH")
                ));
            }
            Ok((stated / full).min(1.0))
        };
        let hard = match self.steering {
            Some(stated) => [relative(stated, "steering")?; 2],
            None if unit == "deg" => hard_over.map(|angle| angle.min(HARD_OVER_DEG) / full),
            None => hard_over.map(|reach| reach / full),
        };
        let [starboard, port] = hard;
        let both = starboard.min(port);
        let chosen = if self.trials.is_empty() { &TrialName::ALL[..] } else { &self.trials };
        let no_propulsion = map.no_propulsion();
        let mut kinds = Vec::new();
        for trial in chosen {
            match trial {
                TrialName::TurningCircle => {
                    kinds.extend([starboard, -port].map(|steering| TrialKind::TurningCircle { steering }));
                }
                TrialName::Zigzag => {
                    let usual =
                        [10.0, 20.0].map(|angle| ZigzagAngles { steering: angle, heading_deg: angle });
                    let usual = usual.into_iter().filter(|angles| angles.steering <= least).collect();
                    let zigzags = if self.zigzag.is_empty() { &usual } else { &self.zigzag };
                    if zigzags.is_empty() {
                        return wrong(format!(
                            "hard over is {least:.4} {unit} for this vessel, less than a zigzag 10/10 needs: give smaller angles, as in {}",
                            key("zigzag").is("5/5")
                        ));
                    }
                    for &ZigzagAngles { steering, heading_deg } in zigzags {
                        let steering = relative(steering, "zigzag")?;
                        let zigzag = |steering| TrialKind::Zigzag { steering, heading_deg };
                        kinds.extend([steering, -steering].map(zigzag));
                    }
                }
                TrialName::PullOut => kinds.push(TrialKind::PullOut { steering: both }),
                TrialName::Spiral => kinds.push(TrialKind::Spiral { steering: both, steps: 24 }),
                TrialName::Acceleration | TrialName::Stopping if no_propulsion.is_some() => {
                    if let (Some(reason), false) = (&no_propulsion, self.trials.is_empty()) {
                        return wrong(format!(
                            "acceleration and stopping need propulsion, and {reason}: choose other trials, or state the input that pushes the vessel, as in {}",
                            key("role").is("NAME=propulsion")
                        ));
                    }
                }
                TrialName::Acceleration => kinds.push(TrialKind::Acceleration),
                TrialName::Stopping => kinds.push(TrialKind::Stopping),
            }
        }
        Ok(kinds)
    }

    /// The model for trials in logs, with a stated scale.
    ///
    /// # Errors
    /// If an option of simulated trials is given.
    pub fn for_logs(&self, mut model: Model) -> Result<Model, SettingError> {
        let others = Self { scale: None, ..self.clone() };
        if others != Self::default() {
            return wrong(format!(
                "trials in logs have their own speed, commands and length of time, and no criteria: of the options of trials, only {} is used with logs; leave the others out, or the logs",
                key("scale")
            ));
        }
        let particulars = &mut model.description.boat.particulars;
        let scale = self.scale.or(particulars.scale);
        if let Some(scale) = scale.filter(|scale| !(scale.is_finite() && *scale > 0.0)) {
            return wrong(format!("{}: give a number greater than 0", key("scale").is(scale)));
        }
        particulars.scale = scale;
        Ok(model)
    }

    fn options(&self, particulars: &Particulars) -> Result<TrialOptions, SettingError> {
        let default = TrialOptions::default();
        if self.speed.is_some() && self.propulsion.is_some() {
            let [speed, propulsion] = ["speed", "propulsion"].map(key);
            return wrong(format!("{speed} and {propulsion} both state the approach: give one of them"));
        }
        if let Some(percent) = self.propulsion.filter(|percent| !(*percent > 0.0 && *percent <= 100.0)) {
            return wrong(format!(
                "{}: give percent of full ahead, greater than 0 and at most 100",
                key("propulsion").is(percent)
            ));
        }
        if let Some(length) = self.length.filter(|length| !(length.is_finite() && *length > 0.0)) {
            return wrong(format!("{}: give metres, greater than 0", key("length").is(length)));
        }
        if self.current.iter().flatten().any(|velocity| !velocity.is_finite()) {
            return wrong(format!("{}: give two velocities in m/s, north and east", key("current")));
        }
        Ok(TrialOptions {
            approach: Options {
                propulsion: self.propulsion.map_or(default.approach.propulsion, |percent| 0.01 * percent),
                speed_m_s: self.speed,
            },
            longest_s: self.longest.map_or(default.longest_s, |longest| longest.0),
            current: self.current.unwrap_or_default(),
            length_m: self.length.or(particulars.length),
            scale: self.scale.or(particulars.scale).unwrap_or(1.0),
        })
    }
}
