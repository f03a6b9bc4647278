//! Model files of recurrent networks: exchange with PyTorch, and refusal of inconsistent files.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use hydroid::evaluate::DesignRange;
use hydroid::log::Channel;
use hydroid::model::{
    Body, Description, Members, Model, ModelError, NamedTensor, Port, Provenance, Reading, decode,
    weights_from_torch, write,
};
use hydroid_core::model::recurrent::{BaseModel, Cell, Network, Recurrent, Scaling};
use hydroid_core::model::sparse::{Equations, Term};
use hydroid_core::predict::Workspace;
use proptest::prelude::*;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde_json::{Value, json};

use crate::networks::{NAMES, golden_json, golden_path, numbers, read};

const DT: f64 = 0.1;

/// A model of a network with unit scaling.
fn model(network: Network, weights: Vec<f64>, base: BaseModel, feedback: bool) -> Model {
    let outputs = network.outputs;
    let inputs = network.inputs - if feedback { outputs } else { 0 };
    let port = |name: String| Port {
        channel: Channel::new(name, "m/s"),
        range: DesignRange { low: -1.0, high: 1.0 / 3.0 },
        training_range: None,
        noise: None,
        rate_limit: None,
    };
    let scaling = Scaling {
        output_mean: vec![0.0; outputs],
        output_scale: vec![1.0; outputs],
        input_mean: vec![0.0; inputs],
        input_scale: vec![1.0; inputs],
        correction_scale: vec![1.0; outputs],
    };
    let recurrent = Recurrent { network, weights, scaling, base, feedback, wash_out: 7 };
    Model {
        description: Description {
            bands: None,
            trial_errors: Vec::new(),
            current: None,
            name: network.cell.name().to_owned(),
            dt: DT,
            outputs: (0..outputs).map(|i| port(format!("y{i}"))).collect(),
            inputs: (0..inputs).map(|i| port(format!("c{i}"))).collect(),
            reading: Reading::default(),
            boat: hydroid::boat::Boat::default(),
            provenance: Provenance {
                hydroid: String::from("0.1.0"),
                seed: 1,
                training: vec![String::from("a.csv")],
                validation: Vec::new(),
                settings: json!({"epochs": 3, "best_epoch": 2, "train_loss": 0.25, "validation": 0.5}),
                ..Provenance::default()
            },
        },
        body: Body::Recurrent(Arc::new(recurrent)),
        members: Members::default(),
        learning: None,
    }
}

fn some_weights(network: &Network) -> Vec<f64> {
    (0..network.weights()).map(|k| (1.0 + k as f64).sqrt().sin() / 3.0).collect()
}

fn cells() -> Vec<Network> {
    let network = |cell, read_out| Network { cell, inputs: 3, outputs: 2, read_out };
    vec![
        network(Cell::Lstm { hidden: 4, projection: Some(2) }, false),
        network(Cell::Lstm { hidden: 4, projection: None }, true),
        network(Cell::Gru { hidden: 3 }, true),
        network(Cell::Vanilla { hidden: 3, layers: 2 }, true),
    ]
}

fn models() -> Vec<Model> {
    let mut all = Vec::new();
    for network in cells() {
        for feedback in [false, true] {
            let inputs = network.inputs - if feedback { 2 } else { 0 };
            let equations = Equations::new(
                vec![Term::constant(), Term::monomial(&[0])],
                vec![0.1, -1.0 / 3.0, 0.0, -0.5],
                2,
                inputs,
                DT,
                2,
            );
            for base in
                [BaseModel::Nothing, BaseModel::Hold, BaseModel::Equations(Arc::new(equations.unwrap()))]
            {
                all.push(model(network, some_weights(&network), base, feedback));
            }
        }
    }
    all
}

fn bytes(model: &Model) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.safetensors");
    write(model, &path).unwrap();
    std::fs::read(path).unwrap()
}

fn decoded(bytes: &[u8]) -> Result<Model, ModelError> {
    decode(bytes, Path::new("m.safetensors"))
}

/// Predictions from the start of a run, after one row of zeros was measured.
fn rollout(model: &Model, inputs: &[f64]) -> Vec<f64> {
    let mut session = model.session();
    let (n, m) = (session.outputs(), session.inputs());
    session.observe(&vec![0.0; n]);
    let mut y = vec![0.0; inputs.len() / m * n];
    session.rollout(inputs, &mut Workspace::new(), &mut y);
    y
}

#[test]
fn a_model_file_is_read_back_with_the_same_predictions() {
    for model in models() {
        let file = bytes(&model);
        let again = decoded(&file).unwrap();
        assert_eq!(again, model);
        assert_eq!(bytes(&again), file);
        let inputs = vec![0.3; 5 * model.description.inputs.len()];
        assert_eq!(rollout(&again, &inputs), rollout(&model, &inputs));
        assert!(again.equations().is_none() && again.member_sessions().is_empty());
        assert!(!again.network_text().is_empty());
    }
}

