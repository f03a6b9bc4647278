//! Exported C that learns, in a program, along a run.

use std::process::Command;

use hydroid::adapt;
use hydroid::model::Model;
use hydroid_export::{COptions, Format, Options, Precision, export};
use tempfile::TempDir;

use crate::models::{commands, drawn, first_outputs};

/// Samples of a rollout.
pub(crate) const AHEAD: usize = 10;

pub(crate) const FAST: [&str; 2] = ["cc", "-O2"];
pub(crate) const SANITIZED: [&str; 4] =
    ["cc", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
pub(crate) const CLANG: [&str; 3] = ["clang", "-O2", "-Wconversion"];

/// A run: commands and measurements, row by row.
#[derive(Clone)]
pub(crate) struct Run {
    pub(crate) first: Vec<f64>,
    pub(crate) held: Vec<f64>,
    pub(crate) commands: Vec<f64>,
    pub(crate) measured: Vec<f64>,
}

impl Run {
    /// Measurements of a vessel that is not the model: each output follows a mixture of the commands, whose effect changes along
    /// the run, behind a lag. Some values are missing, and all of them for sixty samples from `gap` on; `outlier` is added to an
    /// output of a sample.
    pub(crate) fn simulated(
        model: &Model,
        samples: usize,
        gap: usize,
        outlier: impl Fn(usize) -> f64,
    ) -> Self {
        let (first, held) = (first_outputs(model), commands(model, 1, 0.4));
        let (n, m) = (first.len(), held.len());
        let given = commands(model, samples, 2.0);
        let mut y = first.clone();
        let mut measured = Vec::new();
        for (k, c) in given.chunks_exact(m).enumerate() {
            let effect = 0.8 - 0.5 * k as f64 / samples as f64;
            for (i, y) in y.iter_mut().enumerate() {
                let target: f64 = c.iter().enumerate().map(|(j, c)| effect * c / (1 + i + j) as f64).sum();
                *y += (0.1 + 0.05 * i as f64) * (target - *y);
            }
            let noise = drawn(n, k as f64);
            let mut row: Vec<f64> = y.iter().zip(noise).map(|(y, noise)| y + 0.01 * noise).collect();
            if k % 97 == 13 {
                row[k % n] = f64::NAN;
            }
            row[k % n] += outlier(k);
            if (gap..gap + 60).contains(&k) {
                row.fill(f64::NAN);
            }
            measured.extend(row);
        }
        Self { first, held, commands: given, measured }
    }

    pub(crate) fn samples(&self) -> usize {
        self.commands.len() / self.held.len()
    }
}

/// The numbers that a program writes, and the text of the header. The program is learning.c, then `main`; `sizes` are its macros
/// beside SAMPLES and AHEAD.
pub(crate) fn program(
    model: &Model,
    (options, precision): (&adapt::Options, Precision),
    run: &Run,
    (main, sizes): (&str, &[(&str, usize)]),
    flags: &[&str],
) -> (Vec<f64>, String) {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, content: &[u8]| std::fs::write(folder.path().join(name), content).unwrap();
    let c = COptions { precision, adapter: Some(Box::new(options.clone())) };
    let files = export(model, &Format::C(c), &Options { name: String::from("boat") }).unwrap();
    for file in &files {
        write(&file.name, &file.content);
    }
    let sizes = [("SAMPLES", run.samples()), ("AHEAD", AHEAD)].into_iter().chain(sizes.iter().copied());
    let defines: Vec<String> = sizes.map(|(name, size)| format!("#define {name} {size}\n")).collect();
    write("main.c", [&defines.concat(), include_str!("learning.c"), main].concat().as_bytes());
    let parts = [&run.first, &run.held, &run.commands, &run.measured];
    let bytes: Vec<u8> = parts.iter().flat_map(|part| part.iter()).flat_map(|x| x.to_le_bytes()).collect();
    write("run", &bytes);
    let (compiler, flags) = flags.split_first().unwrap();
    let warnings = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"];
    let mut command = Command::new(compiler);
    command.current_dir(&folder).args(warnings).args(flags).args(["main.c", "boat.c", "-o", "main", "-lm"]);
    let output = command.output().unwrap();
    let title = &model.description.name;
    assert!(output.status.success(), "{title}: {}", String::from_utf8_lossy(&output.stderr));
    let output = Command::new(folder.path().join("main")).current_dir(&folder).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && errors.is_empty(), "{title}: {:?} {errors}", output.status);
    let numbers = output.stdout.chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap()));
    (numbers.collect(), String::from_utf8(files[0].content.clone()).unwrap())
}

/// The largest difference of numbers, relative to the largest of them. A number that is not finite differs from all others.
pub(crate) fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let largest = a.iter().filter(|a| a.is_finite()).map(|a| a.abs()).fold(1e-9, f64::max);
    let of = |(a, b): (&f64, &f64)| match (a.is_finite(), b.is_finite()) {
        (true, true) => (a - b).abs() / largest,
        (false, false) => 0.0,
        _ => f64::INFINITY,
    };
    a.iter().zip(b).map(of).fold(0.0, f64::max)
}
