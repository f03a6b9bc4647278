//! On board nothing allocates: a counting allocator around the prediction sessions.
//!
//! One test only: the counter is the process's.
#![allow(unsafe_code)] // an allocator can be written in no other way

#[path = "it/controllers/written.rs"]
mod written;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use hydroid_core::actuator::Map;
use hydroid_core::adapt::guard::{Guard, GuardOptions};
use hydroid_core::adapt::kalman::{
    CovarianceForm, FilterOptions, KalmanEquations, KalmanNetwork, KalmanPlant, LearnableEquations,
    LearnablePlant, RehearsalOptions,
};
use hydroid_core::adapt::{
    Adapter, DirectLastLayer, ExpertMixture, ExpertMixtureOptions, InnovationGate, LastLayerOptions, Outcome,
    RecursiveEquations, RecursiveOptions, Rehearsing,
};
use hydroid_core::control::cem::{Cost, Planner, PlannerOptions};
use hydroid_core::control::{
    AdaptiveAugmentation, AdaptiveAugmentationOptions, AffineEquations, AffineNetwork, AffinePlant,
    Autopilot, AutopilotOptions, Backstepping, BacksteppingOptions, Controller, Estimate,
    FeedbackLinearization, FeedbackLinearizationOptions, HeadingGains, SpeedGains,
};
use hydroid_core::craft::Craft;
use hydroid_core::current::{CurrentOptions, ThroughWater};
use hydroid_core::guidance::{
    LineOfSight, LineOfSightOptions, Path, PathReference, Reference, Side, SpeedLimits, SpeedProfile,
    TimedReference,
};
use hydroid_core::model::affine::{ControlAffine, ControlAffineSession, Effector};
use hydroid_core::model::direct::{Batch, Direct, DirectSession, Perceptron};
use hydroid_core::model::recurrent::{
    BaseModel, Cell, Change, Linearization, Network, Packed, Recurrent, RecurrentSession, Rollout, Scaling,
    Tape,
};
use hydroid_core::model::sparse::{Equations, EquationsSession, Real, Signal, Term};
use hydroid_core::model::{CraftModel, CraftSession, Persistence};
use hydroid_core::predict::{Predictor, Workspace};
use hydroid_core::rate_limit::{RateLimited, RateLimiter};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is passed on to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promises are handed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are handed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Allocations during `work`; the least of several tries, because the test harness has a thread of its own.
fn allocations(mut work: impl FnMut()) -> usize {
    (0..5)
        .map(|_| {
            let before = ALLOCATIONS.load(Ordering::Relaxed);
            work();
            ALLOCATIONS.load(Ordering::Relaxed) - before
        })
        .min()
        .unwrap()
}

/// The same with an actuator's lag, and an output and an input of some samples ago.
fn with_signals(equations: &Equations) -> Equations {
    let signals = vec![
        Signal::Lag { input: 3, time_constant_s: Real(0.3) },
        Signal::Past { variable: 0, samples: 3 },
        Signal::Past { variable: 4, samples: 2 },
    ];
    let mut terms = equations.terms().to_vec();
    terms.extend((5..8).flat_map(|s| [Term::monomial(&[s]), Term::monomial(&[0, s])]));
    let coefficients = (0..3 * terms.len()).map(|k| 0.01 * ((k % 5) as f64 - 2.0)).collect();
    Equations::with_signals(terms, coefficients, 3, 2, signals, 0.1, 2).unwrap()
}

/// Equations that learn under guard, with tests so often that each of the samples that are watched has one.
fn guarded(equations: &Equations, options: &RecursiveOptions) -> Guard {
    let learner = || -> Box<dyn Adapter> {
        Box::new(RecursiveEquations::new(equations, &[(-1.0, 1.0); 5], options).unwrap())
    };
    let options = GuardOptions { horizon: 4, stride: 1, ..GuardOptions::new(0.1) };
    Guard::new(learner(), learner(), learner(), &[(-1.0, 1.0); 3], &[0.01; 3], options).unwrap()
}

fn a_step_allocates_nothing(equations: &Equations) {
    let (mut state, mut scratch) = (vec![0.1; equations.state_len()], vec![0.0; equations.scratch()]);
    let count = allocations(|| {
        for _ in 0..10 {
            equations.step(&mut state, &[0.2, -0.1], &mut scratch);
            equations.wait(&mut state, &[0.2, -0.1], &mut scratch);
        }
    });
    assert_eq!(count, 0, "allocations in a step");
    assert!(state.iter().all(|x| x.is_finite()));
}

