//! Writes vessels in the formats of coefficients, with runs of the same vessels, for `tests/export/coefficients`.
//!
//! ```text
//! cargo run -p hydroid-export --example coefficients -- FOLDER [MODEL ..]
//! ```
//!
//! Without models, the vessels of the folder `vessels`, those that are built in, and `tests/golden/workboat.toml`. With them and
//! without, equations of motion named `launch`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use hydroid::evaluate::DesignRange;
use hydroid::log::Channel;
use hydroid::model::{self, Body, Description, Members, Model, Port, Provenance, Reading};
use hydroid::sindy::ExpressionParser;
use hydroid_core::craft::Dynamics;
use hydroid_core::model::sparse::Equations;
use hydroid_export::coefficients::{CoefficientOptions, Inertia, latex, mss, sdf};
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
        write(&model::read(&path)?, &path.file_stem().unwrap_or_default().to_string_lossy(), &folder)?;
    }
    write(&launch()?, "launch", &folder)
}

/// The files of a model and its run.
fn write(model: &Model, name: &str, folder: &Path) -> Result<(), Failure> {
    let options = Options { name: identifier(name) };
    let with = CoefficientOptions {
        // The service speed of the Mariner, 15 kn; its derivatives are published for it.
        speed: Some(if name == "mariner" { 7.7175 } else { 1.5 }),
        inertia: Some(Inertia { mass: 400.0, i_z: 900.0, x_g: 0.1, ..Inertia::default() }),
        ..CoefficientOptions::default()
    };
    for files in [sdf(model, &options, &with), mss(model, &options), latex(model, &options, &with)] {
        for file in files? {
            std::fs::write(folder.join(file.name), file.content)?;
        }
    }
    let run = run(model).ok_or("only vessels and equations have runs")?;
    Ok(std::fs::write(folder.join(format!("{}.json", options.name)), run.to_string())?)
}

/// Equations of motion with every form of a term, and outputs in another order.
fn launch() -> Result<Model, Failure> {
    let (outputs, inputs) = ([("r", "rad/s"), ("u", "m/s"), ("v", "m/s")], [("n", "rps"), ("delta", "rad")]);
    let names = outputs.iter().chain(&inputs).map(|(name, _)| *name);
    let mut parser = ExpressionParser::new(names, 3, 0.1);
    let mut terms = Vec::new();
    let mut rows = vec![Vec::new(); 3];
    for (term, row) in [
        ("1", [0.0, 0.01, -0.002]),
        ("u", [0.0, -0.2, 0.0]),
        ("v", [-0.05, 0.0, -0.6]),
        ("r", [-0.9, 0.0, 0.1]),
        ("u |u|", [0.0, -0.05, 0.0]),
        ("v |u| below(u, 1.5, 4)", [-0.02, 0.0, -0.1]),
        ("r |u| above(u, 1.5, 4)", [-0.3, 0.0, 0.05]),
        ("u r", [0.0, 0.0, -0.4]),
        ("v r", [0.0, 0.5, 0.0]),
        ("lag(n, 1.5 s) |lag(n, 1.5 s)|", [0.0, 0.02, 0.0]),
        ("u |u| sin(delta)", [0.3, -0.02, -0.1]),
        ("u cos(lag(delta, 0.4 s))", [0.0, 0.05, 0.0]),
        ("r^3", [-0.8, 0.0, 0.0]),
        ("sgn(n)", [0.0, 0.01, 0.0]),
    ] {
        terms.push(parser.term(term)?);
        rows.iter_mut().zip(row).for_each(|(all, value)| all.push(value));
    }
    let signals = parser.signals().to_vec();
    let equations = Equations::with_signals(terms, rows.concat(), 3, 2, signals, 0.1, 2)?;
    let port = |(name, unit): &(&str, &str), low, high| Port {
        channel: Channel::new(*name, *unit),
        range: DesignRange { low, high },
        training_range: None,
        noise: None,
        rate_limit: None,
    };
    Ok(Model {
        description: Description {
            name: String::from("launch"),
            dt: 0.1,
            outputs: outputs.iter().map(|channel| port(channel, -3.0, 3.0)).collect(),
            inputs: vec![port(&inputs[0], -5.0, 10.0), port(&inputs[1], -0.6, 0.6)],
            reading: Reading::default(),
            boat: hydroid::boat::Boat::default(),
            provenance: Provenance {
                hydroid: String::from(env!("CARGO_PKG_VERSION")),
                seed: 0,
                training: Vec::new(),
                validation: Vec::new(),
                settings: serde_json::Value::Null,
                ..Provenance::default()
            },
            bands: None,
            trial_errors: Vec::new(),
            current: None,
        },
        body: Body::Equations(Arc::new(equations)),
        members: Members::default(),
        learning: None,
    })
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
        Body::Equations(equations) => {
            let limits = |port: &Port| [port.range.low, port.range.high];
            let commands = commands(&model.description.inputs.iter().map(limits).collect::<Vec<_>>());
            // The lags of commands of 0.
            let mut state = vec![0.0; equations.state_len()];
            let mut scratch = vec![0.0; equations.scratch()];
            let mut slots = vec![0.0; equations.slots()];
            let order = ["u", "v", "r"].map(|name| {
                model.description.outputs.iter().position(|port| port.channel.name == name).unwrap_or(0)
            });
            let (mut motion, mut moved, mut rates) = (Vec::new(), Vec::new(), Vec::new());
            for command in &commands {
                equations.step(&mut state, command, &mut scratch);
                let mut rate = [0.0; 3];
                equations.load(&state, command, &mut slots);
                equations.derivative(&mut slots, &mut rate);
                motion.push(order.map(|output| state[output]));
                moved.push(state[3..].to_vec());
                rates.push(order.map(|output| rate[output]));
            }
            Some(json!({ "dt": dt, "commands": commands, "nu": motion, "positions": moved, "nu_dot": rates }))
        }
        _ => None,
    }
}
