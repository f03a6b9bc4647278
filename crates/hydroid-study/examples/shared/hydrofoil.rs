//! Logs of the simulated hydrofoil.

use std::path::Path;

use hydroid::log::{self, PrepareOptions, Selection, Trajectory};

use super::Failure;

/// Reads a log with outputs `u`, `v`, `r`, or `u_meas` .. if these are missing.
pub(crate) fn read(path: impl AsRef<str>) -> Result<Trajectory, Failure> {
    let raw = log::read(Path::new(path.as_ref()))?;
    let outputs = if raw.position("u").is_some() { "u,v,r" } else { "u=u_meas,v=v_meas,r=r_meas" };
    let selection = Selection::of(outputs, "PP_cmd,RD_ang")?;
    let mut prepared = log::prepare(&[raw], &selection, &PrepareOptions::default())?;
    Ok(prepared.runs.remove(0))
}