/// A step with its derivatives, products with them, and new weights.
fn derivatives_allocate_nothing(network: Network) {
    let mut packed = Packed::new(network, &vec![0.1; network.weights()]);
    let mut linear = Linearization::new(&packed);
    let weights = vec![0.2; network.weights()];
    let (mut state, mut y) = (vec![0.0; network.state_len()], vec![0.0; network.outputs]);
    let (change, mut out) = (vec![0.1; weights.len()], vec![0.0; network.state_len()]);
    let mut scratch = vec![0.0; linear.scratch(1)];
    let count = allocations(|| {
        packed.set_weights(&weights);
        linear.step(&packed, &mut state, &[0.1, -0.2, 0.3, -0.4, 0.5][..network.inputs]);
        packed.output(&state, &mut y);
        let change = Change { weights: Some(&change), ..Change::default() };
        linear.times(&packed, change, 1, &mut out, &mut scratch);
        linear.output_times(&packed, change, 1, &mut y);
    });
    assert_eq!(count, 0, "allocations in derivatives");
}

/// Every cell, base and way of warming up.
fn recurrent_sessions(equations: &Arc<Equations>) -> Vec<Box<dyn Predictor>> {
    let mut sessions: Vec<Box<dyn Predictor>> = Vec::new();
    for cell in [
        Cell::Lstm { hidden: 6, projection: Some(3) },
        Cell::Gru { hidden: 6 },
        Cell::Vanilla { hidden: 6, layers: 2 },
    ] {
        for (base, feedback) in [
            (BaseModel::Nothing, false),
            (BaseModel::Hold, true),
            (BaseModel::Equations(equations.clone()), true),
        ] {
            let network = Network { cell, inputs: if feedback { 5 } else { 2 }, outputs: 3, read_out: true };
            derivatives_allocate_nothing(network);
            let weights = vec![0.1; network.weights()];
            let (ones, zeros) = (vec![1.0; 3], vec![0.0; 3]);
            let scaling = Scaling {
                output_mean: zeros.clone(),
                output_scale: ones.clone(),
                input_mean: zeros[..2].to_vec(),
                input_scale: ones[..2].to_vec(),
                correction_scale: ones,
            };
            let model = Arc::new(Recurrent { network, weights, scaling, base, feedback, wash_out: 5 });
            if !feedback {
                let filtered = KalmanNetwork::state_filter(Arc::clone(&model), 1e-4, 1.0, &[0.1; 3]);
                sessions.push(Box::new(filtered.unwrap()));
            }
            sessions.push(Box::new(RecurrentSession::new(model).unwrap()));
        }
    }
    sessions
}

fn rate_limited(adapter: Box<dyn Adapter>) -> RateLimited<dyn Adapter> {
    RateLimited::new(adapter, RateLimiter::new([None, Some(0.01)], 0.1).unwrap())
}

/// Hundreds of samples with a row at most of them.
fn learning_allocates_nothing(mut adapter: impl Adapter) {
    let mut learned = 0;
    let mut memory = vec![0.0; adapter.memory_len()];
    let (mut work, mut deviations) = (Workspace::new(), [0.0; 9]);
    adapter.deviations(&[0.1; 40], &[1, 7, 20], &mut work, &mut deviations);
    let count = allocations(|| {
        for k in 0..500 {
            let x = 0.01 * f64::from(k);
            adapter.observe(&[x.sin(), (1.3 * x).cos(), (2.1 * x).sin()]);
            adapter.advance(&[(0.7 * x).sin(), (0.4 * x).cos()]);
            learned += usize::from(adapter.outcome() != Outcome::Waiting);
            adapter.deviations(&[0.1; 40], &[1, 7, 20], &mut work, &mut deviations);
            adapter.save(&mut memory);
            adapter.load(&memory);
        }
    });
    // A guard lets it rest now and then.
    assert!(learned > 1000, "{learned}");
    assert_eq!(count, 0, "allocations while learning");
}

