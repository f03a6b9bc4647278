//! Arguments of `hydroid control`.

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};

use super::Learner;
use super::values::{Duration, Pair, Points};

/// Controllers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ControllerKind {
    /// Feedback linearization of a point ahead of the vessel: equations, vessels and control-affine networks
    Fl,
    /// Backstepping of the same point, which learns constant disturbances: equations, vessels and control-affine networks
    Backstepping,
    /// Model predictive control by the cross-entropy method: any model
    Cem,
    /// Line of sight, PID on the heading, PI on the speed: no model. Tuned by a grid on voyages of its own first
    Pid,
}

/// Tasks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TaskKind {
    /// Round and round, to starboard
    Circle,
    /// Parallel legs to the north and back, with arcs between them
    LawnMower,
    /// From point to point, the corners cut by turning circles
    Waypoints,
    /// From point to point, with corners
    Legs,
}

/// What moves the reference of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TimingKind {
    /// The clock: to be at a place at a time
    Clock,
    /// The vessel: the nearest place of the path, at the speed asked for there
    Foot,
}

/// Where, and how fast.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Task")]
pub struct TaskArgs {
    /// What is to be sailed
    #[arg(long, value_enum, default_value = "circle")]
    pub task: TaskKind,
    /// Speed on straights, and on circles [m/s]
    #[arg(long, value_name = "M_S", default_value_t = 1.5, allow_negative_numbers = true)]
    pub speed: f64,
    /// Speed in turns and over corners [m/s] (default: the same)
    #[arg(long, value_name = "M_S", allow_negative_numbers = true)]
    pub turn_speed: Option<f64>,
    /// Radius of circle and turns [m] (default: 15)
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub radius: Option<f64>,
    /// Lawn-mower: length of a leg [m] (default: 60)
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub leg: Option<f64>,
    /// Lawn-mower: distance of the legs [m] (default: two radii)
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub spacing: Option<f64>,
    /// Lawn-mower: number of legs (default: 4)
    #[arg(long, value_name = "N")]
    pub legs: Option<usize>,
    /// Way-points and legs: north,east of each point [m], separated by semicolons: 0,0;60,0;60,40
    #[arg(long, value_name = "N,E;N,E;..", allow_hyphen_values = true)]
    pub points: Option<Points>,
    /// Largest rate of the speed asked for [m/s^2]
    #[arg(long, value_name = "M_S2", default_value_t = 0.2, allow_negative_numbers = true)]
    pub acceleration: f64,
    /// How long [s]: 90, 5m (default: 120 s on a circle; else half as long again as the course takes, for what follows it and
    /// is slow)
    #[arg(long, value_name = "TIME")]
    pub duration: Option<Duration>,
    /// Where the vessel begins: metres ahead along the path, and to starboard of it
    #[arg(long, value_name = "M,M", default_value = "0,-0.5", allow_hyphen_values = true)]
    pub start: Pair,
}

/// How it is steered.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Controller")]
pub struct HelmArgs {
    /// Which
    #[arg(long, value_enum)]
    pub controller: ControllerKind,
    /// How far ahead of the vessel's origin the point is that is to be on the path [m] (default: 1.5 of fl and backstepping, 0
    /// of cem; pid brings the origin there)
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub lead: Option<f64>,
    /// Farther than this from its reference the vessel is lost [m]
    #[arg(long, value_name = "M", default_value_t = 2.0, allow_negative_numbers = true)]
    pub tolerance: f64,
    /// Errors count, and the vessel is to be settled, from here on (default: 40 s on a circle, else 10 s; a third of the
    /// duration at the most, and half of the time that the course takes)
    #[arg(long, value_name = "TIME")]
    pub from: Option<Duration>,
    /// fl: natural frequency [rad/s] and damping of the error (default: 1.5,0.7)
    #[arg(long, value_name = "RAD_S,ZETA")]
    pub bandwidth: Option<Pair>,
    /// fl: gain of an integral [1/s^3] against what the model misses and what pushes steadily (default: 0; with the default
    /// bandwidth 1 is a good one)
    #[arg(long, value_name = "PER_S3", allow_negative_numbers = true)]
    pub integral: Option<f64>,
    /// fl: a small network around the law learns under way what its model misses, and is used while it foretells what happens
    #[arg(long, conflicts_with = "adapt")]
    pub learned: bool,
    /// backstepping: the rate of all its gains [1/s] (default: 1)
    #[arg(long, value_name = "PER_S", allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// cem: what moves the reference (default: clock)
    #[arg(long, value_enum)]
    pub reference: Option<TimingKind>,
    /// cem: samples that a plan looks ahead (default: 20)
    #[arg(long, value_name = "N")]
    pub horizon: Option<usize>,
    /// cem: candidates in an iteration; a tenth of them are elites (default: 350)
    #[arg(long, value_name = "N")]
    pub candidates: Option<usize>,
    /// cem: iterations (default: 5)
    #[arg(long, value_name = "N")]
    pub iterations: Option<usize>,
    /// cem: Gauss-Newton steps from the best candidate; 0 for what was drawn alone (default: 2)
    #[arg(long, value_name = "N")]
    pub descents: Option<usize>,
    /// cem: prices of a metre, a radian, and 1 m/s (default: 1,0.2,0.2)
    #[arg(long, value_name = "M,RAD,M_S")]
    pub prices: Option<super::values::Triple>,
    /// cem: end a search after so many milliseconds; the best plan so far counts. The result depends on the clock then
    #[arg(long, value_name = "MS", allow_negative_numbers = true)]
    pub plan_time: Option<f64>,
    /// Time between two commands [s] (default: the model's sample time; 0.1 for vessels and pid)
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub dt: Option<f64>,
    /// Commands change at most so fast: propeller, rudder, in their units per second; inf for no limit
    #[arg(long, value_name = "PP,RD", default_value = "inf,inf")]
    pub rate_limits: Pair,
}

