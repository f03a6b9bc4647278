//! Small models of every kind, with constant numbers.

use std::sync::Arc;

use hydroid::adapt::{self, Method};
use hydroid::evaluate::DesignRange;
use hydroid::log::{Channel, ChannelSpec};
use hydroid::model::{Body, Description, Learning, Members, Model, Port, Provenance, Reading};
use hydroid_core::actuator::Map;
use hydroid_core::adapt::{ExpertMixtureOptions, InnovationGate};
use hydroid_core::craft::Craft;
use hydroid_core::model::affine::{ControlAffine, Effector};
use hydroid_core::model::committee::{Committee, DifferenceEquations, Member, Prior, Shape};
use hydroid_core::model::direct::{Direct, Perceptron};
use hydroid_core::model::recurrent::{BaseModel, Cell, Network, Recurrent, Scaling};
use hydroid_core::model::sparse::{Equations, Term};

/// Sample time of all models but those that are slow \[s\].
pub const DT: f64 = 0.1;

/// Sample time of the slow model \[s\].
const SLOW: f64 = 10.0;

/// Names of the models.
pub const NAMES: [&str; 10] =
    ["equations", "slow", "mixture", "lstm", "gru", "rnn", "direct", "affine", "committee", "vessel"];

/// The model of a name; that of an unknown name is `equations`.
pub fn model(name: &str) -> Model {
    match name {
        "slow" => described(name, SLOW, Body::Equations(Arc::new(equations(SLOW)))),
        "mixture" => Model { learning: Some(learning()), ..described(name, DT, moving()) },
        "lstm" => recurrent(name, Cell::Lstm { hidden: 2, projection: Some(1) }, BaseModel::Hold, false),
        "gru" => {
            let base = BaseModel::Equations(Arc::new(equations(DT)));
            recurrent(name, Cell::Gru { hidden: 1 }, base, false)
        }
        "rnn" => recurrent(name, Cell::Vanilla { hidden: 1, layers: 2 }, BaseModel::Nothing, true),
        "direct" => direct(name),
        "affine" => affine(name),
        "committee" => committee(name),
        "vessel" => Model::of_vessel(&Craft::simple(), DT).expect("a built-in vessel"),
        _ => described("equations", DT, moving()),
    }
}

/// The model and the options of a variant, as in `gru`, `equations+kalman+guard`; the noise is known.
pub fn variant(text: &str) -> (Model, adapt::Options) {
    let mut parts = text.split('+');
    let model = model(parts.next().unwrap_or_default());
    let mut options = adapt::Options::of(&model);
    options.kalman.noise = Some(vec![0.02; model.description.outputs.len()]);
    if model.description.dt == SLOW {
        options.least_squares.window_s = Some(2.0 * SLOW);
    }
    for part in parts {
        match part {
            "kalman" if matches!(model.body, Body::Equations(_)) => options.method = Method::Kalman,
            "guard" => options = options.guarded(&model),
            _ => {}
        }
    }
    (model, options)
}

/// All variants that can be adapted.
pub fn variants() -> Vec<String> {
    let adaptable = NAMES.into_iter().filter(|name| *name != "affine");
    let learners = adaptable.chain(["equations+kalman"]).map(str::to_owned);
    learners.flat_map(|name| [name.clone(), name + "+guard"]).collect()
}

fn described(name: &str, dt: f64, body: Body) -> Model {
    let port = |name: &str, unit: &str, noise| Port {
        channel: Channel::new(name, unit),
        range: DesignRange { low: -2.0, high: 2.0 },
        training_range: None,
        noise,
        rate_limit: None,
    };
    let mut reading = Reading::default();
    reading.selection.time = Some("t".to_owned());
    reading.selection.outputs = ["u", "r"].map(ChannelSpec::named).into();
    reading.selection.inputs = ["n", "delta"].map(ChannelSpec::named).into();
    Model {
        description: Description {
            name: name.to_owned(),
            dt,
            outputs: vec![port("u", "m/s", Some(0.02)), port("r", "rad/s", Some(0.01))],
            inputs: vec![port("n", "", None), port("delta", "rad", None)],
            reading,
            boat: hydroid::boat::Boat::default(),
            provenance: Provenance {
                hydroid: "0.1.0".to_owned(),
                seed: 0,
                training: Vec::new(),
                validation: Vec::new(),
                settings: serde_json::Value::Null,
                ..Provenance::default()
            },
            bands: None,
            trial_errors: Vec::new(),
            current: None,
        },
        body,
        members: Members::default(),
        learning: None,
    }
}