/// Runs a model: measurements, so that a state filter corrects, and rollouts.
fn used(model: &Model) {
    let mut session = model.session();
    let (n, m) = (session.outputs(), session.inputs());
    for k in 0..3 {
        session.observe(&vec![0.1 * f64::from(k); n]);
        session.advance(&vec![0.2; m]);
    }
    session.observe(&vec![0.1; n]);
    session.rollout(&vec![0.1; 2 * m], &mut Workspace::new(), &mut vec![0.0; 2 * n]);
}

fn head(bytes: &[u8]) -> Value {
    let (_, metadata) = SafeTensors::read_metadata(bytes).unwrap();
    serde_json::from_str(&metadata.metadata().as_ref().unwrap()["hydroid"]).unwrap()
}

/// The file with another head, and tensors changed.
fn changed(
    bytes: &[u8],
    change: impl FnOnce(&mut Value),
    tensor: impl Fn(&str, &mut (Dtype, Vec<usize>, Vec<u8>)) -> bool,
) -> Vec<u8> {
    let mut head = head(bytes);
    change(&mut head);
    let tensors = SafeTensors::deserialize(bytes).unwrap();
    let mut kept = Vec::new();
    for (name, view) in tensors.iter() {
        let mut parts = (view.dtype(), view.shape().to_vec(), view.data().to_vec());
        if tensor(name, &mut parts) {
            kept.push((name.to_owned(), parts));
        }
    }
    let views = kept
        .iter()
        .map(|(name, (dtype, shape, data))| (name, TensorView::new(*dtype, shape.clone(), data).unwrap()));
    let metadata = HashMap::from([(String::from("hydroid"), head.to_string())]);
    safetensors::serialize(views, Some(metadata)).unwrap()
}

fn refusal(bytes: &[u8]) -> String {
    decoded(bytes).unwrap_err().to_string()
}

#[test]
fn networks_that_contradict_themselves_are_refused() {
    // LSTM without read-out, increments.
    let good = bytes(&models()[1]);
    let keep = |_: &str, _: &mut (Dtype, Vec<usize>, Vec<u8>)| true;
    assert!(decoded(&changed(&good, |_| (), keep)).is_ok());
    let with = |change: &dyn Fn(&mut Value)| refusal(&changed(&good, change, keep));
    // Sizes that would exhaust the memory, or are inconsistent.
    for hidden in [0, 5, 1 << 20, usize::MAX] {
        let told = with(&|head| head["structure"]["network"]["cell"]["hidden"] = json!(hidden));
        assert!(told.contains("m.safetensors"), "{told}");
    }
    for (path, value) in [
        ("/structure/network/inputs", json!(4)),
        ("/structure/network/outputs", json!(3)),
        ("/structure/network/read_out", json!(true)),
        ("/structure/feedback", json!(true)),
        ("/structure/wash_out", json!(-1)),
        ("/structure/wash_out", json!(usize::MAX)),
        ("/structure/base", json!("ocean")),
        ("/structure/base", json!({"equations": {"terms": [], "substeps": 1}})),
        ("/structure/scaling/output_scale", json!([1.0])),
        ("/structure/scaling/output_scale", json!([1.0, 0.0])),
        ("/structure/scaling/input_mean", json!([0.0, 0.0, null])),
        ("/structure/scaling/colour", json!(1)),
        ("/structure/network/cell/cell", json!("transformer")),
        ("/structure/kind", json!("sparse_equations")),
        ("/description/dt", json!(-0.1)),
    ] {
        let told = with(&|head| match head.pointer_mut(path) {
            Some(place) => *place = value.clone(),
            None => head["structure"]["scaling"]["colour"] = value.clone(),
        });
        assert!(told.contains("m.safetensors"), "{path}: {told}");
    }
    let missing = refusal(&changed(&good, |_| (), |name, _| name != "weight_hh_l0"));
    assert!(missing.contains("'weight_hh_l0' is missing"), "{missing}");
    let nan = |name: &str, parts: &mut (Dtype, Vec<usize>, Vec<u8>)| {
        if name == "bias_ih_l0" {
            parts.2[..8].copy_from_slice(&f64::NAN.to_le_bytes());
        }
        true
    };
    assert!(refusal(&changed(&good, |_| (), nan)).contains("'bias_ih_l0' is not finite"));
    let turned = |name: &str, parts: &mut (Dtype, Vec<usize>, Vec<u8>)| {
        if name == "weight_ih_l0" {
            parts.1.reverse();
        }
        true
    };
    let told = refusal(&changed(&good, |_| (), turned));
    assert!(told.contains("[3, 16]") && told.contains("[16, 3]"), "{told}");
}

#[test]
fn single_precision_of_pytorch_is_read() {
    let model = &models()[8];
    let single = |_: &str, parts: &mut (Dtype, Vec<usize>, Vec<u8>)| {
        #[allow(clippy::cast_possible_truncation)]
        let narrow = |bytes: &[u8]| (f64::from_le_bytes(bytes.try_into().unwrap()) as f32).to_le_bytes();
        if parts.0 == Dtype::F64 {
            *parts = (Dtype::F32, parts.1.clone(), parts.2.chunks_exact(8).flat_map(narrow).collect());
        }
        true
    };
    let only_weights = |name: &str, parts: &mut (Dtype, Vec<usize>, Vec<u8>)| {
        if name == "coefficients" { true } else { single(name, parts) }
    };
    let read = decoded(&changed(&bytes(model), |_| (), only_weights)).unwrap();
    let (ours, theirs) = (&model.recurrent().unwrap().weights, &read.recurrent().unwrap().weights);
    assert!(ours.iter().zip(theirs).all(|(a, b)| (a - b).abs() < 1e-7));
}

