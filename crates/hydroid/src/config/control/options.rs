//! The options of `hydroid control` without those of live streams.
// Help texts come from the comments of the options; brackets are units.
#![expect(rustdoc::broken_intra_doc_links, reason = "the comments are help texts, too")]

use std::path::PathBuf;

use serde::Deserialize;

use crate::adapt::Method;
use crate::boat::StatedRoles;
use crate::closed_loop::{Conditions, ControlMethod, Dispersion, Timing, TruePlant, Wind};
use crate::config::Duration;
#[cfg(feature = "arguments")]
use crate::config::value::{named, numbers, points};
use crate::identify::GivenRange;
use crate::written;

/// North and east of each point [m].
pub type Points = Vec<[f64; 2]>;

/// Reference paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "arguments", derive(clap::ValueEnum))]
pub enum TaskKind {
    /// A circle to starboard
    #[default]
    Circle,
    /// Parallel legs to the north and back, joined by arcs
    LawnMower,
    /// From point to point, with turning circles at the corners
    Waypoints,
    /// From point to point, with sharp corners
    Legs,
    /// Station keeping: hold a point and a heading, if the actuators suffice
    Station,
}

impl TaskKind {
    /// Name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Circle => "circle",
            Self::LawnMower => "lawn-mower",
            Self::Waypoints => "waypoints",
            Self::Legs => "straight legs",
            Self::Station => "station",
        }
    }
}

#[cfg(feature = "arguments")]
mod headings {
    pub(super) const TASK: &str = "Task";
    pub(super) const CONTROLLER: &str = "Controller";
    pub(super) const ADAPTATION: &str = "Online adaptation";
    pub(super) const DISTURBANCES: &str = "Disturbances (unknown to the controller)";
    pub(super) const TRIALS: &str = "Monte Carlo";
}
#[cfg(feature = "arguments")]
use headings::{ADAPTATION, CONTROLLER, DISTURBANCES, TASK, TRIALS};

