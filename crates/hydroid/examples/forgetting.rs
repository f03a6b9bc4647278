//! What a network forgets at sea, and what helps.
//!
//! ```text
//! cargo run --release -p hydroid --example forgetting -- MODEL[,MODEL ..] TRAIN SEA TEST [epochs=1] [KEY=VALUE ..]
//! ```
//!
//! Each way against forgetting in turn, with settings a way of its own: `leak` and `shore` \[s\], `guard` (`true`), and of a rehearsal
//! `every` (samples), `windows`, `window` \[s\], `variance`, `factor`.
//!
//! Models are recurrent networks that see inputs alone; `TRAIN` is a log that they were trained on, `SEA` the one that they
//! sail through (`epochs` times), `TEST` one of the waters that they knew. Mean error 20 steps ahead against the truth, u v r,
//! medians over the models: along `SEA` in its first and its last epoch, and then along `TEST`: with the weights that
//! came of it held, a filter on the state alone; and by the session itself, which goes on learning.

#[path = "shared/hydrofoil.rs"]
mod hydrofoil;

use std::path::Path;

use hydrofoil::read;
use hydroid::adapt::{self, Kalman, Options, Rehearse};
use hydroid::log::Trajectory;
use hydroid::model::{self, Model};
use hydroid_core::adapt::Adapter;
use hydroid_core::predict::Workspace;

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Standard deviations of the simulated sensors.
const NOISE: [f64; 3] = [0.01, 0.01, 0.017_453_292_519_943_295];
const STEPS: usize = 20;

/// What is done against forgetting.
#[derive(Clone, Copy)]
struct Way {
    name: &'static str,
    /// Time of the leak \[s\].
    leak_s: f64,
    /// Time walked through what it was trained on \[s\].
    shore_s: f64,
    rehearsal: Option<Rehearse>,
    guard: bool,
}

const DEFAULT: Way =
    Way { name: "leak in 33000 s (default)", leak_s: 33_000.0, shore_s: 0.0, rehearsal: None, guard: false };
const REHEARSAL: Option<Rehearse> =
    Some(Rehearse { windows: 32, window_s: 10.0, every: 2, state_variance: 0.1, noise_factor: 1.0 });

/// After every sample.
const ALL_THE_TIME: Option<Rehearse> =
    Some(Rehearse { windows: 32, window_s: 10.0, every: 1, state_variance: 0.1, noise_factor: 1.0 });

const WAYS: [Way; 12] = [
    Way { name: "nothing", leak_s: f64::INFINITY, ..DEFAULT },
    DEFAULT,
    Way { name: "leak in 3300 s", leak_s: 3300.0, ..DEFAULT },
    Way { name: "shore, 200 s", shore_s: 200.0, ..DEFAULT },
    Way { name: "shore, 2000 s", shore_s: 2000.0, ..DEFAULT },
    Way { name: "rehearsal", rehearsal: REHEARSAL, ..DEFAULT },
    Way { name: "rehearsal and shore, 200 s", rehearsal: REHEARSAL, shore_s: 200.0, ..DEFAULT },
    Way { name: "after each, shore, 200 s", rehearsal: ALL_THE_TIME, shore_s: 200.0, ..DEFAULT },
    Way { name: "guard", guard: true, ..DEFAULT },
    Way { name: "guard and shore, 200 s", shore_s: 200.0, guard: true, ..DEFAULT },
    Way { name: "guard and rehearsal", rehearsal: REHEARSAL, guard: true, ..DEFAULT },
    Way { name: "guard, rehearsal, shore", rehearsal: REHEARSAL, shore_s: 200.0, guard: true, ..DEFAULT },
];

