//! Exported C that learns, against the adapters of hydroid: 10,000 samples with noise, missing values and outliers.

use std::process::Command;
use std::sync::Arc;

use hydroid::adapt::{self, InnovationGate};
use hydroid::model::{Body, Model};
use hydroid_core::adapt::Adapter;
use hydroid_core::model::committee::{Committee, Prior};
use hydroid_core::predict::Workspace;
use hydroid_export::{COptions, Format, Options, Precision, export};
use tempfile::TempDir;

use crate::models::{all, commands, drawn, first_outputs};

const SAMPLES: usize = 10_000;

/// Samples of a rollout, and between two of them.
const AHEAD: usize = 10;
const EVERY: usize = 500;

/// A run: commands and measurements, row by row.
struct Run {
    first: Vec<f64>,
    held: Vec<f64>,
    commands: Vec<f64>,
    measured: Vec<f64>,
}

/// Measurements of a vessel that is not the model: each output follows a mixture of the commands, whose effect changes along
/// the run, behind a lag.
fn simulated(model: &Model, samples: usize) -> Run {
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
        if k % 1301 == 700 {
            row[k % n] += 5.0;
        }
        if (4000..4060).contains(&k) {
            row.fill(f64::NAN);
        }
        measured.extend(row);
    }
    Run { first, held, commands: given, measured }
}

/// What an adapter learns and predicts: its weights at every tenth sample, and rollouts.
#[derive(Debug, PartialEq)]
struct Learned {
    weights: Vec<f64>,
    predicted: Vec<f64>,
    /// Rows that were learned, and rejected.
    counts: [usize; 2],
}

impl Learned {
    fn of(adapter: &mut dyn Adapter, run: &Run) -> Self {
        let (n, m) = (run.first.len(), run.held.len());
        let mut own = Self { weights: Vec::new(), predicted: Vec::new(), counts: [0; 2] };
        let mut work = Workspace::new();
        let mut y = vec![0.0; AHEAD * n];
        for _ in 1..adapter.warm_up() {
            adapter.observe(&run.first);
            adapter.advance(&run.held);
        }
        adapter.observe(&run.first);
        for (k, (c, row)) in run.commands.chunks_exact(m).zip(run.measured.chunks_exact(n)).enumerate() {
            adapter.advance(c);
            adapter.observe(row);
            match adapter.outcome() {
                hydroid_core::adapt::Outcome::Waiting => {}
                hydroid_core::adapt::Outcome::Rejected(_) => own.counts[1] += 1,
                _ => own.counts[0] += 1,
            }
            if k % 10 == 0 {
                own.weights.extend(adapter.weights());
            }
            if k % EVERY == 0 {
                adapter.rollout(&run.commands[..AHEAD * m], &mut work, &mut y);
                own.predicted.extend(&y);
            }
        }
        own
    }
}

