//! The session of recurrent models compared with the equations of the model, for every base, with and without feedback.

use std::sync::Arc;

use hydroid_core::model::recurrent::{
    BaseModel, Cell, Network, Packed, Part, Recurrent, RecurrentError, RecurrentSession, Scaling,
};
use hydroid_core::model::sparse::{Equations, Real, Signal, Term};
use hydroid_core::predict::{Predictor, Workspace};

fn numbers(count: usize, seed: f64) -> Vec<f64> {
    (0..count).map(|k| ((k as f64 + seed) * 12.9898).sin()).collect()
}

fn cells() -> [Cell; 4] {
    [
        Cell::Lstm { hidden: 5, projection: Some(2) },
        Cell::Lstm { hidden: 4, projection: None },
        Cell::Gru { hidden: 6 },
        Cell::Vanilla { hidden: 4, layers: 3 },
    ]
}

/// Two outputs, two inputs; a lag, and past values of both channels.
fn equations() -> Equations {
    let signals = vec![
        Signal::Lag { input: 2, time_constant_s: Real(0.4) },
        Signal::Past { variable: 0, samples: 2 },
        Signal::Past { variable: 3, samples: 1 },
    ];
    let terms: Vec<Term> = (0..7).map(|v| Term::monomial(&[v])).collect();
    let coefficients = numbers(2 * terms.len(), 3.0).iter().map(|x| 0.5 * x).collect();
    Equations::with_signals(terms, coefficients, 2, 2, signals, 0.1, 2).unwrap()
}

fn bases() -> [BaseModel; 3] {
    [BaseModel::Nothing, BaseModel::Hold, BaseModel::Equations(Arc::new(equations()))]
}

fn model(cell: Cell, base: BaseModel, feedback: bool) -> Recurrent {
    let network = Network { cell, inputs: if feedback { 4 } else { 2 }, outputs: 2, read_out: true };
    let scaling = Scaling {
        output_mean: vec![1.0, -0.5],
        output_scale: vec![2.0, 0.3],
        input_mean: vec![10.0, 0.1],
        input_scale: vec![5.0, 0.2],
        correction_scale: vec![2.0, 0.3],
    };
    let weights = numbers(network.weights(), 0.5).iter().map(|x| 0.6 * x).collect();
    Recurrent { network, weights, scaling, base, feedback, wash_out: 7 }
}

fn every_model() -> impl Iterator<Item = Recurrent> {
    cells().into_iter().flat_map(|cell| {
        bases()
            .into_iter()
            .flat_map(move |base| [false, true].map(|feedback| model(cell, base.clone(), feedback)))
    })
}

fn session(model: &Recurrent) -> RecurrentSession {
    RecurrentSession::new(Arc::new(model.clone())).unwrap()
}

fn command(k: usize) -> [f64; 2] {
    [10.0 + 5.0 * (0.3 * k as f64).sin(), 0.2 * (0.17 * k as f64).cos()]
}

fn measured(k: usize) -> [f64; 2] {
    [1.0 + (0.1 * k as f64).sin(), -0.5 + 0.2 * (0.23 * k as f64).cos()]
}

fn bits(y: &[f64]) -> Vec<u64> {
    y.iter().map(|y| y.to_bits()).collect()
}

/// The model's equations, written independently on vectors.
struct Plain<'a> {
    model: &'a Recurrent,
    h: Vec<f64>,
    /// Outputs and memory of the base.
    front: Vec<f64>,
}

impl<'a> Plain<'a> {
    fn new(model: &'a Recurrent, y: [f64; 2]) -> Self {
        let memory = if let BaseModel::Equations(e) = &model.base { e.state_len() - 2 } else { 0 };
        let front = y.into_iter().chain(vec![f64::NAN; memory]).collect();
        Self { model, h: vec![0.0; model.network.state_len()], front }
    }

    fn step(&mut self, c: [f64; 2]) {
        let (model, s) = (self.model, &self.model.scaling);
        let mut x: Vec<f64> = (0..2).map(|i| (c[i] - s.input_mean[i]) / s.input_scale[i]).collect();
        if model.feedback {
            x.extend((0..2).map(|i| (self.front[i] - s.output_mean[i]) / s.output_scale[i]));
        }
        let packed = Packed::new(model.network, &model.weights);
        packed.step(&mut self.h, &x, &mut vec![0.0; packed.scratch()]);
        let mut g = [0.0; 2];
        packed.output(&self.h, &mut g);
        match &model.base {
            BaseModel::Nothing => self.front[..2].copy_from_slice(&s.output_mean),
            BaseModel::Hold => {}
            BaseModel::Equations(e) => e.step(&mut self.front, &c, &mut vec![0.0; e.scratch()]),
        }
        for i in 0..2 {
            self.front[i] += s.correction_scale[i] * g[i];
        }
    }
}

