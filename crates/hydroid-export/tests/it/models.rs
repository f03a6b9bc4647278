//! Models of every kind with drawn numbers.

use std::path::Path;
use std::sync::Arc;

use hydroid::evaluate::DesignRange;
use hydroid::log::Channel;
use hydroid::model::{Body, Description, Members, Model, Port, Provenance, Reading};
use hydroid_core::actuator::Map;
use hydroid_core::model::affine::{ControlAffine, Effector};
use hydroid_core::model::committee::{Committee, DifferenceEquations, Member, Prior, Shape as Difference};
use hydroid_core::model::direct::{Direct, Perceptron};
use hydroid_core::model::recurrent::{BaseModel, Cell, Network, Recurrent, Scaling};
use hydroid_core::model::sparse::{Equations, Factor, Gate, Real, Shape, Signal, Term};
use serde_json::json;

pub(crate) const DT: f64 = 0.1;

/// Numbers between -1 and 1 that are equal in every run.
pub(crate) fn drawn(count: usize, stream: f64) -> Vec<f64> {
    (0..count).map(|k| ((1.0 + k as f64).sqrt() * 12.9898 + stream * 78.233).sin()).collect()
}

fn port(name: &str, unit: &str) -> Port {
    let range = DesignRange { low: -1.0, high: 2.0 };
    Port { channel: Channel::new(name, unit), range, training_range: None, noise: None, rate_limit: None }
}

pub(crate) fn model(name: &str, body: Body) -> Model {
    Model {
        description: Description {
            bands: None,
            trial_errors: Vec::new(),
            current: None,
            name: name.to_owned(),
            dt: DT,
            outputs: vec![port("u", "m/s"), port("v", "m/s"), port("r", "rad/s")],
            inputs: vec![port("n", "1/s"), port("delta", "rad")],
            reading: Reading::default(),
            boat: hydroid::boat::Boat::default(),
            provenance: Provenance {
                hydroid: String::from("0.2.0"),
                seed: 0,
                training: vec![String::from("a.csv")],
                validation: Vec::new(),
                settings: json!({}),
                ..Provenance::default()
            },
        },
        body,
        members: Members::default(),
        learning: None,
    }
}

fn terms(signals: u16) -> Vec<Term> {
    let gate = Gate { centre: Real(0.4), slope: Real(5.0) };
    let of = |variable, shape| Factor { variable, shape };
    let mut terms = vec![
        Term::constant(),
        Term::monomial(&[0]),
        Term::monomial(&[1]),
        Term::monomial(&[2]),
        Term::signed_square(0, 0),
        Term::signed_square(1, 0),
        Term::monomial(&[0, 2]),
        Term::monomial(&[3]),
        Term::new(vec![of(0, Shape::Power(2)), of(4, Shape::Sin)]),
        Term::new(vec![of(0, Shape::Above(gate)), of(2, Shape::Power(1))]),
        Term::new(vec![of(0, Shape::Below(gate)), of(3, Shape::Power(3))]),
        Term::new(vec![of(4, Shape::Cos), of(3, Shape::Abs)]),
        Term::of(2, Shape::Sign),
    ];
    terms.extend((0..signals).map(|signal| Term::monomial(&[5 + signal])));
    terms
}

fn coefficients(terms: usize, stream: f64) -> Vec<f64> {
    let mut numbers: Vec<f64> = drawn(3 * terms, stream).iter().map(|x| 0.2 * x).collect();
    for output in 0..3 {
        // Damping, and terms that only some equations have.
        numbers[output * terms + 1 + output] = -0.9;
        numbers[output * terms + 6] = if output == 1 { -0.3 } else { 0.0 };
        numbers[output * terms + 12] *= 0.01;
    }
    numbers
}

pub(crate) fn lag(input: u16, time_constant_s: f64) -> Signal {
    Signal::Lag { input, time_constant_s: Real(time_constant_s) }
}

pub(crate) fn sparse(signals: Vec<Signal>, substeps: usize) -> Equations {
    let terms = terms(u16::try_from(signals.len()).unwrap());
    let numbers = coefficients(terms.len(), 0.3);
    Equations::with_signals(terms, numbers, 3, 2, signals, DT, substeps).unwrap()
}

