//! The validation error of a training equals that of `evaluate`.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::vessel::{INPUTS, OUTPUTS, measured, smooth};
use hydroid::evaluate::{Options, evaluate};
use hydroid::progress::silent;
use hydroid::train::{BaseKind, CellKind, Job, Precision, TrainOptions, train};
use hydroid_core::model::recurrent::RecurrentSession;

#[test]
fn the_validation_error_is_that_of_the_evaluation() {
    // So short that every origin is evaluated.
    let (a, mut b) = (smooth("a", 1500, 0.0), smooth("b", 209, 100.0));
    let mut values = b.outputs.rows(0, 209).to_vec();
    for (k, c) in [(20, 0), (21, 0), (122, 1), (150, 0), (151, 0), (151, 1), (180, 1)] {
        values[2 * k + c] = f64::NAN;
    }
    b.outputs = measured(values);
    for (cell, base, feedback) in [
        (CellKind::Lstm, BaseKind::Nothing, false),
        (CellKind::Gru, BaseKind::Nothing, true),
        (CellKind::Rnn, BaseKind::Hold, true),
        (CellKind::Gru, BaseKind::Hold, false),
    ] {
        let settings = TrainOptions {
            hidden: 5,
            epochs: 5,
            wash_out_s: Some(12.0),
            window_s: Some(5.0),
            base,
            feedback,
            precision: Precision::F64,
            ..TrainOptions::of(cell)
        };
        let job = Job {
            runs: &[&a],
            validation: &[&b],
            outputs: &OUTPUTS,
            inputs: &INPUTS,
            horizon: 25,
            equations: None,
        };
        let trained = train(&job, &settings, None, &mut |_| ControlFlow::Continue(())).unwrap();
        let mut session =
            RecurrentSession::new(Arc::new(trained.model.recurrent().unwrap().clone())).unwrap();
        let options = Options { horizon: 25, ..Options::default() };
        let evaluation = evaluate("trained", &mut session, &OUTPUTS, &[&b], &options, &mut silent()).unwrap();
        let (told, score) = (trained.validation, evaluation.score());
        // Equal origins; the hidden state follows the whole run instead of the wash-out.
        let off = (told / score - 1.0).abs();
        println!("{cell:?} {base:?} {feedback}: {told} {score}, off by {off:.1e}");
        assert!(off < 1e-5, "{cell:?} {base:?} {feedback}: {told} {score}");
    }
}
