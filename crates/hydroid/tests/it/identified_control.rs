//! Feedback linearization with identified equations on the true plant. Equations that are not invertible are refused,
//! and a controller that loses the track reports it.

use std::sync::Arc;

use hydroid::closed_loop::{self, Conditions, ControlLaw, Metrics, Scenario, SpeedOptions, Timing, Track};
use hydroid::excitation::Excitation;
use hydroid::identify::{
    GivenRanges, Job, Method, MotionOption, NetworkTrainingOptions, RateLimitOption, SindyOptions, identify,
};
use hydroid::log::{Split, Trajectory};
use hydroid::model::{Body, Reading};
use hydroid::progress::silent;
use hydroid::simulate::{self, simulate};
use hydroid::sindy::{
    Constraints, FitOptions, Library, LinearRegression, Optimizer, RegressionForm, Scaling, Variables,
};
use hydroid_core::control::{
    AffineEquations, AffinePlant, Controller, FeedbackLinearization, FeedbackLinearizationOptions, Status,
};
use hydroid_core::craft::Craft;
use hydroid_core::model::sparse::{Equations, Term};

const MOTION: [&str; 3] = ["u", "v", "r"];
const WITH_FORCE: [&str; 4] = ["u", "v", "r", "P_f"];
const DT: f64 = 0.1;
const SEEDS: [u64; 5] = [1, 2, 3, 4, 5];
/// Terms of a vessel with quadratic drag and one function of each command: affine in the commands.
const PHYSICAL: [&str; 12] =
    ["u", "v", "r", "u |u|", "v |v|", "r |r|", "u r", "v r", "r^2", "u v", "PP_cmd", "u sin(RD_ang)"];

/// A circle of a radius \[m\] at a speed \[m/s\], of a point at a distance ahead of the origin \[m\].
#[derive(Clone, Copy)]
struct Task {
    radius: f64,
    speed: f64,
    lead: f64,
}

const SIMPLE: Task = Task { radius: 10.0, speed: 1.5, lead: 1.0 };
/// Circles at low speed, at take-off and in flight.
const HYDROFOIL: [Task; 3] = [
    Task { radius: 15.0, speed: 1.5, lead: 1.5 },
    Task { radius: 25.0, speed: 2.5, lead: 1.5 },
    Task { radius: 30.0, speed: 4.0, lead: 1.5 },
];

struct Outcome {
    /// Root mean square distance from the reference from 40 s on \[m\].
    rms: f64,
    /// Share of the samples with each status, in the order of [`Status::ALL`].
    shares: [f64; 6],
}

/// An independent implementation of the same task gives 0.0003 m with clean and 0.0045 m with noisy velocities.
#[test]
fn equations_from_noisy_data_control_the_simple_vessel() {
    let vessel = Craft::simple();
    let equations = with_measured_force();
    let mut law = on_equations(&vessel, &equations, SIMPLE.lead).unwrap();
    let [clean, noisy] = both(&vessel, SIMPLE, &mut law, true);
    println!("force measured: {:.5} m clean, {:.5} m noisy", clean.rms, noisy.rms);
    assert!(clean.rms <= 0.0005 && noisy.rms <= 0.005);
    let [clean, noisy] = both(&vessel, SIMPLE, &mut on_plant(&vessel, SIMPLE.lead), false);
    assert!(clean.rms < 1e-6 && noisy.rms <= 0.0042);
}

/// An independent implementation, on two hours of data, gives 0.010, 0.016 and 0.018 m. Here ten minutes; lag and gate
/// are identified, the terms are given.
#[test]
fn identified_equations_control_the_hydrofoil_in_all_modes() {
    let vessel = Craft::hydrofoil();
    let equations = identified(&vessel, 600.0);
    for (task, limit) in HYDROFOIL.into_iter().zip([0.012, 0.020, 0.022]) {
        let mut law = on_equations(&vessel, &equations, task.lead).unwrap();
        let [clean, noisy] = both(&vessel, task, &mut law, false);
        println!("{} m/s: {:.5} m clean, {:.5} m noisy", task.speed, clean.rms, noisy.rms);
        assert!(noisy.rms <= limit, "{} m/s: {} m", task.speed, noisy.rms);
    }
}