fn scaling() -> Scaling {
    Scaling {
        output_mean: vec![0.5, 0.0, 0.1],
        output_scale: vec![0.8, 0.3, 0.4],
        input_mean: vec![0.2, -0.1],
        input_scale: vec![0.7, 0.5],
        correction_scale: vec![0.05, 0.03, 0.04],
    }
}

fn bases() -> [(&'static str, BaseModel); 3] {
    let past = |variable, samples| Signal::Past { variable, samples };
    let equations = sparse(vec![lag(3, 0.7), past(0, 1), past(2, 3), past(4, 2)], 2);
    [
        ("nothing", BaseModel::Nothing),
        ("hold", BaseModel::Hold),
        ("equations", BaseModel::Equations(Arc::new(equations))),
    ]
}

fn recurrent(cell: Cell, read_out: bool, base: BaseModel, feedback: bool) -> Body {
    let network = Network { cell, inputs: if feedback { 5 } else { 2 }, outputs: 3, read_out };
    let weights = drawn(network.weights(), 0.7).iter().map(|w| 0.5 * w).collect();
    Body::Recurrent(Arc::new(Recurrent { network, weights, scaling: scaling(), base, feedback, wash_out: 9 }))
}

fn direct(base: BaseModel, history: usize, hidden: Vec<usize>) -> Body {
    let horizon = 6;
    let (inputs, outputs) = Direct::lengths(history, horizon, 3, 2);
    let network = Perceptron { inputs, hidden, outputs };
    let weights = drawn(network.weights(), 0.2).iter().map(|w| 0.2 * w).collect();
    Body::Direct(Arc::new(Direct { network, weights, scaling: scaling(), history, horizon, base }))
}

fn affine() -> Body {
    let network = Perceptron { inputs: 3, hidden: vec![8, 7], outputs: 9 };
    let weights = drawn(network.weights(), 0.9).iter().map(|w| 0.5 * w).collect();
    let scaling = Scaling { correction_scale: vec![0.2, 0.1, 0.1], ..scaling() };
    let effectors = vec![
        Effector { map: Map::SignedSquare, time_constant_s: 0.5, unit: 1.2 },
        Effector { map: Map::Sine, time_constant_s: 0.05, unit: 0.6 },
    ];
    let model = ControlAffine { network, weights, scaling, effectors, dt: DT, wash_out: 5 };
    Body::Affine(Arc::new(model))
}

fn committee(ranges: bool) -> Body {
    let member = |lags: usize, clock, votes, stream| {
        let variables = 5 * (lags + 1);
        let mut terms = terms(0);
        terms.extend((5..variables).map(|v| Term::monomial(&[u16::try_from(v).unwrap()])));
        let numbers = coefficients(terms.len(), stream);
        let shape = Difference { outputs: 3, inputs: 2, lags, clock, dt: DT };
        let equations = DifferenceEquations::new(terms, numbers, shape).unwrap();
        Member { equations, votes, prior: None }
    };
    let mut members =
        vec![member(1, 3, 2, 0.1), member(0, 2, 1, 0.2), member(2, 1, 2, 0.5), member(0, 1, 1, 0.8)];
    let count = members[1].equations.terms().len();
    let identity = (0..count * count).map(|at| f64::from(u8::from(at % (count + 1) == 0))).collect();
    members[1].prior = Some(Prior { averaging: 2, information: 10.0, r_factor: identity });
    let committee = Committee::new(members).unwrap();
    let committee = if ranges { committee.with_ranges(vec![(0.0, 0.4); 3]).unwrap() } else { committee };
    Body::Committee(Arc::new(committee))
}

fn limited(model: Model) -> Model {
    let mut model = model;
    model.description.name.push_str(" behind a limit of the rate");
    model.description.inputs[1].rate_limit = Some(0.9);
    model
}

/// The vessel files of the project.
pub(crate) fn vessels() -> Vec<Model> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../vessels");
    ["mariner", "otter", "tug"]
        .iter()
        .map(|name| hydroid::model::read(&folder.join(format!("{name}.toml"))).unwrap())
        .collect()
}

