//! Vessel files on arbitrary text: reading, writing, and the motion of what was read: `cargo +nightly fuzz run vessel_file`.
#![no_main]

use hydroid::craft::parse;
use hydroid_core::model::{CraftModel, CraftSession};
use hydroid_core::predict::Predictor;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let Ok(file) = parse(text, "boat.toml".as_ref()) else { return };
    let again = parse(&file.text(), "again.toml".as_ref()).expect("a written vessel file can be read");
    assert_eq!(file.craft.thrusters.len(), again.craft.thrusters.len());
    let Ok(model) = CraftModel::new(file.craft.clone(), 0.1) else { return };
    let mut session = CraftSession::new(&model);
    session.observe(&[0.0; 3]);
    let command: Vec<f64> = file.craft.commands.iter().map(|command| command.limits[1]).collect();
    for _ in 0..3 {
        session.advance(&command);
    }
});
