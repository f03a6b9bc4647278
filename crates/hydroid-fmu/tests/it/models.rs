//! A model of each kind.

use std::path::Path;
use std::sync::Arc;

use hydroid::evaluate::DesignRange;
use hydroid::log::Channel;
use hydroid::model::{
    Body, CurrentEstimate, Description, Members, Model, Port, Provenance, Reading, decode, encode, read,
};
use hydroid_core::actuator::Map;
use hydroid_core::model::affine::{ControlAffine, Effector};
use hydroid_core::model::committee::{Committee, DifferenceEquations, Member, Shape as Clock};
use hydroid_core::model::direct::{Direct, Perceptron};
use hydroid_core::model::recurrent::{BaseModel, Cell, Network, Recurrent, Scaling};
use hydroid_core::model::sparse::{Equations, Factor, Gate, Real, Shape, Signal, Term};

pub(crate) const DT: f64 = 0.1;

pub(crate) fn port(name: &str, unit: &str, low: f64, high: f64) -> Port {
    let channel = Channel::new(name, unit);
    Port { channel, range: DesignRange { low, high }, training_range: None, noise: None, rate_limit: None }
}

/// A model of surge, sway and yaw rate under a propeller and a rudder.
pub(crate) fn model(body: Body) -> Model {
    let outputs =
        vec![port("u", "m/s", 0.0, 3.0), port("v", "m/s", -1.0, 1.0), port("r", "rad/s", -0.5, 0.5)];
    let inputs = vec![port("n", "Hz", 0.0, 4.0), port("delta", "rad", -0.6, 0.6)];
    let provenance = Provenance {
        hydroid: String::from("0.2.0"),
        seed: 1,
        training: Vec::new(),
        validation: Vec::new(),
        settings: serde_json::json!({}),
        ..Provenance::default()
    };
    let description = Description {
        name: String::from("test"),
        dt: DT,
        outputs,
        inputs,
        reading: Reading::default(),
        boat: hydroid::boat::Boat::default(),
        provenance,
        bands: None,
        trial_errors: Vec::new(),
        current: None,
    };
    Model { description, body, members: Members::default(), learning: None }
}

/// Manoeuvring equations with quadratic drag, a gate and the products of a rudder; `signals` replace the command `n`, and
/// add a term of `u`.
pub(crate) fn equations(signals: Vec<Signal>) -> Arc<Equations> {
    let (u, v, r, n, delta) = (0, 1, 2, 3, 4);
    let (thrust, past) = match signals.as_slice() {
        [] => (n, u),
        [_] => (5, u),
        _ => (5, 6),
    };
    let gate = Gate { centre: Real(1.5), slope: Real(4.0) };
    let terms = vec![
        Term::monomial(&[u]),
        Term::signed_square(u, u),
        Term::monomial(&[thrust]),
        Term::monomial(&[v]),
        Term::monomial(&[r]),
        Term::monomial(&[u, r]),
        Term::new(vec![
            Factor { variable: u, shape: Shape::Power(1) },
            Factor { variable: delta, shape: Shape::Sin },
        ]),
        Term::new(vec![
            Factor { variable: u, shape: Shape::Above(gate) },
            Factor { variable: v, shape: Shape::Abs },
            Factor { variable: v, shape: Shape::Power(1) },
        ]),
        Term::monomial(&[past]),
    ];
    #[rustfmt::skip]
    let coefficients = vec![
        -0.20, -0.15, 0.40,  0.00,  0.00,  0.00,  0.00,  0.00, 0.01,
         0.00,  0.00, 0.00, -0.70,  0.10, -0.20, -0.05, -0.60, 0.00,
         0.00,  0.00, 0.00, -0.05, -1.10,  0.00,  0.30,  0.00, 0.01,
    ];
    Arc::new(Equations::with_signals(terms, coefficients, 3, 2, signals, DT, 3).unwrap())
}

fn wave(k: usize) -> f64 {
    (12.9898 * (k + 1) as f64).sin()
}

fn weights(count: usize) -> Vec<f64> {
    (0..count).map(|k| 0.3 * wave(k)).collect()
}

fn scaling(correction: f64) -> Scaling {
    Scaling {
        output_mean: vec![1.5, 0.0, 0.0],
        output_scale: vec![0.8, 0.3, 0.2],
        input_mean: vec![2.0, 0.0],
        input_scale: vec![1.2, 0.3],
        correction_scale: vec![correction; 3],
    }
}

fn recurrent(cell: Cell, base: BaseModel, feedback: bool) -> Body {
    let network = Network { cell, inputs: 2 + if feedback { 3 } else { 0 }, outputs: 3, read_out: true };
    let weights = weights(network.weights());
    Body::Recurrent(Arc::new(Recurrent {
        network,
        weights,
        scaling: scaling(0.05),
        base,
        feedback,
        wash_out: 7,
    }))
}