/// Polynomial models. A threshold that removes the propeller leaves one command, which is refused. With smoothed
/// derivatives the controller loses the track and reports it. The errors of the others are ten times as large.
#[test]
fn polynomials_are_refused_lost_or_ten_times_as_far_from_the_reference() {
    let vessel = Craft::hydrofoil();
    let data = log(&vessel, &MOTION, 7_200.0, 0);
    let law = |degree, regression, threshold| {
        let equations = polynomial(&data, degree, regression, Optimizer::Stlsq(threshold));
        on_equations(&vessel, &equations, HYDROFOIL[0].lead)
    };
    let refused = law(2, RegressionForm::Central, 0.5).map(|_| ()).unwrap_err();
    assert_eq!(refused, "1 of the commands move the vessel: a point in the plane needs at least 2");
    let mut smoothed = law(3, RegressionForm::Smoothed { half: 25 }, 0.2).unwrap();
    let [_, lost] = both(&vessel, HYDROFOIL[2], &mut smoothed, false);
    let grave = |(status, share): (&Status, f64)| if *status >= Status::Lost { share } else { 0.0 };
    let grave: f64 = Status::ALL.iter().zip(lost.shares).map(grave).sum();
    println!("smoothed: {:.1} m, lost or singular in {grave:.3} of the samples", lost.rms);
    assert!(lost.rms > 5.0 && grave > 0.5);
    let [_, moderate] =
        both(&vessel, HYDROFOIL[0], &mut law(2, RegressionForm::Central, 0.05).unwrap(), false);
    println!("degree 2: {:.4} m", moderate.rms);
    assert!((0.02..0.3).contains(&moderate.rms));
}

/// Simulates a circle of 120 s with noise of a scale and a seed; `measured` passes the propeller's force to the
/// controller.
fn circle(
    vessel: &Craft,
    task: Task,
    controller: &mut (dyn Controller + Send + Sync),
    measured: bool,
    (noise, seed): (f64, u64),
) -> Outcome {
    let circle = closed_loop::Task::Circle { radius: task.radius };
    let track = Track::new(&circle, &SpeedOptions::cruise(task.speed)).unwrap();
    let scenario = Scenario { duration_s: 120.0, start: [0.0, -0.5], ..Scenario::new(vessel.clone(), track) };
    let conditions = Conditions { noise, ..Conditions::calm(seed) };
    let actuators = if measured { vec![Some(3), None] } else { Vec::new() };
    let mut controller = ControlLaw { controller, lead: task.lead, timing: Timing::Clock, actuators };
    let run = closed_loop::run(&scenario, &conditions, &mut controller, &mut silent()).unwrap();
    let metrics = Metrics::of(&run, 40.0);
    let count = |status: Status| metrics.status.get(status.name()).copied().unwrap_or(0);
    let samples = run.samples.len() as f64;
    Outcome { rms: metrics.rms_position, shares: Status::ALL.map(|status| count(status) as f64 / samples) }
}

/// The result with exact velocities, and the median over the seeds with noisy ones.
fn both(
    vessel: &Craft,
    task: Task,
    controller: &mut (dyn Controller + Send + Sync),
    measured: bool,
) -> [Outcome; 2] {
    let clean = circle(vessel, task, controller, measured, (0.0, 0));
    let mut noisy: Vec<Outcome> =
        SEEDS.iter().map(|&seed| circle(vessel, task, controller, measured, (1.0, seed))).collect();
    noisy.sort_by(|a, b| a.rms.total_cmp(&b.rms));
    [clean, noisy.swap_remove(SEEDS.len() / 2)]
}

fn log(vessel: &Craft, outputs: &[&str], duration_s: f64, seed: u64) -> Trajectory {
    let options =
        simulate::Options { duration_s, seed, ..simulate::Options::new(vessel.clone(), Excitation::Mixed) };
    simulate(&options, &mut silent()).unwrap().to_trajectory(outputs).unwrap()
}

