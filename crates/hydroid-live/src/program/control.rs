//! Arguments of `hydroid control`, whose section of the configuration file has the path and the controller on board.

mod options;

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};

use hydroid::config::Duration;

use super::roles::{RoleArgs, ValueArgs};
use super::values::{Learner, NamedNumber, Pair, Points, Triple};

/// Controllers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ControllerKind {
    /// Feedback linearization of a point ahead of the vessel: equations, vessels and control-affine networks
    Fl,
    /// Adaptive backstepping of the same point, which rejects constant disturbances: the same models
    Backstepping,
    /// Model predictive control by the cross-entropy method: any model
    Cem,
    /// Line of sight, PID on the heading, PI on the speed: any model; the gains are found by a grid search on it first
    Pid,
}

/// Tasks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TaskKind {
    /// A circle to starboard
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

/// Parameter of the reference path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TimingKind {
    /// Trajectory tracking: a position for each time
    Time,
    /// Path following: the nearest point of the path, with the speed required there
    Path,
}

/// The reference path and its speed.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Task")]
pub struct TaskArgs {
    /// Reference path
    #[arg(long, value_enum, default_value = "circle")]
    pub task: TaskKind,
    /// Speed on straights and circles [m/s] (default: 1.5; for an identified model that of half the propulsion)
    #[arg(long, value_name = "M_S", allow_negative_numbers = true)]
    pub speed: Option<f64>,
    /// Speed in turns and at corners [m/s] (default: --speed)
    #[arg(long, value_name = "M_S", allow_negative_numbers = true)]
    pub turn_speed: Option<f64>,
    /// Radius of circle and turns [m] (default: 15, in proportion to the turning radius of an identified model)
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub radius: Option<f64>,
    /// Lawn-mower: length of a leg [m] (default: four radii)
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub leg: Option<f64>,
    /// Lawn-mower: distance between legs [m] (default: two radii)
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub spacing: Option<f64>,
    /// Lawn-mower: number of legs (default: 4)
    #[arg(long, value_name = "N")]
    pub legs: Option<usize>,
    /// Waypoints and legs: north,east of each point [m]: '0,0;60,0;60,40'; station: one point (default: 0,0)
    #[arg(long, value_name = "N,E;N,E;..", allow_hyphen_values = true)]
    pub points: Option<Points>,
    /// Waypoints and legs: the points of a CSV file (north [m] and east [m], or lat [deg] and lon [deg]) or a GPX file
    #[arg(long, value_name = "FILE", conflicts_with = "points")]
    pub waypoints: Option<PathBuf>,

    /// Station: heading to hold, clockwise from north [deg] (default: 0)
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub heading: Option<f64>,
    /// Largest rate of change of the reference speed [m/s^2] (default: 0.2, in proportion for an identified model)
    #[arg(long, value_name = "M_S2", allow_negative_numbers = true)]
    pub acceleration: Option<f64>,
    /// Duration of the simulation: 90, 5m (default: 120 s on a circle, else 1.5 times the duration of the reference)
    #[arg(long, value_name = "TIME")]
    pub duration: Option<Duration>,
    /// Initial position relative to the start of the path [m]: ahead, to starboard (default: 0,-0.5, in proportion for an
    /// identified model)
    #[arg(long, value_name = "M,M", allow_hyphen_values = true)]
    pub start: Option<Pair>,
}