/// Networks that learn, whatever they keep of their covariance.
fn learning_networks_allocate_nothing() {
    for covariance in [CovarianceForm::Full, CovarianceForm::Blocks { group: 2 }] {
        let (cell, feedback, ones, zeros) = (Cell::Gru { hidden: 4 }, false, vec![1.0; 3], vec![0.0; 3]);
        let network = Network { cell, inputs: 2, outputs: 3, read_out: true };
        let weights: Vec<f64> = (0..network.weights()).map(|k| 0.3 * (k as f64).sin()).collect();
        let scaling = Scaling {
            output_mean: zeros.clone(),
            output_scale: ones.clone(),
            input_mean: zeros[..2].to_vec(),
            input_scale: ones[..2].to_vec(),
            correction_scale: ones,
        };
        let uniform = FilterOptions::uniform(weights.len(), 0.01, 1e-6, (1.0, 1e-4), &[0.1; 3]);
        let options = FilterOptions { leak: 1e-4, huber: 3.0, covariance, ..uniform };
        let base = BaseModel::Nothing;
        let model = Recurrent { network, weights, scaling, base, feedback, wash_out: 5 };
        let (windows, samples, initial_state) = (2, 10, 0.1);
        let rehearsal = RehearsalOptions { windows, samples, every: 2, initial_state, noise_factor: 1.0 };
        let mut session = KalmanNetwork::with_rehearsal(Arc::new(model), options, Some(rehearsal)).unwrap();
        session.store_window(&[0.1; 3 * 20], &[0.2; 2 * 20]);
        learning_allocates_nothing(session);
    }
}

/// Equations that learn by a filter.
fn filtered(equations: &Equations) -> KalmanEquations {
    let model = LearnableEquations::new(equations, &[(-1.0, 1.0); 5]).unwrap();
    let uniform = FilterOptions::uniform(model.places().len(), 0.01, 1e-6, (1.0, 1e-4), &[0.1; 3]);
    KalmanEquations::new(model, FilterOptions { leak: 1e-4, huber: 3.0, ..uniform }).unwrap()
}

/// A vessel that learns by a filter.
fn vessel(model: &CraftModel) -> KalmanPlant {
    let plant = LearnablePlant::new(model);
    let uniform = FilterOptions::uniform(plant.places().len(), 0.01, 1e-6, (1.0, 1e-4), &[0.1; 3]);
    KalmanPlant::new(model, FilterOptions { leak: 1e-4, huber: 3.0, ..uniform }).unwrap()
}

/// Every law on a vessel, and those with a model also on equations.
fn controllers() -> Vec<Box<dyn Controller>> {
    let vessel = Craft::hydrofoil();
    let limits = AffinePlant::limits(&vessel);
    let plant = || AffinePlant::new(&vessel).unwrap();
    let equations =
        || AffineEquations::new(&written::equations(&vessel, written::Force::Hidden), [0, 1, 2]).unwrap();
    let linearized = FeedbackLinearizationOptions { integral: 0.2, ..FeedbackLinearizationOptions::new(1.5) };
    let autopilot = AutopilotOptions {
        line_of_sight: LineOfSightOptions { lookahead: 5.0, integral: 0.1 },
        heading: HeadingGains::nomoto(1.2, 0.6, 1.0, 1.0, 2.0),
        speed: SpeedGains { proportional: 40.0, integral: 5.0, trim: [0.0, 47.0] },
        steerage: 0.3,
        tolerance: 3.0,
    };
    vec![
        Box::new(FeedbackLinearization::new(plant(), &limits, 0.1, linearized).unwrap()),
        Box::new(FeedbackLinearization::new(equations(), &limits, 0.1, linearized).unwrap()),
        Box::new(
            FeedbackLinearization::new(
                AffineNetwork::new(affine_network()).unwrap(),
                &limits,
                0.1,
                linearized,
            )
            .unwrap(),
        ),
        Box::new(Backstepping::new(plant(), &limits, 0.1, BacksteppingOptions::new(1.5)).unwrap()),
        Box::new(Backstepping::new(equations(), &limits, 0.1, BacksteppingOptions::new(1.5)).unwrap()),
        Box::new(Autopilot::new(limits.first_chunk().unwrap(), 0.1, autopilot).unwrap()),
        Box::new(
            AdaptiveAugmentation::new(
                FeedbackLinearization::new(plant(), &limits, 0.1, linearized).unwrap(),
                AdaptiveAugmentationOptions { window_s: 0.3, ..AdaptiveAugmentationOptions::default() },
                1,
            )
            .unwrap(),
        ),
    ]
}

