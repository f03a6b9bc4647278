//! Checkpoints of a training.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::OnceLock;

use hydroid::evaluate::DesignRange;
use hydroid::log::Trajectory;
use hydroid::train::{CellKind, Job, TrainError, TrainOptions, Trained, train};
use serde_json::Value;

use crate::repair::{Tensors, version};
use crate::{exercise, models, scratch};

const KEY: &str = "hydroid_training";

fn trained(epochs: usize, checkpoint: &Path) -> Result<Trained, TrainError> {
    let run: Trajectory = exercise::run(&models::model("equations"));
    let (runs, ranges) = ([&run], vec![DesignRange { low: -1.0, high: 1.0 }; 2]);
    let job = Job {
        runs: &runs,
        validation: &runs,
        outputs: &ranges,
        inputs: &ranges,
        horizon: 2,
        equations: None,
    };
    let options = TrainOptions {
        hidden: 2,
        epochs: 3,
        restarts: 2,
        refit: false,
        wash_out_s: Some(0.2),
        window_s: Some(0.3),
        ..TrainOptions::of(CellKind::Gru)
    };
    let until = |status: &hydroid::train::Status| {
        if status.epoch >= epochs { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    train(&job, &options, Some(checkpoint), &mut { until })
}

/// What is read as the checkpoint of a small training is resumed.
pub fn checkpoint(bytes: &[u8]) {
    let Some(mut tensors) = Tensors::read(bytes) else { return };
    if let Some(mut head) = tensors.head(KEY) {
        // A checkpoint belongs to the training that is resumed.
        for key in ["options", "data", "hydroid"] {
            head.insert(key.to_owned(), own_head()[key].clone());
        }
        tensors.set_head(KEY, head);
    }
    let path = scratch::path("checkpoint");
    std::fs::write(&path, tensors.write()).expect("the scratch file can be written");
    if let Ok(trained) = trained(usize::MAX, &path) {
        assert!(trained.model.weights().iter().all(|weight| weight.is_finite()));
    }
}

fn own_head() -> &'static Value {
    static HEAD: OnceLock<Value> = OnceLock::new();
    HEAD.get_or_init(|| {
        let head = Tensors::read(&seed(1)).and_then(|tensors| tensors.head(KEY)).expect("a checkpoint");
        assert_eq!(head["hydroid"], version());
        Value::Object(head)
    })
}

/// The checkpoint after some epochs.
pub fn seed(epochs: usize) -> Vec<u8> {
    let path = scratch::path("seed");
    let _ = std::fs::remove_file(&path);
    let _ = trained(epochs, &path);
    std::fs::read(&path).expect("a checkpoint was written")
}
