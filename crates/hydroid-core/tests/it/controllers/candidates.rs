//! Batched rollouts of candidates equal single rollouts: every kind of model, adapted sessions, and the guard.

use std::sync::Arc;

use hydroid_core::adapt::guard::{Guard, GuardOptions};
use hydroid_core::adapt::kalman::{FilterOptions, KalmanNetwork};
use hydroid_core::adapt::{
    Adapter, DirectLastLayer, ExpertMixture, ExpertMixtureOptions, InnovationGate, LastLayerOptions, Learning,
};
use hydroid_core::craft::Craft;
use hydroid_core::model::direct::{Direct, DirectSession, Perceptron};
use hydroid_core::model::recurrent::{BaseModel, Cell, Network, Recurrent, RecurrentSession, Scaling};
use hydroid_core::model::sparse::{Equations, EquationsSession, Real, Signal, Term};
use hydroid_core::model::{CraftModel, CraftSession};
use hydroid_core::predict::{Predictor, Workspace};

use crate::controllers::helm::DT;
use crate::controllers::written::{Force, equations};

fn wild(k: usize) -> f64 {
    (12.9898 * k as f64).sin()
}

/// Advances a session over some samples, one of them with a missing output.
fn walk(session: &mut dyn Predictor, samples: usize) {
    for k in 0..samples {
        let missing = if k == 5 { f64::NAN } else { 0.1 * wild(k + 9) };
        session.observe(&[2.3 + 0.1 * wild(k), missing, -0.1 + 0.05 * wild(k + 3)]);
        session.advance(&[120.0 + 20.0 * wild(k), 0.2]);
    }
}

/// `rollout_batch` of 1 to 71 sequences over `steps` samples against `rollout` of each.
fn agree(session: &dyn Predictor, work: &mut Workspace, steps: usize) {
    for count in [1, 3, 16, 20, 71] {
        let commands: Vec<f64> = (0..count * steps * 2)
            .map(|k| if k % 2 == 0 { 100.0 + 200.0 * wild(k) } else { 0.4 * wild(k) })
            .collect();
        let (mut one, mut two) = (vec![0.0; count * steps * 3], vec![0.0; count * steps * 3]);
        let mut alone = Workspace::new();
        for k in 0..count {
            let commands = &commands[2 * k * steps..2 * (k + 1) * steps];
            session.rollout(commands, &mut alone, &mut one[3 * k * steps..3 * (k + 1) * steps]);
        }
        session.rollout_batch(count, &commands, work, &mut two);
        for (k, (a, b)) in one.iter().zip(&two).enumerate() {
            let same = (a - b).abs() < 1e-11 * (1.0 + a.abs()) || (a.is_nan() && b.is_nan());
            assert!(same, "{k} of {count}: {a} and {b}");
        }
    }
}

fn side_by_side(session: &dyn Predictor, steps: usize) -> Workspace {
    let mut work = Workspace::new();
    agree(session, &mut work, steps);
    work
}

fn scaling() -> Scaling {
    Scaling {
        output_mean: vec![2.0, 0.0, 0.1],
        output_scale: vec![1.5, 0.3, 0.2],
        input_mean: vec![100.0, 0.0],
        input_scale: vec![90.0, 0.3],
        correction_scale: vec![1.0, 0.2, 0.1],
    }
}

fn network(cell: Cell, base: BaseModel, feedback: bool) -> Arc<Recurrent> {
    let read_out = !matches!(cell, Cell::Lstm { .. });
    let network = Network { cell, inputs: if feedback { 5 } else { 2 }, outputs: 3, read_out };
    let weights = (0..network.weights()).map(|k| 0.4 * wild(k)).collect();
    Arc::new(Recurrent { network, weights, scaling: scaling(), base, feedback, wash_out: 1 })
}

