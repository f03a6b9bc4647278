//! Vessels of the Marine Systems Simulator (MSS) and the Python Vehicle Simulator.
//!
//! `NAME.py` has the class of a vehicle with the interface of the Python Vehicle Simulator (T. I. Fossen,
//! github.com/cybergalactic/PythonVehicleSimulator: `dynamics(eta, nu, u_actual, u_control, sampleTime)`) and needs numpy.
//! `NAME.m` is a function `[xdot, U] = NAME(x, ui)` for MATLAB and Octave, as those in the folder VESSELS of MSS. Both contain
//! all equations of the vessel ([`hydroid_core::craft`]).

use hydroid::model::{Body, Model};

use super::{mss_equations, mss_vessel};
use crate::{ExportError, File, Options, identifier};

/// Templates of vessels, of equations of motion, and the class of both.
const VESSEL: [&str; 2] = [include_str!("templates/vessel.py"), include_str!("templates/vessel.m")];
const EQUATIONS: [&str; 2] = [include_str!("templates/equations.py"), include_str!("templates/equations.m")];
const VEHICLE: &str = include_str!("templates/vehicle.py");

/// Names in small letters that the generated code uses, or that Python or MATLAB reserve beside those of [`identifier`].
const USED: &[&str] = &[
    "abs",
    "acceleration",
    "actuators",
    "advance",
    "beam",
    "commands",
    "cos",
    "cross_flow",
    "damping",
    "dict",
    "disp",
    "elseif",
    "end",
    "error",
    "exp",
    "flying",
    "format",
    "function",
    "helms",
    "isempty",
    "kept",
    "lags",
    "length",
    "lift",
    "linear",
    "mass",
    "mass_matrix",
    "math",
    "max",
    "min",
    "munk",
    "name",
    "nan",
    "inf",
    "nargin",
    "none",
    "np",
    "numel",
    "nu_dot",
    "order_of",
    "otherwise",
    "parameters",
    "parfor",
    "persistent",
    "pi",
    "print",
    "quadratic",
    "range",
    "rudders",
    "servo_rate",
    "servos",
    "settled",
    "sign",
    "sin",
    "spmd",
    "sqrt",
    "step",
    "struct",
    "sum",
    "tanh",
    "thrust_of",
    "thrusters",
    "unwind_protect",
    "until",
    "valueerror",
    "water_density",
    "zeros",
    "zip",
];

/// A vessel or equations of motion as `NAME.py` and `NAME.m`.
///
/// # Errors
/// If the model is neither a vessel nor equations of `u`, `v`, `r` without delays and limits of rates.
pub fn mss(model: &Model, options: &Options) -> Result<Vec<File>, ExportError> {
    let vehicle = match &model.body {
        Body::Craft(craft) => {
            let step = craft.model.dt() / craft.model.steps() as f64;
            mss_vessel::of_craft(&craft.file.craft, step)
        }
        Body::Equations(equations) => mss_equations::vehicle(model, equations)?,
        _ => {
            return Err(ExportError::Unsupported {
                model: model.title(),
                format: "mss",
                reason: format!(
                    "a model of kind '{}' is neither a vessel nor equations of motion",
                    model.kind()
                ),
                remedy: String::from(
                    "identify a vessel with `hydroid identify --methods grey-box --vessel FILE.toml`, or export this \
                     model to C or CasADi",
                ),
            });
        }
    };
    let [python, matlab] = if vehicle.accelerations.is_some() { EQUATIONS } else { VESSEL };
    let name = class_name(&options.name);
    let file = |extension: &str, text: String| File {
        name: format!("{name}.{extension}"),
        content: text.into_bytes(),
    };
    Ok(vec![
        file("py", vehicle.fill(&[python, VEHICLE].concat(), &name, 0)),
        file("m", vehicle.fill(matlab, &name, 1)),
    ])
}

/// Name of the class and the function.
fn class_name(name: &str) -> String {
    let name = identifier(name);
    if USED.contains(&name.to_ascii_lowercase().as_str()) { format!("{name}_vessel") } else { name }
}
