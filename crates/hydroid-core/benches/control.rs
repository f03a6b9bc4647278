//! Speed of a control step: the whole of it, from estimate to command.

#[path = "../tests/it/controllers/written.rs"]
mod written;

use std::sync::Arc;

use divan::{Bencher, black_box};
use hydroid_core::control::cem::{Cost, Planner, PlannerOptions};
use hydroid_core::control::{
    AdaptiveAugmentation, AdaptiveAugmentationOptions, AffineEquations, AffinePlant, Autopilot,
    AutopilotOptions, Backstepping, BacksteppingOptions, Controller, Estimate, FeedbackLinearization,
    FeedbackLinearizationOptions, HeadingGains, SpeedGains,
};
use hydroid_core::craft::Craft;
use hydroid_core::guidance::{LineOfSightOptions, Path, Reference, Side};
use hydroid_core::model::direct::{Direct, DirectSession, Perceptron};
use hydroid_core::model::recurrent::{BaseModel, Cell, Network, Recurrent, RecurrentSession, Scaling};
use hydroid_core::model::sparse::{Equations, EquationsSession};
use hydroid_core::model::{CraftModel, CraftSession};
use hydroid_core::predict::Predictor;
use written::{Force, equations};

fn main() {
    divan::main();
}

/// Known parameters; equations with a hidden lag (of the hydrofoil gated); the same with the force as an output.
const MODELS: [&str; 6] = [
    "simple, plant",
    "simple, equations",
    "simple, equations, force measured",
    "hydrofoil, plant",
    "hydrofoil, gated equations",
    "hydrofoil, gated equations, force measured",
];

fn vessel(name: &str) -> Craft {
    if name.starts_with("simple") { Craft::simple() } else { Craft::hydrofoil() }
}

fn model(name: &str) -> AffineEquations {
    let force = if name.ends_with("measured") { Force::Measured } else { Force::Hidden };
    AffineEquations::new(&equations(&vessel(name), force), [0, 1, 2]).expect("written so that it is affine")
}

/// Steps near the transition, turning: nothing in them is zero.
fn run(bencher: Bencher, controller: &mut dyn Controller) {
    let path = Path::circle([0.0, 0.0], 20.0, Side::Starboard, 0.0).expect("a circle");
    let reference = Reference::new(3.0, &path.at(3.0), 2.4, 0.02);
    let estimate =
        Estimate { eta: [20.1, 1.2, 1.6], nu: [2.4, -0.05, 0.12], current: [0.0; 2], actuators: &[] };
    let mut command = [0.0; 2];
    bencher.bench_local(|| controller.command(black_box(&estimate), black_box(&reference), &mut command));
}

#[divan::bench(args = MODELS, sample_size = 1_000)]
fn feedback_linearization(bencher: Bencher, name: &str) {
    let (vessel, settings) = (vessel(name), FeedbackLinearizationOptions::new(1.5));
    let limits = AffinePlant::limits(&vessel);
    if name.ends_with("plant") {
        let plant = AffinePlant::new(&vessel).expect("built in");
        run(bencher, &mut FeedbackLinearization::new(plant, &limits, 0.1, settings).expect("possible"));
    } else {
        run(bencher, &mut FeedbackLinearization::new(model(name), &limits, 0.1, settings).expect("possible"));
    }
}

#[divan::bench(args = MODELS, sample_size = 1_000)]
fn backstepping(bencher: Bencher, name: &str) {
    let (vessel, settings) = (vessel(name), BacksteppingOptions::new(1.5));
    let limits = AffinePlant::limits(&vessel);
    if name.ends_with("plant") {
        let plant = AffinePlant::new(&vessel).expect("built in");
        run(bencher, &mut Backstepping::new(plant, &limits, 0.1, settings).expect("possible"));
    } else {
        run(bencher, &mut Backstepping::new(model(name), &limits, 0.1, settings).expect("possible"));
    }
}

/// A sample, those at which the network learns among them.
#[divan::bench(sample_size = 1_000)]
fn learned_correction(bencher: Bencher) {
    let vessel = Craft::simple();
    let plant = AffinePlant::new(&vessel).expect("built in");
    let (limits, settings) = (AffinePlant::limits(&vessel), FeedbackLinearizationOptions::new(1.5));
    let base = FeedbackLinearization::new(plant, &limits, 0.1, settings).expect("possible");
    let settings = AdaptiveAugmentationOptions::default();
    run(bencher, &mut AdaptiveAugmentation::new(base, settings, 1).expect("possible"));
}

#[divan::bench(sample_size = 1_000)]
fn autopilot(bencher: Bencher) {
    let settings = AutopilotOptions {
        line_of_sight: LineOfSightOptions { lookahead: 5.0, integral: 0.1 },
        heading: HeadingGains::nomoto(1.2, 0.6, 1.0, 1.0, 2.0),
        speed: SpeedGains { proportional: 40.0, integral: 5.0, trim: [0.0, 47.0] },
        steerage: 0.3,
        tolerance: 3.0,
    };
    let limits = AffinePlant::limits(&Craft::hydrofoil());
    run(bencher, &mut Autopilot::new(limits.first_chunk().expect("two"), 0.1, settings).expect("possible"));
}

