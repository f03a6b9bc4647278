//! Committees of difference equations: their choice on simulated runs, their files, and their adaptation.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use hydroid::adapt::{self, Options, ResolvedOptions, adapt};
use hydroid::committee::{ChooseError, Chosen, choose, choose_with_validation};
use hydroid::evaluate::{self, DesignRange};
use hydroid::log::{Channel, Table, Trajectory};
use hydroid::model::{
    Body, Description, Members, Model, ModelError, Port, Provenance, Reading, decode, encode,
};
use hydroid::progress::silent;
use hydroid_core::adapt::CommitteeSession;
use hydroid_core::model::committee::{Committee, DifferenceEquations, Member, Prior, Shape};
use hydroid_core::model::sparse::Term;
use hydroid_core::predict::{Predictor, Workspace};
use safetensors::tensor::SafeTensors;
use serde_json::{Value, json};

const DT: f64 = 0.1;

/// Standard deviation of the measurement noise.
const NOISE: f64 = 0.01;

/// Uniform noise with the standard deviation 1, the same on every machine.
fn noise(k: usize, channel: usize) -> f64 {
    let x = (k as f64 * 12.9898 + channel as f64 * 78.233).sin() * 43_758.545_3;
    12f64.sqrt() * (x - x.floor() - 0.5)
}

/// Surge under drag and a propeller, yaw under a rudder in its wake, over a sample:
/// `du/dt = -0.1 u - 0.3 u|u| + 0.5 n`, `dr/dt = -r + gain u delta`.
fn step(gain: f64, [u, r]: [f64; 2], [n, delta]: [f64; 2]) -> [f64; 2] {
    let (mut u, mut r) = (u, r);
    for _ in 0..20 {
        let (du, dr) = (-0.1 * u - 0.3 * u * u.abs() + 0.5 * n, -r + gain * u * delta);
        (u, r) = (u + du * DT / 20.0, r + dr * DT / 20.0);
    }
    [u, r]
}

const GAIN: f64 = 0.8;

/// Commands that are held for one to four seconds.
fn command(k: usize) -> [f64; 2] {
    let held = |period: usize, channel: usize| noise(k / period, channel) / 12f64.sqrt() + 0.5;
    [2.0 * held(37, 5), held(13, 6) - 0.5]
}

fn table(names: &[&str], values: Vec<f64>) -> Table {
    Table::new(names.iter().map(|name| Channel::new(*name, "")).collect::<Vec<_>>(), values)
}

/// A run of a vessel with its true outputs; `from` selects commands and noise.
fn run(gain: f64, from: usize, samples: usize) -> Trajectory {
    let mut state = [0.5, 0.0];
    let (mut outputs, mut inputs, mut truth) = (Vec::new(), Vec::new(), Vec::new());
    for k in from..from + samples {
        truth.extend(state);
        outputs.extend([0, 1].map(|i| state[i] + NOISE * noise(k, i)));
        inputs.extend(command(k));
        state = step(gain, state, command(k));
    }
    let outputs = table(&["u", "r"], outputs);
    let truth = Some(table(&["u", "r"], truth));
    Trajectory {
        name: format!("run{from}"),
        t0: 0.0,
        dt: DT,
        outputs,
        inputs: table(&["n", "delta"], inputs),
        truth,
        heading: None,
        position: None,
    }
}

/// Mean NRMSE over outputs and horizons of predictions against the measurements.
fn error(run: &Trajectory, horizon: usize, mut predict: impl FnMut(usize) -> Vec<f64>) -> f64 {
    let width = run.outputs.width();
    let mut squares = vec![0.0; horizon * width];
    let origins: Vec<usize> = (40..run.len() - horizon).collect();
    for &k in &origins {
        let truth = run.outputs.rows(k + 1, k + 1 + horizon);
        let predicted = predict(k);
        squares.iter_mut().zip(predicted.iter().zip(truth)).for_each(|(s, (p, y))| *s += (p - y).powi(2));
    }
    let deviation = |c: usize| {
        let mean = run.outputs.column(c).sum::<f64>() / run.len() as f64;
        (run.outputs.column(c).map(|y| (y - mean).powi(2)).sum::<f64>() / run.len() as f64).sqrt()
    };
    let nrmse = |(at, s): (usize, &f64)| (s / origins.len() as f64).sqrt() / deviation(at % width);
    squares.iter().enumerate().map(nrmse).sum::<f64>() / squares.len() as f64
}

