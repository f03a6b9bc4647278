//! The tables of a vessel file.

use std::collections::BTreeMap;

use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) name: String,
    pub(super) water_density: Option<f64>,
    #[serde(default)]
    pub(super) coriolis: CoriolisForm,
    #[serde(default)]
    pub(super) estimate: EstimateList,
    #[serde(default)]
    pub(super) deviation: BTreeMap<String, f64>,
    pub(super) hull: Option<HullSize>,
    pub(super) rigid_body: RigidBody,
    pub(super) added_mass: AddedMass,
    pub(super) drag: Drag,
    pub(super) flying: Option<FlyingTable>,
    #[serde(default)]
    pub(super) command: Vec<Command>,
    #[serde(default)]
    pub(super) thruster: Vec<ThrusterTable>,
    #[serde(default)]
    pub(super) rudder: Vec<RudderTable>,
    #[serde(default)]
    pub(super) noise: Noise,
}

#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "estimate is a list of paths, or a table of paths with relative standard deviations"
)]
pub(super) enum EstimateList {
    Paths(Vec<String>),
    Deviations(BTreeMap<String, f64>),
}

impl Default for EstimateList {
    fn default() -> Self {
        Self::Paths(Vec::new())
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct HullSize {
    pub(super) length: f64,
    pub(super) beam: f64,
    pub(super) draught: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RigidBody {
    pub(super) mass: f64,
    #[serde(default)]
    pub(super) x_g: f64,
    pub(super) i_z: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AddedMass {
    pub(super) x_udot: f64,
    pub(super) y_vdot: f64,
    #[serde(default)]
    pub(super) y_rdot: f64,
    pub(super) n_rdot: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Drag {
    #[serde(default)]
    pub(super) linear: Matrix,
    #[serde(default)]
    pub(super) quadratic: Matrix,
    #[serde(default)]
    pub(super) lift: [[f64; 2]; 2],
    #[serde(default)]
    pub(super) cross_flow: f64,
}

/// See [`Coriolis`](hydroid_core::craft::Coriolis).
#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum CoriolisForm {
    #[default]
    Full,
    WithoutMunk,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FlyingTable {
    pub(super) added_mass_factor: f64,
    pub(super) drag_factor: f64,
    pub(super) transition_speed: f64,
    pub(super) slope: f64,
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "damping is a list of three numbers (the diagonal) or of three rows of three")]
pub(super) enum Matrix {
    Diagonal([f64; 3]),
    Full([[f64; 3]; 3]),
}

impl Default for Matrix {
    fn default() -> Self {
        Self::Diagonal([0.0; 3])
    }
}

impl Matrix {
    pub(super) fn full(&self) -> [[f64; 3]; 3] {
        match self {
            Self::Diagonal(d) => [[d[0], 0.0, 0.0], [0.0, d[1], 0.0], [0.0, 0.0, d[2]]],
            Self::Full(full) => *full,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Command {
    pub(super) name: String,
    #[serde(default)]
    pub(super) unit: String,
    pub(super) limits: [f64; 2],
    #[serde(default)]
    pub(super) neutral: f64,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Law {
    Quadratic,
    Linear,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ThrusterTable {
    pub(super) name: String,
    pub(super) like: Option<String>,
    pub(super) position: Option<[f64; 2]>,
    pub(super) angle: Option<f64>,
    pub(super) order: BTreeMap<String, f64>,
    pub(super) limits: Option<[f64; 2]>,
    pub(super) lag: Option<f64>,
    pub(super) rate: Option<f64>,
    pub(super) dead_band: Option<f64>,
    pub(super) law: Option<Law>,
    pub(super) forward: Option<f64>,
    pub(super) reverse: Option<f64>,
    pub(super) speed_loss: Option<f64>,
    pub(super) diameter: Option<f64>,
    pub(super) force_noise: Option<f64>,
    pub(super) steering: Option<Steering>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Steering {
    pub(super) order: BTreeMap<String, f64>,
    pub(super) limits: Option<[f64; 2]>,
    #[serde(default)]
    pub(super) lag: f64,
    pub(super) rate: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RudderTable {
    pub(super) name: String,
    pub(super) order: BTreeMap<String, f64>,
    pub(super) limits: Option<[f64; 2]>,
    #[serde(default)]
    pub(super) lag: f64,
    pub(super) rate: Option<f64>,
    #[serde(default)]
    pub(super) law: RudderKind,
    pub(super) gain: Option<f64>,
    pub(super) position: Option<[f64; 2]>,
    pub(super) area: Option<f64>,
    pub(super) aspect_ratio: Option<f64>,
    pub(super) lift_slope: Option<f64>,
    pub(super) wake: Option<f64>,
    pub(super) straightening: Option<f64>,
    pub(super) drag_deduction: Option<f64>,
    pub(super) hull_force: Option<f64>,
    pub(super) hull_position: Option<f64>,
    pub(super) thruster: Option<String>,
    pub(super) race: Option<f64>,
}

#[derive(Clone, Copy, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub(super) enum RudderKind {
    #[default]
    Normal,
    Linear,
    Sine,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Noise {
    pub(super) u: f64,
    pub(super) v: f64,
    pub(super) r: f64,
}
