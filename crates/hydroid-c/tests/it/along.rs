//! Sessions and adapters in C along a run, against the Rust API to the last bit.

use std::path::Path;
use std::sync::OnceLock;

use hydroid::adapt::{Method, Options, Rehearse};
use hydroid::model::{CurrentEstimate, Model, decode, encode, write};
use tempfile::TempDir;

use crate::models;
use crate::program::{CLANG, CPP, Compiler, GCC, Program, exists, sources};
use crate::run::{Run, follow};

const SAMPLES: usize = 320;

/// As it is read back from its file.
fn stored(model: &Model) -> Model {
    decode(&encode(model).unwrap(), Path::new("model")).unwrap()
}

pub(crate) fn in_current(model: Model) -> Model {
    let mut model = model;
    model.description.current = Some(CurrentEstimate {
        motion: [0, 1, 2],
        window: 20,
        deviations: [0.1, 0.1, 0.05],
        initial_m_s: 0.3,
        walk_m_s: 0.01,
    });
    model
}

/// Models of all kinds, by name.
pub(crate) fn model(name: &str) -> Model {
    static ALL: OnceLock<Vec<Model>> = OnceLock::new();
    let all = ALL.get_or_init(models::all);
    let found = all.iter().find(|model| model.description.name == name);
    found.unwrap_or_else(|| panic!("no model {name}")).clone()
}

const KALMAN: &str = "learner = \"kalman\"\nleak = inf\nhuber = 3";

const CURRENT: &str = "estimate_current = 0.25";

const BLOCKS: &str = "covariance = \"blocks:2\"\nweight_variance = 0.05";

const REHEARSES: &str =
    "rehearsal = { windows = 4, window_s = 2, every = 2, state_variance = 0.1, noise_factor = 1 }";

