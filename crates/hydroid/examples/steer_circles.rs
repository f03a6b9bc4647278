//! Circles steered with what was identified: feedback linearization of a point ahead of the vessel, on known parameters,
//! on hydroid's equations, and on polynomials as the thesis identified them.
//!
//! ```text
//! cargo run --release -p hydroid --example steer_circles
//! cargo run --release -p hydroid --example steer_circles -- 600
//! cargo run --release -p hydroid --example steer_circles -- 7200 1 1
//! ```
//!
//! The numbers are the length of the training log in seconds, two hours if none is given, then bandwidth \[rad/s\] and
//! damping of the feedback linearization, if not its own (1 and 1 are those of an independent implementation that the
//! figures can be compared with). Logs are those of `hydroid simulate`: mixed commands, samples of 0.1 s, the vessel's
//! measurement noise, seed 0 to learn from, seed 2 (ten minutes) to choose on.
//!
//! Tasks: the simple vessel on a circle of 10 m at 1.5 m/s, the point 1 m ahead; the hydrofoil on circles of 15, 25 and 30
//! m at 1.5, 2.5 and 4 m/s, which are its low speed, the middle of taking off, and flying, the point 1.5 m ahead. They
//! begin under way, half a metre off. The plant is the true one, commands within its limits and held for 0.1 s, RK4 in
//! steps of 10 ms; the pose is measured exactly, velocities with and without noise.
//!
//! Figures: root mean square distance of the point from its reference from 40 s to 120 s \[m\], with noise the median over
//! five seeds; and the share of samples with a status that is not `tracking`, gravest first.

// A test includes this file as a module; neither has an outside.
#![allow(unreachable_pub, missing_docs)]

use std::sync::Arc;

use hydroid::closed_loop::{self, Conditions, ControlLaw, Metrics, Scenario, SpeedOptions, Timing, Track};
use hydroid::excitation::Excitation;
use hydroid::identify::{GivenRanges, Job, Method, Networks, SindySettings, identify};
use hydroid::log::{Split, Trajectory};
use hydroid::model::{Body, Reading};
use hydroid::progress::silent;
use hydroid::simulate::{self, simulate};
use hydroid::sindy::{
    Constraints, FitOptions, Library, LinearRegression, Optimizer, RegressionForm, Scaling, Variables,
};
use hydroid_core::control::{
    AffineEquations, AffineNetwork, AffinePlant, Backstepping, BacksteppingOptions, Controller,
    FeedbackLinearization, FeedbackLinearizationOptions, Status,
};
use hydroid_core::model::affine::ControlAffine;
use hydroid_core::model::sparse::{Equations, Term};
use hydroid_core::vessel::VesselParams;

/// What moves.
pub const MOTION: [&str; 3] = ["u", "v", "r"];
/// The same with the force of the propeller, where it is measured.
pub const WITH_FORCE: [&str; 4] = ["u", "v", "r", "P_f"];
/// Sample time \[s\].
pub const DT: f64 = 0.1;
const DURATION_S: f64 = 120.0;
const SETTLED_S: f64 = 40.0;
/// Seeds of the noise under way.
pub const SEEDS: [u64; 5] = [1, 2, 3, 4, 5];

/// A circle.
#[derive(Clone, Copy)]
pub struct Task {
    pub radius: f64,
    pub speed: f64,
    pub ahead: f64,
}

pub const SIMPLE: Task = Task { radius: 10.0, speed: 1.5, ahead: 1.0 };
pub const HYDROFOIL: [Task; 3] = [
    Task { radius: 15.0, speed: 1.5, ahead: 1.5 },
    Task { radius: 25.0, speed: 2.5, ahead: 1.5 },
    Task { radius: 30.0, speed: 4.0, ahead: 1.5 },
];

/// What became of a circle.
pub struct Outcome {
    /// Root mean square distance from the reference \[m\].
    pub rms: f64,
    /// Share of samples with each status, as [`Status::ALL`] has them.
    pub shares: [f64; 6],
}

