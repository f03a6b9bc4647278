//! The regressions against coefficients of PySINDy 2.1.0 and an independent implementation (`tests/golden`).

use std::path::PathBuf;

use hydroid::log::{Channel, Table, Trajectory};
use hydroid::sindy::{
    Constraints, FitOptions, Library, LinearRegression, Optimizer, RegressionForm, Scaling, Variables,
};
use serde_json::Value;

fn golden(name: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden").join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn columns(name: &str) -> impl Fn(&str) -> Vec<f64> {
    let text = golden(name);
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header: Vec<String> =
        reader.headers().unwrap().iter().map(|h| h.split(" [").next().unwrap().to_owned()).collect();
    let rows: Vec<Vec<f64>> =
        reader.records().map(|r| r.unwrap().iter().map(|v| v.parse().unwrap()).collect()).collect();
    move |wanted| {
        let at = header.iter().position(|h| h == wanted).unwrap_or_else(|| panic!("no column {wanted}"));
        rows.iter().map(|row| row[at]).collect()
    }
}

fn table(names: &[&str], columns: &[Vec<f64>]) -> Table {
    let channels: Vec<Channel> = names.iter().map(|n| Channel::new(*n, "")).collect();
    let values = (0..columns[0].len()).flat_map(|k| columns.iter().map(move |c| c[k])).collect();
    Table::new(channels, values)
}

fn simple(noisy: bool) -> Trajectory {
    let column = columns("simple_3000.csv");
    let outputs = ["u", "v", "r", "P_f"];
    let measured: Vec<Vec<f64>> =
        outputs.iter().map(|n| column(&if noisy { format!("{n}_noisy") } else { (*n).to_owned() })).collect();
    Trajectory {
        name: String::from("simple_3000"),
        t0: 0.0,
        dt: 0.1,
        outputs: table(&outputs, &measured),
        inputs: table(&["PP", "RD"], &[column("PP_cmd"), column("RD_cmd")]),
        truth: None,
        heading: None,
        position: None,
    }
}

/// Scaled coefficients, `[equation][term]`.
fn scaled(
    run: &Trajectory,
    regression: RegressionForm,
    scales: &[f64],
    threshold: f64,
    alpha: f64,
) -> Vec<Vec<f64>> {
    let terms = Library::polynomial(2).terms(&Variables::of(run));
    let count = terms.len();
    let prepared =
        LinearRegression::new(&[run], terms, regression, &Scaling::Variables(scales.to_vec())).unwrap();
    let ridge = alpha / prepared.rows() as f64;
    let fit = prepared
        .fit(&FitOptions {
            optimizer: Optimizer::Stlsq(threshold),
            ridge,
            substeps: 1,
            constraints: Constraints::default(),
        })
        .unwrap();
    fit.scaled.chunks_exact(count).map(<[f64]>::to_vec).collect()
}

fn names(run: &Trajectory) -> Vec<String> {
    let names: Vec<&str> =
        run.outputs.channels().iter().chain(run.inputs.channels()).map(|c| c.name.as_str()).collect();
    Library::polynomial(2).terms(&Variables::of(run)).iter().map(|t| t.name(&names)).collect()
}

/// Largest difference from the reference over all coefficients.
fn difference(ours: &[Vec<f64>], names: &[String], equations: &[&str], reference: &Value) -> f64 {
    let mut worst = 0.0f64;
    for (ours, equation) in ours.iter().zip(equations) {
        let theirs = reference[equation].as_object().unwrap();
        for name in theirs.keys() {
            assert!(names.contains(name), "unknown term {name}");
        }
        for (name, value) in names.iter().zip(ours) {
            let expected = theirs.get(name).map_or(0.0, |v| v.as_f64().unwrap());
            worst = worst.max((value - expected).abs());
        }
    }
    worst
}

#[test]
fn simple_plant_coefficients_equal_pysindy_and_the_midpoint_reference() {
    let reference: Value = serde_json::from_str(&golden("simple_coefficients.json")).unwrap();
    let mut compared = 0;
    for (section, regression) in [
        ("pysindy_finite_difference", RegressionForm::Central),
        ("zero_order_hold_midpoint", RegressionForm::Midpoint { intervals: 1 }),
    ] {
        for (case, result) in reference["results"][section].as_object().unwrap() {
            let run = simple(result["data"] == "noisy");
            let ours = scaled(
                &run,
                regression,
                &[1.0, 1.0, 1.0, 100.0, 100.0, 10.0],
                result["threshold"].as_f64().unwrap(),
                result["alpha"].as_f64().unwrap(),
            );
            let worst = difference(
                &ours,
                &names(&run),
                &["u_dot", "v_dot", "r_dot", "P_f_dot"],
                &result["coefficients"],
            );
            assert!(worst < 1e-9, "{section}, {case}: off by {worst:e}");
            compared += 1;
        }
    }
    assert!(compared >= 8, "only {compared} cases in the reference");
}

#[test]
fn lorenz_coefficients_equal_pysindy() {
    let reference: Value = serde_json::from_str(&golden("lorenz_coefficients.json")).unwrap();
    let column = columns("lorenz_5000.csv");
    let run = Trajectory {
        name: String::from("lorenz"),
        t0: 0.0,
        dt: 0.002,
        outputs: table(&["x", "y", "z"], &[column("x"), column("y"), column("z")]),
        inputs: table_without_columns(),
        truth: None,
        heading: None,
        position: None,
    };
    let terms = names(&run);
    for (case, result) in reference["results"].as_object().unwrap() {
        let ours = scaled(
            &run,
            RegressionForm::Central,
            &[1.0; 3],
            result["threshold"].as_f64().unwrap(),
            result["alpha"].as_f64().unwrap(),
        );
        let worst = difference(&ours, &terms, &["x_dot", "y_dot", "z_dot"], &result["coefficients"]);
        assert!(worst < 1e-9, "{case}: off by {worst:e}");
    }
}

fn table_without_columns() -> Table {
    Table::new(Vec::new(), Vec::new())
}