/// Options of a closed loop, of the command, of the section `[control]` of a file, and of Python. One that is not given has a
/// default, which may follow from the size of the vessel.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[cfg_attr(feature = "arguments", derive(clap::Args), group(skip))]
pub struct ClosedLoopOptions {
    /// Reference path
    #[cfg_attr(feature = "arguments", arg(long, value_enum, default_value_t, help_heading = TASK))]
    pub task: TaskKind,
    /// Speed on straights and circles [m/s] (default: 1.5; for an identified model that of half the propulsion)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M_S", allow_negative_numbers = true, help_heading = TASK))]
    pub speed: Option<f64>,
    /// Speed in turns and at corners [m/s] (default: speed)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M_S", allow_negative_numbers = true, help_heading = TASK))]
    pub turn_speed: Option<f64>,
    /// Radius of circle and turns [m] (default: 15, in proportion to the turning radius of an identified model)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M", allow_negative_numbers = true, help_heading = TASK))]
    pub radius: Option<f64>,
    /// Lawn-mower: length of a leg [m] (default: four radii)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M", allow_negative_numbers = true, help_heading = TASK))]
    pub leg: Option<f64>,
    /// Lawn-mower: distance between legs [m] (default: two radii)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M", allow_negative_numbers = true, help_heading = TASK))]
    pub spacing: Option<f64>,
    /// Lawn-mower: number of legs (default: 4)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N", help_heading = TASK))]
    pub legs: Option<usize>,
    /// Waypoints and legs: north,east of each point [m]: '0,0;60,0;60,40'; station: one point (default: 0,0)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N,E;N,E;..", allow_hyphen_values = true, value_parser = points, help_heading = TASK))]
    #[serde(deserialize_with = "crate::config::value::read_points")]
    pub points: Option<Points>,
    /// Waypoints and legs: the points of a CSV file (north [m] and east [m], or lat [deg] and lon [deg]), a GPX or GeoJSON file,
    /// or a mission of an autopilot (.plan of QGroundControl, .waypoints)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "FILE", help_heading = TASK))]
    pub waypoints: Option<PathBuf>,
    /// Station: heading to hold, clockwise from north [deg] (default: 0)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "DEG", allow_negative_numbers = true, help_heading = TASK))]
    pub heading: Option<f64>,
    /// Largest rate of change of the reference speed [m/s^2] (default: 0.2, in proportion for an identified model)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M_S2", allow_negative_numbers = true, help_heading = TASK))]
    pub acceleration: Option<f64>,
    /// Duration of the simulation: 90, 5m (default: 120 s on a circle, else 1.5 times the duration of the reference)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "TIME", help_heading = TASK))]
    pub duration: Option<Duration>,
    /// Initial position relative to the start of the path [m]: ahead, to starboard (default: 0,-0.5, in proportion for an
    /// identified model)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M,M", allow_hyphen_values = true, value_parser = numbers::<2>, help_heading = TASK))]
    #[serde(deserialize_with = "crate::config::value::read_numbers")]
    pub start: Option<[f64; 2]>,
    /// Control law; cem works with every kind of model
    #[cfg_attr(feature = "arguments", arg(long, value_enum, default_value_t, help_heading = CONTROLLER))]
    pub controller: ControlMethod,
    /// Distance of the controlled point ahead of the vessel's origin [m] (default: fl, backstepping 1.5; cem, pid 0)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M", allow_negative_numbers = true, help_heading = CONTROLLER))]
    pub lead: Option<f64>,
    /// Largest distance from the reference at which the vessel counts as on track [m] (default: 2, in proportion for an
    /// identified model)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M", allow_negative_numbers = true, help_heading = CONTROLLER))]
    pub tolerance: Option<f64>,
    /// Time from which errors count and the vessel must be on track (default: 40 s on a circle, else 10 s, less on short tasks)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "TIME", help_heading = CONTROLLER))]
    pub evaluate_from: Option<Duration>,
    /// fl: natural frequency [rad/s] and damping ratio of the error dynamics (default: 1.5,0.7)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "RAD_S,ZETA", value_parser = numbers::<2>, help_heading = CONTROLLER))]
    #[serde(deserialize_with = "crate::config::value::read_numbers")]
    pub bandwidth: Option<[f64; 2]>,
    /// fl: integral gain [1/s^3] against model error and steady disturbances (default: 0; 1 suits the default bandwidth)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "PER_S3", allow_negative_numbers = true, help_heading = CONTROLLER))]
    pub integral: Option<f64>,
    /// fl: a small network learns the model error online and compensates it while its predictions hold
    #[cfg_attr(feature = "arguments", arg(long, help_heading = CONTROLLER))]
    pub adaptive_augmentation: bool,
    /// backstepping: common rate of the gains [1/s] (default: 1)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "PER_S", allow_negative_numbers = true, help_heading = CONTROLLER))]
    pub rate: Option<f64>,
    /// cem: trajectory tracking (time) or path following (path) (default: time)
    #[cfg_attr(feature = "arguments", arg(long, value_enum, help_heading = CONTROLLER))]
    pub reference: Option<Timing>,
    /// cem: prediction horizon [commands] (default: 20; 40 for an identified model)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N", help_heading = CONTROLLER))]
    pub horizon: Option<usize>,
    /// cem: samples for which a command of a plan is held (default: 1, in proportion to the time of a turn of an identified model)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N", help_heading = CONTROLLER))]
    pub hold: Option<usize>,
    /// cem: candidates per iteration; a tenth of them are elites (default: 60)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N", help_heading = CONTROLLER))]
    pub candidates: Option<usize>,
    /// cem: iterations (default: 2)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N", help_heading = CONTROLLER))]
    pub iterations: Option<usize>,
    /// cem: Gauss-Newton steps from the best candidate (default: 2)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N", help_heading = CONTROLLER))]
    pub gauss_newton_steps: Option<usize>,
    /// cem: cost weights of position error [1/m^2], course error [1/rad^2] and speed error [s^2/m^2] (default: 1,0.2,0.2)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M,RAD,M_S", value_parser = numbers::<3>, help_heading = CONTROLLER))]
    #[serde(deserialize_with = "crate::config::value::read_numbers")]
    pub cost_weights: Option<[f64; 3]>,
    /// cem: weight of the squared change from command to command, relative to half of the range of the command; a larger one
    /// gives calmer commands (default: 0.05)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "WEIGHT", help_heading = CONTROLLER))]
    pub change_weight: Option<f64>,
    /// cem: time limit of a plan [ms]; the best plan found so far is used, so that the result depends on the clock
    #[cfg_attr(feature = "arguments", arg(long, value_name = "MS", allow_negative_numbers = true, help_heading = CONTROLLER))]
    pub plan_time: Option<f64>,
    /// On board: age of the last measured position, heading or velocity beyond which the commands have their neutral values
    /// (default: 1 s, at least 5 samples)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "TIME", help_heading = CONTROLLER))]
    pub max_age: Option<Duration>,
    /// On board: polygon that the vessel must not leave, in a file as those of way-points: outside it, and where no way to the
    /// task stays inside, the commands have their neutral values
    #[cfg_attr(feature = "arguments", arg(long, value_name = "FILE", help_heading = CONTROLLER))]
    pub fence: Option<PathBuf>,
    /// On board: polygon that the vessel must keep out of. May be repeated
    #[cfg_attr(feature = "arguments", arg(long, value_name = "FILE", help_heading = CONTROLLER))]
    pub keep_out: Vec<PathBuf>,
    /// Sample time of the controller [s] (default: that of the model; 0.1 for vessels and pid)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "S", allow_negative_numbers = true, help_heading = CONTROLLER))]
    pub dt: Option<f64>,
    /// Largest rate of change of a command, in its unit per second (default: that of the vessel or model). May be repeated
    #[cfg_attr(feature = "arguments", arg(long, value_name = "NAME=RATE", value_parser = named::<f64>, value_delimiter = ',', help_heading = CONTROLLER))]
    #[serde(deserialize_with = "written::named")]
    pub rate_limit: Vec<(String, f64)>,
    /// Limits of a command, in the unit of the input in the boat, else of the model, within those that the boat states (default:
    /// those of the boat, 35 deg for a steering angle, or in simulations the range of the log). May be repeated
    #[cfg_attr(feature = "arguments", arg(long, value_name = "NAME=LOW:HIGH", value_delimiter = ',', value_parser = named::<GivenRange>, help_heading = CONTROLLER))]
    #[serde(deserialize_with = "written::named")]
    pub limit: Vec<(String, GivenRange)>,
    /// Value of a command without effect, in the same unit (default: that of the boat, 1500 for pulses in us, 0 for physical
    /// quantities); value of an input that is not commanded, as of the wind (default: 0). May be repeated
    #[cfg_attr(feature = "arguments", arg(long, value_name = "NAME=VALUE", value_delimiter = ',', value_parser = named::<f64>, help_heading = CONTROLLER))]
    #[serde(deserialize_with = "written::named")]
    pub neutral: Vec<(String, f64)>,
    /// Roles of inputs: propulsion, steering, thruster, disturbance or setting, as in delta=steering,wind=disturbance
    /// (default: those of the model, found from names, units and its response)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "INPUT=ROLE,..", help_heading = CONTROLLER))]
    #[serde(deserialize_with = "written::optional")]
    pub role: Option<StatedRoles>,
    /// pid: inputs that push the vessel, separated by commas; -NAME pushes astern (default: by the roles of the inputs)
    #[cfg_attr(feature = "arguments", arg(long, value_delimiter = ',', value_name = "INPUTS", allow_hyphen_values = true, help_heading = CONTROLLER))]
    #[serde(deserialize_with = "written::list")]
    pub push: Vec<String>,
    /// pid: inputs that turn the vessel to starboard; -NAME turns to port (default: by the roles of the inputs)
    #[cfg_attr(feature = "arguments", arg(long, value_delimiter = ',', value_name = "INPUTS", allow_hyphen_values = true, help_heading = CONTROLLER))]
    #[serde(deserialize_with = "written::list")]
    pub turn: Vec<String>,
    /// Take the model as one of the motion through the water, and estimate the current: standard deviation of its components
    /// at the start [m/s], as in 0.3
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M/S", allow_negative_numbers = true, help_heading = ADAPTATION))]
    pub estimate_current: Option<f64>,
    /// Adapt the model in the loop, as hydroid adapt does
    #[cfg_attr(feature = "arguments", arg(long, help_heading = ADAPTATION))]
    pub adapt: bool,
    /// Method of adaptation (default: least-squares for equations and direct predictors, kalman for networks and vessels)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "METHOD", value_enum, help_heading = ADAPTATION))]
    pub learner: Option<Method>,
    /// Switch the guard off: always use the adapted model
    #[cfg_attr(feature = "arguments", arg(long, help_heading = ADAPTATION))]
    pub no_guard: bool,
    /// Seed of noise, gusts and plans
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N", default_value_t, help_heading = DISTURBANCES))]
    pub seed: u64,
    /// Factor on the measurement noise of the plant; 0: none (default: 1)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "FACTOR", allow_negative_numbers = true, help_heading = DISTURBANCES))]
    pub noise: Option<f64>,
    /// Factor on the process noise of a model as the plant, from its residuals; 0: none (default: 0)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "FACTOR", allow_negative_numbers = true, help_heading = DISTURBANCES))]
    pub process_noise: Option<f64>,
    /// Velocity of the current: north,east [m/s] (default: still water)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N,E", allow_hyphen_values = true, value_parser = numbers::<2>, help_heading = DISTURBANCES))]
    #[serde(deserialize_with = "crate::config::value::read_numbers")]
    pub current: Option<[f64; 2]>,
    /// Constant wind force on the hull: north,east [N] (default: 0,0); wind, gusts and mass need a plant with given parameters
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N,E", allow_hyphen_values = true, value_parser = numbers::<2>, help_heading = DISTURBANCES))]
    #[serde(deserialize_with = "crate::config::value::read_numbers")]
    pub wind: Option<[f64; 2]>,
    /// Gusts: standard deviation [N] and time constant [s] of a Gauss-Markov force in each direction (default: 0,5)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N,S", value_parser = numbers::<2>, help_heading = DISTURBANCES))]
    #[serde(deserialize_with = "crate::config::value::read_numbers")]
    pub gusts: Option<[f64; 2]>,
    /// Factor on mass and yaw inertia: 1.2 for 20 % more (default: 1)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "FACTOR", allow_negative_numbers = true, help_heading = DISTURBANCES))]
    pub mass: Option<f64>,
    /// Input delay [s]: a whole number of samples (default: 0)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "S", allow_negative_numbers = true, help_heading = DISTURBANCES))]
    pub delay: Option<f64>,
    /// Time from which current, wind and mass factor apply, as in 60s: before it, the vessel is as built, in still water
    #[cfg_attr(feature = "arguments", arg(long, value_name = "TIME", help_heading = DISTURBANCES))]
    pub onset: Option<Duration>,
    /// Number of trials, each with its own seed, mass, current and wind (default: a single run under the stated conditions)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N", help_heading = TRIALS))]
    pub runs: Option<usize>,
    /// Largest relative change of the mass of a trial (default: 0.2)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "FRACTION", allow_negative_numbers = true, help_heading = TRIALS))]
    pub mass_variation: Option<f64>,
    /// Largest speed of the current, from any direction [m/s] of a trial (default: 0.3)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M_S", allow_negative_numbers = true, help_heading = TRIALS))]
    pub current_variation: Option<f64>,
    /// Largest wind force, from any direction [N], half of it in gusts of a trial (default: 15)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N", allow_negative_numbers = true, help_heading = TRIALS))]
    pub wind_variation: Option<f64>,
}