/// `du/dt = (-0.3 u |u| + 0.5 n) / T`, `dr/dt = (-r + 0.8 delta) / T` with `T` of ten samples.
fn equations(dt: f64) -> Equations {
    let terms =
        vec![Term::signed_square(0, 0), Term::monomial(&[1]), Term::monomial(&[2]), Term::monomial(&[3])];
    let coefficients = [-0.3, 0.0, 0.5, 0.0, 0.0, -1.0, 0.0, 0.8].map(|xi| xi / (10.0 * dt)).to_vec();
    Equations::new(terms, coefficients, 2, 2, dt, 2).expect("valid equations")
}

fn moving() -> Body {
    Body::Equations(Arc::new(equations(DT)))
}

fn triangle(terms: usize) -> Vec<f64> {
    (0..terms * terms).map(|k| if k % terms >= k / terms { 1.0 / (k + 1) as f64 } else { 0.0 }).collect()
}

fn learning() -> Learning {
    let settings = ExpertMixtureOptions {
        priors_s: vec![100.0, 10.0],
        forgetting_s: 30.0,
        window: 2,
        horizon: 5,
        gate: InnovationGate::default(),
    };
    Learning { settings, r_factor: triangle(4) }
}

fn weights(count: usize) -> Vec<f64> {
    (0..count).map(|k| (1.0 + k as f64).sqrt().sin() / 3.0).collect()
}

fn scaling() -> Scaling {
    Scaling {
        output_mean: vec![0.0; 2],
        output_scale: vec![1.0; 2],
        input_mean: vec![0.0; 2],
        input_scale: vec![1.0; 2],
        correction_scale: vec![0.1; 2],
    }
}

fn recurrent(name: &str, cell: Cell, base: BaseModel, feedback: bool) -> Model {
    let network = Network { cell, inputs: if feedback { 4 } else { 2 }, outputs: 2, read_out: true };
    let weights = weights(network.weights());
    let body = Recurrent { network, weights, scaling: scaling(), base, feedback, wash_out: 2 };
    described(name, DT, Body::Recurrent(Arc::new(body)))
}

fn direct(name: &str) -> Model {
    let (history, horizon) = (2, 3);
    let (inputs, outputs) = Direct::lengths(history, horizon, 2, 2);
    let network = Perceptron { inputs, hidden: vec![3], outputs };
    let weights = weights(network.weights());
    let body = Direct { network, weights, scaling: scaling(), history, horizon, base: BaseModel::Hold };
    described(name, DT, Body::Direct(Arc::new(body)))
}

fn affine(name: &str) -> Model {
    let network = Perceptron { inputs: 2, hidden: vec![3], outputs: 6 };
    let weights = weights(network.weights());
    let effector = |map| Effector { map, time_constant_s: 0.5, unit: 1.0 };
    let effectors = vec![effector(Map::SignedSquare), effector(Map::Sine)];
    let body = ControlAffine { network, weights, scaling: scaling(), effectors, dt: DT, wash_out: 3 };
    described(name, DT, Body::Affine(Arc::new(body)))
}

fn committee(name: &str) -> Model {
    let shape = Shape { outputs: 2, inputs: 2, lags: 1, clock: 2, dt: DT };
    let member = |votes, prior| {
        let terms = vec![Term::monomial(&[0]), Term::monomial(&[1]), Term::monomial(&[3])];
        let coefficients = vec![-0.3, 0.0, 0.5, 0.0, -1.0, 0.8];
        let equations = DifferenceEquations::new(terms, coefficients, shape).expect("valid equations");
        Member { equations, votes, prior }
    };
    let prior = Prior { averaging: 2, information: 0.5, r_factor: triangle(3) };
    let committee = Committee::new(vec![member(2, None), member(1, Some(prior))]);
    let committee = committee.and_then(|committee| committee.with_ranges(vec![(-2.0, 2.0); 2]));
    described(name, DT, Body::Committee(Arc::new(committee.expect("a valid committee"))))
}
