//! Writes models in C with a run and its predictions, for a microcontroller:
//! `cargo run -p hydroid-export --example microcontroller -- FOLDER`.

#[path = "../tests/it/models.rs"]
mod models;

use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use hydroid::adapt;
use hydroid::model::{Body, Model};
use hydroid_core::predict::Workspace;
use hydroid_export::{COptions, Format, Options, Precision, check, export, identifier};

const SAMPLES: usize = 100;

/// The run as tables of C.
fn tables(precision: Precision, numbers: &[(&str, &[f64])]) -> String {
    let predicted = numbers.iter().filter(|(name, _)| *name == "predicted").flat_map(|(_, numbers)| *numbers);
    let largest = predicted.fold(0.0_f64, |largest, y| largest.max(y.abs()));
    let tolerance = largest * if precision == Precision::Double { 1e-12 } else { 1e-5 };
    let mut text = format!(
        "#include \"vessel.h\"\n#define RUN_SAMPLES {SAMPLES}u\n#define RUN_TOLERANCE ((vessel_real){tolerance:?})\n"
    );
    for (name, numbers) in numbers {
        let list: Vec<String> = numbers.iter().map(|x| format!("(vessel_real){x:?}")).collect();
        let _ = writeln!(text, "static const vessel_real run_{name}[] = {{ {} }};", list.join(", "));
    }
    text
}

/// A rollout.
fn rollout(model: &Model, precision: Precision) -> String {
    let (first, held) = (models::first_outputs(model), models::commands(model, 1, 0.4));
    let ahead = models::commands(model, SAMPLES, 1.0);
    let predicted = check::Run::start(model, &first, &held).rollout(&ahead);
    tables(precision, &[("first", &first), ("held", &held), ("ahead", &ahead), ("predicted", &predicted)])
}

/// A run along which the model learns from a steady motion that it does not predict, and a rollout behind it.
fn learning(model: &Model, options: &adapt::Options, precision: Precision) -> Result<String, Box<dyn Error>> {
    let first = models::first_outputs(model);
    let ahead = models::commands(model, SAMPLES, 1.0);
    // The unknown past of a session is its first command.
    let held = ahead[..model.description.inputs.len()].to_vec();
    let (mut adapter, _) = adapt::adapter(model, options, &[])?;
    adapter.observe(&first);
    for c in ahead.chunks_exact(held.len()) {
        adapter.advance(c);
        adapter.observe(&first);
    }
    let mut predicted = vec![0.0; SAMPLES * first.len()];
    adapter.rollout(&ahead, &mut Workspace::new(), &mut predicted);
    let text = tables(
        precision,
        &[("first", &first), ("held", &held), ("ahead", &ahead), ("predicted", &predicted)],
    );
    Ok(text + "#define RUN_LEARNS\n")
}

fn main() -> Result<(), Box<dyn Error>> {
    let into = PathBuf::from(std::env::args().nth(1).ok_or("name a folder")?);
    // A network whose filter fits into the memory of a board.
    let small = models::all().into_iter().find(|model| model.description.name == "gru on hold");
    for model in models::timed().into_iter().chain(small) {
        let mut method = adapt::Options::of(&model);
        method.kalman.noise = Some(vec![0.01; model.description.outputs.len()]);
        let learns = match &model.body {
            Body::Equations(_) | Body::Committee(_) => true,
            Body::Recurrent(network) => network.weights.len() < 500,
            _ => false,
        };
        for (precision, suffix) in [(Precision::Double, "double"), (Precision::Float, "float")] {
            let write = |prefix: &str, options: COptions, run: String| -> Result<(), Box<dyn Error>> {
                let name = identifier(&model.description.name);
                let folder = into.join(format!("{prefix}{name}-{suffix}"));
                fs::create_dir_all(&folder)?;
                let name = Options { name: String::from("vessel") };
                for file in export(&model, &Format::C(options), &name)? {
                    fs::write(folder.join(&file.name), &file.content)?;
                }
                Ok(fs::write(folder.join("run.h"), run)?)
            };
            write("", precision.into(), rollout(&model, precision))?;
            if learns {
                let options = COptions { precision, adapter: Some(Box::new(method.clone())) };
                write("learning-", options, learning(&model, &method, precision)?)?;
            }
        }
    }
    Ok(())
}