/// Error of a session along a run.
fn session_error(session: &mut dyn Predictor, run: &Trajectory, horizon: usize) -> f64 {
    let mut work = Workspace::new();
    let mut at = 0;
    session.reset();
    session.observe(run.outputs.row(0));
    error(run, horizon, |k| {
        while at < k {
            session.advance(run.inputs.row(at));
            at += 1;
            session.observe(run.outputs.row(at));
        }
        let mut y = vec![0.0; horizon * run.outputs.width()];
        session.rollout(run.inputs.rows(k, k + horizon), &mut work, &mut y);
        y
    })
}

/// Error of the simulated vessel itself from measured origins: what the noise permits without a filter.
fn noise_limited(run: &Trajectory, horizon: usize) -> f64 {
    error(run, horizon, |k| {
        let mut state: [f64; 2] = run.outputs.row(k).try_into().unwrap();
        let ahead = |k: usize| {
            state = step(GAIN, state, run.inputs.row(k).try_into().unwrap());
            state
        };
        (k..k + horizon).flat_map(ahead).collect()
    })
}

fn chosen(runs: &[Trajectory], horizon: usize) -> Result<Chosen, ChooseError> {
    choose(&runs.iter().collect::<Vec<_>>(), horizon, &mut silent())
}

fn votes(committee: &Committee) -> u32 {
    committee.members().iter().map(|member| member.votes).sum()
}

/// One and two runs are divided into blocks, three are the folds, and seven share six folds.
#[test]
fn a_chosen_committee_predicts_as_well_as_the_noise_permits() {
    const HORIZON: usize = 30;
    let test = run(GAIN, 100_000, 900);
    let persistence = error(&test, HORIZON, |k| {
        std::iter::repeat_n(test.outputs.row(k), HORIZON).flatten().copied().collect()
    });
    let limit = noise_limited(&test, HORIZON);
    assert!(limit < 0.3 * persistence, "the simulation is predictable: {limit} {persistence}");
    for (count, samples) in [(1, 1500), (2, 750), (3, 500), (7, 220)] {
        let runs: Vec<_> = (0..count).map(|i| run(GAIN, 2_000 * i, samples)).collect();
        let Chosen { committee, candidates, error, best_error, .. } = chosen(&runs, HORIZON).unwrap();
        let mut session = CommitteeSession::new(Arc::new(committee.clone())).unwrap();
        let own = session_error(&mut session, &test, HORIZON);
        println!(
            "{count} runs: {own:.4} (limit {limit:.4}, persistence {persistence:.4}), cv {error:.4} {best_error:.4}"
        );
        assert!(own < 0.5 * persistence && own < 1.2 * limit, "{count} runs: {own} {limit} {persistence}");
        // The cross-validated error is an estimate of the error on a new run.
        assert!(
            (0.4..2.5).contains(&(error / own)) && error < 1.05 * best_error,
            "{error} {best_error} {own}"
        );
        assert!(candidates > 300);
        assert_eq!(votes(&committee), 20);
        assert_eq!((committee.outputs(), committee.inputs(), committee.dt()), (2, 2, DT));
    }
}

/// `y0 += T (-0.5 y0 + 0.8 c + 0.3 y1 y0')` and `y1 += T (-1.2 y1 + 0.5 c' + 0.2 y0 c)`, with the last sample `'`.
fn difference_step(y: [f64; 2], past: [f64; 2], c: f64, c_past: f64) -> [f64; 2] {
    let rates = [-0.5 * y[0] + 0.8 * c + 0.3 * y[1] * past[0], -1.2 * y[1] + 0.5 * c_past + 0.2 * y[0] * c];
    [y[0] + DT * rates[0], y[1] + DT * rates[1]]
}