/// Guidance and control, sample by sample; what is not measured as well.
fn steering_allocates_nothing() {
    let path = Path::lawn_mower([0.0, 0.0], 0.3, 30.0, 20.0, 3, 8.0, Side::Port).unwrap();
    let profile = SpeedProfile::new(&path, &SpeedLimits::cruise(2.0)).unwrap();
    let options = LineOfSightOptions { lookahead: 5.0, integral: 0.1 };
    for mut controller in controllers() {
        let (mut walker, mut follower) = (TimedReference::new(&profile), PathReference::new(0.0, 5.0));
        let mut sight = LineOfSight::new(options).unwrap();
        let mut command = [0.0; 2];
        let count = allocations(|| {
            for k in 0..100 {
                let x = 0.1 * f64::from(k);
                walker.advance(&profile, 0.1);
                let foot = follower.project(&path, [x, 0.2]);
                sight.update(&foot.pose, [x, 0.2], [1.0, 0.0], 0.1);
                let measured = [if k % 7 == 0 { f64::NAN } else { 20.0 }, f64::NAN];
                let nu = [if k % 11 == 0 { f64::NAN } else { 0.1 * x }, 0.0, 0.01];
                let estimate = Estimate { eta: [x, 0.2, 0.3], nu, current: [0.0; 2], actuators: &measured };
                controller.command(&estimate, &walker.reference(&path, &profile), &mut command);
                let (speed, rate) = profile.at(foot.s);
                controller.command(&estimate, &Reference::new(foot.s, &foot.pose, speed, rate), &mut command);
            }
            controller.reset();
        });
        assert_eq!(count, 0, "allocations while steering");
        assert!(command.iter().all(|c| c.is_finite()));
    }
}

/// A law takes new coefficients, and refuses others.
fn updating_allocates_nothing() {
    let vessel = Craft::simple();
    let equations = written::equations(&vessel, written::Force::Measured);
    let model = AffineEquations::new(&equations, [0, 1, 2]).unwrap();
    let options = FeedbackLinearizationOptions::new(1.5);
    let mut law = FeedbackLinearization::new(model, &AffinePlant::limits(&vessel), 0.1, options).unwrap();
    let good = equations.coefficients().to_vec();
    let bad: Vec<f64> = good.iter().map(|c| -c).collect();
    law.update(|model| model.set_coefficients(&good)).unwrap();
    let count = allocations(|| {
        law.update(|model| model.set_coefficients(&bad)).unwrap_err();
        law.update(|model| model.set_coefficients(&good)).unwrap();
    });
    assert_eq!(count, 0, "allocations in an update");
}

/// Plans on a session, with time and without.
fn planning_allocates_nothing(session: &dyn Predictor) {
    let limits = AffinePlant::limits(&Craft::hydrofoil());
    let options = PlannerOptions { candidates: 12, elites: 4, iterations: 2, ..PlannerOptions::new(1) };
    let mut planner = Planner::new(options, Cost::tracking(2), &limits, 3, 0.1, 5.0).unwrap();
    let path = Path::circle([0.0, 0.0], 20.0, Side::Port, 0.0).unwrap();
    let references = [Reference::new(1.0, &path.at(1.0), 2.0, 0.0); 20];
    let mut command = [0.0; 2];
    let mut plan =
        |stop: bool| planner.command(session, [20.0, 0.0, 1.5], &references, &mut || stop, &mut command);
    plan(false);
    let count = allocations(|| {
        plan(false);
        plan(true);
    });
    assert_eq!(count, 0, "allocations while planning");
}

/// Samples with their windows, and missing values.
fn estimating_the_current_allocates_nothing(model: Box<dyn Predictor>) {
    let options = CurrentOptions {
        motion: [0, 1, 2],
        dt: 0.1,
        window: 10,
        deviations: [0.1, 0.1, 0.05],
        noise: [0.0; 3],
        initial: 0.5,
        walk: 0.01,
    };
    let mut session = ThroughWater::new(model, options).unwrap();
    let mut run = || {
        for k in 0..400 {
            let x = 0.01 * f64::from(k);
            session.observe_heading(if k == 200 { f64::NAN } else { x });
            let r = if k == 210 { f64::NAN } else { 0.1 };
            session.advance_observe(&[20.0, 0.1], &[2.0 + x.sin(), 0.1 * x, r]);
        }
    };
    run();
    assert_eq!(allocations(run), 0, "allocations while estimating the current");
    assert_ne!(session.current().unwrap().velocity, [0.0; 2]);
}

