//! Hydrodynamic coefficients of a model for simulators and papers.
//!
//! [`Coefficients::of`] reads them from a vessel or from equations of motion of the marine form. [`sdf`] writes them as
//! plugins of Gazebo, [`mss`] as vessels of the Marine Systems Simulator and the Python Vehicle Simulator, [`latex`] as a
//! table.
//!
//! # Equations
//!
//! Body frame forward, starboard, down at the origin of the vessel file; `nu = (u, v, r)` relative to the water; SI units
//! and radians:
//!
//! ```text
//! m (udot - v r - x_g r^2)      = X + X_actuators
//! m (vdot + u r + x_g rdot)     = Y + Y_actuators
//! I_z rdot + m x_g (vdot + u r) = N + N_actuators
//! X = sum of X_a a over the variables a = udot, u, |u| u, v r, ..; likewise Y and N
//! ```
//!
//! (SNAME, *Nomenclature for treating the motion of a submerged body through a fluid*, 1950; T. I. Fossen, *Handbook of
//! Marine Craft Hydrodynamics and Motion Control*, 2nd edition, 2021, chapter 6.) Resistance has negative derivatives. The
//! Coriolis and centripetal forces of the added mass follow from its derivatives:
//!
//! ```text
//! X_vr = -Y_vdot    X_rr = -Y_rdot    Y_ur = X_udot    N_uv = Y_vdot - X_udot (Munk moment)    N_ur = Y_rdot
//! ```
//!
//! In equations of motion the variables contain inputs as well, such as `u u delta` and `|n| n`, and no other forces act. The linear
//! derivatives by velocities and inputs are those of [`straight_course`].

mod derivative;
mod equations;
mod latex;
mod linear;
mod literal;
mod mss;
mod mss_equations;
mod mss_vessel;
mod numbers;
mod sdf;
mod servos;
mod vehicle;
mod vessel;

use hydroid::boat::Value;
use hydroid::model::{Body, Model, Port, UnitProduct, latex_symbol};
use hydroid::plant::input_values;

pub use derivative::{Derivative, Force, Input, Variable};
pub use latex::latex;
pub use linear::{Linear, straight_course};
pub use mss::mss;
pub use sdf::sdf;

use crate::ExportError;

/// Options of the formats of coefficients.
#[derive(Clone, Debug, PartialEq)]
pub struct CoefficientOptions {
    /// Mass of the vessel, where the model has none: it turns accelerations of equations of motion into forces.
    pub inertia: Option<Inertia>,
    /// Length \[m\] of the prime system; else that of the vessel file.
    pub length: Option<f64>,
    /// Density of the water \[kg/m^3\], where the model has none.
    pub water_density: f64,
    /// Speed \[m/s\] of the prime system and of the linear derivatives of a straight course.
    pub speed: Option<f64>,
    /// Name of the link in Gazebo.
    pub link: String,
}

impl Default for CoefficientOptions {
    /// Sea water at 15 degrees Celsius, and the link `base_link`.
    fn default() -> Self {
        Self {
            inertia: None,
            length: None,
            water_density: 1025.0,
            speed: None,
            link: String::from("base_link"),
        }
    }
}

/// Mass and added mass of a vessel about the origin of its body frame; see [`hydroid_core::craft::Hull`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inertia {
    /// Mass \[kg\].
    pub mass: f64,
    /// Yaw inertia about the origin \[kg m^2\].
    pub i_z: f64,
    /// Centre of gravity ahead of the origin \[m\].
    pub x_g: f64,
    /// `X_udot` \[kg\], not positive.
    pub x_udot: f64,
    /// `Y_vdot` \[kg\], not positive.
    pub y_vdot: f64,
    /// `Y_rdot = N_vdot` \[kg m\].
    pub y_rdot: f64,
    /// `N_rdot` \[kg m^2\], not positive.
    pub n_rdot: f64,
}