/// Sails a circle with noise of a scale and a seed; `measured` says whether the propeller's force is told.
pub fn circle(
    vessel: &VesselParams,
    task: Task,
    controller: &mut dyn Controller,
    measured: bool,
    (noise, seed): (f64, u64),
) -> Outcome {
    let circle = closed_loop::Task::Circle { radius: task.radius };
    let course = Track::new(&circle, &SpeedOptions::cruise(task.speed)).expect("a circle");
    let scene =
        Scenario { duration_s: DURATION_S, start: [0.0, -0.5], ..Scenario::new(vessel.clone(), course) };
    let conditions = Conditions { noise, ..Conditions::calm(seed) };
    let mut controller = ControlLaw { controller, lead: task.ahead, timing: Timing::Clock, force: measured };
    let run =
        closed_loop::run(&scene, &conditions, &mut controller, &mut silent()).expect("built-in vessels sail");
    let metrics = Metrics::of(&run, SETTLED_S);
    let count = |status: Status| metrics.status.get(status.name()).copied().unwrap_or(0);
    let samples = run.samples.len() as f64;
    Outcome { rms: metrics.rms_position, shares: Status::ALL.map(|status| count(status) as f64 / samples) }
}

/// With clean velocities, and the median with noisy ones.
pub fn both(
    vessel: &VesselParams,
    task: Task,
    controller: &mut dyn Controller,
    measured: bool,
) -> [Outcome; 2] {
    let clean = circle(vessel, task, controller, measured, (0.0, 0));
    let mut noisy: Vec<Outcome> =
        SEEDS.iter().map(|&seed| circle(vessel, task, controller, measured, (1.0, seed))).collect();
    noisy.sort_by(|a, b| a.rms.total_cmp(&b.rms));
    [clean, noisy.swap_remove(SEEDS.len() / 2)]
}

/// A run under mixed commands.
pub fn run(vessel: &VesselParams, outputs: &[&str], duration_s: f64, seed: u64) -> Trajectory {
    let options =
        simulate::Options { duration_s, seed, ..simulate::Options::new(vessel.clone(), Excitation::Mixed) };
    let record = simulate(&options, &mut silent()).expect("the built-in vessels can be simulated");
    record.to_trajectory(outputs).expect("these are measured")
}

/// The physics of a vessel with quadratic drag, and one function of each command: equations of these terms are always
/// affine.
pub const PHYSICAL: [&str; 12] =
    ["u", "v", "r", "u |u|", "v |v|", "r |r|", "u r", "v r", "r^2", "u v", "PP_cmd", "u sin(RD_ang)"];

/// What hydroid finds, of terms that are given or, without any, when nothing is set.
pub fn identified(vessel: &VesselParams, train_s: f64, terms: &[&str]) -> Arc<Equations> {
    let sindy =
        SindySettings { terms: terms.iter().map(ToString::to_string).collect(), ..SindySettings::default() };
    match learned(vessel, train_s, Method::Sindy, sindy) {
        Body::Equations(equations) => equations,
        _ => unreachable!("the method gives equations"),
    }
}

/// A control-affine network, when nothing is set.
pub fn network(vessel: &VesselParams, train_s: f64) -> Arc<ControlAffine> {
    match learned(vessel, train_s, Method::Affine, SindySettings::default()) {
        Body::Affine(network) => network,
        _ => unreachable!("the method gives a control-affine network"),
    }
}

/// What a method learns.
fn learned(vessel: &VesselParams, train_s: f64, method: Method, sindy: SindySettings) -> Body {
    let outputs = &MOTION[..];
    let split = Split {
        train: vec![run(vessel, outputs, train_s, 0)],
        validation: vec![run(vessel, outputs, 600.0, 2)],
        test: vec![run(vessel, outputs, 600.0, 1)],
        notes: Vec::new(),
    };
    let job = Job {
        methods: vec![method],
        split,
        reading: Reading::default(),
        horizon: 100,
        origin_stride: 20,
        seed: 0,
        ranges: GivenRanges::new(),
        networks: Networks::default(),
        sindy,
    };
    let mut found = identify(&job, &mut silent()).expect("the built-in vessels are identified");
    found.candidates.swap_remove(0).model.body
}