/// A whole way there and back, and a rollout.
fn recurrent_batches_allocate_nothing(cell: Cell) {
    let network = Network { cell, inputs: 2, outputs: 3, read_out: true };
    let weights: Vec<f32> = (0..network.weights()).map(|k| 0.1 * (k as f32).sin()).collect();
    let (mut tape, mut rollout) = (Tape::new(&network, 5, 20), Rollout::new(&network, 20));
    let mut gradient = weights.clone();
    let count = allocations(|| {
        tape.load(&weights);
        rollout.load(&weights);
        for k in 0..5 {
            tape.input_mut(k).fill(0.5);
            tape.step(k);
            rollout.input_mut().fill(0.5);
            rollout.step();
        }
        tape.begin_backward();
        for k in (0..5).rev() {
            tape.output_adjoint_mut(k).fill(1.0);
            tape.step_back(k);
        }
        tape.gradient(&mut gradient);
    });
    assert_eq!(count, 0, "allocations in batches of {}", cell.name());
    assert!(gradient.iter().all(|x| x.is_finite()) && rollout.output()[0].is_finite());
}

/// Predicts four samples at once from three; with a batch of its network on the way.
fn direct(base: BaseModel) -> Arc<Direct> {
    let (inputs, outputs) = Direct::lengths(3, 4, 3, 2);
    let network = Perceptron { inputs, hidden: vec![7, 5], outputs };
    let weights = vec![0.1; network.weights()];
    let mut batch = Batch::<f64>::new(&network, 20);
    let mut gradient = vec![0.0; weights.len()];
    let count = allocations(|| {
        batch.input_mut().fill(0.5);
        batch.forward(&weights);
        batch.output_adjoint_mut().fill(1.0);
        batch.backward(&weights, &mut gradient);
    });
    assert_eq!(count, 0, "allocations in a batch");
    let scaling = Scaling {
        output_mean: vec![0.0; 3],
        output_scale: vec![1.0; 3],
        input_mean: vec![0.0; 2],
        input_scale: vec![1.0; 2],
        correction_scale: vec![1.0; 3],
    };
    let model = Direct { network, weights, scaling, history: 3, horizon: 4, base };
    Arc::new(model)
}

/// Its last layer learns.
fn read_out(base: BaseModel) -> DirectLastLayer {
    let options = LastLayerOptions { forgetting: 0.99, information: 0.1, leak: true, noise_rate: 0.01 };
    DirectLastLayer::new(direct(base), &options).unwrap()
}

/// A control-affine network of three outputs and two commands.
fn affine_network() -> Arc<ControlAffine> {
    let network = Perceptron { inputs: 3, hidden: vec![6], outputs: 9 };
    let weights = (0..network.weights()).map(|k| 0.1 * (k as f64).sin()).collect();
    let scaling = Scaling {
        output_mean: vec![0.0; 3],
        output_scale: vec![1.0; 3],
        input_mean: vec![0.0; 2],
        input_scale: vec![1.0; 2],
        correction_scale: vec![1.0; 3],
    };
    let effector = |map| Effector { map, time_constant_s: 0.5, unit: 1.0 };
    let effectors = vec![effector(Map::Identity), effector(Map::Sine)];
    Arc::new(ControlAffine { network, weights, scaling, effectors, dt: 0.1, wash_out: 3 })
}