/// How the model learns.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Learning on the way")]
pub struct LearnArgs {
    /// The model learns in the loop, as with hydroid adapt, and each command is made with what it has learned so far
    #[arg(long)]
    pub adapt: bool,
    /// How the model learns: equations by least squares (the default) or by the filter, direct predictors by least squares,
    /// recurrent networks and vessels by the filter
    #[arg(long, value_name = "HOW", value_enum, requires = "adapt")]
    pub learner: Option<Learner>,
    /// No guard: whatever was learned is steered by
    #[arg(long, requires = "adapt")]
    pub no_guard: bool,
    /// A log that the model was trained on: the learner walks through the beginning of it first. May be given again
    #[arg(long, value_name = "LOG", requires = "adapt")]
    pub shore: Vec<PathBuf>,
    /// How much of each of these logs
    #[arg(long, value_name = "TIME", default_value = "200s", requires = "shore")]
    pub shore_time: Duration,
}

/// What the vessel meets; the controller is not told.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Conditions (the controller is not told)")]
pub struct SeaArgs {
    /// Seed of noise, gusts and plans; the same seed gives the same voyage
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Scale of the vessel's measurement noise; 0 for none
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, allow_negative_numbers = true)]
    pub noise: f64,
    /// Current, where the water goes: north,east [m/s]
    #[arg(long, value_name = "N,E", default_value = "0,0", allow_hyphen_values = true)]
    pub current: Pair,
    /// Steady force of the wind on the hull: north,east [N]
    #[arg(long, value_name = "N,E", default_value = "0,0", allow_hyphen_values = true)]
    pub wind: Pair,
    /// Gusts: standard deviation [N] and time constant [s] of a Gauss-Markov force in each direction
    #[arg(long, value_name = "N,S", default_value = "0,5")]
    pub gusts: Pair,
    /// Factor on mass and yaw inertia: 1.2 for 20 % more
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, allow_negative_numbers = true)]
    pub mass: f64,
    /// Time between a command and the moment at which it acts [s]: a whole number of samples
    #[arg(long, value_name = "S", default_value_t = 0.0, allow_negative_numbers = true)]
    pub delay: f64,
}

/// Many voyages.
#[derive(Clone, Debug, ClapArgs)]
#[command(next_help_heading = "Monte Carlo")]
pub struct FleetArgs {
    /// Sail so many times, each with its own seed and conditions
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub runs: usize,
    /// Mass varies by up to this share, with --runs (default: 0.2)
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub mass_spread: Option<f64>,
    /// Current varies by up to this, from any direction [m/s], with --runs (default: 0.3)
    #[arg(long, value_name = "M_S", allow_negative_numbers = true)]
    pub current_spread: Option<f64>,
    /// Wind varies by up to this, from any direction [N], half of it in gusts, with --runs (default: 15)
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub wind_spread: Option<f64>,
}

/// Steer a vessel with a model: a controller in closed loop with the true plant, with noise, current, wind and delay
///
/// fl and backstepping invert the model: equations whose terms have one known function of each command, a control-affine
/// network, or a vessel (a TOML file). cem plans with any model. pid has none, and is tuned by a grid on seeds of its own: what the others are to be
/// compared with. With --adapt the model learns in the loop, under guard, and what it has learned is used at the next command.
#[derive(Debug, ClapArgs)]
#[command(after_help = "Examples:
  hydroid control hydrofoil --controller fl --plant hydrofoil --speed 4 --radius 30     true parameters
  hydroid control out/sindy.safetensors --controller backstepping --speed 2.5 --radius 25 -o steered
  hydroid control out/gru.safetensors --controller cem --adapt --task lawn-mower --speed 4 --turn-speed 1.8 --radius 15
  hydroid control --controller pid --task lawn-mower --speed 4 --turn-speed 1.8 --radius 15
  hydroid control hydrofoil --controller fl --mass 1.2 --current 0.2,-0.2 --gusts 10,5 --delay 0.2
  hydroid control hydrofoil --controller fl --learned --mass 1.2 --current 0,0.3 --task lawn-mower
  hydroid control hydrofoil --controller fl --runs 1000 --json        current, wind and mass vary from run to run
  hydroid control hydrofoil-low-speed --controller cem --task waypoints --points '0,0;40,0;40,30' --radius 10

Exit status: 0 the vessel held its course; 1 it did not: farther from its reference than the tolerance after the time from which
errors count, or not at the end of the path in time (of many runs: any of them), or a command beyond a limit; 2 wrong input.")]
pub struct Control {
    /// The model: a .safetensors file, a vessel of your own (a TOML file), or hydrofoil, hydrofoil-low-speed, simple. None for
    /// --controller pid
    #[arg(value_name = "MODEL")]
    pub model: Option<PathBuf>,
    /// The true plant: simple, hydrofoil, hydrofoil-low-speed, or a vessel of your own (a TOML file)
    #[arg(long, value_name = "PLANT", default_value = "hydrofoil")]
    pub plant: String,
    /// Folder for track.csv (a log), control.json and report.html
    #[arg(long, short, value_name = "DIR")]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub helm: HelmArgs,
    #[command(flatten)]
    pub task: TaskArgs,
    #[command(flatten)]
    pub sea: SeaArgs,
    #[command(flatten)]
    pub learn: LearnArgs,
    #[command(flatten)]
    pub fleet: FleetArgs,
}