/// A polynomial with thresholded or eliminated terms, forces in 100 N. Terms with more than one effort (a command, or the
/// propeller's force) are left out: no law could invert them.
pub fn polynomial(
    data: &Trajectory,
    degree: u8,
    regression: RegressionForm,
    optimizer: Optimizer,
) -> Equations {
    let efforts = |term: &Term| {
        let factors = term.factors().iter().filter(|f| usize::from(f.variable) >= MOTION.len());
        factors.map(|f| f.shape.degree()).sum::<i32>()
    };
    let mut terms = Library::polynomial(degree).terms(&Variables::of(data));
    terms.retain(|term| efforts(term) <= 1);
    let mut scales = vec![1.0; data.outputs.width() + 2];
    scales[MOTION.len()..=data.outputs.width()].fill(100.0);
    let scaling = Scaling::Variables(scales);
    let prepared =
        LinearRegression::new(&[data], terms, regression, &scaling).expect("enough rows for a polynomial");
    let options = FitOptions { optimizer, ridge: 0.0, substeps: 1, constraints: Constraints::default() };
    prepared.fit(&options).expect("nothing constrains it").equations
}

/// The simple vessel with its force measured, as an independent implementation identified it: degree 2, weak form over 20
/// samples.
pub fn with_measured_force(train_s: f64) -> Equations {
    let data = run(&VesselParams::simple(), &WITH_FORCE, train_s, 0);
    polynomial(&data, 2, RegressionForm::Weak { intervals: 20 }, Optimizer::Stepwise(0.01))
}

/// The law on known parameters.
pub fn on_plant(vessel: &VesselParams, ahead: f64, gains: Gains) -> FeedbackLinearization<AffinePlant> {
    let model = AffinePlant::new(vessel).expect("built in");
    FeedbackLinearization::new(model, &AffinePlant::limits(vessel), DT, settings(ahead, gains))
        .expect("possible settings")
}

/// Equations as laws invert them.
///
/// # Errors
/// Why they cannot, with the names of the log.
pub fn affine(vessel: &VesselParams, equations: &Equations) -> Result<AffineEquations, String> {
    let commands = [&vessel.commands.propeller.name, &vessel.commands.rudder.name];
    let mut names: Vec<String> = WITH_FORCE[..equations.outputs()].iter().map(ToString::to_string).collect();
    names.extend(commands.into_iter().cloned());
    let signals: Vec<String> = equations.signals().iter().map(|signal| signal.name(&names, DT)).collect();
    names.extend(signals);
    AffineEquations::new(equations, [0, 1, 2]).map_err(|error| error.with_names(&names))
}

/// The law on equations.
///
/// # Errors
/// Why they cannot be inverted.
pub fn on_equations(
    vessel: &VesselParams,
    equations: &Equations,
    ahead: f64,
    gains: Gains,
) -> Result<FeedbackLinearization<AffineEquations>, String> {
    let model = affine(vessel, equations)?;
    FeedbackLinearization::new(model, &AffinePlant::limits(vessel), DT, settings(ahead, gains))
        .map_err(|error| error.to_string())
}

/// The law on a network.
///
/// # Errors
/// Why it cannot be inverted.
pub fn on_network(
    vessel: &VesselParams,
    network: &Arc<ControlAffine>,
    ahead: f64,
    gains: Gains,
) -> Result<FeedbackLinearization<AffineNetwork>, String> {
    AffineNetwork::new(Arc::clone(network))
        .and_then(|model| {
            FeedbackLinearization::new(model, &AffinePlant::limits(vessel), DT, settings(ahead, gains))
        })
        .map_err(|error| error.to_string())
}

/// Bandwidth \[rad/s\] and damping; none for those of the law.
pub type Gains = Option<(f64, f64)>;

