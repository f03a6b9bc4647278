//! Writes models in C with a run and its predictions, for a microcontroller:
//! `cargo run -p hydroid-export --example microcontroller -- FOLDER`.

#[expect(dead_code, reason = "a part is for the tests")]
#[path = "../tests/it/models.rs"]
mod models;

use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use hydroid::model::Model;
use hydroid_export::{Format, Options, Precision, check, export, identifier};

const SAMPLES: usize = 100;

/// The run as tables of C.
fn run(model: &Model, precision: Precision) -> String {
    let (first, held) = (models::first_outputs(model), models::commands(model, 1, 0.4));
    let ahead = models::commands(model, SAMPLES, 1.0);
    let predicted = check::Run::start(model, &first, &held).rollout(&ahead);
    let largest = predicted.iter().fold(0.0_f64, |largest, y| largest.max(y.abs()));
    let tolerance = largest * if precision == Precision::Double { 1e-12 } else { 1e-5 };
    let mut text = format!(
        "#include \"vessel.h\"\n#define RUN_SAMPLES {SAMPLES}u\n#define RUN_TOLERANCE ((vessel_real){tolerance:?})\n"
    );
    for (name, numbers) in [("first", first), ("held", held), ("ahead", ahead), ("predicted", predicted)] {
        let list: Vec<String> = numbers.iter().map(|x| format!("(vessel_real){x:?}")).collect();
        let _ = writeln!(text, "static const vessel_real run_{name}[] = {{ {} }};", list.join(", "));
    }
    text
}

fn main() -> Result<(), Box<dyn Error>> {
    let into = PathBuf::from(std::env::args().nth(1).ok_or("name a folder")?);
    for model in models::timed() {
        for (precision, suffix) in [(Precision::Double, "double"), (Precision::Float, "float")] {
            let folder = into.join(format!("{}-{suffix}", identifier(&model.description.name)));
            fs::create_dir_all(&folder)?;
            let options = Options { name: String::from("vessel") };
            for file in export(&model, &Format::C(precision.into()), &options)? {
                fs::write(folder.join(&file.name), &file.content)?;
            }
            fs::write(folder.join("run.h"), run(&model, precision))?;
        }
    }
    Ok(())
}
