//! Model files and PyTorch: it reads a file, predicts equally, continues the training, and writes a file that is read.
//!
//! The Python with PyTorch is `HYDROID_PYTHON` or `python3`; without PyTorch and safetensors the test passes with a
//! message. `network_file` compares with files that PyTorch made.

use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;

use hydroid::evaluate::DesignRange;
use hydroid::log::Channel;
use hydroid::model::{Body, Description, Members, Model, Port, Provenance, Reading, read, write};
use hydroid_core::model::recurrent::{BaseModel, Cell, Network, Recurrent, Scaling};
use hydroid_core::predict::Workspace;

fn python() -> Option<String> {
    let python = std::env::var("HYDROID_PYTHON").unwrap_or_else(|_| String::from("python3"));
    let there = Command::new(&python)
        .args(["-c", "import torch, safetensors.torch"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success());
    if !there {
        let _ = writeln!(
            std::io::stderr(),
            "skipped: no PyTorch (pip install torch safetensors numpy, or name a Python that has them in HYDROID_PYTHON)"
        );
    }
    there.then_some(python)
}

fn model(network: Network) -> Model {
    let port = |name: String| Port {
        channel: Channel::new(name, ""),
        range: DesignRange { low: -1.0, high: 1.0 },
        training_range: None,
        noise: None,
        rate_limit: None,
    };
    let (inputs, outputs) = (network.inputs, network.outputs);
    let recurrent = Recurrent {
        network,
        weights: (0..network.weights()).map(|k| (1.0 + k as f64).sqrt().sin() / 2.0).collect(),
        scaling: Scaling {
            output_mean: vec![0.5; outputs],
            output_scale: vec![2.0; outputs],
            input_mean: vec![-0.1; inputs],
            input_scale: vec![3.0; inputs],
            correction_scale: vec![2.0; outputs],
        },
        base: BaseModel::Nothing,
        feedback: false,
        wash_out: 1,
    };
    Model {
        description: Description {
            bands: None,
            trial_errors: Vec::new(),
            current: None,
            name: network.cell.name().to_owned(),
            dt: 0.1,
            outputs: (0..outputs).map(|i| port(format!("y{i}"))).collect(),
            inputs: (0..inputs).map(|i| port(format!("c{i}"))).collect(),
            reading: Reading::default(),
            boat: hydroid::boat::Boat::default(),
            provenance: Provenance {
                hydroid: String::from("0.1.0"),
                seed: 0,
                training: Vec::new(),
                validation: Vec::new(),
                settings: serde_json::Value::Null,
                ..Provenance::default()
            },
        },
        body: Body::Recurrent(Arc::new(recurrent)),
        members: Members::default(),
        learning: None,
    }
}

fn rollout(model: &Model, inputs: &[f64]) -> Vec<f64> {
    let mut session = model.session();
    let (n, m) = (session.outputs(), session.inputs());
    session.observe(&vec![0.0; n]);
    let mut y = vec![0.0; inputs.len() / m * n];
    session.rollout(inputs, &mut Workspace::new(), &mut y);
    y
}

#[test]
fn weights_travel_to_pytorch_and_back() {
    let Some(python) = python() else { return };
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/peers/torch_network.py");
    let inputs: Vec<f64> = (0..3 * 50).map(|k| (0.7 * f64::from(k)).sin()).collect();
    let text = serde_json::to_string(&inputs).unwrap();
    for (cell, read_out) in [
        (Cell::Lstm { hidden: 6, projection: Some(2) }, false),
        (Cell::Lstm { hidden: 6, projection: None }, true),
        (Cell::Gru { hidden: 5 }, true),
        (Cell::Vanilla { hidden: 4, layers: 3 }, true),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let (ours, theirs) =
            (folder.path().join("ours.safetensors"), folder.path().join("theirs.safetensors"));
        let model = model(Network { cell, inputs: 3, outputs: 2, read_out });
        write(&model, &ours).unwrap();
        let [first, second] = ask(&python, script, &ours, &theirs, &text);
        same(&rollout(&model, &inputs), &first);
        // PyTorch has changed the weights and written a file of its own.
        let changed = read(&theirs).unwrap();
        assert_ne!(changed.recurrent().unwrap().weights, model.recurrent().unwrap().weights);
        same(&rollout(&changed, &inputs), &second);
    }
}

fn ask(python: &str, script: &str, ours: &Path, theirs: &Path, inputs: &str) -> [Vec<f64>; 2] {
    let mut child = Command::new(python)
        .arg(script)
        .args([ours, theirs])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(inputs.as_bytes()).unwrap();
    let answer = child.wait_with_output().unwrap();
    assert!(answer.status.success());
    serde_json::from_slice(&answer.stdout).unwrap()
}

fn same(ours: &[f64], theirs: &[f64]) {
    assert_eq!(ours.len(), theirs.len());
    for (ours, theirs) in ours.iter().zip(theirs) {
        assert!((ours - theirs).abs() < 1e-12, "{ours} {theirs}");
    }
}
