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

use hydroid_export::{Format, Options, Precision, export, identifier};

fn main() -> Result<(), Box<dyn Error>> {
    let into = PathBuf::from(std::env::args().nth(1).ok_or("name a folder")?);
    let all = models::all().into_iter().map(|model| {
        let folder = format!("{}_{}", model.kind(), identifier(&model.description.name));
        (model, folder)
    });
    for (model, folder) in all.chain([(models::hostile(), String::from("hostile"))]) {
        let folder = into.join(folder);
        fs::create_dir_all(&folder)?;
        let options = Options { name: String::from("vessel") };
        for format in [&Format::C(Precision::Double), &Format::Casadi] {
            match export(&model, format, &options) {
                Ok(files) => {
                    for file in files {
                        fs::write(folder.join(&file.name), &file.content)?;
                    }
                }
                Err(error) => println!("{}: {error}", folder.display()),
            }
        }
        fs::write(folder.join("run.json"), serde_json::to_string(&run::Run::of(&model))?)?;
    }
    Ok(())
}
