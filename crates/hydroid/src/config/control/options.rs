//! The options of `hydroid control` without those of live streams.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Deserialize;

use crate::adapt::Method;
use crate::boat::Roles;
use crate::closed_loop::{Conditions, ControlMethod, Dispersion, Timing, TruePlant, Wind};
use crate::config::Duration;
use crate::identify::GivenRanges;

/// Kinds of reference paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TaskKind {
    /// A circle to starboard.
    #[default]
    Circle,
    /// Parallel legs to the north and back, joined by arcs.
    LawnMower,
    /// From point to point, with turning circles at the corners.
    Waypoints,
    /// From point to point, with sharp corners.
    Legs,
    /// Station keeping: a point and a heading.
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

/// Options of a closed loop. An option that is `None` has a default, which may follow from the size of the vessel
/// ([`Scale`](crate::closed_loop::Scale)).
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ClosedLoopOptions {
    /// Reference path.
    pub task: TaskKind,
    /// Speed on straights and circles \[m/s\]; default 1.5, for an identified model that of half the propulsion.
    pub speed: Option<f64>,
    /// Speed in turns and at corners \[m/s\]; default `speed`.
    pub turn_speed: Option<f64>,
    /// Radius of circle and turns \[m\]; default 15, in proportion to the turning radius of an identified model.
    pub radius: Option<f64>,
    /// Lawn-mower: length of a leg \[m\]; default four radii.
    pub leg: Option<f64>,
    /// Lawn-mower: distance between legs \[m\]; default two radii.
    pub spacing: Option<f64>,
    /// Lawn-mower: number of legs; default 4.
    pub legs: Option<usize>,
    /// Waypoints and legs: north and east of each point \[m\]. Station: one point; default the origin.
    pub points: Option<Vec<[f64; 2]>>,
    /// Waypoints and legs: a CSV or GPX file with the points.
    pub waypoints: Option<PathBuf>,
    /// Station: heading, clockwise from north \[deg\]; default 0.
    pub heading: Option<f64>,
    /// Largest rate of change of the reference speed \[m/s^2\]; default 0.2, in proportion for an identified model.
    pub acceleration: Option<f64>,
    /// Duration of the simulation; default 120 s on a circle, else 1.5 times the duration of the reference.
    pub duration: Option<Duration>,
    /// Initial position relative to the start of the path, ahead and to starboard \[m\]; default 0 and -0.5, in proportion
    /// for an identified model.
    pub start: Option<[f64; 2]>,

    /// Control law.
    pub controller: ControlMethod,
    /// Distance of the controlled point ahead of the vessel's origin \[m\]; default 1.5 for the laws that invert a model,
    /// else 0.
    pub lead: Option<f64>,
    /// Largest distance from the reference at which the vessel is on track \[m\]; default 2, in proportion for an
    /// identified model.
    pub tolerance: Option<f64>,
    /// Time from which errors count; default [`Scenario::default_from_s`](crate::closed_loop::Scenario::default_from_s).
    pub evaluate_from: Option<Duration>,
    /// Feedback linearization: natural frequency \[rad/s\] and damping ratio of the error dynamics; default 1.5 and 0.7.
    pub bandwidth: Option<[f64; 2]>,
    /// Feedback linearization: integral gain \[1/s^3\]; default 0.
    pub integral: Option<f64>,
    /// Feedback linearization: a network learns the model error online.
    pub adaptive_augmentation: bool,
    /// Backstepping: common rate of the gains \[1/s\]; default 1.
    pub rate: Option<f64>,
    /// Predictive control: trajectory tracking or path following; default tracking.
    pub reference: Option<Timing>,
    /// Predictive control: horizon \[commands\]; default 20, for an identified model 40.
    pub horizon: Option<usize>,
    /// Predictive control: samples for which a command of a plan is held; default 1, in proportion for an identified model.
    pub hold: Option<usize>,
    /// Predictive control: candidates in each iteration; default 60. A tenth of them are elites.
    pub candidates: Option<usize>,
    /// Predictive control: iterations; default 2.
    pub iterations: Option<usize>,
    /// Predictive control: Gauss-Newton steps from the best candidate; default 2.
    pub gauss_newton_steps: Option<usize>,
    /// Predictive control: weights of position error \[1/m^2\], course error \[1/rad^2\] and speed error \[s^2/m^2\]; default
    /// 1, 0.2 and 0.2.
    pub cost_weights: Option<[f64; 3]>,
    /// Predictive control: time limit of a plan \[ms\]. The result then depends on the machine.
    pub plan_time: Option<f64>,
    /// Sample time \[s\]; default that of an identified model, else 0.1.
    pub dt: Option<f64>,
    /// Largest rate of change of a command, in its unit per second, by name; default that of vessel or model.
    pub rate_limit: BTreeMap<String, f64>,
    /// Limits of a command, by name, in the unit of the input of the boat; default those of the boat of the plant.
    pub limit: GivenRanges,
    /// Value of a command without effect, by name, in the unit of the input of the boat; default that of the boat.
    pub neutral: BTreeMap<String, f64>,
    /// Roles of inputs, in place of those of the model.
    pub role: Roles,
    /// Autopilot: inputs that push the vessel; `-NAME` pushes astern. Default: by the roles of the inputs.
    pub push: Vec<String>,
    /// Autopilot: inputs that turn the vessel to starboard; `-NAME` turns to port. Default: by the roles of the inputs.
    pub turn: Vec<String>,

    /// Standard deviation of the components of the current at the start \[m/s\], for a model of the motion through the
    /// water that estimates the current; `None` for the model as it is.
    pub estimate_current: Option<f64>,
    /// Whether the model adapts in the loop.
    pub adapt: bool,
    /// Method of adaptation; default that of the kind of model.
    pub learner: Option<Method>,
    /// Adaptation without a guard.
    pub no_guard: bool,

    /// Seed of noise, gusts and plans.
    pub seed: u64,
    /// Factor on the measurement noise of the plant; 0 for none.
    pub noise: f64,
    /// Factor on the process noise of a model as the plant; 0 for none.
    pub process_noise: f64,
    /// Velocity of the current, north and east \[m/s\].
    pub current: [f64; 2],
    /// Steady force of the wind on the hull, north and east \[N\].
    pub wind: [f64; 2],
    /// Gusts: standard deviation \[N\] and time constant \[s\].
    pub gusts: [f64; 2],
    /// Factor on mass and yaw inertia.
    pub mass: f64,
    /// Input delay \[s\], a whole number of samples.
    pub delay: f64,
    /// Time from which current, wind and mass factor apply; default 0.
    pub onset: Option<Duration>,

    /// Number of Monte Carlo trials; 1 for a single run under the stated conditions.
    pub runs: usize,
    /// Trials: largest relative change of the mass; default 0.2.
    pub mass_variation: Option<f64>,
    /// Trials: largest speed of the current, from any direction \[m/s\]; default 0.3.
    pub current_variation: Option<f64>,
    /// Trials: largest force of the wind, from any direction, half of it in gusts \[N\]; default 15.
    pub wind_variation: Option<f64>,
}

