//! A controller with one model of a vessel steers another model of it along a lawn-mower.
//!
//! ```text
//! HYDROID_DATA=... cargo run --release -p hydroid-research --bin steer_fleet -- [law] [model] [plant] [VESSEL ...]
//! ```
//!
//! For each vessel of the simulated fleet, the model of the controller (method `sindy` unless another is given) is identified
//! from runs 2, 4 and 6, and the plant (method `committee`) from runs 1, 3 and 5. The law is `cem` or `pid`, with its defaults
//! for the model. Twenty seeds, each with measurement noise, the process noise of the plant, and a current of up to 0.3 m/s
//! from another direction. The table has the median and the largest RMS cross-track error over the seeds, the limit of 5 % of
//! the length of the vessel plus 0.2 m, the seeds that held the track, and the commands beyond a limit.

use std::path::Path;
use std::sync::Arc;

use hydroid::closed_loop::{
    Conditions, ControlMethod, ControllerOptions, Dispersion, Scale, Scenario, SpeedOptions, Task, Track,
    monte_carlo, tune_autopilot,
};
use hydroid::identify::{Method, MotionOption, identify};
use hydroid::log::Trajectory;
use hydroid::manoeuvre::{Approach, Options, Response};
use hydroid::model::{Model, Reading};
use hydroid::plant::{InputMap, Simulation};
use hydroid::progress::silent;
use hydroid_research::sets::{SETS, Set, methods};

/// Lengths of the vessels \[m\].
const LENGTHS: [(&str, f64); 5] =
    [("otter", 2.0), ("tanker", 304.8), ("clarke83", 50.0), ("zefakkel", 45.0), ("transit", 80.0)];

const SEEDS: usize = 20;

fn model(
    set: &Set,
    (runs, reading): &(Vec<Vec<Trajectory>>, Reading),
    chosen: [usize; 3],
    method: &[Method],
) -> anyhow::Result<Arc<Model>> {
    // The last one is the test run, which decides nothing.
    let test = chosen.map(|run| (run + 1) % runs.len())[0];
    let some: Vec<Vec<Trajectory>> = chosen.iter().chain([&test]).map(|&run| runs[run].clone()).collect();
    let job = set.job(&some, reading, 3, method, MotionOption::Auto, None)?;
    let identified = identify(&job, &mut silent())?;
    Ok(Arc::new(identified.candidates[identified.best.unwrap_or(0)].model.clone()))
}

fn steer(set: &Set, data: &Path, law: ControlMethod, [own, other]: [&[Method]; 2]) -> anyhow::Result<()> {
    let logs = set.read(data)?;
    let (own, plant) = (model(set, &logs, [1, 3, 5], own)?, model(set, &logs, [0, 2, 4], other)?);
    let inputs = InputMap::find(&own)?;
    let half = Options { propulsion: 0.5, speed_m_s: None };
    let response = Response::about(&Approach::new(&own, &inputs, Simulation::new(&own)?, &half)?, &inputs)?;
    let scale = Scale::of(&response);
    let radius = 15.0 * scale.radius;
    let task = Task::LawnMower { leg: 2.0 * radius, spacing: 2.0 * radius, legs: 3, radius };
    let surge = response.surge.ok_or_else(|| anyhow::anyhow!("no input pushes the vessel"))?;
    let acceleration = 0.1 * surge.gain_m_s / surge.time_s;
    let pace = SpeedOptions { acceleration, ..SpeedOptions::cruise(response.speed_m_s) };
    let mut scenario = Scenario::new(plant, Track::new(&task, &pace)?);
    scenario.dt_s = own.description.dt;
    scenario.tolerance = 2.0 * scale.radius;
    scenario.start = [0.0, -0.5 * scale.radius];
    let from_s = scenario.default_from_s();
    let mut control = ControllerOptions::new(law, &scenario.plant, scenario.dt_s).scaled(scale);
    if law == ControlMethod::Autopilot {
        let on_model = Scenario { plant: Arc::clone(&own).into(), ..scenario.clone() };
        let tuned = tune_autopilot(&on_model, &inputs, response.speed_m_s, from_s, &mut silent())?;
        control.autopilot = Some(tuned.gains);
    } else {
        control.model = Some(own);
    }
    let nominal = Conditions { process_noise: 1.0, ..Conditions::calm(1) };
    let spread = Dispersion { mass: 0.0, current: 0.3, wind: 0.0 };
    let all = monte_carlo(&control, &scenario, &nominal, &spread, SEEDS, from_s, &mut silent())?;
    let length = LENGTHS.iter().find(|(name, _)| *name == set.name).map_or(f64::NAN, |(_, length)| *length);
    println!(
        "| {} | {:.2} m/s, {radius:.0} m | {:.3} | {:.3} | {:.2} | {} | {} |",
        set.name,
        response.speed_m_s,
        all.rms_cross_track.median,
        all.rms_cross_track.max,
        0.05 * length + 0.2,
        all.held,
        all.violations
    );
    Ok(())
}

fn main() -> anyhow::Result<()> {
    let Some(data) = std::env::var_os("HYDROID_DATA") else {
        println!("skipped: no HYDROID_DATA");
        return Ok(());
    };
    let mut args = std::env::args().skip(1);
    let law = match args.next().as_deref() {
        None | Some("cem") => ControlMethod::CrossEntropy,
        Some("pid") => ControlMethod::Autopilot,
        Some(other) => anyhow::bail!("'{other}' is not a law: write cem or pid"),
    };
    let own = methods(&args.next().unwrap_or_else(|| String::from("sindy")))?;
    let other = methods(&args.next().unwrap_or_else(|| String::from("committee")))?;
    let chosen: Vec<String> = args.collect();
    println!("| vessel | speed, radius | median [m] | largest [m] | limit [m] | held | beyond limits |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for set in SETS.iter().filter(|set| set.folder.starts_with("fleet")) {
        if chosen.is_empty() || chosen.iter().any(|name| name == set.name) {
            steer(set, Path::new(&data), law, [&own, &other])?;
        }
    }
    Ok(())
}