struct Case {
    /// Constant weights.
    frozen: bool,
    model: Model,
    /// None for a session that does not learn; else whether it is guarded, and options.
    learns: Option<(bool, &'static str)>,
}

fn case(name: &str, learns: Option<(bool, &'static str)>) -> Case {
    Case { frozen: false, model: stored(&model(name)), learns }
}

/// Options in Rust that are written independently of the section.
fn options(case: &Case, noise: &[f64]) -> Option<Options> {
    let (guarded, section) = case.learns?;
    let mut options = Options::of(&case.model);
    if guarded {
        options = options.guarded(&case.model);
    }
    match section {
        "" => {}
        KALMAN => {
            options.method = Method::Kalman;
            options.kalman.leak_s = f64::INFINITY;
            options.kalman.huber = 3.0;
        }
        CURRENT => options.current_m_s = Some(0.25),
        BLOCKS => {
            options.kalman.covariance = "blocks:2".parse().unwrap();
            options.kalman.weight_variance = 0.05;
        }
        REHEARSES => {
            let (windows, every) = (4, 2);
            let (state_variance, noise_factor) = (0.1, 1.0);
            options.kalman.rehearsal =
                Some(Rehearse { windows, window_s: 2.0, every, state_variance, noise_factor });
        }
        other => panic!("{other}"),
    }
    options.kalman.noise = Some(noise.to_vec());
    Some(options)
}

/// Equal to the last bit; all NaN are equal.
pub(crate) fn same(title: &str, expected: &[f64], found: &[f64]) {
    assert_eq!(expected.len(), found.len(), "{title}");
    for (at, (a, b)) in expected.iter().zip(found).enumerate() {
        assert!(a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()), "{title}, number {at}: {a} {b}");
    }
}

/// Numbers of a file of results.
pub(crate) fn numbers(path: &Path) -> Vec<f64> {
    let bytes = std::fs::read(path).unwrap();
    bytes.as_chunks::<8>().0.iter().map(|bytes| f64::from_ne_bytes(*bytes)).collect()
}

fn compare(program: &Program, case: &Case) {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let title = format!("{} {:?}", case.model.description.name, case.learns);
    write(&case.model, Path::new(&path("model"))).unwrap();
    let run = Run::of(&case.model, SAMPLES, case.learns.is_some());
    run.write(Path::new(&path("run")));
    let (mode, json) = match case.learns {
        None if case.frozen => ("frozen", "{}"),
        None => ("session", "{}"),
        Some((false, json)) => ("adapter", json),
        Some((true, json)) => ("guarded", json),
    };
    program.run(&[
        &path("model"),
        &path("run"),
        &path("results"),
        mode,
        json,
        &path("memory"),
        &path("learned"),
    ]);
    let of = if case.frozen { case.model.frozen() } else { case.model.clone() };
    let (expected, learned) = follow(&of, &run, options(case, &run.noise).as_ref());
    let found = numbers(Path::new(&path("results")));
    assert!(expected.iter().filter(|x| x.is_finite()).count() > expected.len() / 3, "{title}");
    same(&title, &expected, &found);
    if let Some(learned) = learned {
        let written = std::fs::read(path("learned")).unwrap();
        assert!(written == encode(&learned).unwrap(), "{title}: the learned model");
        let weights = encode(&case.model).unwrap();
        assert_ne!(written, weights, "{title} has learned nothing");
    }
}

fn sessions() -> Vec<Case> {
    let names = [
        "equations with past outputs",
        "gru on equations",
        "lstm with projection on hold, without feedback",
        "committee",
        "direct on equations",
        "affine",
        "otter",
        "hydrofoil",
        "equations behind a limit of the rate",
    ];
    let mut cases: Vec<Case> = names.iter().map(|name| case(name, None)).collect();
    cases.push(Case { frozen: false, model: stored(&in_current(model("equations"))), learns: None });
    // Its members adapt, unless it is frozen.
    cases.push(Case { frozen: true, ..case("committee", None) });
    cases
}

fn adapters() -> Vec<Case> {
    let in_current =
        Case { frozen: false, model: stored(&in_current(model("equations"))), learns: Some((true, CURRENT)) };
    vec![
        case("equations with lags", Some((false, ""))),
        case("equations", Some((true, KALMAN))),
        case("gru on hold", Some((false, BLOCKS))),
        case("lstm on nothing, without feedback", Some((true, ""))),
        case("lstm on hold", Some((true, REHEARSES))),
        case("direct on hold", Some((false, ""))),
        case("committee", Some((true, ""))),
        case("hydrofoil", Some((false, ""))),
        case("equations behind a limit of the rate", Some((true, ""))),
        in_current,
    ]
}

fn program(compiler: &Compiler) -> Program {
    Program::of(compiler, &sources().join("follow.c"))
}

#[test]
fn sessions_in_c_are_those_of_rust() {
    let program = program(&GCC);
    for case in sessions() {
        compare(&program, &case);
    }
}

#[test]
fn adapters_in_c_are_those_of_rust() {
    let program = program(&GCC);
    for case in adapters() {
        compare(&program, &case);
    }
}

#[test]
fn cpp_and_clang_compile_the_same() {
    for compiler in [CPP, CLANG] {
        if exists(&compiler) {
            let program = program(&compiler);
            compare(&program, &case("gru on equations", None));
            compare(&program, &case("equations with lags", Some((false, ""))));
        }
    }
}

#[test]
fn the_shared_library_does_the_same() {
    let libraries = libraries();
    let flags = Compiler { program: "cc", flags: &["-std=c99", "-O2"] };
    let (folder, path) = (format!("-L{libraries}"), format!("-Wl,-rpath,{libraries}"));
    let program = Program::linked(&flags, &sources().join("follow.c"), &[&folder, &path, "-lhydroid_c"]);
    compare(&program, &case("lstm on nothing, without feedback", Some((true, ""))));
}

fn libraries() -> String {
    crate::program::libraries().to_str().unwrap().to_owned()
}
