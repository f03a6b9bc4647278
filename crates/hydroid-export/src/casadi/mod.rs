//! `CasADi`: a Python file that builds the functions of a model as `casadi.Function`s.
//!
//! The file needs the Python package `casadi` alone. Functions of numbers consist of `SX` symbols, which `CasADi` evaluates
//! fastest; functions with matrices or repeated steps consist of `MX` symbols, which keep both as they are. Derivatives
//! are exact, and finite wherever the model is differentiable: `CasADi` masks the derivative of the branch of `if_else`
//! that is not taken, and the helpers of the file (`sqrt.py`, `logistic.py`) have forms without overflow.

mod function;
mod text;

use hydroid::model::Model;

use crate::name::identifier;
use crate::state_space::StateSpace;
use crate::{File, Options};

/// Modules that the file imports: a file of such a name would import itself.
const IMPORTED: [&str; 4] = ["acados_template", "casadi", "do_mpc", "numpy"];

/// Writes a model as `NAME.py`.
pub(crate) fn export(model: &Model, options: &Options) -> Vec<File> {
    let space = StateSpace::of(model);
    let mut name = identifier(&options.name);
    if IMPORTED.contains(&name.to_ascii_lowercase().as_str()) {
        name.push_str("_model");
    }
    let text = text::Text { name: &name, model, space: &space }.module();
    vec![File { name: format!("{name}.py"), content: text.into_bytes() }]
}