#[test]
fn sessions_and_rollouts_equal_the_equations() {
    for model in every_model() {
        let mut session = session(&model);
        let mut plain = Plain::new(&model, measured(0));
        session.observe(&measured(0));
        for k in 0..20 {
            session.advance(&command(k));
            plain.step(command(k));
            let mut y = [0.0; 2];
            session.output(&mut y);
            assert_eq!(bits(&y), bits(&plain.front[..2]), "prediction");
            session.observe(&measured(k + 1));
            plain.front[..2].copy_from_slice(&measured(k + 1));
        }
        let commands: Vec<f64> = (20..30).flat_map(command).collect();
        let mut y = vec![0.0; 20];
        let (mut before, mut after) = (vec![0.0; session.snapshot_len()], vec![0.0; session.snapshot_len()]);
        session.snapshot(&mut before);
        session.rollout(&commands, &mut Workspace::new(), &mut y);
        session.snapshot(&mut after);
        assert_eq!(bits(&before), bits(&after), "a rollout does not move the session");
        for k in 20..30 {
            plain.step(command(k));
            assert_eq!(bits(&y[2 * (k - 20)..2 * (k - 19)]), bits(&plain.front[..2]), "rollout");
        }
        assert!(y.iter().all(|y| y.is_finite()));
    }
}

/// A session restored from a snapshot, and a fork, give bit-identical predictions.
#[test]
fn snapshots_and_forks_hold_all_that_predictions_depend_on() {
    for model in every_model() {
        let (mut walked, mut other) = (session(&model), session(&model));
        for k in 0..9 {
            walked.observe(&measured(k));
            walked.advance(&command(k));
        }
        let mut snapshot = vec![0.0; walked.snapshot_len()];
        walked.snapshot(&mut snapshot);
        other.restore(&snapshot);
        let commands: Vec<f64> = (9..14).flat_map(command).collect();
        let mut predictions = [vec![0.0; 10], vec![0.0; 10], vec![0.0; 10]];
        let fork = walked.fork();
        for (session, y) in [&walked as &dyn Predictor, &other, &*fork].into_iter().zip(&mut predictions) {
            session.rollout(&commands, &mut Workspace::new(), y);
        }
        assert_eq!(bits(&predictions[0]), bits(&predictions[1]));
        assert_eq!(bits(&predictions[0]), bits(&predictions[2]));
        walked.reset();
        let mut fresh = session(&model);
        for session in [&mut walked, &mut fresh] {
            session.observe(&measured(3));
            session.advance(&command(3));
        }
        let mut of_fresh = vec![0.0; snapshot.len()];
        walked.snapshot(&mut snapshot);
        fresh.snapshot(&mut of_fresh);
        assert_eq!(bits(&snapshot), bits(&of_fresh), "reset forgets the run");
    }
}

#[test]
fn unmeasured_outputs_are_predicted() {
    for model in every_model() {
        let mut session = session(&model);
        session.observe(&measured(0));
        for k in 0..4 {
            session.advance(&command(k));
            session.observe(&measured(k + 1));
        }
        session.advance(&command(4));
        let mut predicted = [0.0; 2];
        session.output(&mut predicted);
        session.observe(&[f64::NAN, 0.25]);
        let mut y = [0.0; 2];
        session.output(&mut y);
        assert_eq!(bits(&y), bits(&[predicted[0], 0.25]));
    }
}

/// With sensors that report in turns, the run starts at the first measurement of the last one.
#[test]
fn models_of_increments_wait_for_a_measurement_of_all_outputs() {
    for model in every_model() {
        let mut session = session(&model);
        let mut y = [0.0; 2];
        session.observe(&[1.5, f64::NAN]);
        session.advance(&command(0));
        session.output(&mut y);
        let free = !model.feedback && matches!(model.base, BaseModel::Nothing);
        if free {
            assert!(y.iter().all(|y| y.is_finite()), "inputs are all that this network needs");
            continue;
        }
        assert_eq!(bits(&y), bits(&[1.5, f64::NAN]), "waits as it was measured");
        let moved = session.hidden().iter().any(|&h| h != 0.0);
        assert_eq!(moved, !model.feedback, "a network without feedback reads its inputs meanwhile");
        // Lags and delay lines follow the commands; two more samples fill the delay line of outputs.
        for k in 1..4 {
            session.observe(&measured(k));
            session.advance(&command(k));
        }
        session.output(&mut y);
        assert!(y.iter().all(|y| y.is_finite()), "{:?}", model.base);
    }
}