impl Inertia {
    /// Mass matrix as `[m11, m22, m23, m33]`.
    pub fn mass_matrix(&self) -> [f64; 4] {
        let Self { mass, i_z, x_g, x_udot, y_vdot, y_rdot, n_rdot } = *self;
        [mass - x_udot, mass - y_vdot, mass * x_g - y_rdot, i_z - n_rdot]
    }

    fn added_mass(&self) -> [Derivative; 5] {
        [
            (Force::X, 0, self.x_udot),
            (Force::Y, 1, self.y_vdot),
            (Force::Y, 2, self.y_rdot),
            (Force::N, 1, self.y_rdot),
            (Force::N, 2, self.n_rdot),
        ]
        .map(|(force, i, value)| Derivative::new(force, Variable::Acceleration(i), value))
    }

    /// Derivatives of the Coriolis and centripetal forces of the added mass.
    fn centripetal(&self) -> [Derivative; 5] {
        let Self { x_udot, y_vdot, y_rdot, .. } = *self;
        [
            (Force::X, Variable::product(&[1, 2]), -y_vdot),
            (Force::X, Variable::product(&[2, 2]), -y_rdot),
            (Force::Y, Variable::product(&[0, 2]), x_udot),
            (Force::N, munk(), y_vdot - x_udot),
            (Force::N, Variable::product(&[0, 2]), y_rdot),
        ]
        .map(|(force, variable, value)| Derivative::new(force, variable, value))
    }
}

/// `u v`, the variable of the Munk moment.
fn munk() -> Variable {
    Variable::product(&[0, 1])
}

/// Coriolis and centripetal forces of the added mass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Centripetal {
    /// All, beside the derivatives of the list.
    Full,
    /// All but the Munk moment, beside the derivatives of the list.
    WithoutMunk,
    /// The derivatives of the list contain them.
    InDerivatives,
}

/// Hydrodynamic coefficients of a vessel.
#[derive(Clone, Debug, PartialEq)]
pub struct Coefficients {
    /// Name of the vessel.
    pub name: String,
    /// Density of the water \[kg/m^3\].
    pub water_density: f64,
    /// Length, beam and draught \[m\], if known.
    pub size: Option<[f64; 3]>,
    /// Mass and added mass.
    pub inertia: Inertia,
    /// Standard deviations of mass, `I_z` and `x_g`, if they were estimated.
    pub inertia_deviations: [Option<f64>; 3],
    /// Derivatives that are not zero.
    pub derivatives: Vec<Derivative>,
    /// Coriolis and centripetal forces of the added mass.
    pub centripetal: Centripetal,
    /// Cross-flow drag coefficient `C_d` and its standard deviation.
    pub cross_flow: (f64, Option<f64>),
    /// Variables of the derivatives after `u`, `v`, `r`: the inputs of the model, and signals computed from them.
    pub inputs: Vec<Input>,
    /// Parts of the model that are neither derivatives nor cross-flow drag, with their values.
    pub other_forces: Vec<String>,
}

impl Coefficients {
    /// The coefficients of a model for a format.
    ///
    /// # Errors
    /// If the model is neither a vessel nor equations of motion of the marine form with a given mass.
    pub fn of(
        model: &Model,
        options: &CoefficientOptions,
        format: &'static str,
    ) -> Result<Self, ExportError> {
        let coefficients = match &model.body {
            Body::Craft(craft) => vessel::of_craft(&craft.file),
            Body::Equations(_) => equations::of(model, options, format)?,
            _ => return Err(no_coefficients(model, format)),
        };
        Ok(Self { inputs: inputs(model), ..coefficients })
    }

    /// The derivatives by velocities that come beside the added mass and its Coriolis and centripetal forces.
    pub fn beside_added_mass(&self) -> Vec<Derivative> {
        let is_velocity = |of: &&Derivative| matches!(of.variable, Variable::Product { .. });
        let mut all: Vec<Derivative> = self.derivatives.iter().filter(is_velocity).cloned().collect();
        for derivative in self.inertia.centripetal() {
            let is_munk = derivative.variable == munk();
            if self.centripetal == Centripetal::InDerivatives
                || (is_munk && self.centripetal == Centripetal::WithoutMunk)
            {
                add(&mut all, Derivative { value: -derivative.value, ..derivative });
            }
        }
        all.retain(|derivative| derivative.value != 0.0 || derivative.deviation.is_some());
        all
    }