fn direct(base: BaseModel) -> Body {
    let (history, horizon) = (3, 5);
    let network = Perceptron {
        inputs: history * 3 + (history - 1 + horizon) * 2,
        hidden: vec![8],
        outputs: 3 * horizon,
    };
    let weights = weights(network.weights());
    Body::Direct(Arc::new(Direct { network, weights, scaling: scaling(0.02), history, horizon, base }))
}

fn affine() -> Body {
    let network = Perceptron { inputs: 3, hidden: vec![6], outputs: 9 };
    let weights = weights(network.weights());
    let effectors = vec![
        Effector { map: Map::SignedSquare, time_constant_s: 0.7, unit: 4.0 },
        Effector { map: Map::Sine, time_constant_s: 0.2, unit: 0.5 },
    ];
    Body::Affine(Arc::new(ControlAffine {
        network,
        weights,
        scaling: scaling(0.05),
        effectors,
        dt: DT,
        wash_out: 10,
    }))
}

fn committee() -> Body {
    let terms =
        vec![Term::monomial(&[0]), Term::monomial(&[2]), Term::monomial(&[3]), Term::monomial(&[0, 4])];
    let member = |lags, clock, votes, drag: f64| {
        let shape = Clock { outputs: 3, inputs: 2, lags, clock, dt: DT };
        #[rustfmt::skip]
        let coefficients = vec![
            -drag,  0.0, 0.4,  0.0,
              0.0, -0.2, 0.0, -0.05,
              0.0, -1.0, 0.0,  0.3,
        ];
        let equations = DifferenceEquations::new(terms.clone(), coefficients, shape).unwrap();
        Member { equations, votes, prior: None }
    };
    let members = vec![member(1, 3, 2, 0.5), member(0, 2, 3, 0.6), member(2, 4, 1, 0.4)];
    let ranges = vec![(-1.0, 5.0), (-1.0, 1.0), (-0.5, 0.5)];
    Body::Committee(Arc::new(Committee::new(members).unwrap().with_ranges(ranges).unwrap()))
}

pub(crate) fn vessel(name: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../vessels").join(format!("{name}.toml"));
    read(&path).unwrap()
}

pub(crate) fn lag() -> Signal {
    Signal::Lag { input: 3, time_constant_s: Real(0.8) }
}

/// Models of all kinds, with names. Each is as it is read back from its file.
pub(crate) fn all() -> Vec<(String, Model)> {
    let lstm = Cell::Lstm { hidden: 4, projection: None };
    let gru = Cell::Gru { hidden: 4 };
    let mut all: Vec<(String, Model)> =
        ["hydrofoil", "otter", "mariner", "tug"].map(|name| (name.to_owned(), vessel(name))).into();
    all.push((String::from("simple"), read(Path::new("simple")).unwrap()));
    all.push((String::from("otter_50ms"), vessel("otter").at_step(0.05).unwrap()));
    let past = || Signal::Past { variable: 0, samples: 2 };
    for (name, body) in [
        ("equations", Body::Equations(equations(Vec::new()))),
        ("equations_lag", Body::Equations(equations(vec![lag()]))),
        ("equations_past", Body::Equations(equations(vec![lag(), past()]))),
        ("lstm", recurrent(lstm, BaseModel::Nothing, false)),
        ("gru_feedback", recurrent(gru, BaseModel::Hold, true)),
        ("gru_grey_box", recurrent(gru, BaseModel::Equations(equations(vec![lag()])), false)),
        ("direct", direct(BaseModel::Nothing)),
        ("direct_grey_box", direct(BaseModel::Equations(equations(Vec::new())))),
        ("affine", affine()),
        ("committee", committee()),
    ] {
        all.push((name.to_owned(), model(body)));
    }
    let mut limited = model(Body::Equations(equations(Vec::new())));
    limited.description.inputs[1].rate_limit = Some(0.2);
    all.push((String::from("rate_limit"), limited));
    let mut in_current = model(Body::Equations(equations(Vec::new())));
    in_current.description.current = Some(CurrentEstimate {
        motion: [0, 1, 2],
        window: 20,
        deviations: [0.1, 0.1, 0.05],
        initial_m_s: 0.3,
        walk_m_s: 0.01,
    });
    all.push((String::from("current"), in_current));
    let mut still = model(Body::Equations(equations(Vec::new())));
    for (port, name) in still.description.outputs.iter_mut().zip(["speed", "drift", "turn"]) {
        name.clone_into(&mut port.channel.name);
    }
    all.push((String::from("no_motion"), still));
    let reread = |(name, model): (String, Model)| {
        let again = decode(&encode(&model).unwrap(), Path::new(&name)).unwrap();
        (name, again.at_step(model.description.dt).unwrap())
    };
    all.into_iter().map(reread).collect()
}
