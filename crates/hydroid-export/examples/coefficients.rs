//! Writes vessels in the formats of coefficients, with runs of the same vessels, for `tests/export/coefficients`.
//!
//! ```text
//! cargo run -p hydroid-export --example coefficients -- FOLDER [MODEL ..]
//! ```
//!
//! Without models, the vessels of the folder `vessels`, those that are built in, and `tests/golden/workboat.toml`.

use std::path::{Path, PathBuf};

use hydroid::model::{self, Body, Model};
use hydroid_core::craft::Dynamics;
use hydroid_core::vessel::{Command, Plant, State};
use hydroid_export::coefficients::{CoefficientOptions, latex, mss, sdf};
use hydroid_export::{Options, identifier};
use serde_json::json;

/// Length of a run [samples], and of a constant command.
const SAMPLES: usize = 1_000;
const HELD: usize = 25;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let folder = arguments.next().ok_or("usage: coefficients FOLDER [MODEL ..]")?;
    let mut models: Vec<PathBuf> = arguments.collect();
    if models.is_empty() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let vessels = ["otter", "mariner", "tug"].map(|name| root.join(format!("vessels/{name}.toml")));
        models.extend(vessels);
        models.push(root.join("tests/golden/workboat.toml"));
        models.extend(["simple", "hydrofoil", "hydrofoil-low-speed"].map(PathBuf::from));
    }
    std::fs::create_dir_all(&folder)?;
    for path in models {
        let model = model::read(&path)?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let options = Options { name: identifier(&stem) };
        // The service speed of the Mariner, 15 kn; its derivatives are published for it.
        let speed = Some(if options.name == "mariner" { 7.7175 } else { 1.5 });
        let with_speed = CoefficientOptions { speed, ..CoefficientOptions::default() };
        for files in [sdf, mss, latex].map(|format| format(&model, &options, &with_speed)) {
            for file in files? {
                std::fs::write(folder.join(file.name), file.content)?;
            }
        }
        let run = run(&model).ok_or("only vessels have runs")?;
        std::fs::write(folder.join(format!("{}.json", options.name)), run.to_string())?;
    }
    Ok(())
}

/// Commands that jump between values within their limits.
fn commands(limits: &[[f64; 2]]) -> Vec<Vec<f64>> {
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / (1_u64 << 24) as f64
    };
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for sample in 0..SAMPLES {
        let row = if sample % HELD == 0 {
            limits.iter().map(|[low, high]| low + (high - low) * random()).collect()
        } else {
            rows[sample - 1].clone()
        };
        rows.push(row);
    }
    rows
}

/// A run from rest: the sample time, commands, and after each sample `u`, `v`, `r`, positions and accelerations.
fn run(model: &Model) -> Option<serde_json::Value> {
    let dt = model.description.dt;
    match &model.body {
        Body::Craft(named) => {
            let craft = named.model.craft();
            let limits: Vec<[f64; 2]> = craft.commands.iter().map(|command| command.limits).collect();
            let neutral: Vec<f64> = craft.commands.iter().map(|command| command.neutral).collect();
            let dynamics: &Dynamics = named.model.dynamics();
            let (mut nu, mut positions) = ([0.0; 3], vec![0.0; dynamics.servos()]);
            dynamics.settle(&neutral, &mut positions);
            let steps = named.model.steps();
            let commands = commands(&limits);
            let (mut motion, mut moved, mut rates) = (Vec::new(), Vec::new(), Vec::new());
            for command in &commands {
                dynamics.advance(&mut nu, &mut positions, command, dt / steps as f64, steps);
                motion.push(nu);
                moved.push(positions.clone());
                rates.push(dynamics.acceleration(nu, &positions));
            }
            Some(json!({ "dt": dt, "commands": commands, "nu": motion, "positions": moved, "nu_dot": rates }))
        }
        Body::Plant(named) => {
            let plant = Plant::new(named.params()).ok()?;
            let channels = [&named.params().commands.propeller, &named.params().commands.rudder];
            let commands = commands(&channels.map(|channel| channel.limits));
            let mut state = State::default();
            let (mut motion, mut moved, mut rates) = (Vec::new(), Vec::new(), Vec::new());
            for row in &commands {
                let command = Command { pp: row[0], rd: row[1] };
                for _ in 0..named.steps() {
                    state = plant.advance(&state, &command, dt / named.steps() as f64);
                }
                motion.push(state.nu());
                moved.push([state.p_f, row[1]]);
                rates.push(plant.derivative(&state, &command).nu());
            }
            Some(json!({ "dt": dt, "commands": commands, "nu": motion, "positions": moved, "nu_dot": rates }))
        }
        _ => None,
    }
}
