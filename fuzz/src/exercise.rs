//! Use of a model: everything that commands do with one, on a few samples.

use std::path::Path;
use std::sync::Arc;

use hydroid::adapt::{self, Method};
use hydroid::closed_loop::{ControlMethod, ControllerOptions, SpeedOptions, Task, Track};
use hydroid::evaluate::{self, evaluate};
use hydroid::log::{Channel, Table, Trajectory};
use hydroid::model::{Body, Model, NamedEquations, decode, encode};
use hydroid::plant::{InputMap, Simulation};
use hydroid::progress::silent;
use hydroid_core::adapt::Adapter;
use hydroid_core::memory::Memory;
use hydroid_core::predict::{Predictor, Workspace};
use hydroid_live::stream::{self, Line, Options, Pilot, Position, Stream};

/// Samples of the log on which a model is used.
const SAMPLES: usize = 12;

/// Runs a model in all its uses.
pub(crate) fn model(model: &Model) {
    assert!(model.description.dt.is_finite() && model.description.dt > 0.0, "{} s", model.description.dt);
    texts(model);
    sessions(model);
    let run = run(model);
    let _ = model.outside(std::slice::from_ref(&run));
    assert_eq!(model.check(std::slice::from_ref(&run)), Ok(()));
    let ranges = model.output_ranges();
    let options = evaluate::Options { horizon: 3, ..evaluate::Options::default() };
    let runs = [&run];
    let _ = evaluate("fuzz", model.session().as_mut(), &ranges, &runs, &options, &mut silent());
    adapted(model);
    simulated(model);
    controlled(model);
    rewritten(model);
}

/// Steps, a rollout, and a snapshot of a session.
fn used(session: &mut dyn Predictor) {
    let (n, m) = (session.outputs(), session.inputs());
    for k in 0..3 {
        session.observe_heading(0.1 * f64::from(k));
        session.observe(&vec![0.1 * f64::from(k); n]);
        session.advance(&vec![0.2; m]);
    }
    session.observe(&vec![f64::NAN; n]);
    let mut snapshot = vec![0.0; session.snapshot_len()];
    session.snapshot(&mut snapshot);
    let rollout = |session: &dyn Predictor| {
        let mut y = vec![0.0; 4 * n];
        session.rollout(&vec![0.1; 4 * m], &mut Workspace::new(), &mut y);
        y
    };
    let predicted = rollout(session);
    let mut fork = session.fork();
    fork.restore(&snapshot);
    same(&rollout(fork.as_ref()), &predicted, "a restored snapshot predicts the same");
    session.reset();
}

fn same(a: &[f64], b: &[f64], what: &str) {
    let equal = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
    assert!(a.len() == b.len() && a.iter().zip(b).all(equal), "{what}: {a:?} and {b:?}");
}

fn sessions(model: &Model) {
    used(model.session().as_mut());
    used(model.frozen().session().as_mut());
    for member in model.member_sessions().iter_mut().take(3) {
        used(member.as_mut());
    }
}

/// The channels of a model in a short log.
pub(crate) fn run(model: &Model) -> Trajectory {
    let description = &model.description;
    let table = |channels: Vec<Channel>, phase: f64| {
        let count = channels.len();
        let value = |k: usize| 0.3 * ((k / count.max(1)) as f64 * 0.7 + phase).sin();
        Table::new(channels, (0..SAMPLES * count).map(value).collect())
    };
    Trajectory {
        name: "fuzz".to_owned(),
        t0: 0.0,
        dt: description.dt,
        outputs: table(description.outputs.iter().map(|port| port.channel.clone()).collect(), 0.0),
        inputs: table(description.inputs.iter().map(|port| port.channel.clone()).collect(), 1.0),
        truth: None,
        heading: Some((0..SAMPLES).map(|k| 0.1 * k as f64).collect()),
        position: None,
    }
}

fn texts(model: &Model) {
    let _ = (model.kind(), model.title(), model.weights(), model.description.stated());
    let lines = [model.network_text(), model.scaling_text(), model.plant_text()];
    assert!(lines.iter().flatten().all(|line| !line.is_empty()));
    let _ = (model.description.rate_limits_text(), model.named_members());
    let named = |motion: NamedEquations<'_>| {
        let _ = (motion.equations_text(), motion.signals_text(), motion.units_text());
        let _ = (motion.coefficients_text(), motion.correlations_text(), motion.gates_text());
        let _ = (motion.coefficient_uncertainty(), motion.jacobian_text());
        let latex = [motion.equations_latex(), motion.units_latex(), motion.coefficients_latex()];
        for text in latex {
            assert_eq!(text.matches("\\begin{").count(), text.matches("\\end{").count(), "{text}");
        }
    };
    model.equations().into_iter().chain(model.base_equations()).for_each(named);
}

/// The adapters of a model, alone and guarded: samples, bands, and their state saved and loaded.
fn adapted(model: &Model) {
    let mut options = adapt::Options::of(model);
    let n = model.description.outputs.len();
    options.kalman.noise = Some(vec![0.01; n]);
    let filter = adapt::Options { method: Method::Kalman, ..options.clone() };
    let is_equations = matches!(model.body, Body::Equations(_));
    for options in std::iter::once(options).chain(is_equations.then_some(filter)) {
        for options in [options.clone(), options.guarded(model)] {
            let Ok((mut adapter, _)) = adapt::adapter(model, &options, &[]) else { continue };
            used_adapter(adapter.as_mut());
            let memory = Memory::saved(|memory| adapter.visit_state(memory));
            let (mut other, _) = adapt::adapter(model, &options, &[]).expect("the same options");
            other.load(&memory);
            let again = Memory::saved(|memory| other.visit_state(memory));
            same(&again, &memory, "a loaded state is saved as it was");
            served(model, adapter);
        }
    }
    if let Ok(with_current) = model.with_current(0.3) {
        used(with_current.session().as_mut());
    }
}

