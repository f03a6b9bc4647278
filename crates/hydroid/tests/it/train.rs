//! Complete trainings.

use std::cell::Cell;
use std::ops::ControlFlow;
use std::path::Path;

use crate::vessel::{INPUTS, OUTPUTS, measured, sail};
use hydroid::log::Trajectory;
use hydroid::train::{BaseKind, CellKind, Ending, Job, Status, TrainError, TrainOptions, Trained, train};

/// A vessel under steps of the command, with some noise.
fn run(name: &str, samples: usize, seed: u64) -> Trajectory {
    let state = Cell::new(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let random = || {
        let mut x = state.get();
        x ^= x << 13;
        x ^= x >> 7;
        x ^= x << 17;
        state.set(x);
        (x >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let mut held = 0.0;
    let command = |k: usize| {
        if k.is_multiple_of(15) {
            held = random();
        }
        held
    };
    sail(name, samples, command, |_, [u, v]| [u + 0.005 * random(), v + 0.005 * random()])
}

fn settings(cell: CellKind) -> TrainOptions {
    TrainOptions {
        hidden: 6,
        epochs: 6,
        batch: 8,
        wash_out_s: Some(2.0),
        window_s: Some(4.0),
        learning_rate: 0.02,
        ..TrainOptions::of(cell)
    }
}

type MeteredAdapter<'a> = &'a mut dyn FnMut(&Status) -> ControlFlow<()>;

fn with(
    settings: &TrainOptions,
    checkpoint: Option<&Path>,
    watch: MeteredAdapter<'_>,
) -> Result<Trained, TrainError> {
    let (a, b, c) = (run("a", 900, 1), run("b", 500, 2), run("c", 400, 3));
    let job = Job {
        runs: &[&a, &b],
        validation: &[&c],
        outputs: &OUTPUTS,
        inputs: &INPUTS,
        horizon: 20,
        equations: None,
    };
    train(&job, settings, checkpoint, watch)
}

fn go(settings: &TrainOptions) -> Trained {
    with(settings, None, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// Compares everything but the training time.
fn same(a: &Trained, b: &Trained) {
    assert_eq!(Trained { seconds: 0.0, ..a.clone() }, Trained { seconds: 0.0, ..b.clone() });
}

#[test]
fn every_cell_and_base_learns_the_vessel() {
    for (cell, base, feedback) in [
        (CellKind::Lstm, BaseKind::Nothing, false),
        (CellKind::Gru, BaseKind::Hold, true),
        (CellKind::Rnn, BaseKind::Nothing, true),
    ] {
        let trained = go(&TrainOptions { feedback, base, epochs: 40, ..settings(cell) });
        let first = trained.history[0].validation;
        assert!(trained.validation < 0.35, "{cell:?}: {} after {first}", trained.validation);
        assert_eq!(trained.history.len(), 40);
        assert_eq!(trained.ending, Ending::Done);
        let least = trained.history.iter().map(|epoch| epoch.validation).fold(f64::INFINITY, f64::min);
        assert_eq!((least, trained.history[trained.best_epoch - 1].validation), (trained.validation, least));
    }
}

#[test]
fn the_bytes_do_not_depend_on_threads() {
    let settings =
        TrainOptions { restarts: 3, batch: 40, epochs: 3, refit: true, ..settings(CellKind::Lstm) };
    let [one, two, three] = [1, 2, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| go(&settings))
    });
    same(&one, &two);
    same(&one, &three);
    assert_ne!(one.model.weights(), go(&TrainOptions { seed: 1, ..settings.clone() }).model.weights());
    // The first of several restarts equals a training without restarts.
    let alone = go(&TrainOptions { restarts: 1, ..settings });
    assert_eq!(alone.validation, one.restarts[0]);
}

#[test]
fn an_interrupted_training_resumes_to_the_same_model() {
    let folder = tempfile::tempdir().unwrap();
    for (index, cell) in [CellKind::Lstm, CellKind::Gru].into_iter().enumerate() {
        // Long enough for several progress callbacks on a fast machine.
        let settings = TrainOptions { restarts: 2, epochs: 400, refit: index == 1, ..settings(cell) };
        let whole = go(&settings);
        let path = folder.path().join(format!("{index}.checkpoint"));
        let (mut interruptions, mut latest) = (0, 0.0);
        let parts = loop {
            let mut begun = None;
            let result = with(&settings, Some(&path), &mut |status| {
                latest = status.fraction;
                let begun = *begun.get_or_insert(status.fraction);
                if status.fraction >= begun + 0.02 {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            });
            match result {
                Ok(trained) => break trained,
                Err(TrainError::Cancelled(_)) => interruptions += 1,
                Err(error) => panic!("{error}"),
            }
            assert!(interruptions < 200);
        };
        same(&whole, &parts);
        assert!(interruptions > 0, "the training was over before it could be interrupted");
        assert!(latest > 0.5 && latest <= 1.0, "{latest}");
        // A finished training does not change.
        same(&whole, &with(&settings, Some(&path), &mut |_| ControlFlow::Break(())).unwrap());
        let other = TrainOptions { learning_rate: 0.01, ..settings };
        let error = with(&other, Some(&path), &mut |_| ControlFlow::Continue(())).unwrap_err().to_string();
        assert!(error.contains("other options") && error.contains("checkpoint"), "{error}");
        std::fs::write(&path, b"not a checkpoint").unwrap();
        let error = with(&other, Some(&path), &mut |_| ControlFlow::Continue(())).unwrap_err().to_string();
        assert!(error.contains("remove it to start anew"), "{error}");
    }
}

#[test]
fn a_training_with_a_time_limit_equals_one_with_the_same_number_of_epochs() {
    let settings = TrainOptions { epochs: 1_000_000, budget_s: Some(1.0), ..settings(CellKind::Gru) };
    let trained = go(&settings);
    assert!(trained.epochs < 1_000_000);
    let again = go(&TrainOptions { epochs: trained.epochs, budget_s: None, ..settings.clone() });
    // The time limit may end the training before the last planned epoch.
    assert_eq!(again.history[..trained.history.len()], trained.history);
    if trained.ending == Ending::Done {
        assert_eq!(again.model, trained.model);
    }
    let little = TrainOptions { budget_s: Some(1e-6), ..settings.clone() };
    let error = with(&little, None, &mut |_| ControlFlow::Continue(())).unwrap_err();
    assert!(matches!(error, TrainError::NoTime { epoch_s, .. } if epoch_s > 1e-6), "{error}");
    // The measurement of the time of an epoch can be interrupted.
    let stopped = with(&settings, None, &mut |status| {
        assert_eq!(status.fraction, 0.0);
        ControlFlow::Break(())
    });
    assert!(matches!(stopped, Err(TrainError::Cancelled(_))));
}

#[test]
fn a_time_limit_below_one_epoch_is_refused() {
    let settings =
        TrainOptions { hidden: 300, budget_s: Some(10.0), window_s: Some(30.0), ..settings(CellKind::Lstm) };
    let long = run("long", 800_000, 1);
    let job = Job {
        runs: &[&long],
        validation: &[&run("c", 400, 3)],
        outputs: &OUTPUTS,
        inputs: &INPUTS,
        horizon: 20,
        equations: None,
    };
    let error = train(&job, &settings, None, &mut |_| ControlFlow::Continue(())).unwrap_err().to_string();
    assert!(error.contains("which takes about"), "{error}");
}

#[test]
fn patience_ends_a_training_that_gets_no_better() {
    let settings = TrainOptions { patience: Some(3), learning_rate: 1e-12, ..settings(CellKind::Rnn) };
    let trained = go(&TrainOptions { epochs: 500, ..settings });
    assert_eq!(trained.ending, Ending::Patience);
    assert_eq!(trained.history.len(), trained.best_epoch + 3);
}

#[test]
fn invalid_arguments_are_refused() {
    let told = |settings: TrainOptions| {
        with(&settings, None, &mut |_| ControlFlow::Continue(())).unwrap_err().to_string()
    };
    let base = settings(CellKind::Lstm);
    let of = |change: fn(&mut TrainOptions)| {
        let mut settings = base.clone();
        change(&mut settings);
        told(settings)
    };
    assert!(of(|s| s.window_s = Some(1e4)).contains("needs 100021 samples"));
    assert!(of(|s| s.window_s = Some(1e4)).contains("or a shorter wash_out_s or window_s"));
    assert!(
        of(|s| s.patience = Some(0))
            .contains("patience = 0 is invalid; expected: at least 1, or leave it out")
    );
    assert!(of(|s| s.batch = 0).contains("batch = 0"));
    assert!(of(|s| s.hidden = 0).contains("at least 1"));
    assert!(of(|s| s.layers = Some(2)).contains("only rnn has layers"));
    assert!(of(|s| s.read_out = false).contains("add the read-out"));
    assert!(of(|s| s.learning_rate = f64::NAN).contains("learning_rate = NaN"));
    assert!(of(|s| s.channel_weights = vec![1.0]).contains("one number for each output"));
    assert!(of(|s| s.base = BaseKind::Equations).contains("none are given"));
    let still = Trajectory {
        // The mean is not exactly 0.1.
        outputs: measured(vec![0.1; 1800]),
        ..run("still", 900, 1)
    };
    let horizon = |horizon: usize, validation: &Trajectory| {
        let runs = &[&run("moving", 900, 1)];
        let job = Job {
            runs,
            validation: &[validation],
            outputs: &OUTPUTS,
            inputs: &INPUTS,
            horizon,
            equations: None,
        };
        train(&job, &base, None, &mut |_| ControlFlow::Continue(())).unwrap_err().to_string()
    };
    for told in [horizon(usize::MAX, &run("b", 500, 2)), horizon(20, &run("short", 30, 1))] {
        assert!(told.contains("shorter wash_out_s or horizon"), "{told}");
    }
    for (origins, validation) in [("1 origins", &run("one", 41, 2)), ("origins", &still)] {
        let told = horizon(20, validation);
        assert!(told.contains(origins) && told.contains("a shorter horizon"), "{told}");
    }
    let one = |runs: &[&Trajectory], validation: &[&Trajectory]| {
        let job = Job { runs, validation, outputs: &OUTPUTS, inputs: &INPUTS, horizon: 20, equations: None };
        train(&job, &base, None, &mut |_| ControlFlow::Continue(())).unwrap_err().to_string()
    };
    let moving = run("moving", 900, 1);
    assert!(one(&[&still], &[&moving]).contains("'u' does not move"));
    assert!(one(&[], &[&moving]).contains("no training runs"));
    assert!(one(&[&moving], &[&run("short", 30, 1)]).contains("no validation run is long enough"));
    let slow = Trajectory { dt: 0.2, ..run("slow", 900, 1) };
    assert!(one(&[&moving], &[&slow]).contains("sample time of 0.2 s"));
}

#[test]
fn settings_are_read_from_toml_and_mistakes_are_told() {
    let read: TrainOptions = toml::from_str("cell = \"gru\"\nhidden = 9\nschedule = \"cosine\"").unwrap();
    assert_eq!((read.cell, read.hidden, read.epochs), (CellKind::Gru, 9, TrainOptions::default().epochs));
    assert!(toml::from_str::<TrainOptions>("hiden = 9").is_err());
    let text = toml::to_string(&read).unwrap();
    assert_eq!(toml::from_str::<TrainOptions>(&text).unwrap(), read);
}
