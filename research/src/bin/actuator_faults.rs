//! Faults of actuators in logs, and false alarms.
//!
//! ```text
//! HYDROID_DATA=... cargo run --release -p hydroid-research --bin actuator_faults -- [model] [plant] [WINDOW_S] [VESSEL ...]
//! ```
//!
//! For each vessel the model that watches (method `sindy` unless another is given) is identified from every second run. It watches
//! the other runs as they were logged: each alarm is false. Then another model of the vessel (method `committee`), from these other
//! runs, has the commands of all runs with each fault from the middle of the run on, and noise like that of the log.

use std::path::Path;

use hydroid::closed_loop::{ActuatorCheck, ActuatorFault, limits_of};
use hydroid::identify::{Method, MotionOption, identify};
use hydroid::log::Trajectory;
use hydroid::model::{Model, Reading};
use hydroid::progress::silent;
use hydroid_core::actuator::Limits;
use hydroid_research::sets::{SETS, Set, methods};
use rand::{RngExt as _, SeedableRng as _};

fn model(
    set: &Set,
    (runs, reading): &(Vec<Vec<Trajectory>>, Reading),
    odd: bool,
    method: &[Method],
) -> anyhow::Result<Model> {
    let chosen: Vec<Vec<Trajectory>> = runs
        .iter()
        .skip(usize::from(odd))
        .step_by(2)
        .chain(runs.iter().skip(usize::from(!odd)).step_by(2).take(1))
        .cloned()
        .collect();
    let job = set.job(&chosen, reading, chosen.len() - 1, method, MotionOption::Auto, None)?;
    let identified = identify(&job, &mut silent())?;
    Ok(identified.candidates[identified.best.unwrap_or(0)].model.clone())
}

struct Watch<'a> {
    model: &'a Model,
    limits: Vec<Limits>,
    window_s: f64,
}

impl Watch<'_> {
    fn check(&self) -> Option<ActuatorCheck> {
        ActuatorCheck::new(self.model, &self.limits, self.window_s)
    }

    /// Time of the first alarm after the start \[s\], and its fault.
    fn alarm(&self, run: &Trajectory, outputs: impl Fn(usize) -> Vec<f64>) -> Option<(f64, ActuatorFault)> {
        let mut check = self.check()?;
        check.reset();
        for k in 0..run.len() {
            if k > 0 {
                check.advance(run.inputs.row(k - 1));
            }
            check.observe(run.heading.as_ref().map_or(f64::NAN, |all| all[k]), &outputs(k));
            if let Some(fault) = check.found() {
                return Some((k as f64 * run.dt, fault));
            }
        }
        None
    }
}

fn simulated(
    plant: &Model,
    watch: &Watch<'_>,
    run: &Trajectory,
    fault: Option<ActuatorFault>,
    from: usize,
) -> Vec<Vec<f64>> {
    let mut random = rand::rngs::SmallRng::seed_from_u64(1);
    let mut session = plant.session();
    let n = session.outputs();
    let warm_up = session.warm_up();
    let mut y = vec![0.0; n];
    let mut all = Vec::new();
    for k in 0..run.len() {
        if k > 0 {
            let mut command = run.inputs.row(k - 1).to_vec();
            if let Some(fault) = fault.filter(|_| k > from) {
                fault.apply(&mut command, &watch.limits);
            }
            session.advance(&command);
        }
        let missing = vec![f64::NAN; n];
        session.observe_heading(run.heading.as_ref().map_or(f64::NAN, |all| all[k]));
        session.observe(if k <= warm_up { run.outputs.row(k) } else { &missing });
        session.output(&mut y);
        let noise = plant.description.outputs.iter().map(|port| port.noise.unwrap_or(0.0));
        all.push(
            y.iter()
                .zip(noise)
                .map(|(y, s)| y + s * (12.0_f64).sqrt() * (random.random::<f64>() - 0.5))
                .collect(),
        );
    }
    all
}

fn vessel(set: &Set, data: &Path, window_s: f64, [own, other]: [&[Method]; 2]) -> anyhow::Result<()> {
    let logs = set.read(data)?;
    let model_a = model(set, &logs, false, own)?;
    let plant = model(set, &logs, true, other)?;
    let watch = Watch { model: &model_a, limits: limits_of(&model_a)?, window_s };
    let Some(_) = watch.check() else {
        println!("{}: no bands", set.name);
        return Ok(());
    };
    let (mut hours, mut alarms) = (0.0, Vec::new());
    for run in logs.0.iter().skip(1).step_by(2).flatten() {
        hours += run.len() as f64 * run.dt / 3600.0;
        alarms.extend(watch.alarm(run, |k| run.outputs.row(k).to_vec()).map(|a| (run.name.clone(), a)));
    }
    println!("{}: {hours:.2} h, false alarms {alarms:?}", set.name);
    let mut false_of_plant = 0;
    for run in logs.0.iter().flatten() {
        let y = simulated(&plant, &watch, run, None, 0);
        false_of_plant += usize::from(watch.alarm(run, |k| y[k].clone()).is_some());
    }
    println!("  of the plant: {false_of_plant} of {}", logs.0.iter().flatten().count());
    for fault in ActuatorFault::all(&watch.limits) {
        let mut words = Vec::new();
        for run in logs.0.iter().flatten() {
            let from = run.len() / 2;
            let y = simulated(&plant, &watch, run, Some(fault), from);
            words.push(match watch.alarm(run, |k| y[k].clone()) {
                Some((t, found)) => format!(
                    "{:.1}{}",
                    t - from as f64 * run.dt,
                    if found == fault { String::new() } else { format!(" {found:?}") }
                ),
                None => String::from("-"),
            });
        }
        println!("  {fault:?}: {}", words.join(", "));
    }
    Ok(())
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let text = |k: usize, default: &str| arguments.get(k).map_or(default.to_owned(), Clone::clone);
    let (own, other) = (methods(&text(0, "sindy"))?, methods(&text(1, "committee"))?);
    let window_s: f64 = text(2, "1").parse()?;
    let data = std::env::var("HYDROID_DATA")?;
    for set in
        SETS.iter().filter(|set| arguments.len() < 4 || arguments[3..].iter().any(|name| name == set.name))
    {
        if let Err(error) = vessel(set, Path::new(&data), window_s, [&own, &other]) {
            println!("{}: {error:#}", set.name);
        }
    }
    Ok(())
}