#[test]
fn a_session_allocates_nothing_once_its_workspace_has_grown() {
    assert!(allocations(|| drop(std::hint::black_box(vec![0u8; 64]))) > 0, "the counter counts");
    steering_allocates_nothing();
    updating_allocates_nothing();
    let flying = written::equations(&Craft::hydrofoil(), written::Force::Hidden);
    let mut session = EquationsSession::new(Arc::new(flying));
    session.observe(&[2.0, 0.0, 0.1]);
    planning_allocates_nothing(&session);
    estimating_the_current_allocates_nothing(Box::new(session.clone()));
    let terms: Vec<Term> = (0..5).flat_map(|a| (a..5).map(move |b| Term::monomial(&[a, b]))).collect();
    let coefficients = (0..3 * terms.len()).map(|k| 0.01 * ((k % 5) as f64 - 2.0)).collect();
    let equations = Equations::new(terms, coefficients, 3, 2, 0.1, 2).unwrap();
    let options = RecursiveOptions {
        forgetting_s: 60.0,
        window: 4,
        prior_s: 10.0,
        leak: true,
        all_terms: false,
        gate: InnovationGate::default(),
    };
    let adapter = RecursiveEquations::new(&equations, &[(-1.0, 1.0); 5], &options).unwrap();
    let blend = ExpertMixtureOptions {
        priors_s: vec![100.0, 5.0],
        forgetting_s: 60.0,
        window: 4,
        horizon: 40,
        gate: InnovationGate::OPEN,
    };
    learning_allocates_nothing(
        ExpertMixture::new(adapter.equations(), &[(-1.0, 1.0); 5], &blend, None).unwrap(),
    );
    learning_allocates_nothing(adapter.clone());
    learning_allocates_nothing(rate_limited(Box::new(adapter.clone())));
    learning_allocates_nothing(filtered(&equations));
    learning_networks_allocate_nothing();
    learning_allocates_nothing(read_out(BaseModel::Hold));
    learning_allocates_nothing(guarded(&equations, &options));
    let craft = CraftModel::new(Craft::hydrofoil(), 0.1).unwrap();
    learning_allocates_nothing(vessel(&craft));
    recurrent_batches_allocate_nothing(Cell::Lstm { hidden: 6, projection: Some(3) });
    recurrent_batches_allocate_nothing(Cell::Gru { hidden: 6 });
    recurrent_batches_allocate_nothing(Cell::Vanilla { hidden: 6, layers: 2 });
    let recalling = with_signals(&equations);
    a_step_allocates_nothing(&equations);
    a_step_allocates_nothing(&recalling);
    let recalls = RecursiveEquations::new(&recalling, &[(-1.0, 1.0); 5], &options).unwrap();
    learning_allocates_nothing(recalls.clone());
    learning_allocates_nothing(filtered(&recalling));
    learning_allocates_nothing(ExpertMixture::new(&recalling, &[(-1.0, 1.0); 5], &blend, None).unwrap());
    let below = Arc::new(recalling.clone());
    let [on_plain, on_recalling] =
        [&equations, &recalling].map(|equations| BaseModel::Equations(Arc::new(equations.clone())));
    learning_allocates_nothing(read_out(on_recalling.clone()));
    let sessions: [Box<dyn Predictor>; 17] = [
        Box::new(ControlAffineSession::new(affine_network()).unwrap()),
        Box::new(DirectSession::new(direct(BaseModel::Hold)).unwrap()),
        Box::new(DirectSession::new(direct(on_plain)).unwrap()),
        Box::new(DirectSession::new(direct(on_recalling.clone())).unwrap()),
        Box::new(read_out(on_recalling)),
        Box::new(read_out(BaseModel::Hold)),
        read_out(BaseModel::Hold).fork(),
        vessel(&craft).fork(),
        Box::new(vessel(&craft)),
        Box::new(CraftSession::new(&craft)),
        recalls.fork(),
        Box::new(recalls),
        Box::new(EquationsSession::new(Arc::new(recalling))),
        adapter.fork(),
        Box::new(adapter),
        Box::new(EquationsSession::new(Arc::new(equations))),
        Box::new(Persistence::new(3, 2)),
    ];
    for mut session in sessions.into_iter().chain(recurrent_sessions(&below)) {
        let mut work = Workspace::new();
        let (commands, mut y) = ([0.1; 200], [0.0; 300]);
        let mut snapshot = vec![0.0; session.snapshot_len()];
        session.observe(&[0.1, 0.2, 0.3]);
        session.rollout(&commands, &mut work, &mut y);
        planning_allocates_nothing(session.as_ref());
        let count = allocations(|| {
            session.observe(&[0.1, f64::NAN, 0.3]);
            session.advance(&[0.5, -0.5]);
            // A state filter corrects from the second sample on, and with fewer outputs than it has room for.
            session.observe(&[0.2, f64::NAN, 0.1]);
            session.advance(&[0.5, -0.5]);
            session.observe(&[0.2, 0.1, 0.1]);
            session.rollout(&commands, &mut work, &mut y);
            session.rollout(&commands[..20], &mut work, &mut y[..30]);
            session.snapshot(&mut snapshot);
            session.restore(&snapshot);
            session.output(&mut y[..3]);
            session.reset();
            session.observe(&[0.1, 0.2, 0.3]);
        });
        assert_eq!(count, 0, "allocations in a session");
    }
}
