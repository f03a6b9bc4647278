//! The exported C, compiled and run, against the sessions of hydroid.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use hydroid::adapt;
use hydroid::boat::Input;
use hydroid::model::Model;
use hydroid_export::{COptions, Format, Options, Precision, export};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use tempfile::TempDir;

use crate::models::all;
use crate::run::{AHEAD, ALONG, Run, difference};

fn write(model: &Model, options: impl Into<COptions>, name: &str, folder: &Path) {
    let format = Format::C(options.into());
    for file in export(model, &format, &Options { name: name.to_owned() }).unwrap() {
        std::fs::write(folder.join(&file.name), &file.content).unwrap();
    }
}

fn table(name: &str, numbers: &[f64]) -> String {
    let mut text = format!("static const double {name}[{}] = {{\n", numbers.len());
    for number in numbers {
        let _ = if number.is_nan() { writeln!(text, "    NAN,") } else { writeln!(text, "    {number:?},") };
    }
    text + "};\n"
}

/// A program that follows a run, saves and restores the state, rolls out, and prints all predictions.
fn program(name: &str, run: &Run) -> String {
    let upper = name.to_ascii_uppercase();
    let Run { first, held, along, measured, ahead, .. } = run;
    let (outputs, inputs) = (first.len(), held.len());
    let tables = [
        table("first", first),
        table("held", held),
        table("along", along),
        table("measured", measured),
        table("ahead", ahead),
    ];
    format!(
        "#include \"{name}.h\"
#include <math.h>
#include <stdio.h>
#include <string.h>
{tables}
typedef {name}_real real;
static real row[{inputs}], y[{outputs}], commands[{ahead_len}], predicted[{AHEAD} * {outputs}];
static const real *copied(const double *from, real *into, size_t count)
{{
    size_t i;
    for (i = 0; i < count; ++i) {{
        into[i] = (real)from[i];
    }}
    return into;
}}
int main(void)
{{
    static {name}_state state, saved;
    size_t k;
    copied(first, y, {outputs});
    {name}_init(&state, y, copied(held, row, {inputs}));
    for (k = 0; k < {ALONG}; ++k) {{
        if ({name}_step(&state, copied(along + k * {inputs}, row, {inputs}), {upper}_DT) != {upper}_OK) {{
            return 2;
        }}
        {name}_observe(&state, copied(measured + k * {outputs}, y, {outputs}));
    }}
    copied(ahead, commands, {ahead_len});
    {name}_rollout(&state, commands, {AHEAD}, predicted);
    for (k = 0; k < {AHEAD} * {outputs}; ++k) {{
        printf(\"%.17g\\n\", (double)predicted[k]);
    }}
    /* The same, with a copy of the state in the middle. */
    for (k = 0; k < 20; ++k) {{
        if (k == 10) {{
            memcpy(&saved, &state, sizeof state);
            memset(&state, 0, sizeof state);
            memcpy(&state, &saved, sizeof state);
        }}
        if ({name}_step(&state, commands + k * {inputs}, {upper}_DT) != {upper}_OK) {{
            return 3;
        }}
        {name}_output(&state, y);
    }}
    for (k = 0; k < {outputs}; ++k) {{
        printf(\"%.17g\\n\", (double)y[k]);
    }}
    saved = state;
    if ({name}_step(&state, commands, {upper}_DT * (real)1.5) != {upper}_TIME || memcmp(&saved, &state, sizeof state) != 0) {{
        return 4;
    }}
    if ({name}_step(&state, commands, (real)NAN) != {upper}_TIME || {name}_step(&state, commands, -{upper}_DT) != {upper}_TIME) {{
        return 5;
    }}
    return 0;
}}
",
        tables = tables.concat(),
        ahead_len = ahead.len(),
    )
}

struct Compiler {
    program: &'static str,
    flags: &'static [&'static str],
}

const WARNINGS: [&str; 5] = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"];

const UNDEFINED: Compiler =
    Compiler { program: "cc", flags: &["-O1", "-fsanitize=undefined", "-fno-sanitize-recover=all"] };

const ADDRESS: Compiler = Compiler { program: "cc", flags: &["-O2", "-fsanitize=address,undefined"] };

const CLANG: Compiler = Compiler { program: "clang", flags: &["-O2", "-Wconversion"] };

fn compile(compiler: &Compiler, folder: &Path, name: &str) {
    let mut command = Command::new(compiler.program);
    command.current_dir(folder).args(WARNINGS).args(compiler.flags);
    command.args(["main.c", &format!("{name}.c"), "-o", "main", "-lm"]);
    let output = command.output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name}: {errors}");
}

fn numbers(folder: &Path) -> Vec<f64> {
    let output = Command::new(folder.join("main")).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && errors.is_empty(), "{:?} {errors}", output.status);
    String::from_utf8(output.stdout).unwrap().lines().map(|line| line.parse().unwrap()).collect()
}