/// With gates, a lag and ten integration steps in a sample, from an advanced session.
#[test]
fn batches_of_equations_equal_single_rollouts() {
    for vessel in [Craft::simple(), Craft::hydrofoil()] {
        let mut session = EquationsSession::new(Arc::new(equations(&vessel, Force::Hidden)));
        walk(&mut session, 3);
        side_by_side(&session, 15);
    }
    // An unknown lag starts at its first command, as in a single rollout.
    let lag = |seconds| vec![Signal::Lag { input: 3, time_constant_s: Real(seconds) }];
    let lagging = |seconds| {
        let (terms, coefficients) = (vec![Term::monomial(&[5])], vec![0.1, 0.0, 0.0]);
        let made = Equations::with_signals(terms, coefficients, 3, 2, lag(seconds), DT, 2).unwrap();
        let mut session = EquationsSession::new(Arc::new(made));
        session.observe(&[0.0; 3]);
        session
    };
    let mut work = side_by_side(&lagging(0.5), 4);
    agree(&lagging(2.0), &mut work, 4);
}

/// Every cell with every base, also before all outputs were measured.
#[test]
fn batches_of_recurrent_networks_equal_single_rollouts() {
    let below = Arc::new(equations(&Craft::simple(), Force::Hidden));
    for cell in [
        Cell::Lstm { hidden: 6, projection: Some(3) },
        Cell::Gru { hidden: 6 },
        Cell::Vanilla { hidden: 6, layers: 2 },
    ] {
        for (base, feedback) in [
            (BaseModel::Nothing, false),
            (BaseModel::Nothing, true),
            (BaseModel::Hold, false),
            (BaseModel::Hold, true),
            (BaseModel::Equations(Arc::clone(&below)), false),
            (BaseModel::Equations(Arc::clone(&below)), true),
        ] {
            let mut session = RecurrentSession::new(network(cell, base, feedback)).unwrap();
            let mut work = side_by_side(&session, 9);
            walk(&mut session, 12);
            agree(&session, &mut work, 15);
        }
    }
}

/// Shorter and longer than the horizon.
#[test]
fn batches_of_direct_predictors_equal_single_rollouts() {
    let below = BaseModel::Equations(Arc::new(equations(&Craft::hydrofoil(), Force::Hidden)));
    for base in [BaseModel::Nothing, BaseModel::Hold, below] {
        let (inputs, outputs) = Direct::lengths(3, 7, 3, 2);
        let network = Perceptron { inputs, hidden: vec![20, 9], outputs };
        let weights = (0..network.weights()).map(|k| 0.3 * wild(k)).collect();
        let model = Direct { network, weights, scaling: scaling(), history: 3, horizon: 7, base };
        let mut session = DirectSession::new(Arc::new(model)).unwrap();
        let mut work = side_by_side(&session, 7);
        walk(&mut session, 12);
        for steps in [1, 7, 17] {
            agree(&session, &mut work, steps);
        }
    }
}

/// With the present last layer, and through a guard.
#[test]
fn batches_of_adapting_direct_predictors_equal_single_rollouts() {
    let below = BaseModel::Equations(Arc::new(equations(&Craft::hydrofoil(), Force::Hidden)));
    for base in [BaseModel::Hold, below] {
        direct_predictors_that_learn(base);
    }
}

fn direct_predictors_that_learn(base: BaseModel) {
    let (inputs, outputs) = Direct::lengths(3, 7, 3, 2);
    let network = Perceptron { inputs, hidden: vec![20, 9], outputs };
    let weights: Vec<f64> = (0..network.weights()).map(|k| 0.3 * wild(k)).collect();
    let model = Arc::new(Direct { network, weights, scaling: scaling(), history: 3, horizon: 7, base });
    let options = LastLayerOptions { forgetting: 0.99, information: 0.5, leak: true, noise_rate: 0.01 };
    let learner = || DirectLastLayer::new(Arc::clone(&model), &options).unwrap();
    let mut learned = learner();
    let mut work = side_by_side(&learned, 7);
    let before = learned.weights().to_vec();
    walk(&mut learned, 60);
    assert_ne!(learned.weights(), before);
    for steps in [1, 7, 17] {
        agree(&learned, &mut work, steps);
    }
    agree(learned.fork().as_ref(), &mut work, 7);

    let companion = || -> Box<dyn Adapter> {
        Box::new(DirectLastLayer::companion(Arc::clone(&model), &options).unwrap())
    };
    let guarded = GuardOptions { horizon: 4, stride: 1, ..GuardOptions::new(0.1) };
    let ranges = [(0.0, 6.0), (-1.5, 1.5), (-1.0, 1.0)];
    let [first, second] = [learner(), learner()].map(Box::new);
    let mut guard = Guard::new(first, second, companion(), &ranges, &[0.01; 3], guarded).unwrap();
    let mut work = side_by_side(&guard, 7);
    for _ in 0..6 {
        walk(&mut guard, 10);
        agree(&guard, &mut work, 7);
    }
}