fn used_adapter(adapter: &mut dyn Adapter) {
    used(adapter);
    let (n, m) = (adapter.outputs(), adapter.inputs());
    for k in 0..3 {
        adapter.observe(&vec![0.1 * f64::from(k); n]);
        let _ = (adapter.outcome(), adapter.innovations(), adapter.weights(), adapter.health());
        let mut deviations = vec![0.0; 2 * n];
        adapter.deviations(&vec![0.1; 2 * m], &[1, 2], &mut Workspace::new(), &mut deviations);
        adapter.advance(&vec![0.1; m]);
    }
}

/// A stream of the model answers every line.
fn served(model: &Model, adapter: Box<dyn Adapter>) {
    let reading = model.description.reading.clone();
    let options = Options { name: "fuzz".to_owned(), reading, horizons: vec![1, 3], timing: false };
    let Ok(mut stream) = Stream::new(model, adapter, options) else { return };
    let ports = || model.description.outputs.iter().chain(&model.description.inputs);
    for k in 0..3 {
        let t = f64::from(k) * model.description.dt;
        let mut line = serde_json::Map::from_iter([("t".to_owned(), t.into())]);
        line.extend(ports().map(|port| (port.channel.name.clone(), 0.1.into())));
        let line = serde_json::Value::Object(line).to_string();
        let mut answer = Vec::new();
        // The reading of the file may name other columns.
        if stream.serve(Line::Whole(line.as_bytes()), &mut answer).is_err() {
            return;
        }
        assert_eq!(answer.iter().filter(|byte| **byte == b'\n').count(), 1);
    }
}

fn simulated(model: &Model) {
    let _ = InputMap::find(model);
    let members = Simulation::of_members(model).unwrap_or_default();
    for mut simulation in Simulation::new(model).into_iter().chain(members.into_iter().take(2)) {
        let d = &model.description;
        simulation.start([0.0; 3], &vec![0.1; d.outputs.len()], &vec![0.1; d.inputs.len()]);
        for _ in 0..3 {
            simulation.advance(&vec![0.2; d.inputs.len()]);
        }
    }
}

/// Options of a controller of a vessel that the model describes.
pub(crate) fn controller(model: &Arc<Model>, method: ControlMethod) -> ControllerOptions {
    let plant = Arc::clone(model).into();
    let mut options = ControllerOptions::new(method, &plant, model.description.dt);
    options.model = Some(Arc::clone(model));
    (options.planner.candidates, options.planner.elites) = (8, 2);
    (options.planner.horizon, options.planner.iterations) = (4, 1);
    options
}

/// A stream that is steered by each control law answers with finite commands.
fn controlled(model: &Model) {
    let model = Arc::new(model.clone());
    let track = Track::new(&Task::Circle { radius: 10.0 }, &SpeedOptions::cruise(1.0));
    let track = track.expect("a valid track");
    let methods =
        [ControlMethod::FeedbackLinearization, ControlMethod::Backstepping, ControlMethod::CrossEntropy];
    for method in methods {
        let options = controller(&model, method);
        let Ok(pilot) = Pilot::new(&options, track.clone(), 1, None) else { continue };
        let Ok((mut adapter, _)) = adapt::adapter(&model, &options_with_noise(&model), &[]) else { return };
        adapter.freeze(true);
        let reading = model.description.reading.clone();
        let options = stream::Options { name: "fuzz".to_owned(), reading, horizons: vec![2], timing: false };
        let Ok(mut stream) = Stream::new(&model, adapter, options) else { return };
        if stream.steer(pilot, Position::default()).is_err() {
            return;
        }
        for k in 0..3 {
            let t = f64::from(k) * model.description.dt;
            let mut line =
                serde_json::json!({ "t": t, "x": 0.1 * t, "y": 0.0, "psi": 0.1 }).as_object().cloned();
            let line = line.as_mut().expect("an object");
            for port in &model.description.outputs {
                line.insert(port.channel.name.clone(), 0.1.into());
            }
            let line = serde_json::Value::from(line.clone()).to_string();
            let mut answer = Vec::new();
            if stream.serve(Line::Whole(line.as_bytes()), &mut answer).is_err() {
                return;
            }
            let answer: serde_json::Value = serde_json::from_slice(&answer).expect("an answer");
            let commands = answer["command"].as_object().expect("a command");
            assert!(commands.values().all(serde_json::Value::is_number), "{answer}");
        }
    }
}

fn options_with_noise(model: &Model) -> adapt::Options {
    let mut options = adapt::Options::of(model);
    options.kalman.noise = Some(vec![0.01; model.description.outputs.len()]);
    options
}

/// A written model is read back, and written to the same bytes.
fn rewritten(model: &Model) {
    if model.is_vessel() {
        return;
    }
    let path = Path::new("fuzz.safetensors");
    let written = encode(model).expect("a model that was read can be written");
    let again = decode(&written, path).unwrap_or_else(|error| panic!("a written model is refused: {error}"));
    assert_eq!(&again, model, "a written model is read back");
    assert!(encode(&again).expect("written again") == written, "a model is written to the same bytes");
}
