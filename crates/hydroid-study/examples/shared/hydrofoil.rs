//! Logs of the simulated hydrofoil, as hydroid and the reference write them.

use std::path::Path;

use hydroid::log::{self, PrepareOptions, Selection, Trajectory};

use super::Failure;

/// Reads one: its outputs `u`, `v`, `r`, or `u_meas` .. where there are none of these names.
pub(crate) fn read(path: impl AsRef<str>) -> Result<Trajectory, Failure> {
    let raw = log::read(Path::new(path.as_ref()))?;
    let outputs = if raw.position("u").is_some() { "u,v,r" } else { "u=u_meas,v=v_meas,r=r_meas" };
    let selection = Selection::of(outputs, "PP_cmd,RD_ang")?;
    let mut prepared = log::prepare(&[raw], &selection, &PrepareOptions::default())?;
    Ok(prepared.runs.remove(0))
}