type Errors = [f64; 3];

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [models, train, sea, test, rest @ ..] = arguments.as_slice() else {
        return Err("give MODEL[,MODEL ..] TRAIN SEA TEST [epochs=N] [KEY=VALUE ..]".into());
    };
    let (mut epochs, mut own, mut rehearse) = (1, None::<Way>, Rehearse::default());
    for word in rest {
        let (key, value) = word.split_once('=').ok_or("KEY=VALUE follows the logs")?;
        if key == "epochs" {
            epochs = value.parse::<usize>()?;
            continue;
        }
        let way = own.get_or_insert(Way { name: "as given", ..DEFAULT });
        match key {
            "leak" => way.leak_s = value.parse()?,
            "shore" => way.shore_s = value.parse()?,
            "guard" => way.guard = value.parse()?,
            "windows" => rehearse.windows = value.parse()?,
            "window" => rehearse.window_s = value.parse()?,
            "every" => rehearse.every = value.parse()?,
            "variance" => rehearse.state_variance = value.parse()?,
            "factor" => rehearse.noise_factor = value.parse()?,
            _ => return Err(format!("there is no {key}").into()),
        }
        if matches!(key, "windows" | "window" | "every" | "variance" | "factor") {
            way.rehearsal = Some(rehearse);
        }
    }
    let ways = own.map_or(WAYS.to_vec(), |own| vec![own]);
    let models: Vec<Model> =
        models.split(',').map(|path| model::read(Path::new(path))).collect::<Result<_, _>>()?;
    let (train, sea, test) = (read(train)?, read(sea)?, read(test)?);
    for Way { name, leak_s, shore_s, rehearsal, guard } in ways {
        let noise = Some(NOISE.to_vec());
        let kalman = Kalman { leak_s, rehearsal, noise, ..Kalman::default() };
        let options = Options { kalman, ..Options::default() };
        let way = |model: &Model| -> Result<[Errors; 5], Failure> {
            let own = if guard { options.clone().guarded(model) } else { options.clone() };
            let mut session = adapt::adapter(model, &own, &[&sea])?.0;
            let before = held(model, session.weights(), &options, &test)?;
            // Casts saturate.
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let samples = (shore_s / train.dt) as usize;
            adapt::rehearse_shore(session.as_mut(), &[&train]);
            adapt::remember_shore(session.as_mut(), &[&train.slice(0, samples.min(train.len()))]);
            let along: Vec<Errors> = (0..epochs.max(1)).map(|_| errors(session.as_mut(), &sea)).collect();
            let after = held(model, session.weights(), &options, &test)?;
            let second = along[1.min(along.len() - 1)];
            Ok([before, second, along[along.len() - 1], after, errors(session.as_mut(), &test)])
        };
        let all: Vec<[Errors; 5]> = std::thread::scope(|scope| {
            let workers: Vec<_> = models.iter().map(|model| scope.spawn(|| way(model))).collect();
            let joined =
                workers.into_iter().map(|w| w.join().map_err(|_| Failure::from("a run panicked"))?);
            joined.collect::<Result<_, _>>()
        })?;
        let middle = |part: usize, c: usize| {
            let mut values: Vec<f64> = all.iter().map(|errors| errors[part][c]).collect();
            values.sort_unstable_by(f64::total_cmp);
            values[values.len() / 2]
        };
        let text = |part| format!("{:.4} {:.4} {:.4}", middle(part, 0), middle(part, 1), middle(part, 2));
        println!(
            "{name:26} test before {}  sea, epoch {} {}  last {}  test, held {}  session {}",
            text(0),
            2.min(epochs),
            text(1),
            text(2),
            text(3),
            text(4)
        );
    }
    Ok(())
}

/// Errors along a log with these weights, and a filter on the state alone.
fn held(model: &Model, weights: &[f64], options: &Options, run: &Trajectory) -> Result<Errors, Failure> {
    let (_, used) = adapt::adapter(model, options, &[run])?;
    let learned = adapt::learned(model, weights, &[], &used)?;
    let sure = Kalman {
        weight_variance: 0.0,
        weight_noise_per_s: 0.0,
        state_noise_per_s: 1e-3,
        noise_factor: 1.0,
        leak_s: f64::INFINITY,
        rehearsal: None,
        ..options.kalman.clone()
    };
    let mut session = adapt::adapter(&learned, &Options { kalman: sure, ..Options::default() }, &[run])?.0;
    session.freeze(true);
    Ok(errors(session.as_mut(), run))
}

fn errors(session: &mut dyn Adapter, run: &Trajectory) -> Errors {
    let truth = run.truth.as_ref().unwrap_or(&run.outputs);
    let (m, commands) = (run.inputs.width(), run.inputs.rows(0, run.len()));
    let (mut work, mut y) = (Workspace::new(), [0.0; 3 * STEPS]);
    let (mut sums, mut count) = ([0.0; 3], 0.0);
    session.reset();
    for k in 0..run.len() - STEPS {
        session.observe(run.outputs.row(k));
        // The hidden state has settled.
        if k >= 100 && k % 5 == 0 {
            session.rollout(&commands[m * k..m * (k + STEPS)], &mut work, &mut y);
            for (c, sum) in sums.iter_mut().enumerate() {
                *sum += (y[3 * (STEPS - 1) + c] - truth.row(k + STEPS)[c]).abs();
            }
            count += 1.0;
        }
        session.advance(run.inputs.row(k));
    }
    sums.map(|sum| sum / count)
}