impl ClosedLoopOptions {
    /// The conditions of a run.
    pub fn conditions(&self) -> Conditions {
        let [gust, gust_s] = self.gusts.unwrap_or([0.0, Wind::CALM.gust_s]);
        Conditions {
            seed: self.seed,
            noise: self.noise.unwrap_or(1.0),
            process_noise: self.process_noise.unwrap_or(0.0),
            current: self.current.unwrap_or_default(),
            wind: Wind { force: self.wind.unwrap_or_default(), gust, gust_s },
            mass: self.mass.unwrap_or(1.0),
            delay_s: self.delay.unwrap_or(0.0),
            onset_s: self.onset.map_or(0.0, |onset| onset.0),
        }
    }

    /// The first one that is given of the options of each control law.
    pub(super) fn of_laws(&self) -> [(ControlMethod, Option<&'static str>); 3] {
        [
            (ControlMethod::FeedbackLinearization, first!(self, bandwidth integral adaptive_augmentation)),
            (ControlMethod::Backstepping, first!(self, rate)),
            (
                ControlMethod::CrossEntropy,
                first!(self, horizon hold candidates iterations gauss_newton_steps cost_weights change_weight plan_time),
            ),
        ]
    }

    /// The first one that is given of the options of a simulation.
    pub(super) fn of_simulation(&self) -> Option<&'static str> {
        first!(self, runs duration start evaluate_from noise process_noise current wind gusts mass delay onset)
    }

    /// Number of trials.
    pub fn runs(&self) -> usize {
        self.runs.unwrap_or(1)
    }

    /// Dispersion of the conditions of trials. An identified model has no forces and no mass.
    pub fn dispersion(&self, plant: &TruePlant) -> Dispersion {
        let default = Dispersion::default();
        let default = match plant {
            TruePlant::Vessel(_) => default,
            TruePlant::Model(_) => Dispersion { mass: 0.0, wind: 0.0, ..default },
        };
        Dispersion {
            mass: self.mass_variation.unwrap_or(default.mass),
            current: self.current_variation.unwrap_or(default.current),
            wind: self.wind_variation.unwrap_or(default.wind),
        }
    }
}