fn scaling() -> Scaling {
    Scaling {
        output_mean: vec![0.0; 3],
        output_scale: vec![1.0; 3],
        input_mean: vec![0.0; 2],
        input_scale: vec![100.0, 1.0],
        correction_scale: vec![1.0; 3],
    }
}

/// Equations with one integration step in a sample, as identification makes them; recurrent networks of 18 cells, on their own
/// or on the equations of the simple vessel; the direct predictor of the thesis, 58-256-256-256-60.
fn session(name: &str) -> Box<dyn Predictor> {
    let number = |k: usize| (1.7 * k as f64).sin();
    let recurrent = |cell, base, feedback| -> Box<dyn Predictor> {
        let read_out = !matches!(cell, Cell::Lstm { .. });
        let network = Network { cell, inputs: if feedback { 5 } else { 2 }, outputs: 3, read_out };
        let weights = (0..network.weights()).map(|k| 0.3 * number(k)).collect();
        let scaling = scaling();
        let model = Recurrent { network, weights, scaling, base, feedback, wash_out: 1 };
        Box::new(RecurrentSession::new(Arc::new(model)).expect("parts that fit"))
    };
    match name {
        "LSTM" => recurrent(Cell::Lstm { hidden: 18, projection: Some(3) }, BaseModel::Nothing, false),
        "GRU" => recurrent(Cell::Gru { hidden: 18 }, BaseModel::Nothing, false),
        "GRU on equations" => {
            let base = BaseModel::Equations(Arc::new(one_step("simple")));
            recurrent(Cell::Gru { hidden: 18 }, base, true)
        }
        "direct" => {
            let (inputs, outputs) = Direct::lengths(4, 20, 3, 2);
            let network = Perceptron { inputs, hidden: vec![256; 3], outputs };
            let weights = (0..network.weights()).map(|k| 0.1 * number(k)).collect();
            let model = Direct {
                network,
                weights,
                scaling: scaling(),
                history: 4,
                horizon: 20,
                base: BaseModel::Nothing,
            };
            Box::new(DirectSession::new(Arc::new(model)).expect("parts that fit"))
        }
        name if name.ends_with("vessel") => {
            let model = CraftModel::new(vessel(name), 0.1).expect("built in");
            Box::new(CraftSession::new(&model))
        }
        name => Box::new(EquationsSession::new(Arc::new(one_step(name)))),
    }
}

/// Equations with one integration step in a sample, as identification makes them.
fn one_step(name: &str) -> Equations {
    let fine = equations(&vessel(name), Force::Hidden);
    let (terms, coefficients, signals) =
        (fine.terms().to_vec(), fine.coefficients().to_vec(), fine.signals().to_vec());
    Equations::with_signals(terms, coefficients, 3, 2, signals, 0.1, 1).expect("as before")
}

const PLANNED: [&str; 8] = [
    "simple, vessel",
    "hydrofoil, vessel",
    "simple, equations",
    "hydrofoil, gated equations",
    "LSTM",
    "GRU",
    "GRU on equations",
    "direct",
];

/// A whole plan: 350 candidates side by side, 20 samples ahead, 5 iterations.
#[divan::bench(args = PLANNED, sample_count = 20)]
fn cem(bencher: Bencher, name: &str) {
    let mut session = session(name);
    begin(session.as_mut());
    plans(bencher, session.as_ref());
}

fn begin(session: &mut dyn Predictor) {
    for _ in 0..5 {
        session.observe(&[2.4, -0.05, 0.12]);
        session.advance(&[100.0, 0.1]);
    }
    session.observe(&[2.4, -0.05, 0.12]);
}

fn plans(bencher: Bencher, session: &dyn Predictor) {
    let limits = AffinePlant::limits(&Craft::hydrofoil());
    // What is drawn alone: steps downhill are 49 candidates each.
    let settings = PlannerOptions {
        candidates: 350,
        elites: 35,
        iterations: 5,
        gauss_newton_steps: 0,
        ..PlannerOptions::new(1)
    };
    let mut planner = Planner::new(settings, Cost::tracking(2), &limits, 3, 0.1, 5.0).expect("possible");
    let path = Path::circle([0.0, 0.0], 20.0, Side::Starboard, 0.0).expect("a circle");
    let at = |k: u32| Reference::new(0.24 * f64::from(k), &path.at(0.24 * f64::from(k)), 2.4, 0.0);
    let references: Vec<Reference> = (1..=20).map(at).collect();
    let (mut command, pose) = ([0.0; 2], [20.1, 0.0, 1.57]);
    bencher
        .bench_local(|| planner.command(session, pose, black_box(&references), &mut || false, &mut command));
}
