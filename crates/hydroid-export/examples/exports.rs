//! Writes models of every kind in every format, each with a run and its predictions, for tests in other languages:
//! `cargo run -p hydroid-export --example exports -- FOLDER`.

#[path = "../tests/it/models.rs"]
mod models;
#[expect(dead_code, reason = "a part is for the tests in Rust")]
#[path = "../tests/it/run.rs"]
mod run;

use std::error::Error;
use std::fs;
use std::path::PathBuf;

use hydroid_export::check::Run;
use hydroid_export::{Format, Options, Precision, export, identifier};

fn main() -> Result<(), Box<dyn Error>> {
    let into = PathBuf::from(std::env::args().nth(1).ok_or("name a folder")?);
    for model in models::all() {
        let folder = into.join(format!("{}_{}", model.kind(), identifier(&model.description.name)));
        fs::create_dir_all(&folder)?;
        for (name, format) in [
            ("vessel", Format::C(Precision::Double.into())),
            ("vessel", Format::Casadi),
            ("vessel", Format::Onnx(Precision::Double)),
            ("vessel_float", Format::Onnx(Precision::Float)),
        ] {
            let options = Options { name: String::from(name) };
            match export(&model, &format, &options) {
                Ok(files) => {
                    for file in files {
                        fs::write(folder.join(&file.name), &file.content)?;
                    }
                }
                Err(error) => println!("{}: {error}", folder.display()),
            }
        }
        let run = run::Run::of(&model);
        // The rates at the start of the run, under the first command of the rollout.
        let rates = Run::start(&model, &run.first, &run.held).rates(&run.ahead[..run.held.len()]);
        let mut run = serde_json::to_value(run)?;
        run["rates"] = serde_json::to_value(rates)?;
        fs::write(folder.join("run.json"), run.to_string())?;
    }
    Ok(())
}