/// Models of every kind.
pub(crate) fn all() -> Vec<Model> {
    let past = |variable, samples| Signal::Past { variable, samples };
    let equations = |signals, substeps| Body::Equations(Arc::new(sparse(signals, substeps)));
    let mut all = vec![
        model("equations", equations(vec![], 1)),
        model("equations with lags", equations(vec![lag(3, 0.7), lag(4, 0.02)], 3)),
        model("equations with past commands", equations(vec![past(3, 2), lag(4, 0.3), past(4, 1)], 2)),
        model("equations with past outputs", equations(vec![past(0, 1), past(2, 3), lag(3, 0.4)], 2)),
        model("affine", affine()),
        model("committee", committee(true)),
        model("committee without ranges", committee(false)),
        limited(model("committee", committee(true))),
        limited(model("equations", equations(vec![lag(4, 0.3)], 1))),
        limited(model("direct", direct(BaseModel::Hold, 3, vec![7]))),
        model("direct with the present only", direct(BaseModel::Hold, 1, vec![7, 5])),
        model("direct, linear", direct(BaseModel::Nothing, 2, vec![])),
    ];
    let cells = [
        ("lstm with projection", Cell::Lstm { hidden: 5, projection: Some(3) }, false),
        ("lstm", Cell::Lstm { hidden: 4, projection: None }, true),
        ("gru", Cell::Gru { hidden: 6 }, true),
        ("rnn", Cell::Vanilla { hidden: 3, layers: 2 }, true),
    ];
    for (name, cell, read_out) in cells {
        for (base_name, base) in bases() {
            let name = format!("{name} on {base_name}");
            all.push(model(&name, recurrent(cell, read_out, base.clone(), true)));
            all.push(model(&format!("{name}, without feedback"), recurrent(cell, read_out, base, false)));
        }
    }
    for (name, base) in bases() {
        all.push(model(&format!("direct on {name}"), direct(base, 4, vec![9, 8])));
    }
    all.extend(vessels());
    for vessel in ["simple", "hydrofoil", "hydrofoil-low-speed"] {
        all.push(hydroid::model::read(Path::new(vessel)).unwrap());
    }
    all
}

#[allow(dead_code, reason = "examples use a part")]
/// Models of the sizes that identification gives by default, for measurements of time and memory.
pub(crate) fn timed() -> Vec<Model> {
    let lstm = Cell::Lstm { hidden: 18, projection: Some(3) };
    let equations = Body::Equations(Arc::new(sparse(vec![lag(3, 0.7), lag(4, 0.1)], 1)));
    let mut timed = vec![
        model("GRU, 18 cells", recurrent(Cell::Gru { hidden: 18 }, true, BaseModel::Hold, true)),
        model("LSTM, 18 cells, projected to 3", recurrent(lstm, false, BaseModel::Hold, true)),
        model("equations with two lags", equations),
        model("control-affine network", affine()),
        model("committee of 4 members", committee(true)),
    ];
    timed.extend(vessels().into_iter().filter(|vessel| vessel.description.name == "otter"));
    timed
}

/// Commands within the ranges of a model that change from sample to sample, row by row.
pub(crate) fn commands(model: &Model, samples: usize, stream: f64) -> Vec<f64> {
    let inputs = &model.description.inputs;
    let mut rows = Vec::new();
    for k in 0..samples {
        for (i, port) in inputs.iter().enumerate() {
            let middle = 0.5 * (port.range.low + port.range.high);
            let half = 0.5 * (port.range.high - port.range.low);
            let (fast, slow) =
                ((k / 7) as f64 * (1.7 + i as f64) + stream, k as f64 * 0.013 * (1.0 + i as f64));
            rows.push(middle + 0.5 * half * (fast.sin() + (slow + stream).cos()));
        }
    }
    rows
}

/// Outputs at the start of a run.
pub(crate) fn first_outputs(model: &Model) -> Vec<f64> {
    let of = |port: &Port| port.range.low + 0.6 * (port.range.high - port.range.low);
    model.description.outputs.iter().map(of).collect()
}
