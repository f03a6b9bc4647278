//! hydroid's simulation of a model as a program, for controllers in other languages:
//! `cargo run -p hydroid-export --example plant -- MODEL`.
//!
//! The first line of the input is the pose and the outputs of a steady motion, and its command; each further line is a
//! command, which is held for a sample. The answer to each line is the pose and the outputs.

use std::error::Error;
use std::io::{BufRead as _, Write as _, stdin, stdout};
use std::path::Path;

use hydroid::plant::Simulation;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("name a model file or a vessel file")?;
    let model = hydroid::model::read(Path::new(&path))?;
    let (outputs, inputs) = (model.description.outputs.len(), model.description.inputs.len());
    let mut simulation = Simulation::new(&model)?;
    for (k, line) in stdin().lock().lines().enumerate() {
        let line = line?;
        let numbers = line.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>();
        let numbers = numbers.map_err(|error| format!("line {}: '{line}': {error}", k + 1))?;
        let expected = if k == 0 { 3 + outputs + inputs } else { inputs };
        if numbers.len() != expected {
            return Err(
                format!("line {}: {expected} numbers expected, {} given", k + 1, numbers.len()).into()
            );
        }
        if k == 0 {
            let eta = [numbers[0], numbers[1], numbers[2]];
            simulation.start(eta, &numbers[3..3 + outputs], &numbers[3 + outputs..]);
        } else {
            simulation.advance(&numbers);
        }
        let row: Vec<String> =
            simulation.eta().iter().chain(simulation.outputs()).map(|number| format!("{number:?}")).collect();
        println!("{}", row.join(" "));
        stdout().flush()?;
    }
    Ok(())
}