/// A program that reads a run, learns along it, continues in a copy of its memory in the middle, and writes what it learns.
const PROGRAM: &str = "#include \"NAME.h\"
#include <stdio.h>
#include <string.h>
typedef NAME_real real;
static real first[N], held[M], given[SAMPLES * M], measured[SAMPLES * N], ahead[AHEAD * N];
static int taken(FILE *file, real *into, size_t count)
{
    size_t i;
    for (i = 0; i < count; ++i) {
        double number;
        if (fread(&number, sizeof number, 1, file) != 1) {
            return 0;
        }
        into[i] = (real)number;
    }
    return 1;
}
static void put(const real *from, size_t count)
{
    size_t i;
    for (i = 0; i < count; ++i) {
        const double number = (double)from[i];
        fwrite(&number, sizeof number, 1, stdout);
    }
}
int main(void)
{
    static NAME_state state, other_state;
    static NAME_adapter adapter, other;
    NAME_adapter *a = &adapter;
    NAME_state *s = &state;
    real counts[3] = { 0, 0, 0 };
    const real size = (real)sizeof adapter;
    size_t k;
    FILE *file = fopen(\"run\", \"rb\");
    if (file == NULL || !taken(file, first, N) || !taken(file, held, M) || !taken(file, given, SAMPLES * M) ||
        !taken(file, measured, SAMPLES * N)) {
        return 2;
    }
    fclose(file);
    NAME_adapter_init(a, s, first, held);
    put(s->x + UPPER_FIRST_WEIGHT, UPPER_WEIGHTS);
    for (k = 1; k < WARM_UP; ++k) {
        NAME_adapter_step(a, s, held);
        NAME_adapter_observe(a, s, first);
    }
    for (k = 0; k < SAMPLES; ++k) {
        NAME_adapter_step(a, s, given + k * M);
        counts[NAME_adapter_observe(a, s, measured + k * N)] += 1;
        if (k % 10 == 0) {
            put(s->x + UPPER_FIRST_WEIGHT, UPPER_WEIGHTS);
        }
        if (k % EVERY == 0) {
            NAME_rollout(s, given, AHEAD, ahead);
            put(ahead, AHEAD * N);
        }
        if (k == SAMPLES / 2 + 1) {
            memcpy(&other, a, sizeof other);
            memcpy(&other_state, s, sizeof other_state);
            memset(a, 255, sizeof other);
            memset(s, 255, sizeof other_state);
            a = &other;
            s = &other_state;
        }
    }
    put(counts, 3);
    put(&size, 1);
    /* Another run keeps what was learned, and a new beginning forgets it. */
    NAME_adapter_start(a, s, first, held);
    put(s->x + UPPER_FIRST_WEIGHT, UPPER_WEIGHTS);
    NAME_adapter_init(a, s, first, held);
    put(s->x + UPPER_FIRST_WEIGHT, UPPER_WEIGHTS);
    return 0;
}
";

fn program(name: &str, run: &Run, warm_up: usize) -> String {
    let (n, m) = (run.first.len(), run.held.len());
    let sizes = [
        ("N", n),
        ("M", m),
        ("SAMPLES", run.measured.len() / n),
        ("AHEAD", AHEAD),
        ("EVERY", EVERY),
        ("WARM_UP", warm_up),
    ];
    let defines: Vec<String> = sizes.iter().map(|(name, size)| format!("#define {name} {size}\n")).collect();
    defines.concat() + &PROGRAM.replace("UPPER", &name.to_ascii_uppercase()).replace("NAME", name)
}

/// The numbers that the program writes, and the text of the header.
fn compiled(
    model: &Model,
    options: COptions,
    run: &Run,
    warm_up: usize,
    flags: &[&str],
) -> (Vec<f64>, String) {
    let folder = TempDir::new().unwrap();
    let name = "boat";
    let files = export(model, &Format::C(options), &Options { name: name.to_owned() }).unwrap();
    for file in &files {
        std::fs::write(folder.path().join(&file.name), &file.content).unwrap();
    }
    std::fs::write(folder.path().join("main.c"), program(name, run, warm_up)).unwrap();
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

/// The largest difference of numbers, relative to the largest of them.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let largest = a.iter().map(|a| a.abs()).fold(1e-9, f64::max);
    a.iter().zip(b).map(|(a, b)| (a - b).abs() / largest).fold(0.0, f64::max)
}

/// Learns along a run in C and in Rust, and gives the differences of weights and predictions.
fn compare(
    model: &Model,
    options: &adapt::Options,
    precision: Precision,
    samples: usize,
    flags: &[&str],
) -> [f64; 2] {
    let title = &model.description.name;
    let run = simulated(model, samples);
    let (mut adapter, _) = adapt::adapter(model, options, &[]).unwrap();
    let initial = adapter.weights().to_vec();
    let learned = Learned::of(adapter.as_mut(), &run);
    let c_options = COptions { precision, adapter: Some(Box::new(options.clone())) };
    let (numbers, header) = compiled(model, c_options, &run, adapter.warm_up(), flags);
    let (w, n) = (initial.len(), run.first.len());
    let (start, mut rest) = numbers.split_at(w);
    let (mut weights, mut predicted) = (Vec::new(), Vec::new());
    for k in 0..samples {
        if k % 10 == 0 {
            weights.extend(&rest[..w]);
            rest = &rest[w..];
        }
        if k % EVERY == 0 {
            predicted.extend(&rest[..AHEAD * n]);
            rest = &rest[AHEAD * n..];
        }
    }
    let single = precision == Precision::Float;
    let exact = if single { 1e-6 } else { 0.0 };
    assert!(apart(&initial, start) <= exact, "{title}");
    assert_eq!(rest.len(), 4 + 2 * w);
    let [waiting, accepted, rejected, size] = rest[..4].try_into().unwrap();
    assert_eq!(waiting + accepted + rejected, samples as f64);
    if !single {
        // At least one member completed a row, or an equation did.
        assert_eq!([accepted, rejected], learned.counts.map(|count| count as f64), "{title}");
    }
    assert!(accepted > samples as f64 / 50.0, "{title}: {accepted} rows");
    assert!(header.contains(&format!("memory of the method: {size} bytes")), "{title}: {size}");
    let last = &rest[4..4 + w];
    assert!(apart(last, start) > 1e-3, "{title}: nothing was learned");
    assert!(apart(&rest[4 + w..], start) == 0.0, "{title}: a new beginning");
    [apart(&learned.weights, &weights), apart(&learned.predicted, &predicted)]
}

const FAST: [&str; 2] = ["cc", "-O2"];
const SANITIZED: [&str; 3] = ["cc", "-O1", "-fsanitize=address,undefined"];
const CLANG: [&str; 3] = ["clang", "-O2", "-Wconversion"];

fn equations(model: &Model) -> bool {
    matches!(model.body, Body::Equations(_))
}

/// A committee of which two members learn, from priors that are not diagonal.
fn committee() -> Model {
    let mut model = all().into_iter().find(|model| matches!(model.body, Body::Committee(_))).unwrap();
    let Body::Committee(given) = &model.body else { unreachable!() };
    let mut members = given.members().to_vec();
    for (index, averaging) in [(0, 3), (1, 1), (2, 5)] {
        let count = members[index].equations.terms().len();
        let numbers = drawn(count * count, index as f64);
        let triangle = (0..count * count).map(|at| match at % count {
            column if column < at / count => 0.0,
            column if column == at / count => 3.0 + numbers[at],
            _ => numbers[at],
        });
        let r_factor = triangle.collect();
        members[index].prior =
            (index != 1).then_some(Prior { averaging, information: 2.0 + index as f64, r_factor });
    }
    let ranges = given.ranges().to_vec();
    let committee = Committee::new(members).unwrap().with_ranges(ranges).unwrap();
    model.body = Body::Committee(Arc::new(committee));
    model.description.name = String::from("committee with two members that learn");
    model
}

/// Models that learn, with the options of their method.
fn learning_models() -> Vec<(Model, adapt::Options)> {
    let learns = |model: &Model| matches!(model.body, Body::Equations(_) | Body::Committee(_));
    let mut models: Vec<(Model, adapt::Options)> = all()
        .into_iter()
        .chain([committee()])
        .filter(learns)
        .map(|model| {
            let options = adapt::Options::of(&model);
            (model, options)
        })
        .collect();
    let (model, defaults) = models.iter().find(|(model, _)| equations(model)).unwrap().clone();
    let mut add = |name: &str, change: &dyn Fn(&mut adapt::LeastSquaresOptions)| {
        let (mut model, mut options) = (model.clone(), defaults.clone());
        name.clone_into(&mut model.description.name);
        change(&mut options.least_squares);
        models.push((model, options));
    };
    add("equations, all terms", &|options| options.all_terms = true);
    add("equations without leak", &|options| options.leak = false);
    add("equations that forget nothing", &|options| options.forgetting_s = f64::INFINITY);
    add("equations without gate", &|options| options.gate = InnovationGate::OPEN);
    add("equations with rows of one sample", &|options| options.window_s = Some(0.1));
    models
}

#[test]
fn what_is_learned_in_c_is_what_hydroid_learns() {
    for (model, options) in learning_models() {
        let title = &model.description.name;
        let far = compare(&model, &options, Precision::Double, SAMPLES, &FAST);
        assert!(far.iter().all(|far| *far < 1e-9), "{title}: {far:?}");
    }
}

#[test]
fn learning_in_single_precision_follows_that_in_double_precision() {
    for (model, options) in learning_models() {
        let title = &model.description.name;
        let far = compare(&model, &options, Precision::Float, 1000, &FAST);
        assert!(far.iter().all(|far| *far < 1e-5), "{title}: {far:?}");
    }
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn learning_in_c_passes_sanitizers_and_clang() {
    let clang = Command::new("clang").arg("--version").output().is_ok();
    if !clang {
        println!("skipped: no clang");
    }
    for (model, options) in learning_models() {
        for precision in [Precision::Double, Precision::Float] {
            compare(&model, &options, precision, 1000, &SANITIZED);
            if clang {
                compare(&model, &options, precision, 1000, &CLANG);
            }
        }
    }
}

#[test]
fn models_without_an_adapter_in_c_are_refused() {
    let refused = |model: &Model, options: &adapt::Options| {
        let c_options = COptions { precision: Precision::Double, adapter: Some(Box::new(options.clone())) };
        let format = Format::C(c_options);
        let error = export(model, &format, &Options { name: String::from("boat") }).unwrap_err();
        error.to_string()
    };
    for model in all().iter().filter(|model| !matches!(model.body, Body::Equations(_) | Body::Recurrent(_))) {
        let options = adapt::Options::of(model);
        match &model.body {
            Body::Committee(_) => {}
            Body::Direct(_) | Body::Plant(_) => {
                let error = refused(model, &options);
                assert!(error.contains("without --adapter") && error.contains("C library"), "{error}");
            }
            _ => {
                assert!(refused(model, &options).contains("cannot be adapted"), "{}", model.description.name);
            }
        }
    }
    // Constant members, and options that do not fit.
    let constant = committee().frozen();
    assert!(refused(&constant, &adapt::Options::of(&constant)).contains("none of its members learns"));
    let model = all().remove(0);
    let mut options = adapt::Options::of(&model);
    options.least_squares.window_s = Some(1e9);
    assert!(refused(&model, &options).contains("window of 1000000000 s"));
    options = adapt::Options::of(&model);
    options.method = adapt::Method::Kalman;
    assert!(refused(&model, &options).contains("without --adapter"));
}
