//! Error(k) of a model beside C0, below, across and above the hydrofoil's change of mode (thesis, section 4.2 and figure 5).
//!
//! ```text
//! cargo run --release --example error_k -- MODEL LOG [FIGURE.svg]
//! ```
//!
//! The model starts from what was measured and is compared with the truth. Beside it stand, from the same origins,
//!
//! - C0, the perfect model of low speed, from the true state with the true force of the propeller;
//! - the true plant from the measured velocities with the true force of the propeller: what noise at the start alone does.
//!
//! `Error(k)` is, for each output, the mean absolute error over 10 windows of 20 steps, the window `m` starting at the
//! sample `k + 20 m`; `k = 3, 203, 403, ..`, so that windows follow each other. A model that needs more samples before its
//! first prediction begins with a later `k`. The log is one that `hydroid simulate hydrofoil` writes, with the true
//! outputs and the column `P_f_true`; the model may be of any kind.

use std::path::Path;
use std::process::ExitCode;

use hydroid::log;
use hydroid::model;
use hydroid_core::vessel::{Plant, VesselParams};
use hydroid_report::style;
use hydroid_study::error_k::{self, Block, Errors, PLACES, Record, STEPS, TRANSITION, WINDOWS};

/// Origins of which one is taken for the plants, which are slower than networks.
const STRIDE: usize = 5;

type Failure = Box<dyn std::error::Error>;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let done = match arguments.as_slice() {
        [model, log] => tell(model, log, None),
        [model, log, figure] => tell(model, log, Some(figure)),
        _ => Err("give MODEL LOG [FIGURE.svg]".into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn read(path: &str, reading: &model::Reading) -> Result<Record, Failure> {
    let raw = log::read(Path::new(path))?;
    let force = raw
        .position("P_f_true")
        .map(|c| raw.columns[c].values.clone())
        .ok_or_else(|| format!("{path} has no column P_f_true: give a simulated hydrofoil's log"))?;
    let run = log::prepare(&[raw], &reading.selection, &reading.options)?.runs.remove(0);
    let truth =
        run.truth.as_ref().ok_or_else(|| format!("{path} has no true outputs: give a simulated log"))?;
    let names: Vec<&str> = run.outputs.channels().iter().map(|c| c.name.as_str()).collect();
    if names != ["u", "v", "r"] || force.len() != run.len() || run.inputs.width() != 2 {
        return Err(format!("{path}: a model of u, v, r under PP_cmd, RD_ang is needed").into());
    }
    let truth = truth.rows(0, truth.len()).to_vec();
    Ok(Record { run, truth, force })
}

fn tell(model: &str, log: &str, figure: Option<&String>) -> Result<(), Failure> {
    let model = model::read(Path::new(model))?;
    let record = read(log, &model.description.reading)?;
    model.check(std::slice::from_ref(&record.run))?;
    let [c0, truth] =
        [VesselParams::hydrofoil_low_speed(), VesselParams::hydrofoil()].map(|p| Plant::new(&p));
    let (c0, plant) = (c0?, truth?);
    let (windows, [first, last]) = error_k::walk(&record, model.session().as_mut());
    let speeds = |k: usize, steps: usize| (k..=k + steps).map(|k| record.truth(k)[0]);

    println!("mean absolute error over {STEPS} steps, u [m/s], v [m/s], r [rad/s]");
    let kind = |k: usize| {
        let above = speeds(k, STEPS).filter(|u| *u > TRANSITION).count();
        if above == 0 {
            0
        } else if above > STEPS {
            1
        } else {
            2
        }
    };
    let origins: Vec<usize> = (0..windows.len()).filter(|&k| windows[k].is_some()).collect();
    for (name, wanted) in
        [("all", None), ("below the transition", Some(0)), ("above", Some(1)), ("across", Some(2))]
    {
        let chosen: Vec<usize> =
            origins.iter().copied().filter(|&k| wanted.is_none_or(|wanted| kind(k) == wanted)).collect();
        let some: Vec<usize> = chosen.iter().copied().step_by(STRIDE).collect();
        let of = |origins: &[usize], error: &dyn Fn(usize) -> Errors| {
            let mut sums = [0.0; 3];
            for &k in origins {
                error_k::add(&mut sums, error(k), origins.len());
            }
            row(sums)
        };
        let measured = |k: usize| std::array::from_fn(|c| record.run.outputs.row(k)[c]);
        println!(
            "  {name:21} {:6} windows   model {}   C0 {}   plant from the noise {}",
            chosen.len(),
            of(&chosen, &|k| windows[k].unwrap_or_default()),
            of(&some, &|k| record.of_plant(&c0, record.truth(k), k)),
            of(&some, &|k| record.of_plant(&plant, measured(k), k)),
        );
    }
    println!("  first step {}   last step {}", row(first), row(last));

    let blocks = error_k::blocks_of(&record, &windows, &c0);
    println!("Error(k), the mean of {WINDOWS} windows of {STEPS} steps");
    for (place, name) in PLACES.iter().enumerate() {
        let chosen: Vec<&Block> = blocks.iter().filter(|block| error_k::is(block, place)).collect();
        let mean = |of: fn(&Block) -> Errors| {
            let mut sums = [0.0; 3];
            for block in &chosen {
                error_k::add(&mut sums, of(block), chosen.len());
            }
            row(sums)
        };
        println!(
            "  {name:21} {:6} blocks    model {}   C0 {}",
            chosen.len(),
            mean(|b| b.model),
            mean(|b| b.c0)
        );
    }
    if let Some(path) = figure {
        let drawn = error_k::figure(&blocks, &model.description.name, style::MODEL_LINE, record.run.dt);
        std::fs::write(path, drawn.file()?)?;
    }
    Ok(())
}

fn row(errors: Errors) -> String {
    errors.map(|error| format!("{error:.4}")).join(" ")
}