fn compare(model: &Model, precision: Precision, compiler: &Compiler) {
    // A sum of increments in single precision has the roundings of all of them.
    let summed = model.description.name.contains("on hold");
    let tolerance = match (precision, summed) {
        (Precision::Double, _) => 1e-12,
        (Precision::Float, false) => 1e-5,
        (Precision::Float, true) => AHEAD as f64 * 0.5 * f64::from(f32::EPSILON),
    };
    let folder = TempDir::new().unwrap();
    let name = "vessel";
    write(model, precision, name, folder.path());
    let (title, n) = (&model.description.name, model.description.outputs.len());
    let run = Run::of(model);
    let source = program(name, &run);
    std::fs::write(folder.path().join("main.c"), source).unwrap();
    compile(compiler, folder.path(), name);
    let found = numbers(folder.path());
    let far = difference(&run.predicted, &found[..AHEAD * n], n);
    assert!(far < tolerance, "{title}: {far}");
    let far = difference(&run.stepped, &found[AHEAD * n..], n);
    assert!(far < tolerance, "{title}, step by step: {far}");
}

#[test]
fn a_model_of_each_kind_runs_in_c() {
    let kinds = [
        "equations with past outputs",
        "gru on equations",
        "lstm with projection on hold",
        "committee",
        "direct on equations",
        "affine",
    ];
    for model in all() {
        if kinds.contains(&model.description.name.as_str()) || model.is_vessel() {
            compare(&model, Precision::Double, &UNDEFINED);
        }
    }
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn all_models_run_in_c() {
    for model in all() {
        compare(&model, Precision::Double, &ADDRESS);
        compare(&model, Precision::Float, &UNDEFINED);
    }
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn all_models_run_in_c_with_clang() {
    if Command::new("clang").arg("--version").output().is_err() {
        println!("skipped: no clang");
        return;
    }
    for model in all() {
        compare(&model, Precision::Double, &CLANG);
        compare(&model, Precision::Float, &CLANG);
    }
}

#[test]
fn commands_are_converted_from_the_values_that_are_sent() {
    let mut model = all().into_iter().find(|model| model.description.name == "affine").unwrap();
    let pulses = Input {
        unit: Some("us".into()),
        neutral: Some(1500.0),
        limits: Some([1100.0, 1900.0]),
        scale: Some(-400.0),
        ..Input::default()
    };
    let rudder = Input { unit: Some("deg".into()), limits: Some([-30.0, 25.0]), ..Input::default() };
    model.description.boat.inputs = [("n".to_owned(), pulses), ("delta".to_owned(), rudder)].into();
    let folder = TempDir::new().unwrap();
    write(&model, Precision::Double, "vessel", folder.path());
    let header = std::fs::read_to_string(folder.path().join("vessel.h")).unwrap();
    for line in [
        "n: neutral 0 1/s (stated), limits -1 to 1 1/s (stated); as it is sent, neutral 1500 us, limits 1100 to 1900 us, and in the model -0.0025 (raw - 1500)",
        "delta: neutral 0 rad (0, without effect), limits -0.5235987755982988 to 0.4363323129985824 rad (stated); as it is sent, neutral 0 deg, limits -30 to 25 deg",
    ] {
        assert!(header.contains(line), "{line}\n{header}");
    }
    let source = "#include \"vessel.h\"
#include <stdio.h>
int main(void)
{
    double row[2] = {1700.0, 10.0};
    vessel_from_raw(row, row);
    printf(\"%.17g\\n%.17g\\n\", row[0], row[1]);
    vessel_to_raw(row, row);
    printf(\"%.17g\\n%.17g\\n\", row[0], row[1]);
    return 0;
}
";
    std::fs::write(folder.path().join("main.c"), source).unwrap();
    compile(&UNDEFINED, folder.path(), "vessel");
    let expected = [-0.5, 10.0_f64.to_radians(), 1700.0, 10.0];
    for (found, expected) in numbers(folder.path()).into_iter().zip(expected) {
        assert!((found - expected).abs() < 1e-12 * expected.abs(), "{found} {expected}");
    }
}

#[test]
fn hostile_names_do_not_leave_their_place() {
    let strategy = prop::collection::vec(
        "\\PC{0,30}|\\*/ *#error|\\?\\?/|\"; *abort\\(\\); *//|NAME|REAL|UPPER|TERMS",
        5,
    );
    let mut runner =
        TestRunner::new(ProptestConfig { cases: 12, failure_persistence: None, ..Default::default() });
    let base = all().remove(1);
    let outcome = runner.run(&strategy, |names| {
        let mut model = base.clone();
        model.description.name = names[0].clone();
        model.description.provenance.training = names.clone();
        let d = &mut model.description;
        for (port, name) in d.outputs.iter_mut().chain(&mut d.inputs).zip(&names) {
            port.channel.name.clone_from(name);
            port.channel.unit.clone_from(name);
        }
        let folder = TempDir::new().unwrap();
        let adapter = Some(Box::new(adapt::Options::of(&model)));
        write(&model, COptions { precision: Precision::Double, adapter }, &names[1], folder.path());
        let name = hydroid_export::identifier(&names[1]);
        std::fs::write(
            folder.path().join("main.c"),
            format!("#include \"{name}.h\"\nint main(void) {{ return 0; }}\n"),
        )
        .unwrap();
        compile(&Compiler { program: "cc", flags: &["-O0"] }, folder.path(), &name);
        Ok(())
    });
    outcome.unwrap();
}