    /// All derivatives by velocities, with those of the Coriolis and centripetal forces of the added mass: the forces of the
    /// hull but the cross-flow drag and the [`other_forces`](Self::other_forces).
    pub fn with_centripetal(&self) -> Vec<Derivative> {
        let mut all = self.beside_added_mass();
        self.inertia.centripetal().into_iter().for_each(|derivative| add(&mut all, derivative));
        all.retain(|derivative| derivative.value != 0.0 || derivative.deviation.is_some());
        all
    }

    /// Derivatives of the cross-flow drag in pure sway and in pure yaw, where it is `Y_|v|v |v| v` and `N_|r|r |r| r`:
    ///
    /// ```text
    /// Y_|v|v = -1/2 rho T C_d L    N_|r|r = -1/2 rho T C_d L^4 / 32
    /// ```
    pub fn cross_flow_derivatives(&self) -> Vec<Derivative> {
        let Some([length, _, draught]) = self.size.filter(|_| self.cross_flow.0 != 0.0) else {
            return Vec::new();
        };
        let factor = -0.5 * self.water_density * draught * self.cross_flow.0;
        vec![
            Derivative::new(Force::Y, Variable::signed(1, 1), factor * length),
            Derivative::new(Force::N, Variable::signed(2, 2), factor * length.powi(4) / 32.0),
        ]
    }
}

/// Inputs of a model, and the signals of equations.
fn inputs(model: &Model) -> Vec<Input> {
    let ports = &model.description.inputs;
    let channel = |(port, source): (&Port, u16)| Input {
        name: port.channel.name.clone(),
        latex: latex_symbol(&port.channel.name),
        unit: UnitProduct::of_channel(&port.channel.name, &port.channel.unit),
        source,
    };
    let mut all: Vec<Input> = ports.iter().zip(3..).map(channel).collect();
    if let Some(named) = model.equations() {
        let signals = named.equations().signals();
        let first = named.equations().outputs() + ports.len();
        let symbols = named.variable_names().into_iter().zip(named.variables_latex()).skip(first);
        for ((signal, (name, latex)), unit) in
            signals.iter().zip(symbols).zip(named.variable_units().into_iter().skip(first))
        {
            all.push(Input { name, latex, unit, source: signal.source() });
        }
    }
    all
}

/// Adds a derivative to the one of the same variable, or to the list.
fn add(all: &mut Vec<Derivative>, derivative: Derivative) {
    let same =
        |known: &&mut Derivative| known.force == derivative.force && known.variable == derivative.variable;
    match all.iter_mut().find(same) {
        Some(known) => {
            known.value += derivative.value;
            known.deviation = match (known.deviation, derivative.deviation) {
                (Some(a), Some(b)) => Some(a.hypot(b)),
                (a, b) => a.or(b),
            };
        }
        None if derivative.value != 0.0 || derivative.deviation.is_some() => all.push(derivative),
        None => {}
    }
}

/// Neutral values and limits of the inputs of a model.
fn values(model: &Model, format: &'static str) -> Result<Vec<Value>, ExportError> {
    input_values(model).map_err(|error| ExportError::Unsupported {
        model: model.title(),
        format,
        reason: error.to_string(),
        remedy: String::from("correct it in [boat.inputs], and identify again"),
    })
}

fn no_coefficients(model: &Model, format: &'static str) -> ExportError {
    ExportError::Unsupported {
        model: model.title(),
        format,
        reason: format!("a model of kind '{}' has no hydrodynamic coefficients", model.kind()),
        remedy: String::from(
            "identify a vessel with `hydroid identify --methods grey-box --vessel FILE.toml`, or export this model to \
             a format of general models",
        ),
    }
}