/// The controller and its parameters.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Controller")]
pub struct ControllerArgs {
    /// Control law; cem works with every kind of model
    #[arg(long, value_enum, default_value = "cem")]
    pub controller: ControllerKind,
    /// Distance of the controlled point ahead of the vessel's origin [m] (default: fl, backstepping 1.5; cem, pid 0)
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub lead: Option<f64>,
    /// Largest distance from the reference at which the vessel counts as on track [m] (default: 2, in proportion for an
    /// identified model)
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub tolerance: Option<f64>,
    /// Time from which errors count and the vessel must be on track (default: 40 s on a circle, else 10 s, less on short tasks)
    #[arg(long, value_name = "TIME")]
    pub evaluate_from: Option<Duration>,
    /// fl: natural frequency [rad/s] and damping ratio of the error dynamics (default: 1.5,0.7)
    #[arg(long, value_name = "RAD_S,ZETA")]
    pub bandwidth: Option<Pair>,
    /// fl: integral gain [1/s^3] against model error and steady disturbances (default: 0; 1 suits the default bandwidth)
    #[arg(long, value_name = "PER_S3", allow_negative_numbers = true)]
    pub integral: Option<f64>,
    /// fl: a small network learns the model error online and compensates it while its predictions hold
    #[arg(long, conflicts_with = "adapt")]
    pub adaptive_augmentation: bool,
    /// backstepping: common rate of the gains [1/s] (default: 1)
    #[arg(long, value_name = "PER_S", allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// cem: trajectory tracking (time) or path following (path) (default: time)
    #[arg(long, value_enum)]
    pub reference: Option<TimingKind>,
    /// cem: prediction horizon [commands] (default: 20; 40 for an identified model)
    #[arg(long, value_name = "N")]
    pub horizon: Option<usize>,
    /// cem: samples for which a command of a plan is held (default: 1, in proportion to the time of a turn of an identified model)
    #[arg(long, value_name = "N")]
    pub hold: Option<usize>,
    /// cem: candidates per iteration; a tenth of them are elites (default: 60)
    #[arg(long, value_name = "N")]
    pub candidates: Option<usize>,
    /// cem: iterations (default: 2)
    #[arg(long, value_name = "N")]
    pub iterations: Option<usize>,
    /// cem: Gauss-Newton steps from the best candidate (default: 2)
    #[arg(long, value_name = "N")]
    pub gauss_newton_steps: Option<usize>,
    /// cem: cost weights of position error [1/m^2], course error [1/rad^2] and speed error [s^2/m^2] (default: 1,0.2,0.2)
    #[arg(long, value_name = "M,RAD,M_S")]
    pub cost_weights: Option<Triple>,
    /// cem: time limit of a plan [ms]; the best plan found so far is used, so that the result depends on the clock
    #[arg(long, value_name = "MS", allow_negative_numbers = true)]
    pub plan_time: Option<f64>,
    /// Sample time of the controller [s] (default: that of the model; 0.1 for vessels and pid)
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub dt: Option<f64>,
    /// Largest rate of change of a command, in its unit per second (default: that of the vessel or model). May be repeated
    #[arg(long, value_name = "NAME=RATE")]
    pub rate_limit: Vec<NamedNumber>,
    /// Limits and neutral values of inputs.
    #[command(flatten)]
    pub values: ValueArgs,
    /// Roles of inputs.
    #[command(flatten)]
    pub roles: RoleArgs,
    /// pid: inputs that push the vessel, separated by commas; -NAME pushes astern (default: by the roles of the inputs)
    #[arg(long, value_delimiter = ',', value_name = "INPUTS", allow_hyphen_values = true)]
    pub push: Vec<String>,
    /// pid: inputs that turn the vessel to starboard; -NAME turns to port (default: by the roles of the inputs)
    #[arg(long, value_delimiter = ',', value_name = "INPUTS", allow_hyphen_values = true)]
    pub turn: Vec<String>,
}

/// Online adaptation of the model.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Online adaptation")]
pub struct AdaptationArgs {
    /// Take the model as one of the motion through the water, and estimate the current: standard deviation of its components
    /// at the start [m/s], as in 0.3
    #[arg(long, value_name = "M/S", allow_negative_numbers = true)]
    pub estimate_current: Option<f64>,
    /// Adapt the model in the loop, as hydroid adapt does
    #[arg(long)]
    pub adapt: bool,
    /// Method of adaptation (default: least-squares for equations and direct predictors, kalman for networks and vessels)
    #[arg(long, value_name = "METHOD", value_enum, requires = "adapt")]
    pub learner: Option<Learner>,
    /// Switch the guard off: always use the adapted model
    #[arg(long, requires = "adapt")]
    pub no_guard: bool,
    /// A log that the model was trained on: the filter runs over its beginning first. May be repeated
    #[arg(long, value_name = "LOG", requires = "adapt")]
    pub training_log: Vec<PathBuf>,
    /// Length of the beginning of each training log
    #[arg(long, value_name = "TIME", default_value = "200s", requires = "training_log")]
    pub training_time: Duration,
}

/// Disturbances, noise and parameter changes of the simulated plant; the controller does not know them.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Disturbances (unknown to the controller)")]
pub struct DisturbanceArgs {
    /// Seed of noise, gusts and plans
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Factor on the measurement noise of the plant; 0: none
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, allow_negative_numbers = true)]
    pub noise: f64,
    /// Factor on the process noise of a model as the plant, from its residuals; 0: none
    #[arg(long, value_name = "FACTOR", default_value_t = 0.0, allow_negative_numbers = true)]
    pub process_noise: f64,
    /// Velocity of the current: north,east [m/s]
    #[arg(long, value_name = "N,E", default_value = "0,0", allow_hyphen_values = true)]
    pub current: Pair,
    /// Constant wind force on the hull: north,east [N]; wind, gusts and mass need a plant with given parameters
    #[arg(long, value_name = "N,E", default_value = "0,0", allow_hyphen_values = true)]
    pub wind: Pair,
    /// Gusts: standard deviation [N] and time constant [s] of a Gauss-Markov force in each direction
    #[arg(long, value_name = "N,S", default_value = "0,5")]
    pub gusts: Pair,
    /// Factor on mass and yaw inertia: 1.2 for 20 % more
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, allow_negative_numbers = true)]
    pub mass: f64,
    /// Input delay [s]: a whole number of samples
    #[arg(long, value_name = "S", default_value_t = 0.0, allow_negative_numbers = true)]
    pub delay: f64,
    /// Time from which current, wind and mass factor apply, as in 60s: before it, the vessel is as built, in still water
    #[arg(long, value_name = "TIME")]
    pub onset: Option<Duration>,
}

