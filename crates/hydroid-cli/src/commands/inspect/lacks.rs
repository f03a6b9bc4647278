//! What logs lack for identification, and the experiment that adds it.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{anyhow, bail};
use hydroid::atomic;
use hydroid::boat::Boat;
use hydroid::log::Trajectory;
use hydroid_live::experiment::Logged;
use serde_json::{Value, json};

use crate::args::Global;

fn logged(runs: &[Trajectory]) -> Result<Logged, String> {
    let channels = |run: &Trajectory| (run.outputs.channels().to_vec(), run.inputs.channels().to_vec());
    let first = runs.first().ok_or("there is no run")?;
    if runs.iter().any(|run| channels(run) != channels(first)) {
        return Err("the logs have different outputs or inputs".to_owned());
    }
    let mut boat = Boat::default();
    boat.find(first.inputs.channels());
    Logged::of(runs, &boat)
}

pub(super) fn json(runs: &[Trajectory]) -> Value {
    let found = match logged(runs) {
        Ok(found) => found,
        Err(reason) => return json!({ "not_judged": reason }),
    };
    let inputs = found.explored.inputs().iter().map(|channel| {
        json!({
            "name": channel.axis.name,
            "low": channel.axis.low,
            "high": channel.axis.high,
            "seconds": channel.seconds,
        })
    });
    json!({
        "inputs": inputs.collect::<Vec<_>>(),
        "time_scales_s": { "speed": found.time_scales_s[0], "yaw_rate": found.time_scales_s[1] },
        "seconds": found.explored.excited_s(),
        "needed_seconds": found.explored.needed_s(),
        "lacks": found.lacks,
    })
}

pub(super) fn show(runs: &[Trajectory]) {
    if runs.is_empty() {
        return;
    }
    let found = match logged(runs) {
        Ok(found) => found,
        Err(reason) => {
            outln!("excitation not judged: {reason}");
            return;
        }
    };
    let scale = |of: Option<f64>| of.map_or_else(|| "not known".to_owned(), |s| format!("{s:.1} s"));
    let [speed, yaw_rate] = found.time_scales_s.map(scale);
    outln!(
        "excitation {:.0} s with changing commands; time scale of the speed {speed}, of the yaw rate {yaw_rate}",
        found.explored.excited_s()
    );
    if found.lacks.is_empty() {
        outln!("lacks      nothing that identification needs");
    }
    for (i, lack) in found.lacks.iter().enumerate() {
        outln!("{:<10} {lack}", if i == 0 { "lacks" } else { "" });
    }
}

/// Writes the experiment.
pub(super) fn write_plan(path: &Path, runs: &[Trajectory], global: Global) -> anyhow::Result<()> {
    let found = logged(runs).map_err(|reason| anyhow!("there is no plan of an experiment: {reason}"))?;
    let rows = found.plan(0);
    let Some((end, _)) = rows.last() else {
        bail!("there is no plan of an experiment: the commands of the logs suffice for identification");
    };
    let unit = |unit: &str| if unit.is_empty() { String::new() } else { format!(" [{unit}]") };
    let names = found.inputs.iter().map(|channel| format!(",{}{}", channel.name, unit(&channel.unit)));
    let mut text = format!("t [s]{}\n", names.collect::<String>());
    for (t, commands) in &rows {
        write!(text, "{t:.3}")?;
        commands.iter().try_for_each(|command| write!(text, ",{command:.4}"))?;
        text.push('\n');
    }
    atomic::write(path, |out| out.write_all(text.as_bytes()))?;
    if !global.json {
        outln!(
            "written to {}: {} steps in {end:.0} s. Check that there is room: at each step, a command is held until the next row",
            path.display(),
            rows.len()
        );
    }
    Ok(())
}