/// With the present weights of a filter or of recursive least squares; also through a guard, which bounds the deviation
/// from the reference model.
#[test]
fn batches_of_adapting_sessions_equal_single_rollouts() {
    let model = network(Cell::Gru { hidden: 5 }, BaseModel::Nothing, false);
    let learner = |learns: bool| -> Box<dyn Adapter> {
        let deviation = if learns { 0.1 } else { 0.0 };
        let options = FilterOptions::uniform(model.weights.len(), deviation, 0.0, (1.0, 1e-4), &[0.01; 3]);
        Box::new(KalmanNetwork::new(Arc::clone(&model), options).unwrap())
    };
    let mut learned = learner(true);
    let mut work = Workspace::new();
    walk(learned.as_mut(), 40);
    assert_ne!(learned.weights(), model.weights);
    agree(learned.as_ref(), &mut work, 15);
    agree(learned.fork().as_ref(), &mut work, 15);

    let options = GuardOptions { horizon: 4, stride: 1, ..GuardOptions::new(0.1) };
    let ranges = [(0.0, 6.0), (-1.5, 1.5), (-1.0, 1.0), (-130.0, 350.0), (-0.524, 0.524)];
    let mut guard =
        Guard::new(learner(true), learner(true), learner(false), &ranges[..3], &[0.01; 3], options).unwrap();
    let mut work = side_by_side(&guard, 15);
    for _ in 0..6 {
        walk(&mut guard, 10);
        agree(&guard, &mut work, 15);
    }
    agree(guard.fork().as_ref(), &mut work, 15);

    let blend = ExpertMixtureOptions {
        priors_s: vec![100.0, 5.0],
        forgetting_s: 60.0,
        window: 4,
        horizon: 40,
        gate: InnovationGate::OPEN,
    };
    let below = equations(&Craft::simple(), Force::Hidden);
    let mut session = ExpertMixture::new(&below, &ranges, &blend, None).unwrap();
    let mut work = side_by_side(&session, 15);
    walk(&mut session, 60);
    assert_ne!(session.weights(), ExpertMixture::new(&below, &ranges, &blend, None).unwrap().weights());
    agree(&session, &mut work, 15);
}

/// Models without batched rollouts, and a workspace of another model.
#[test]
fn batches_of_other_models_equal_single_rollouts() {
    let past = vec![Signal::Past { variable: 0, samples: 2 }];
    let terms = vec![Term::monomial(&[5])];
    let below = Arc::new(Equations::with_signals(terms, vec![0.1, 0.0, 0.0], 3, 2, past, DT, 1).unwrap());
    let on_past = network(Cell::Gru { hidden: 3 }, BaseModel::Equations(Arc::clone(&below)), true);
    let plain = network(Cell::Gru { hidden: 3 }, BaseModel::Nothing, false);
    let (inputs, outputs) = Direct::lengths(3, 4, 3, 2);
    let perceptron = Perceptron { inputs, hidden: vec![6], outputs };
    let weights = (0..perceptron.weights()).map(|k| 0.3 * wild(k)).collect();
    let base = BaseModel::Equations(Arc::clone(&below));
    let direct = Direct { network: perceptron, weights, scaling: scaling(), history: 3, horizon: 4, base };
    let sessions: [Box<dyn Predictor>; 5] = [
        Box::new(EquationsSession::new(below)),
        Box::new(DirectSession::new(Arc::new(direct)).unwrap()),
        Box::new(RecurrentSession::new(on_past).unwrap()),
        Box::new(CraftSession::new(&CraftModel::new(Craft::simple(), DT).unwrap())),
        Box::new(RecurrentSession::new(plain).unwrap()),
    ];
    let mut others = Workspace::new();
    for mut session in sessions {
        let mut work = Workspace::new();
        walk(session.as_mut(), 6);
        agree(session.as_ref(), &mut work, 8);
        agree(session.as_ref(), &mut others, 8);
    }
}