#[test]
fn known_difference_equations_are_found() {
    const HORIZON: usize = 15;
    let simulated = |from: usize, samples: usize| {
        let mut y = vec![[0.1, 0.0]; 2];
        let c: Vec<f64> = (from..from + samples).map(|k| command(k)[0] - 1.0).collect();
        for k in 1..samples - 1 {
            y.push(difference_step(y[k], y[k - 1], c[k], c[k - 1]));
        }
        let outputs = table(&["y0", "y1"], y.concat());
        Trajectory {
            name: format!("{from}"),
            t0: 0.0,
            dt: DT,
            outputs,
            inputs: table(&["c"], c),
            truth: None,
            heading: None,
            position: None,
        }
    };
    let runs: Vec<_> = [0, 1000, 2000].map(|from| simulated(from, 400)).into();
    let found = chosen(&runs, HORIZON).unwrap();
    // A horizon of 15 samples has a single clock step.
    assert!(found.committee.members().iter().all(|member| member.equations.shape().clock == 1));
    let mut session = CommitteeSession::new(Arc::new(found.committee)).unwrap();
    let own = session_error(&mut session, &simulated(9000, 400), HORIZON);
    assert!(own < 1e-3 && found.error < 1e-3, "{own} {}", found.error);
}

#[test]
fn the_members_before_the_refit_have_not_seen_the_validation_run() {
    let runs: Vec<Trajectory> = (0..3).map(|i| run(1.0, 5_000 * i, 1_500)).collect();
    let [a, b, c] = [&runs[0], &runs[1], &runs[2]];
    let with =
        |validation: &Trajectory| choose_with_validation(&[a, b], &[validation], 30, &mut silent()).unwrap();
    let chosen = with(c);
    assert_eq!(votes(&chosen.before_refit), votes(&chosen.committee));
    assert_ne!(chosen.before_refit, chosen.committee);
    let structure = |of: &Committee| -> Vec<_> {
        of.members().iter().map(|m| (*m.equations.shape(), m.equations.terms().to_vec(), m.votes)).collect()
    };
    assert_eq!(structure(&chosen.before_refit), structure(&chosen.committee));
    // Without validation runs there is nothing to leave out.
    let all = choose(&[a, b, c], 30, &mut silent()).unwrap();
    assert_eq!((&all.before_refit, &all.committee), (&chosen.committee, &chosen.committee));
    // Another last sample of the validation run changes the fit on all runs alone.
    let mut values = c.outputs.rows(0, c.len()).to_vec();
    let last = values.len() - 1;
    values[last] += 1e-3;
    let changed = Trajectory { outputs: Table::new(c.outputs.channels().to_vec(), values), ..c.clone() };
    let changed = with(&changed);
    assert_ne!(changed.committee, chosen.committee);
    if structure(&changed.before_refit) == structure(&chosen.before_refit) {
        assert_eq!(changed.before_refit, chosen.before_refit);
    }
}

#[test]
fn the_choice_does_not_depend_on_the_number_of_threads() {
    let runs: Vec<_> = (0..2).map(|i| run(GAIN, 2_000 * i, 300)).collect();
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let found = pool.install(|| chosen(&runs, 20)).unwrap();
        let bytes = encode(&model(found.committee.clone())).unwrap();
        (found, bytes)
    };
    let (one, two) = (on(1), on(2));
    assert_eq!(one.0, two.0);
    assert_eq!(one.1, two.1);
}

