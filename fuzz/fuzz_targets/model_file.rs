//! The reader of model files on arbitrary bytes: `cargo +nightly fuzz run model_file`. What is read as a
//! model must also predict.
#![no_main]

use std::path::Path;

use hydroid::model::decode;
use hydroid_core::predict::Workspace;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(model) = decode(bytes, Path::new("fuzz.safetensors")) else { return };
    let mut session = model.session();
    let (outputs, inputs) = (session.outputs(), session.inputs());
    // A state filter corrects from the second sample on.
    for _ in 0..2 {
        session.observe(&vec![0.1; outputs]);
        session.advance(&vec![0.2; inputs]);
    }
    session.rollout(&vec![0.1; 2 * inputs], &mut Workspace::new(), &mut vec![0.0; 2 * outputs]);
    for mut member in model.member_sessions() {
        member.observe(&vec![0.1; outputs]);
        member.rollout(&vec![0.1; 2 * inputs], &mut Workspace::new(), &mut vec![0.0; 2 * outputs]);
    }
});