#[test]
fn damaged_files_never_panic() {
    // An LSTM on equations, one with a state filter, a GRU with feedback on equations.
    for model in [&models()[2], &models()[0], &models()[17]] {
        let whole = bytes(model);
        for at in 0..whole.len() {
            assert!(decoded(&whole[..at]).is_err());
            for flip in [0x01, 0x80, 0xff] {
                let mut damaged = whole.clone();
                damaged[at] ^= flip;
                if let Ok(model) = decoded(&damaged) {
                    used(&model);
                }
            }
        }
    }
}

proptest! {
    /// A head with arbitrary numbers is refused or gives a model that predicts.
    #[test]
    fn arbitrary_sizes_are_refused_or_sound(
        hidden in prop_oneof![0usize..9, any::<usize>()],
        inputs in 0usize..5,
        outputs in 0usize..4,
        layers in prop_oneof![0usize..4, any::<usize>()],
        kind in 0usize..4,
        feedback: bool,
        wash_out in prop_oneof![0usize..9, any::<usize>()],
    ) {
        let models = models();
        let of = [0, 6, 12, 18][kind];
        let file = changed(&bytes(&models[of]), |head| {
            let structure = &mut head["structure"];
            structure["network"]["cell"]["hidden"] = json!(hidden);
            structure["network"]["inputs"] = json!(inputs);
            structure["network"]["outputs"] = json!(outputs);
            if kind == 3 {
                structure["network"]["cell"]["layers"] = json!(layers);
            }
            structure["feedback"] = json!(feedback);
            structure["wash_out"] = json!(wash_out);
        }, |_, _| true);
        if let Ok(model) = decoded(&file) {
            used(&model);
        }
    }

    /// Complete files of networks of any size.
    #[test]
    fn sound_files_are_used_without_harm(
        hidden in 1usize..6,
        projection in proptest::option::of(1usize..4),
        layers in 1usize..3,
        inputs in 1usize..4,
        outputs in 1usize..5,
        kind in 0usize..3,
    ) {
        let cell = match kind {
            0 => Cell::Lstm { hidden, projection: projection.filter(|p| *p < hidden) },
            1 => Cell::Gru { hidden },
            _ => Cell::Vanilla { hidden, layers },
        };
        let network = Network { cell, inputs, outputs, read_out: true };
        let model = model(network, some_weights(&network), BaseModel::Nothing, false);
        used(&decoded(&bytes(&model)).unwrap());
    }
}

/// Files that PyTorch wrote become models that give PyTorch's outputs, and what is written of these models holds the very
/// tensors of PyTorch's file. (`tests/peers/recurrent_golden.py` makes the files.)
#[test]
fn weights_travel_from_pytorch_and_back() {
    for name in NAMES {
        let golden = golden_json(name);
        let file = read(&golden_path(&format!("networks/{name}_weights.safetensors")));
        let theirs = SafeTensors::deserialize(&file).unwrap();
        let parts: Vec<(String, Vec<usize>, Vec<f64>)> = theirs
            .iter()
            .map(|(name, view)| {
                let values = view.data().chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap()));
                // Names of a module that contains the cell.
                let module = if name.starts_with("linear") { "" } else { "net.rnn." };
                (format!("{module}{name}"), view.shape().to_vec(), values.collect())
            })
            .collect();
        let named: Vec<NamedTensor<'_>> =
            parts.iter().map(|(name, shape, values)| NamedTensor { name, shape, values }).collect();
        let network = crate::networks::network(name);
        let weights = weights_from_torch(&network, &named).unwrap();
        let model = model(network, weights, BaseModel::Nothing, false);
        let written = bytes(&model);
        let again = decoded(&written).unwrap();
        let outputs = rollout(&again, &numbers(&golden["sequence"]["input"]));
        for (ours, theirs) in outputs.iter().zip(numbers(&golden["sequence"]["output"])) {
            assert!((ours - theirs).abs() < 1e-12, "{name}: {ours} {theirs}");
        }
        let ours = SafeTensors::deserialize(&written).unwrap();
        assert_eq!(ours.len(), theirs.len());
        for (name, view) in theirs.iter() {
            assert_eq!(ours.tensor(name).unwrap(), view, "{name}");
        }

        let missing = weights_from_torch(&network, &named[1..]).unwrap_err();
        assert!(missing.contains("is missing"), "{missing}");
        let twice: Vec<NamedTensor<'_>> = named.iter().chain(&named[..1]).copied().collect();
        assert!(weights_from_torch(&network, &twice).unwrap_err().contains("leave one out"));
    }
}