#[test]
fn runs_without_a_committee_are_refused() {
    let refused = |runs: &[Trajectory], horizon| chosen(runs, horizon).unwrap_err();
    assert!(matches!(refused(&[run(GAIN, 0, 100)], 30), ChooseError::TooShort { folds: 6, horizon: 30, .. }));
    let short: Vec<_> = (0..4).map(|i| run(GAIN, 1000 * i, 34)).collect();
    let error = refused(&short, 30);
    assert!(matches!(error, ChooseError::TooShort { folds: 4, .. }));
    assert!(error.to_string().contains("a shorter horizon"), "{error}");
    assert!(matches!(refused(&[], 30), ChooseError::Singular));
    // Only one fold has a window.
    let mut one_long = short;
    one_long.push(run(GAIN, 9000, 300));
    assert!(matches!(refused(&one_long, 30), ChooseError::TooShort { .. }));
    let mut unknown = run(GAIN, 0, 400);
    let values = (0..800).map(|at| if at % 2 == 1 { f64::NAN } else { unknown.outputs.row(at / 2)[0] });
    unknown.outputs = table(&["u", "r"], values.collect());
    for _ in 0..2 {
        refused(&[unknown.clone()], 20);
        refused(&[unknown.clone(), unknown.clone(), unknown.clone()], 20);
    }
    let run = run(GAIN, 0, 300);
    let mut calls = 0;
    let cancelled = choose(&[&run], 20, &mut |_| {
        calls += 1;
        if calls > 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(matches!(cancelled, Err(ChooseError::Cancelled(_))));
}

/// Changes outputs and commands of a sample.
type Change = dyn Fn(usize, &mut [f64; 2], &mut [f64; 2]);

/// Runs that carry no information, or faulty values: an error, or a committee whose predictions are finite.
#[test]
fn degenerate_runs_never_panic() {
    let changed = |change: &Change| {
        let mut run = run(GAIN, 0, 240);
        let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
        for k in 0..run.len() {
            let mut y: [f64; 2] = run.outputs.row(k).try_into().unwrap();
            let mut c: [f64; 2] = run.inputs.row(k).try_into().unwrap();
            change(k, &mut y, &mut c);
            outputs.extend(y);
            inputs.extend(c);
        }
        run.outputs = table(&["u", "r"], outputs);
        run.inputs = table(&["n", "delta"], inputs);
        run
    };
    let mut without_inputs = run(GAIN, 0, 240);
    without_inputs.inputs = Table::new(Vec::new(), Vec::new());
    let runs = [
        ("zero outputs", changed(&|_, y, _| *y = [0.0; 2])),
        ("one constant output", changed(&|_, y, _| y[0] = 3.7)),
        ("constant", changed(&|_, y, c| (*y, *c) = ([1.0, -2.0], [0.3; 2]))),
        ("all zero", changed(&|_, y, c| (*y, *c) = ([0.0; 2], [0.0; 2]))),
        ("twin outputs and inputs", changed(&|_, y, c| (y[1], c[1]) = (y[0], c[0]))),
        ("large", changed(&|_, y, c| (y[0], c[0]) = (1e30 * y[0], 1e-30 * c[0]))),
        ("huge", changed(&|_, y, _| y[0] *= 1e160)),
        ("an infinite value", changed(&|k, y, _| y[0] = if k == 120 { f64::INFINITY } else { y[0] })),
        ("missing values", changed(&|k, y, _| y[1] = if k % 50 == 49 { f64::NAN } else { y[1] })),
        ("without inputs", without_inputs),
    ];
    for (what, run) in runs {
        match chosen(std::slice::from_ref(&run), 10) {
            Err(error) => println!("{what}: {error}"),
            Ok(found) => {
                println!("{what}: {}", found.error);
                assert!(found.error.is_finite() && found.best_error.is_finite(), "{what}");
                let mut session = CommitteeSession::new(Arc::new(found.committee)).expect(what);
                let mut y = vec![0.0; 20];
                for k in 0..110 {
                    session.observe(run.outputs.row(k));
                    let c = if run.inputs.width() > 0 { run.inputs.rows(k, k + 10) } else { &[] };
                    session.rollout(c, &mut Workspace::new(), &mut y);
                    assert!(y.iter().all(|y| y.is_finite()), "{what}: {y:?}");
                    session.advance(&c[..run.inputs.width()]);
                }
            }
        }
    }
}

/// A constant member and one that learns, in the form of the simulated vessel.
fn by_hand(information: f64) -> Committee {
    let [u, r, n, delta] = [0, 1, 2, 3];
    let terms = vec![
        Term::constant(),
        Term::monomial(&[u]),
        Term::signed_square(u, u),
        Term::monomial(&[r]),
        Term::monomial(&[n]),
        Term::monomial(&[u, delta]),
    ];
    #[rustfmt::skip]
    let coefficients = vec![
        0.0, -0.1, -0.3,  0.0, 0.5, 0.0,
        0.0,  0.0,  0.0, -1.0, 0.0, GAIN,
    ];
    let member = |lags, clock, votes, prior| {
        let shape = Shape { outputs: 2, inputs: 2, lags, clock, dt: DT };
        let equations = DifferenceEquations::new(terms.clone(), coefficients.clone(), shape).unwrap();
        Member { equations, votes, prior }
    };
    let r_factor =
        (0..36).map(|at| if at % 7 == 0 { 1.0 } else { f64::from(u8::from(at % 6 > at / 6)) / 7.0 });
    let prior = Prior { averaging: 2, information, r_factor: r_factor.collect() };
    let committee = Committee::new(vec![member(1, 3, 2, None), member(0, 2, 3, Some(prior))]).unwrap();
    committee.with_ranges(vec![(-100.0, 100.0); 2]).unwrap()
}

fn port(name: &str, low: f64, high: f64) -> Port {
    let range = DesignRange { low, high };
    Port { channel: Channel::new(name, ""), range, training_range: None, noise: None, rate_limit: None }
}

fn model(committee: Committee) -> Model {
    Model {
        description: Description {
            bands: None,
            trial_errors: Vec::new(),
            current: None,
            name: String::from("committee"),
            dt: DT,
            outputs: vec![port("u", 0.0, 1.5), port("r", -0.6, 0.6)],
            inputs: vec![port("n", 0.0, 2.0), port("delta", -0.5, 0.5)],
            reading: Reading::default(),
            boat: hydroid::boat::Boat::default(),
            provenance: Provenance {
                hydroid: String::from("0.1.0"),
                seed: 0,
                training: vec![String::from("a.csv")],
                validation: Vec::new(),
                settings: json!({}),
                ..Provenance::default()
            },
        },
        body: Body::Committee(Arc::new(committee)),
        members: Members::default(),
        learning: None,
    }
}

fn decoded(bytes: &[u8]) -> Result<Model, ModelError> {
    decode(bytes, Path::new("m.safetensors"))
}

#[test]
fn a_model_file_is_read_back() {
    let model = model(by_hand(3.0));
    let bytes = encode(&model).unwrap();
    let again = decoded(&bytes).unwrap();
    assert_eq!(again, model);
    assert_eq!(encode(&again).unwrap(), bytes);
    assert_eq!((again.kind(), again.weights()), ("committee", 24));
    let text = again.network_text().join("\n");
    assert!(text.contains("2 members with 5 votes") && text.contains("learns"), "{text}");
    let run = run(1.3, 0, 200);
    let (mut first, mut second) = (model.session(), again.session());
    for k in 0..150 {
        let rolled = |session: &dyn Predictor| {
            let mut y = vec![0.0; 40];
            session.rollout(run.inputs.rows(k, k + 20), &mut Workspace::new(), &mut y);
            y
        };
        for session in [&mut first, &mut second] {
            session.observe(run.outputs.row(k));
        }
        assert_eq!(rolled(first.as_ref()), rolled(second.as_ref()));
        for session in [&mut first, &mut second] {
            session.advance(run.inputs.row(k));
        }
    }
}

/// The file of the model with another head, without a tensor, or with another value in a tensor.
fn altered(change: impl FnOnce(&mut Value), without: &str, value: Option<(&str, usize, f64)>) -> Vec<u8> {
    let bytes = encode(&model(by_hand(3.0))).unwrap();
    let (_, metadata) = SafeTensors::read_metadata(&bytes).unwrap();
    let mut head: Value = serde_json::from_str(&metadata.metadata().as_ref().unwrap()["hydroid"]).unwrap();
    change(&mut head);
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let mut views: Vec<_> = tensors.tensors().into_iter().filter(|(name, _)| name != without).collect();
    let mut data = Vec::new();
    if let Some((name, at, value)) = value {
        let view = views.iter_mut().find(|(own, _)| own == name).unwrap();
        data.extend_from_slice(view.1.data());
        data[8 * at..8 * at + 8].copy_from_slice(&value.to_le_bytes());
        view.1 =
            safetensors::tensor::TensorView::new(view.1.dtype(), view.1.shape().to_vec(), &data).unwrap();
    }
    safetensors::serialize(views, Some(HashMap::from([(String::from("hydroid"), head.to_string())]))).unwrap()
}

#[test]
fn damaged_files_are_refused() {
    assert_eq!(decoded(&altered(|_| (), "", None)).unwrap(), model(by_hand(3.0)));
    let refused = |bytes: &[u8], words: &str| {
        let error = decoded(bytes).unwrap_err().to_string();
        assert!(error.contains(words), "'{words}' is not in: {error}");
    };
    for name in ["coefficients.0", "coefficients.1", "r_factor.1"] {
        refused(&altered(|_| (), name, None), &format!("'{name}' is missing"));
    }
    for (name, at) in [("coefficients.0", 3), ("coefficients.1", 11), ("r_factor.1", 8), ("r_factor.1", 7)] {
        refused(&altered(|_| (), "", Some((name, at, f64::NAN))), "");
        refused(&altered(|_| (), "", Some((name, at, f64::INFINITY))), "");
    }
    refused(&altered(|_| (), "", Some(("r_factor.1", 7, 0.0))), "prior of member 1");
    refused(&altered(|_| (), "", Some(("r_factor.1", 7, 1e-200))), "prior of member 1");
    refused(&altered(|_| (), "", Some(("r_factor.1", 6, 1.0))), "prior of member 1");
    let head = |key: &'static str, value: Value| {
        altered(|head| head["structure"]["members"][1][key] = value, "", None)
    };
    refused(&head("votes", json!(0)), "vote");
    refused(&head("votes", json!(-1)), "");
    refused(&head("votes", json!(1u64 << 40)), "");
    for clock in [json!(0), json!(1 << 30), json!(u64::MAX), json!(-3), json!(1.5), Value::Null] {
        refused(&head("clock", clock), "");
    }
    for lags in [json!(1 << 30), json!(u64::MAX), json!(100_000)] {
        refused(&head("lags", lags), "");
    }
    refused(&head("terms", json!([])), "");
    refused(&head("terms", json!([[{"variable": 4, "shape": {"power": 1}}]])), "");
    refused(&head("colour", json!(1)), "colour");
    for (averaging, information) in
        [(json!(0), 1.0), (json!(u64::MAX), 1.0), (json!(1u64 << 40), 1.0), (json!(2), 0.0)]
    {
        refused(&head("learning", json!({"averaging": averaging, "information": information})), "prior");
    }
    refused(&altered(|head| head["structure"]["members"] = json!([]), "", None), "members");
    let many = |head: &mut Value| {
        let member = head["structure"]["members"][0].clone();
        head["structure"]["members"] = json!(vec![member; 3]);
    };
    refused(&altered(many, "", None), "'coefficients.2' is missing");
    refused(&altered(|head| head["description"]["inputs"] = json!([]), "", None), "");
    refused(&altered(|head| head["description"]["outputs"] = json!([]), "", None), "");
    for (horizon, half_widths) in
        [(1, json!([[[1.0]]])), (1, json!([[[1.0, -1.0]]])), (1_u64 << 40, json!([[[1.0, 1.0]]]))]
    {
        let bands = json!({"levels": [0.8], "horizons": [horizon], "half_widths": half_widths});
        let head = move |head: &mut Value| head["description"]["bands"] = bands.clone();
        refused(&altered(head, "", None), "prediction bands");
    }
    // A member that learns with its information out of bounds.
    for information in [1e-300, 1e300] {
        let learning = json!({"averaging": 2, "information": information});
        refused(&head("learning", learning), "prior of member 1");
    }
}

#[test]
fn a_changed_byte_never_panics() {
    let whole = encode(&model(by_hand(3.0))).unwrap();
    for at in 0..whole.len() {
        assert!(decoded(&whole[..at]).is_err());
        for flip in [0x01, 0x80, 0xff] {
            let mut damaged = whole.clone();
            damaged[at] ^= flip;
            let Ok(model) = decoded(&damaged) else { continue };
            let mut session = model.session();
            let (n, m) = (session.outputs(), session.inputs());
            for _ in 0..12 {
                session.observe(&vec![0.1; n]);
                session.advance(&vec![0.2; m]);
            }
            session.rollout(&vec![0.1; 5 * m], &mut Workspace::new(), &mut vec![0.0; 5 * n]);
        }
    }
}

fn options() -> Options {
    Options {
        evaluate: evaluate::Options { horizon: 30, ..evaluate::Options::default() },
        ..Options::default()
    }
}

#[test]
fn adaptation_follows_a_vessel_whose_gain_changed() {
    let model = model(by_hand(1.0));
    let changed = [run(0.4 * GAIN, 5_000, 900), run(0.4 * GAIN, 7_000, 900)];
    let both = changed.each_ref();
    let adapted = adapt(&model, &both, &options(), &mut silent()).unwrap();
    let report = &adapted.report;
    let ResolvedOptions::Committee(used) = &report.settings else { panic!("{:?}", report.settings) };
    assert_eq!(used.learning_votes, 0.6);
    assert!(report.guard.accepted > 300, "{:?}", report.guard);
    let yaw = |evaluation: &evaluate::Evaluation| evaluation.nrmse[29][1];
    assert!(
        yaw(&report.adapted) < 0.7 * yaw(&report.frozen),
        "{:?} {:?}",
        report.adapted.nrmse[29],
        report.frozen.nrmse[29]
    );

    // The frozen model is the committee without learning members.
    let frozen = model.frozen();
    let ranges = model.output_ranges();
    let own = |model: &Model, run: &Trajectory| {
        let runs = [run];
        evaluate::evaluate("", model.session().as_mut(), &ranges, &runs, &options().evaluate, &mut silent())
            .unwrap()
    };
    let alone =
        evaluate::evaluate("", frozen.session().as_mut(), &ranges, &both, &options().evaluate, &mut silent());
    assert_eq!(alone.unwrap().rmse, report.frozen.rmse);
    let constant = adapt(&frozen, &both, &options(), &mut silent()).unwrap();
    assert_eq!(constant.report.adapted.rmse, report.frozen.rmse);
    assert_eq!(constant.report.guard.accepted, 0);

    // The adapted model has the learned weights, is read back, and predicts the changed vessel without learning.
    let (mut adapter, used) = adapt::adapter(&model, &options(), &both).unwrap();
    for run in both {
        adapter.reset();
        for k in 0..run.len() {
            adapter.observe(run.outputs.row(k));
            adapter.advance(run.inputs.row(k));
        }
    }
    let learned = adapt::learned(&model, &options(), adapter.weights(), &["x"], &used).unwrap();
    let members = |model: &Model| match &model.body {
        Body::Committee(committee) => committee.members().to_vec(),
        other => panic!("{other:?}"),
    };
    assert_eq!(members(&learned)[1].equations.coefficients(), adapter.weights());
    assert_eq!(members(&learned)[0], members(&model)[0]);
    assert_eq!(members(&learned)[1].prior, members(&model)[1].prior);
    let gain = adapter.weights()[11];
    assert!((gain - 0.4 * GAIN).abs() < 0.15 * GAIN, "{gain}");
    assert_eq!(decoded(&encode(&adapted.model).unwrap()).unwrap(), adapted.model);
    assert_eq!(
        adapted.model.description.provenance.settings["adapted"][0]["settings"]["method"],
        "committee"
    );
    let next = run(0.4 * GAIN, 9_000, 400);
    let (then, now) = (own(&frozen, &next), own(&adapted.model.frozen(), &next));
    assert!(yaw(&now) < 0.7 * yaw(&then), "{} {}", yaw(&now), yaw(&then));
    assert!(adapt::learned(&model, &options(), &adapter.weights()[1..], &["x"], &used).is_err());
    assert!(adapt::learned(&model, &options(), &[f64::NAN; 12], &["x"], &used).is_err());
}

#[test]
fn a_guarded_committee_adapts() {
    let model = model(by_hand(30.0));
    let changed = run(0.4 * GAIN, 5_000, 900);
    let guarded = adapt(&model, &[&changed], &options().guarded(&model), &mut silent()).unwrap().report;
    assert_eq!(guarded.adapted.diverged, 0);
    assert!(guarded.adapted.score() < guarded.frozen.score());
}