fn settings(ahead: f64, gains: Gains) -> FeedbackLinearizationOptions {
    let own = FeedbackLinearizationOptions::new(ahead);
    gains.map_or(own, |(omega, zeta)| own.with_bandwidth(omega, zeta))
}

/// Statuses that were more than a thousandth of the samples, gravest first.
fn statuses(shares: &[f64; 6]) -> String {
    let told: Vec<String> = Status::ALL
        .iter()
        .zip(shares)
        .rev()
        .filter(|(status, share)| **status != Status::Tracking && **share > 1e-3)
        .map(|(status, share)| format!("{status} {:.1} %", 100.0 * share))
        .collect();
    told.join(", ")
}

fn row<C: Controller>(name: &str, vessel: &VesselParams, task: Task, law: Result<C, String>, measured: bool) {
    let told = match law {
        Ok(mut law) => {
            let [clean, noisy] = both(vessel, task, &mut law, measured);
            format!("{:>8.5} | {:>8.5} | {}", clean.rms, noisy.rms, statuses(&noisy.shares))
        }
        Err(error) => format!("       - |        - | refused: {error}"),
    };
    println!("| {name:<45} | {:>3} | {told} |", task.speed);
}

fn main() -> Result<(), std::num::ParseFloatError> {
    let numbers: Vec<f64> = std::env::args().skip(1).map(|text| text.parse()).collect::<Result<_, _>>()?;
    let train_s = numbers.first().copied().unwrap_or(7_200.0);
    let gains = if let [_, omega, zeta, ..] = numbers[..] { Some((omega, zeta)) } else { None };
    println!("| model | m/s | clean [m] | noisy [m] | not tracking, noisy |");
    println!("| --- | ---: | ---: | ---: | --- |");

    let vessel = VesselParams::simple();
    let task = SIMPLE;
    row("simple: true parameters", &vessel, task, Ok(on_plant(&vessel, task.ahead, gains)), false);
    let found = identified(&vessel, train_s, &[]);
    row(
        "simple: hydroid, nothing set",
        &vessel,
        task,
        on_equations(&vessel, &found, task.ahead, gains),
        false,
    );
    let measured = with_measured_force(train_s);
    let law = on_equations(&vessel, &measured, task.ahead, gains);
    row("simple: degree 2, weak form, force measured", &vessel, task, law, true);

    let vessel = VesselParams::hydrofoil();
    let data = run(&vessel, &MOTION, train_s, 0);
    let found = identified(&vessel, train_s, &[]);
    let mut models = vec![
        (String::from("hydrofoil: hydroid, nothing set"), Arc::clone(&found)),
        (String::from("hydrofoil: hydroid, physical terms"), identified(&vessel, train_s, &PHYSICAL)),
    ];
    for (name, regression) in
        [("central", RegressionForm::Central), ("smoothed 51", RegressionForm::Smoothed { half: 25 })]
    {
        for degree in [2, 3] {
            for threshold in [0.0, 0.05, 0.2, 0.5] {
                let name = format!("hydrofoil: degree {degree}, {name}, {threshold}");
                let fitted = polynomial(&data, degree, regression, Optimizer::Stlsq(threshold));
                models.push((name, Arc::new(fitted)));
            }
        }
    }
    let net = network(&vessel, train_s);
    for task in HYDROFOIL {
        row("hydrofoil: true parameters", &vessel, task, Ok(on_plant(&vessel, task.ahead, gains)), false);
        for (name, equations) in &models {
            row(name, &vessel, task, on_equations(&vessel, equations, task.ahead, gains), false);
        }
        let law = on_network(&vessel, &net, task.ahead, gains);
        row("hydrofoil: control-affine network", &vessel, task, law, false);
        let stepped = affine(&vessel, &found).and_then(|model| {
            let settings = BacksteppingOptions::new(task.ahead);
            Backstepping::new(model, &AffinePlant::limits(&vessel), DT, settings)
                .map_err(|error| error.to_string())
        });
        row("hydrofoil: hydroid, backstepping", &vessel, task, stepped, false);
    }
    Ok(())
}