fn identified(vessel: &Craft, train_s: f64) -> Arc<Equations> {
    let split = Split {
        train: vec![log(vessel, &MOTION, train_s, 0)],
        validation: vec![log(vessel, &MOTION, 600.0, 2)],
        test: vec![log(vessel, &MOTION, 600.0, 1)],
        notes: Vec::new(),
    };
    let job = Job {
        methods: vec![Method::Sindy],
        split,
        reading: Reading::default(),
        boat: hydroid::boat::Boat::default(),
        horizon: 100,
        origin_stride: 20,
        seed: 0,
        ranges: GivenRanges::new(),
        networks: NetworkTrainingOptions::default(),
        vessel: None,
        motion: MotionOption::default(),
        rate_limits: RateLimitOption::default(),
        allow_feedback: Vec::new(),
        sindy: SindyOptions {
            terms: PHYSICAL.iter().map(ToString::to_string).collect(),
            ..SindyOptions::default()
        },
    };
    let mut found = identify(&job, &mut silent()).unwrap();
    match found.candidates.swap_remove(0).model.body {
        Body::Equations(equations) => equations,
        _ => unreachable!("the method gives equations"),
    }
}

/// A polynomial model, with forces in 100 N, without terms in several commands or propeller forces.
fn polynomial(data: &Trajectory, degree: u8, regression: RegressionForm, optimizer: Optimizer) -> Equations {
    let efforts = |term: &Term| {
        let factors = term.factors().iter().filter(|f| usize::from(f.variable) >= MOTION.len());
        factors.map(|f| f.shape.degree()).sum::<i32>()
    };
    let mut terms = Library::polynomial(degree).terms(&Variables::of(data));
    terms.retain(|term| efforts(term) <= 1);
    let mut scales = vec![1.0; data.outputs.width() + 2];
    scales[MOTION.len()..=data.outputs.width()].fill(100.0);
    let scaling = Scaling::Variables(scales);
    let prepared = LinearRegression::new(&[data], terms, regression, &scaling).unwrap();
    let options = FitOptions { optimizer, ridge: 0.0, substeps: 1, constraints: Constraints::default() };
    prepared.fit(&options).unwrap().equations
}

/// The simple vessel with measured propeller force, as in an independent implementation: degree 2, weak form over 20
/// samples.
fn with_measured_force() -> Equations {
    let data = log(&Craft::simple(), &WITH_FORCE, 7_200.0, 0);
    polynomial(&data, 2, RegressionForm::Weak { intervals: 20 }, Optimizer::Stepwise(0.01))
}

fn on_plant(vessel: &Craft, lead: f64) -> FeedbackLinearization<AffinePlant> {
    let (model, limits) = (AffinePlant::new(vessel).unwrap(), AffinePlant::limits(vessel));
    FeedbackLinearization::new(model, &limits, DT, FeedbackLinearizationOptions::new(lead)).unwrap()
}

/// The controller with equations, or the reason why they cannot be inverted.
fn on_equations(
    vessel: &Craft,
    equations: &Equations,
    lead: f64,
) -> Result<FeedbackLinearization<AffineEquations>, String> {
    let model = affine(vessel, equations)?;
    let settings = FeedbackLinearizationOptions::new(lead);
    FeedbackLinearization::new(model, &AffinePlant::limits(vessel), DT, settings)
        .map_err(|error| error.to_string())
}

fn affine(vessel: &Craft, equations: &Equations) -> Result<AffineEquations, String> {
    let commands = [&vessel.commands[0].name, &vessel.commands[1].name];
    let mut names: Vec<String> = WITH_FORCE[..equations.outputs()].iter().map(ToString::to_string).collect();
    names.extend(commands.into_iter().cloned());
    let signals: Vec<String> = equations.signals().iter().map(|signal| signal.name(&names, DT)).collect();
    names.extend(signals);
    AffineEquations::new(equations, [0, 1, 2]).map_err(|error| error.with_names(&names))
}
