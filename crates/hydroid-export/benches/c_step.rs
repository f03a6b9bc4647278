//! Time of a step in exported C against the step in Rust: `cargo bench -p hydroid-export --bench c_step`.
//!
//! Both roll out 1,000 samples again and again, alternately; the figures are medians over the repetitions. The C is compiled
//! with `cc -O3 -march=native`. Networks have 2 inputs, 3 outputs, output feedback and 18 cells.

#[expect(dead_code, reason = "a part is for the tests")]
#[path = "../tests/it/models.rs"]
mod models;

use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use hydroid::model::Model;
use hydroid_core::predict::Workspace;
use hydroid_export::{Format, Options, Precision, export};

const SAMPLES: usize = 1000;
const ROLLOUTS: usize = 300;
const REPETITIONS: usize = 9;

/// A program that prints the time of a sample \[ns\].
fn program(model: &Model) -> String {
    let (y, c) = (models::first_outputs(model), models::commands(model, SAMPLES, 1.0));
    let list = |numbers: &[f64]| {
        numbers.iter().fold(String::new(), |mut text, x| {
            let _ = write!(text, "{x:?}, ");
            text
        })
    };
    format!(
        "#define _POSIX_C_SOURCE 199309L
#include \"vessel.h\"
#include <stdio.h>
#include <time.h>
static const double first[] = {{ {} }};
static const double commands[] = {{ {} }};
static double predicted[{SAMPLES} * VESSEL_OUTPUTS];
int main(void)
{{
    vessel_state state;
    struct timespec begin, end;
    double sum = 0.0;
    int k;
    vessel_init(&state, first, commands);
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (k = 0; k < {ROLLOUTS}; ++k) {{
        vessel_rollout(&state, commands, {SAMPLES}, predicted);
        sum += predicted[k % {SAMPLES}];
    }}
    clock_gettime(CLOCK_MONOTONIC, &end);
    fprintf(stderr, \"%g\\n\", sum);
    printf(\"%.3f\\n\", ((end.tv_sec - begin.tv_sec) * 1e9 + (end.tv_nsec - begin.tv_nsec)) / ({ROLLOUTS}.0 * {SAMPLES}));
    return 0;
}}
",
        list(&y),
        list(&c)
    )
}

fn compile(model: &Model, folder: &Path) -> Result<(), Box<dyn Error>> {
    let options = Options { name: String::from("vessel") };
    for file in export(model, &Format::C(Precision::Double.into()), &options)? {
        fs::write(folder.join(&file.name), &file.content)?;
    }
    fs::write(folder.join("main.c"), program(model))?;
    let mut cc = Command::new("cc");
    cc.current_dir(folder).args([
        "-std=c99",
        "-O3",
        "-march=native",
        "main.c",
        "vessel.c",
        "-o",
        "main",
        "-lm",
    ]);
    if cc.status()?.success() { Ok(()) } else { Err("cc failed".into()) }
}

/// Time of a sample in C \[ns\].
fn in_c(folder: &Path) -> Result<f64, Box<dyn Error>> {
    let output = Command::new(folder.join("main")).output()?;
    Ok(String::from_utf8(output.stdout)?.trim().parse()?)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("{:<34} {:>10} {:>10} {:>7}", "model", "C [ns]", "Rust [ns]", "ratio");
    for model in models::timed() {
        let folder = tempfile::tempdir()?;
        compile(&model, folder.path())?;
        let (y, c) = (models::first_outputs(&model), models::commands(&model, SAMPLES, 1.0));
        let mut session = model.frozen().session();
        session.observe(&y);
        let (mut work, mut predicted) = (Workspace::new(), vec![0.0; SAMPLES * y.len()]);
        let mut in_rust = || {
            let begin = Instant::now();
            for _ in 0..ROLLOUTS {
                session.rollout(std::hint::black_box(&c), &mut work, &mut predicted);
            }
            begin.elapsed().as_secs_f64() * 1e9 / (ROLLOUTS * SAMPLES) as f64
        };
        in_rust();
        let (mut of_c, mut of_rust) = (Vec::new(), Vec::new());
        for _ in 0..REPETITIONS {
            of_c.push(in_c(folder.path())?);
            of_rust.push(in_rust());
        }
        let (c, rust) = (median(of_c), median(of_rust));
        println!("{:<34} {c:>10.0} {rust:>10.0} {:>7.2}", model.description.name, c / rust);
    }
    Ok(())
}