impl Default for ClosedLoopOptions {
    fn default() -> Self {
        Self {
            task: TaskKind::Circle,
            speed: None,
            turn_speed: None,
            radius: None,
            leg: None,
            spacing: None,
            legs: None,
            points: None,
            waypoints: None,
            heading: None,
            acceleration: None,
            duration: None,
            start: None,
            controller: ControlMethod::CrossEntropy,
            lead: None,
            tolerance: None,
            evaluate_from: None,
            bandwidth: None,
            integral: None,
            adaptive_augmentation: false,
            rate: None,
            reference: None,
            horizon: None,
            hold: None,
            candidates: None,
            iterations: None,
            gauss_newton_steps: None,
            cost_weights: None,
            plan_time: None,
            dt: None,
            rate_limit: BTreeMap::new(),
            limit: BTreeMap::new(),
            neutral: BTreeMap::new(),
            role: Roles::new(),
            push: Vec::new(),
            turn: Vec::new(),
            estimate_current: None,
            adapt: false,
            learner: None,
            no_guard: false,
            seed: 0,
            noise: 1.0,
            process_noise: 0.0,
            current: [0.0; 2],
            wind: [0.0; 2],
            gusts: [0.0, Wind::CALM.gust_s],
            mass: 1.0,
            delay: 0.0,
            onset: None,
            runs: 1,
            mass_variation: None,
            current_variation: None,
            wind_variation: None,
        }
    }
}

impl ClosedLoopOptions {
    /// The conditions of a run.
    pub fn conditions(&self) -> Conditions {
        let [gust, gust_s] = self.gusts;
        Conditions {
            seed: self.seed,
            noise: self.noise,
            process_noise: self.process_noise,
            current: self.current,
            wind: Wind { force: self.wind, gust, gust_s },
            mass: self.mass,
            delay_s: self.delay,
            onset_s: self.onset.map_or(0.0, |onset| onset.0),
        }
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
