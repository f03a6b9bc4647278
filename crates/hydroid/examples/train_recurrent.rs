//! Trains a recurrent network on one log, chooses its weights on another, and judges it on a third with truth.
//!
//! ```text
//! cargo run --release --example train_recurrent -- TRAIN VALIDATE TEST[,TEST ..] [KEY=VALUE ..]
//! ```
//!
//! `KEY=VALUE` are settings of the training as TOML (`'cell="gru"'`, `epochs=300`; `seeds=3` trains with seeds 0, 1, 2),
//! for networks that read inputs alone and give the outputs themselves. Ranges are those of the hydrofoil. Logs have
//! columns `u`, `v`, `r`, `u_true`, `v_true`, `r_true`, `PP_cmd`, `RD_ang`. Two figures are told: the RMS error against
//! truth after 100 steps in open loop from a zero state that 100 commands warmed up, with a start at every 20th sample;
//! and the mean absolute error in open loop over the whole test log from a zero state.

#[path = "shared/hydrofoil.rs"]
mod hydrofoil;

use std::f64::consts::FRAC_PI_6;
use std::ops::ControlFlow;

use hydrofoil::read;
use hydroid::evaluate::DesignRange;
use hydroid::log::Trajectory;
use hydroid::train::{BaseKind, Job, TrainOptions, Trained, train};
use hydroid_core::model::recurrent::Rollout;

const WARM_UP: usize = 100;
const HORIZON: usize = 100;
const STRIDE: usize = 20;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [train_log, validation_log, test_logs, keys @ ..] = arguments.as_slice() else {
        return Err("give TRAIN VALIDATE TEST[,TEST ..] [KEY=VALUE ..]".into());
    };
    let (mut seeds, mut text) = (1, String::new());
    for key in keys {
        match key.strip_prefix("seeds=") {
            Some(count) => seeds = count.parse()?,
            None => text.extend([key.as_str(), "\n"]),
        }
    }
    let settings: TrainOptions = toml::from_str(&text)?;
    if settings.feedback || settings.base != BaseKind::Nothing {
        return Err(
            "only networks without feedback and base are judged here: for others, `hydroid identify`".into(),
        );
    }
    let (runs, validation) = (read(train_log)?, read(validation_log)?);
    let tests: Vec<Trajectory> = test_logs.split(',').map(read).collect::<Result<_, _>>()?;
    if let Some(short) = tests.iter().find(|test| test.len() <= WARM_UP + HORIZON) {
        let needed = WARM_UP + HORIZON + 1;
        return Err(format!("{} has {} samples: give at least {needed}", short.name, short.len()).into());
    }
    let range = |low, high| DesignRange { low, high };
    let outputs = [range(0.0, 6.0), range(-1.5, 1.5), range(-1.0, 1.0)];
    let inputs = [range(-130.0, 350.0), range(-FRAC_PI_6, FRAC_PI_6)];
    let job = Job {
        runs: &[&runs],
        validation: &[&validation],
        outputs: &outputs,
        inputs: &inputs,
        horizon: HORIZON,
        equations: None,
    };
    for seed in settings.seed..settings.seed + seeds {
        let settings = TrainOptions { seed, ..settings.clone() };
        let trained = train(&job, &settings, None, &mut |_| ControlFlow::Continue(()))?;
        println!(
            "seed {seed}: {} of {} epochs in {:.1} s, validation {:.4}, of epoch {} ({:?})",
            trained.history.len(),
            trained.epochs,
            trained.seconds,
            trained.validation,
            trained.best_epoch,
            trained.ending
        );
        for (k, epoch) in trained.history.iter().enumerate() {
            if (k + 1) % (trained.history.len() / 10).max(1) == 0 {
                println!(
                    "  epoch {:4}: loss {:.5}, validation {:.4}",
                    k + 1,
                    epoch.train_loss,
                    epoch.validation
                );
            }
        }
        for test in &tests {
            let [rms, mean] = judge(&trained, test);
            println!("  {}: free run {rms:.4?}, whole log {mean:.4?}", test.name);
        }
    }
    Ok(())
}

/// RMS error after a horizon, and mean absolute error over the whole log, of each output against truth.
fn judge(trained: &Trained, run: &Trajectory) -> [Vec<f64>; 2] {
    let truth = run.truth.as_ref().unwrap_or(&run.outputs);
    let starts: Vec<usize> = (0..run.len() - WARM_UP - HORIZON).step_by(STRIDE).collect();
    let mut squares = [0.0; 3];
    open_loop(trained, run, &starts, WARM_UP + HORIZON, |start, steps, y| {
        if steps == WARM_UP + HORIZON {
            for c in 0..3 {
                squares[c] += (y[c] - truth.row(start + steps)[c]).powi(2) / starts.len() as f64;
            }
        }
    });
    let mut sums = [0.0; 3];
    open_loop(trained, run, &[0], run.len() - 1, |_, steps, y| {
        for c in 0..3 {
            sums[c] += (y[c] - truth.row(steps)[c]).abs() / (run.len() - 1) as f64;
        }
    });
    [squares.iter().map(|s: &f64| s.sqrt()).collect(), sums.to_vec()]
}

/// Predictions from zero states by commands alone.
fn open_loop(
    trained: &Trained,
    run: &Trajectory,
    starts: &[usize],
    steps: usize,
    mut each: impl FnMut(usize, usize, [f64; 3]),
) {
    let Some(model) = trained.model.recurrent() else { return };
    let scaling = &model.scaling;
    let mut rollout = Rollout::<f64>::new(&model.network, starts.len());
    rollout.load(&model.weights);
    let lanes = rollout.lanes();
    for k in 0..steps {
        let input = rollout.input_mut();
        for (lane, start) in starts.iter().enumerate() {
            for (i, c) in run.inputs.row(start + k).iter().enumerate() {
                input[i * lanes + lane] = (c - scaling.input_mean[i]) / scaling.input_scale[i];
            }
        }
        rollout.step();
        for (lane, &start) in starts.iter().enumerate() {
            let z = |c: usize| rollout.output()[c * lanes + lane];
            let y = std::array::from_fn(|c| scaling.output_mean[c] + scaling.correction_scale[c] * z(c));
            each(start, k + 1, y);
        }
    }
}
