//! Thresholded least squares compared with PySINDy, on records beyond the golden files.
//!
//! The Python with PySINDy is `HYDROID_PYTHON` or `python3`; without PySINDy the test says so and passes.

use std::fmt::Write as _;
use std::io::Write as _;
use std::process::{Command, Stdio};

use hydroid::excitation::Excitation;
use hydroid::progress::silent;
use hydroid::simulate::{Options, simulate};
use hydroid::sindy::{
    Constraints, FitOptions, Library, LinearRegression, Optimizer, RegressionForm, Scaling, Variables,
};
use hydroid_core::craft::Craft;

fn python() -> Option<String> {
    let python = std::env::var("HYDROID_PYTHON").unwrap_or_else(|_| String::from("python3"));
    let there = Command::new(&python)
        .args(["-c", "import pysindy"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success());
    if !there {
        let _ = writeln!(
            std::io::stderr(),
            "skipped: no PySINDy (pip install pysindy, or name a Python that has it in HYDROID_PYTHON)"
        );
    }
    there.then_some(python)
}

#[test]
fn thresholded_least_squares_equals_pysindy_on_the_hydrofoil() {
    let Some(python) = python() else { return };
    let options =
        Options { duration_s: 300.0, seed: 11, ..Options::new(Craft::hydrofoil(), Excitation::Mixed) };
    let run = simulate(&options, &mut silent()).unwrap().to_trajectory(&["u", "v", "r"]).unwrap();
    // PySINDy thresholds raw coefficients: the propeller is scaled to 100 N.
    let scales = [1.0, 1.0, 1.0, 100.0, 1.0];
    for (degree, threshold) in [(1, 0.0), (2, 0.02), (2, 0.1), (3, 0.05)] {
        let terms = Library::polynomial(degree).terms(&Variables::plain(5, 0));
        let count = terms.len();
        let scaling = Scaling::Variables(scales.to_vec());
        let prepared = LinearRegression::new(&[&run], terms, RegressionForm::Central, &scaling).unwrap();
        let alpha = 1e-6;
        let fit = FitOptions {
            optimizer: Optimizer::Stlsq(threshold),
            ridge: alpha / prepared.rows() as f64,
            substeps: 1,
            constraints: Constraints::default(),
        };
        let ours = prepared.fit(&fit).unwrap().scaled;

        let mut input = format!("{},3,{degree},{threshold},{alpha}\n", run.dt);
        for k in 0..run.len() {
            let row = run.outputs.row(k).iter().chain(run.inputs.row(k)).zip(scales);
            let cells: Vec<String> = row.map(|(value, scale)| (value / scale).to_string()).collect();
            writeln!(input, "{}", cells.join(",")).unwrap();
        }
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/peers/pysindy_fit.py");
        let mut child =
            Command::new(&python).arg(script).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success());
        let theirs: Vec<Vec<f64>> = serde_json::from_slice(&output.stdout).unwrap();

        for (ours, theirs) in ours.chunks_exact(count).zip(&theirs) {
            assert_eq!(theirs.len(), count);
            for (a, b) in ours.iter().zip(theirs) {
                assert!((a - b).abs() <= 1e-6 * b.abs().max(1.0), "degree {degree}, {threshold}: {a} {b}");
            }
        }
    }
}
