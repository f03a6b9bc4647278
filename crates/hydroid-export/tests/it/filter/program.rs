//! The exported model in a program.

use std::process::Command;

use hydroid::adapt;
use hydroid::model::Model;
use hydroid_export::{COptions, Format, Options, Precision, export};
use tempfile::TempDir;

use super::learned::Run;

/// Samples of a rollout.
pub(super) const AHEAD: usize = 10;

const PROGRAM: &str = include_str!("run.c");

/// Samples at which something happens.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    /// Another run starts.
    pub(super) anew: usize,
    /// Learning is frozen, and continues.
    pub(super) frozen: usize,
    pub(super) learning: usize,
    /// The memory is copied, and the copy continues.
    pub(super) copied: usize,
    /// Samples between two comparisons of weights and rollouts.
    pub(super) every: usize,
}

pub(super) const FAST: [&str; 2] = ["cc", "-O2"];
pub(super) const SANITIZED: [&str; 4] =
    ["cc", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
pub(super) const CLANG: [&str; 3] = ["clang", "-O2", "-Wconversion"];

/// The numbers that the program writes, and the text of the header.
pub(super) fn run(
    model: &Model,
    (options, precision): (&adapt::Options, Precision),
    (run, plan): (&Run, &Plan),
    flags: &[&str],
) -> (Vec<f64>, String) {
    let folder = TempDir::new().unwrap();
    let c = COptions { precision, adapter: Some(Box::new(options.clone())) };
    let files = export(model, &Format::C(c), &Options { name: String::from("boat") }).unwrap();
    for file in &files {
        std::fs::write(folder.path().join(&file.name), &file.content).unwrap();
    }
    let sizes = [
        ("SAMPLES", run.commands.len() / run.held.len()),
        ("AHEAD", AHEAD),
        ("ANEW", plan.anew),
        ("FROZEN", plan.frozen),
        ("LEARNING", plan.learning),
        ("COPIED", plan.copied),
        ("EVERY", plan.every),
    ];
    let defines: Vec<String> = sizes.iter().map(|(name, size)| format!("#define {name} {size}\n")).collect();
    let defines = defines.concat();
    std::fs::write(folder.path().join("main.c"), defines + PROGRAM).unwrap();
    let parts = [&run.first, &run.held, &run.commands, &run.measured];
    let bytes: Vec<u8> = parts.iter().flat_map(|part| part.iter()).flat_map(|x| x.to_le_bytes()).collect();
    std::fs::write(folder.path().join("run"), bytes).unwrap();
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
