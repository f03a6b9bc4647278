//! The compiled part of the Python package `hydroid`.
//!
//! Order of the modules, bottom to top: `error` (exceptions), `work` (long calls that Python can interrupt), `arrays`
//! and `settings` (arguments), `log` (logs and runs), `model` (models and their sessions), `evaluate`, `identify`, `adapt`,
//! `vessels` (simulated logs, manoeuvring trials), `control` (closed loops), `on_board` (controllers and planner, sample by
//! sample).

mod adapt;
mod arrays;
mod control;
mod error;
mod evaluate;
mod identify;
mod log;
mod model;
mod on_board;
mod settings;
mod vessels;
mod work;

use pyo3::prelude::*;

#[pymodule]
mod _hydroid {
    use super::{PyResult, env_version};
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::adapt::{Adapter, Prediction, Step};
    #[pymodule_export]
    use super::control::{ClosedLoop, control};
    #[pymodule_export]
    use super::evaluate::evaluate;
    #[pymodule_export]
    use super::identify::{Identification, identify};
    #[pymodule_export]
    use super::log::{Log, Run, prepare, read_logs};
    #[pymodule_export]
    use super::model::{Model, Session};
    #[pymodule_export]
    use super::on_board::{ControlStep, Controller, Planner, command_limits};
    #[pymodule_export]
    use super::settings::options;
    #[pymodule_export]
    use super::vessels::{
        Comparisons, Trials, compare_manoeuvres, manoeuvres, simulate, vessel_toml, vessels,
    };

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env_version())
    }
}

fn env_version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}
