//! Coefficients for simulators and papers. `tests/export/coefficients` runs the exported vessels in Python and Octave.

mod derivatives;
mod equations;
mod gazebo;
mod linear;
mod names;
mod tables;

use std::path::{Path, PathBuf};

use hydroid::craft::{CraftFile, parse};
use hydroid::model::Model;
use hydroid_export::{File, Options};

pub(crate) const VESSELS: [&str; 4] =
    ["vessels/otter", "vessels/mariner", "vessels/tug", "tests/golden/workboat"];

pub(crate) fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(format!("{name}.toml"))
}

pub(crate) fn vessel(name: &str) -> CraftFile {
    let path = path(name);
    parse(&std::fs::read_to_string(&path).unwrap(), &path).unwrap()
}

pub(crate) fn model(file: &CraftFile) -> Model {
    Model::of_craft(file, 0.1).unwrap()
}

pub(crate) fn options() -> Options {
    Options { name: String::from("boat") }
}

/// The content of an exported file as text.
pub(crate) fn content(files: &[File], name: &str) -> String {
    let file = files.iter().find(|file| file.name == name).unwrap();
    String::from_utf8(file.content.clone()).unwrap()
}

/// Velocities in every quadrant, at rest, and beyond the speeds of the vessels.
pub(crate) fn motions() -> Vec<[f64; 3]> {
    let mut all = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 0.3]];
    for u in [-1.3, 2.7] {
        for v in [-0.8, 0.45] {
            for r in [-0.35, 0.2] {
                all.push([u, v, r]);
            }
        }
    }
    all
}

/// Whether two numbers agree to rounding, relative to a scale.
pub(crate) fn near(a: f64, b: f64, scale: f64) -> bool {
    (a - b).abs() <= 1e-12 * scale.abs().max(1e-12)
}