#[test]
fn a_diverged_rollout_is_not_finite() {
    for mut model in every_model() {
        if let BaseModel::Equations(_) = model.base {
            let terms = vec![Term::monomial(&[0, 0, 0]), Term::monomial(&[1])];
            let unstable = Equations::new(terms, vec![1e3, 1.0, 1.0, 1e3], 2, 2, 0.1, 1).unwrap();
            model.base = BaseModel::Equations(Arc::new(unstable));
        }
        let mut session = session(&model);
        session.observe(&[1e3, -1e3]);
        let mut y = vec![0.0; 200];
        session.rollout(&[f64::INFINITY; 200], &mut Workspace::new(), &mut y);
        session.rollout(&[f64::NAN; 200], &mut Workspace::new(), &mut y);
        assert!(y.iter().any(|y| !y.is_finite()));
        let commands: Vec<f64> = (0..100).flat_map(command).collect();
        session.rollout(&commands, &mut Workspace::new(), &mut y);
        assert_eq!(matches!(model.base, BaseModel::Equations(_)), y.iter().any(|y| !y.is_finite()));
        // A NaN command has no effect after the next measurements.
        session.advance(&[f64::NAN, 0.0]);
        for k in 0..4 {
            session.observe(&measured(k));
            session.advance(&command(k));
        }
        let finite = session.hidden().iter().all(|h| h.is_finite());
        assert!(finite, "the hidden state starts again");
    }
}

#[test]
fn warm_up_is_the_wash_out_and_a_sample_or_what_the_equations_need() {
    let mut model = model(Cell::Gru { hidden: 3 }, bases()[2].clone(), false);
    assert_eq!(session(&model).warm_up(), equations().warm_up().max(8));
    model.wash_out = 1000;
    assert_eq!(session(&model).warm_up(), 1001);
    model.wash_out = 1;
    assert_eq!(session(&model).warm_up(), equations().warm_up());
    model.wash_out = 0;
    assert_eq!(session(&model).warm_up(), equations().warm_up());
    model.base = BaseModel::Hold;
    assert_eq!(session(&model).warm_up(), 1);
}

#[test]
fn parts_that_contradict_one_another_are_refused() {
    let good = model(Cell::Gru { hidden: 3 }, BaseModel::Nothing, false);
    assert_eq!(good.check(), Ok(()));
    let refused = |change: &dyn Fn(&mut Recurrent)| {
        let mut model = good.clone();
        change(&mut model);
        let error = model.check().unwrap_err();
        assert!(!error.to_string().is_empty());
        assert_eq!(RecurrentSession::new(Arc::new(model)).unwrap_err(), error);
        error
    };
    assert_eq!(refused(&|m| m.feedback = true), RecurrentError::Inputs { network: 2, model: 4 });
    let length = |part, expected, given| RecurrentError::Length { part, expected, given };
    let weights = good.weights.len();
    assert_eq!(refused(&|m| m.weights.truncate(5)), length(Part::Weights, weights, 5));
    assert_eq!(refused(&|m| m.scaling.input_scale.push(1.0)), length(Part::InputScale, 2, 3));
    let number = |part, index| RecurrentError::Number { part, index };
    assert_eq!(refused(&|m| m.weights[4] = f64::NAN), number(Part::Weights, 4));
    assert_eq!(refused(&|m| m.scaling.output_scale[1] = 0.0), number(Part::OutputScale, 1));
    assert_eq!(refused(&|m| m.scaling.output_mean[0] = f64::INFINITY), number(Part::OutputMean, 0));
    assert_eq!(
        refused(&|m| m.network.outputs = 0),
        RecurrentError::Network(hydroid_core::model::recurrent::NetworkError::Empty("outputs"))
    );
    let alien = Equations::new(vec![Term::monomial(&[0])], vec![1.0], 1, 2, 0.1, 1).unwrap();
    assert_eq!(
        refused(&|m| m.base = BaseModel::Equations(Arc::new(alien.clone()))),
        RecurrentError::Equations { equations: (2, 1), model: (2, 2) }
    );
}