/// Monte Carlo trials.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Monte Carlo")]
pub struct MonteCarloArgs {
    /// Number of trials, each with its own seed, mass, current and wind
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub runs: usize,
    /// Largest relative change of the mass, with --runs (default: 0.2)
    #[arg(long, value_name = "FRACTION", allow_negative_numbers = true)]
    pub mass_variation: Option<f64>,
    /// Largest speed of the current, from any direction [m/s], with --runs (default: 0.3)
    #[arg(long, value_name = "M_S", allow_negative_numbers = true)]
    pub current_variation: Option<f64>,
    /// Largest wind force, from any direction [N], half of it in gusts, with --runs (default: 15)
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub wind_variation: Option<f64>,
}

/// Answers and state of a live stream.
#[derive(Clone, Debug, Default, ClapArgs)]
#[command(next_help_heading = "Live stream")]
pub struct AnswerArgs {
    /// Horizons of the predictions in each answer [samples], ascending (default: 1,10,50,100)
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub horizons: Option<Vec<usize>>,
    /// Save the state of model and controller in this file once a second, and resume from it; lines that were answered before are not used again
    #[arg(long, value_name = "FILE")]
    pub state: Option<PathBuf>,
    /// Add the computing time to each answer [us]
    #[arg(long)]
    pub timing: bool,
}

impl AnswerArgs {
    /// Horizons of the predictions \[samples\].
    pub fn horizons(&self) -> Vec<usize> {
        self.horizons.clone().unwrap_or_else(|| vec![1, 10, 50, 100])
    }

    /// Whether an option is given.
    pub fn is_given(&self) -> bool {
        self.horizons.is_some() || self.state.is_some() || self.timing
    }
}

/// A live stream.
#[derive(Clone, Debug, Default, ClapArgs)]
#[command(next_help_heading = "Live stream")]
pub struct ServiceArgs {
    /// Answers.
    #[command(flatten)]
    pub answers: AnswerArgs,
    /// Record samples, updates and events of the adaptation of the last minutes in this file, for hydroid inspect and
    /// hydroid adapt --replay
    #[arg(long, value_name = "FILE", requires = "adapt")]
    pub black_box: Option<PathBuf>,
    /// Shortest time that the black box holds [min], at least 2 (default: 5)
    #[arg(long, value_name = "MINUTES", requires = "black_box", allow_negative_numbers = true)]
    pub black_box_minutes: Option<f64>,
}

/// Simulate a closed loop, or steer a vessel through a live stream
///
/// Simulation: a controller with a model, and a vessel with noise, current, wind and delay
///
/// The vessel is the model itself, or another plant (--plant). fl and backstepping invert the model: equations with one
/// known function of each command (hydroid identify --for-control), a control-affine network, or a vessel. cem plans with
/// any model. pid is tuned on any model. With --adapt the model adapts in the loop under the guard, and each command uses
/// the adapted model.
///
/// Live stream (-): each line, CSV after a header or a JSON object, has the time, the position (x and y, or lat and lon for
/// geographic way-points), the heading and the outputs of the model. It is answered with a line of JSON: command, status,
/// reference, predicted track and bands. See docs/control-service.md.
#[derive(Debug, ClapArgs)]
#[command(after_help = include_str!("help/control.txt"))]
pub struct Control {
    /// The model: a .safetensors file, a vessel file (.toml), or hydrofoil, hydrofoil-low-speed, simple. pid is tuned on it
    #[arg(value_name = "MODEL")]
    pub model: Option<PathBuf>,
    /// A live stream: - for standard input, or a file. Each line is answered with a command
    #[arg(value_name = "STREAM", allow_hyphen_values = true)]
    pub stream: Option<PathBuf>,
    /// Configuration file with a section [control] (default: hydroid.toml in the current folder, if it exists)
    #[arg(long, short, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// The true plant: a .safetensors file, a vessel file (.toml), or hydrofoil, hydrofoil-low-speed, simple (default: MODEL)
    #[arg(long, value_name = "PLANT")]
    pub plant: Option<PathBuf>,
    /// Folder for track.csv (a log), control.json and report.html
    #[arg(long, short, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Print all options
    #[arg(long)]
    pub help_advanced: bool,
    /// Controller.
    #[command(flatten)]
    pub controller: ControllerArgs,
    /// Task.
    #[command(flatten)]
    pub task: TaskArgs,
    /// Disturbances.
    #[command(flatten)]
    pub disturbances: DisturbanceArgs,
    /// Online adaptation.
    #[command(flatten)]
    pub adaptation: AdaptationArgs,
    /// Monte Carlo trials.
    #[command(flatten)]
    pub monte_carlo: MonteCarloArgs,
    /// Live stream.
    #[command(flatten)]
    pub service: ServiceArgs,
}
