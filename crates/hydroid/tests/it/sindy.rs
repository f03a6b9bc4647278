//! Identification of systems with known equations.

use std::ops::ControlFlow;
use std::path::PathBuf;

use hydroid::evaluate::{self, DesignRange};
use hydroid::excitation::Excitation;
use hydroid::log::{Channel, Table, Trajectory};
use hydroid::simulate::{Options, simulate};
use hydroid::sindy::{
    Assembled, Constraints, Fit, FitError, FitOptions, Library, LinearRegression, Loss, Optimizer,
    RegressionForm, Scaling, SearchError, SearchGrid, SearchOptions, SearchResult, Variables, assemble,
    search,
};
use hydroid_core::craft::Craft;
use hydroid_core::model::sparse::{Program, Term};
use proptest::prelude::*;

const MIDPOINT: RegressionForm = RegressionForm::Midpoint { intervals: 1 };

fn table(prefix: &str, rows: &[Vec<f64>], width: usize) -> Table {
    let channels: Vec<Channel> = (0..width).map(|j| Channel::new(format!("{prefix}{j}"), "")).collect();
    Table::new(channels, rows.concat())
}

fn run(dt: f64, outputs: &[Vec<f64>], inputs: &[Vec<f64>]) -> Trajectory {
    let width = |rows: &[Vec<f64>]| rows.first().map_or(0, Vec::len);
    Trajectory {
        name: String::from("made"),
        t0: 0.0,
        dt,
        outputs: table("y", outputs, width(outputs)),
        inputs: table("c", inputs, width(inputs)),
        truth: None,
        heading: None,
        position: None,
    }
}

/// Pseudo-random numbers in -1..1.
fn wild(k: usize, seed: usize) -> f64 {
    ((1.0 + 12.9898 * k as f64 + 78.233 * seed as f64).sin() * 43_758.545) % 1.0
}

/// `theta` at a point, `[y, c]`.
fn derivative(terms: &[Term], coefficients: &[f64], y: &[f64], c: &[f64]) -> Vec<f64> {
    let point = [y, c].concat();
    coefficients
        .chunks_exact(terms.len())
        .map(|row| terms.iter().zip(row).map(|(t, x)| x * t.value(&point)).sum())
        .collect()
}

/// Samples that satisfy the midpoint rule, `y+ = y + dt f((y + y+)/2, c)`: a regression without discretisation error.
fn obeying_the_midpoint_rule(
    terms: &[Term],
    coefficients: &[f64],
    (outputs, inputs): (usize, usize),
    samples: usize,
    seed: usize,
) -> Trajectory {
    let dt = 0.1;
    let mut y = vec![0.0; outputs];
    let (mut rows, mut commands) = (Vec::new(), Vec::new());
    for k in 0..samples {
        let c: Vec<f64> = (0..inputs).map(|j| 2.0 * wild(k / 5 * inputs + j, seed)).collect();
        rows.push(y.clone());
        let mut next = y.clone();
        for _ in 0..200 {
            let middle: Vec<f64> = y.iter().zip(&next).map(|(a, b)| 0.5 * (a + b)).collect();
            let rate = derivative(terms, coefficients, &middle, &c);
            next = y.iter().zip(&rate).map(|(y, f)| y + dt * f).collect();
        }
        y = next;
        commands.push(c);
    }
    run(dt, &rows, &commands)
}

fn fit(runs: &[&Trajectory], terms: &[Term], regression: RegressionForm, optimizer: Optimizer) -> Fit {
    LinearRegression::new(runs, terms.to_vec(), regression, &Scaling::Contribution)
        .unwrap()
        .fit(&FitOptions { optimizer, ridge: 0.0, substeps: 1, constraints: Constraints::default() })
        .unwrap()
}

/// A stable system of degree 2: linear damping, both inputs, and up to two more terms in each equation.
fn sparse_system() -> impl Strategy<Value = (Vec<Term>, Vec<f64>)> {
    let terms = Library::polynomial(2).terms(&Variables::plain(4, 0));
    let count = terms.len();
    let strong = prop_oneof![0.3..0.8f64, -0.8..-0.3f64];
    let extra = prop::collection::vec((5..count, prop_oneof![0.15..0.3f64, -0.3..-0.15f64]), 0..3);
    let equation = (0.8..1.5f64, strong, extra);
    prop::collection::vec(equation, 2).prop_map(move |equations| {
        let mut coefficients = vec![0.0; 2 * count];
        for (i, (damping, input, extra)) in equations.into_iter().enumerate() {
            let row = &mut coefficients[i * count..(i + 1) * count];
            for (term, value) in extra {
                row[term] = value;
            }
            row[1 + i] = -damping;
            row[3 + i] = input;
        }
        (terms.clone(), coefficients)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn exact_data_of_a_sparse_system_give_it_back_exactly((terms, truth) in sparse_system(), seed in 0usize..1000) {
        let data = obeying_the_midpoint_rule(&terms, &truth, (2, 2), 1500, seed);
        prop_assume!(data.outputs.column(0).chain(data.outputs.column(1)).all(|y| y.abs() < 10.0));
        for optimizer in [Optimizer::Stepwise(1e-3), Optimizer::Stlsq(1e-6)] {
            for regression in [MIDPOINT, RegressionForm::Midpoint { intervals: 7 }] {
                let fit = fit(&[&data], &terms, regression, optimizer);
                for (k, (got, expected)) in fit.equations.coefficients().iter().zip(&truth).enumerate() {
                    prop_assert!((got - expected).abs() < 1e-9, "{k}: {got} for {expected} ({optimizer:?})");
                    prop_assert_eq!(*got == 0.0, *expected == 0.0, "support at {} ({:?})", k, optimizer);
                }
                prop_assert!(fit.residual_rms.iter().all(|r| *r < 1e-10));
            }
        }
    }

    #[test]
    fn other_units_give_the_same_physical_equations(
        (terms, truth) in sparse_system(),
        powers in prop::collection::vec(-4i32..5, 4),
    ) {
        let mut data = obeying_the_midpoint_rule(&terms, &truth, (2, 2), 800, 1);
        add_noise(&mut data, 0.01);
        let scale: Vec<f64> = powers.iter().map(|p| 10f64.powi(*p)).collect();
        let scaled = |table: &Table, scale: &[f64]| {
            let rows: Vec<f64> = (0..table.len())
                .flat_map(|k| table.row(k).iter().zip(scale).map(|(x, s)| x * s).collect::<Vec<_>>())
                .collect();
            Table::new(table.channels().to_vec(), rows)
        };
        let other = Trajectory {
            outputs: scaled(&data.outputs, &scale[..2]),
            inputs: scaled(&data.inputs, &scale[2..]),
            ..data.clone()
        };
        for optimizer in [Optimizer::Stepwise(0.01), Optimizer::Stlsq(0.05)] {
            let regression = RegressionForm::Midpoint { intervals: 10 };
            let (one, two) = (fit(&[&data], &terms, regression, optimizer), fit(&[&other], &terms, regression, optimizer));
            for i in 0..2 {
                for (j, term) in terms.iter().enumerate() {
                    // xi has the unit of the output over that of the term.
                    let unit = scale[i] / term.value(&scale);
                    let (a, b) = (one.equations.coefficient(i, j), two.equations.coefficient(i, j) / unit);
                    prop_assert!((a - b).abs() <= 1e-8 * a.abs().max(1e-3), "({i}, {j}): {a} and {b}");
                }
            }
        }
    }

    #[test]
    fn channels_in_another_order_give_the_equations_in_that_order((terms, truth) in sparse_system()) {
        let mut data = obeying_the_midpoint_rule(&terms, &truth, (2, 2), 800, 2);
        add_noise(&mut data, 0.01);
        let swapped = |table: &Table| {
            Table::new(table.channels().to_vec(), (0..table.len()).flat_map(|k| [table.row(k)[1], table.row(k)[0]]).collect())
        };
        let other = Trajectory { outputs: swapped(&data.outputs), inputs: swapped(&data.inputs), ..data.clone() };
        let image = |variable: u16| [1u16, 0, 3, 2][usize::from(variable)];
        for optimizer in [Optimizer::Stepwise(0.01), Optimizer::Stlsq(0.05)] {
            let (one, two) = (fit(&[&data], &terms, MIDPOINT, optimizer), fit(&[&other], &terms, MIDPOINT, optimizer));
            for (j, term) in terms.iter().enumerate() {
                let variables: Vec<u16> = term
                    .factors()
                    .iter()
                    .flat_map(|f| std::iter::repeat_n(image(f.variable), usize::try_from(f.shape.degree()).unwrap()))
                    .collect();
                let twin = terms.iter().position(|t| *t == Term::monomial(&variables)).unwrap();
                for i in 0..2 {
                    let (a, b) = (one.equations.coefficient(i, j), two.equations.coefficient(1 - i, twin));
                    prop_assert!((a - b).abs() <= 1e-9, "({i}, {j}): {a} and {b}");
                }
            }
        }
    }
}

/// White noise on the outputs, uniform, from a fixed sequence.
fn add_noise(run: &mut Trajectory, amplitude: f64) {
    let values = run.outputs.rows(0, run.len());
    let noisy = values.iter().enumerate().map(|(k, y)| y + amplitude * wild(k, 77)).collect();
    run.outputs = Table::new(run.outputs.channels().to_vec(), noisy);
}

/// One output and one input: `y' = -y + c`, nothing missing.
fn linear(samples: usize) -> Trajectory {
    obeying_the_midpoint_rule(
        &Library::polynomial(1).terms(&Variables::plain(2, 0)),
        &[0.0, -1.0, 1.0],
        (1, 1),
        samples,
        3,
    )
}

fn assembled(runs: &[&Trajectory], regression: RegressionForm) -> Assembled {
    let program = Program::new(&Library::polynomial(1).terms(&Variables::plain(2, 0)), 2).unwrap();
    assemble(&program, runs, regression)
}

#[test]
fn a_row_that_touches_a_missing_sample_is_left_out_and_counted() {
    let mut data = linear(100);
    let mut values: Vec<f64> = data.outputs.column(0).collect();
    values[50] = f64::NAN;
    data.outputs = Table::new(data.outputs.channels().to_vec(), values);
    // Increments 49 and 50 have sample 50 at an end.
    let one = assembled(&[&data], MIDPOINT);
    assert_eq!((one.qr.rows(), one.skipped), (97, 2));
    // Rows start at 0, 1, .. 95 and use samples k .. k + 4 (stride 1 for four intervals).
    let four = assembled(&[&data], RegressionForm::Midpoint { intervals: 4 });
    assert_eq!((four.qr.rows(), four.skipped), (91, 5));
    // Central differences: neighbours of the sample, and the sample itself for the library.
    let central = assembled(&[&data], RegressionForm::Central);
    assert_eq!((central.qr.rows(), central.skipped), (97, 3));
    // The remaining rows are exact.
    let terms = Library::polynomial(1).terms(&Variables::plain(2, 0));
    let fit = fit(&[&data], &terms, MIDPOINT, Optimizer::Stlsq(0.0));
    for (got, expected) in fit.equations.coefficients().iter().zip([0.0, -1.0, 1.0]) {
        assert!((got - expected).abs() < 1e-10);
    }
}

#[test]
fn runs_are_never_joined() {
    // Across the ends of the runs, an increment would be 100/s.
    let first = linear(300);
    let mut second = linear(301);
    let moved: Vec<f64> = second.outputs.column(0).map(|y| y + 10.0).collect();
    second.outputs = Table::new(second.outputs.channels().to_vec(), moved);
    for (regression, rows) in [
        (MIDPOINT, 299 + 300),
        (RegressionForm::Midpoint { intervals: 8 }, 146 + 147),
        (RegressionForm::Central, 601),
    ] {
        let both = assembled(&[&first, &second], regression);
        let mut parts = assembled(&[&first], regression).qr;
        parts.merge(&assembled(&[&second], regression).qr);
        assert_eq!(both.qr.rows(), rows);
        for i in 0..4 {
            for j in i..4 {
                let (a, b) = (both.qr.get(i, j), parts.get(i, j));
                assert!((a.abs() - b.abs()).abs() < 1e-10, "({i}, {j}): {a} and {b}");
            }
        }
        // y' = -y + c in both, with y - 10 in the second.
        assert!(both.qr.column_norm(3) < 60.0, "{}", both.qr.column_norm(3));
    }
}

#[test]
fn a_run_too_short_for_a_row_gives_none() {
    for regression in [MIDPOINT, RegressionForm::Midpoint { intervals: 20 }, RegressionForm::Central] {
        for samples in 0..=21 {
            let data = linear(samples);
            let expected = match regression {
                RegressionForm::Midpoint { intervals } if samples > intervals => {
                    (samples - intervals - 1) / (intervals / 4).max(1) + 1
                }
                RegressionForm::Central if samples >= 3 => samples,
                _ => 0,
            };
            if samples > 0 {
                assert_eq!(assembled(&[&data], regression).qr.rows(), expected as u64);
            }
        }
    }
    let terms = Library::polynomial(1).terms(&Variables::plain(2, 0));
    let refused = LinearRegression::new(&[&linear(4)], terms.clone(), MIDPOINT, &Scaling::Contribution);
    assert_eq!(refused.unwrap_err(), FitError::TooFewRows { rows: 3, skipped: 0, terms: 3 });
    let none = LinearRegression::new(&[], terms, MIDPOINT, &Scaling::Contribution);
    assert_eq!(none.unwrap_err(), FitError::TooFewRows { rows: 0, skipped: 0, terms: 3 });
}

#[test]
fn a_constant_or_unmeasured_output_is_refused() {
    let terms = Library::polynomial(1).terms(&Variables::plain(2, 0));
    for (value, constant) in [(0.0, true), (0.1, true), (f64::NAN, false)] {
        let mut data = linear(50);
        data.outputs = Table::new(data.outputs.channels().to_vec(), vec![value; 50]);
        let refused =
            LinearRegression::new(&[&data], terms.clone(), MIDPOINT, &Scaling::Contribution).unwrap_err();
        if constant {
            assert_eq!(refused, FitError::Constant(String::from("y0")));
        } else {
            assert_eq!(refused, FitError::TooFewRows { rows: 0, skipped: 49, terms: 3 });
        }
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    // More than one piece of 4096 rows, and more pieces than threads.
    let mut data = linear(30_000);
    add_noise(&mut data, 0.01);
    let other = linear(5_000);
    let triangle = |threads: usize, regression| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| assembled(&[&data, &other], regression).qr)
    };
    for regression in [MIDPOINT, RegressionForm::Midpoint { intervals: 6 }, RegressionForm::Central] {
        let one = triangle(1, regression);
        for threads in [2, 3] {
            assert_eq!(triangle(threads, regression), one, "{threads} threads, {regression:?}");
        }
    }
}

#[test]
fn a_library_over_outputs_alone() {
    // A damped oscillator without inputs.
    let terms = Library::polynomial(2).terms(&Variables::plain(2, 0));
    let truth = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, -0.1, 0.0, 0.0, 0.0];
    let mut data = obeying_the_midpoint_rule(&terms, &truth, (2, 0), 2, 0);
    let mut y = vec![1.0, 0.0];
    let mut rows = Vec::new();
    for _ in 0..400 {
        rows.push(y.clone());
        let mut next = y.clone();
        for _ in 0..100 {
            let middle: Vec<f64> = y.iter().zip(&next).map(|(a, b)| 0.5 * (a + b)).collect();
            let rate = derivative(&terms, &truth, &middle, &[]);
            next = y.iter().zip(&rate).map(|(y, f)| y + 0.1 * f).collect();
        }
        y = next;
    }
    data.outputs = table("y", &rows, 2);
    let fit = fit(&[&data], &terms, MIDPOINT, Optimizer::Stepwise(1e-3));
    for (got, expected) in fit.equations.coefficients().iter().zip(truth) {
        assert!((got - expected).abs() < 1e-9);
    }
    assert_eq!((fit.equations.inputs(), fit.equations.active_terms()), (0, 3));
}

/// The reported residual excludes the ridge penalty.
#[test]
fn the_residual_of_a_ridge_fit_is_that_of_the_data() {
    let mut data = linear(2_000);
    add_noise(&mut data, 0.01);
    let terms = Library::polynomial(1).terms(&Variables::plain(2, 0));
    let prepared = LinearRegression::new(&[&data], terms, MIDPOINT, &Scaling::Contribution).unwrap();
    for (optimizer, ridge) in
        [(Optimizer::Stepwise(0.01), 0.0), (Optimizer::Stepwise(0.01), 0.3), (Optimizer::Stlsq(0.01), 0.3)]
    {
        let fit = prepared
            .fit(&FitOptions { optimizer, ridge, substeps: 1, constraints: Constraints::default() })
            .unwrap();
        let [constant, y, c] = [0, 1, 2].map(|j| fit.equations.coefficient(0, j));
        let rows = data.len() - 1;
        let squares: f64 = (0..rows)
            .map(|k| {
                let (a, b) = (data.outputs.row(k)[0], data.outputs.row(k + 1)[0]);
                (10.0 * (b - a) - constant - y * 0.5 * (a + b) - c * data.inputs.row(k)[0]).powi(2)
            })
            .sum();
        let expected = (squares / rows as f64).sqrt();
        let got = fit.residual_rms[0];
        assert!((got / expected - 1.0).abs() < 1e-9, "{got} for {expected} ({optimizer:?}, ridge {ridge})");
    }
}

fn grid(degree: u8) -> SearchGrid {
    SearchGrid {
        structures: vec![Library::polynomial(degree).into()],
        regressions: vec![MIDPOINT],
        optimizers: vec![Optimizer::Stepwise(0.01), Optimizer::Stepwise(0.02)],
        ridges: vec![0.0, 1e-6],
        loss: Loss::Squares,
        constraints: Vec::new(),
        noise: None,
        refine: None,
    }
}

fn search_of(data: &Trajectory, grid: &SearchGrid) -> Result<SearchResult, SearchError> {
    let options = evaluate::Options { horizon: 10, ..evaluate::Options::default() };
    let range = [DesignRange { low: -3.0, high: 3.0 }];
    let judge = SearchOptions {
        validation: &[data],
        outputs: &range,
        inputs: &range,
        evaluation: options,
        seed: 0,
        ensemble_size: 10,
        refine_samples: 100_000,
    };
    search(&[data], &judge, grid, &mut |_| ControlFlow::Continue(()))
}

#[test]
fn the_search_chooses_by_prediction_error_and_lists_the_candidates() {
    let mut data = linear(1_000);
    add_noise(&mut data, 0.01);
    let mut both = grid(1);
    both.structures.push(Library::polynomial(0).into());
    let found = search_of(&data, &both).unwrap();
    let chosen = &found.trials[found.chosen];
    assert_eq!(chosen.structure.library, Library::polynomial(1), "a constant predicts nothing");
    let best = found.trials.iter().filter_map(|t| t.score).fold(f64::INFINITY, f64::min);
    assert!(chosen.score.unwrap() <= 1.02 * best, "the simplest within the noise of the best");
    let ensemble = found.ensemble.unwrap();
    let decay = found.fit.equations.terms().iter().position(|t| *t == Term::monomial(&[0])).unwrap();
    assert!(
        (ensemble.low[decay]..=ensemble.high[decay]).contains(&found.fit.equations.coefficient(0, decay))
    );
    assert!(ensemble.inclusion[decay] == 1.0 && found.stability.is_bounded());
    assert!(found.trials.len() < 8, "a setting that changes nothing is not judged again");
    assert_eq!((found.rows, found.unidentifiable.len()), ((999, 0), 0));
    assert!((found.fit.equations.coefficient(0, 1) + 1.0).abs() < 0.05);
    assert!(matches!(
        search_of(&data, &SearchGrid { ridges: Vec::new(), ..grid(1) }),
        Err(SearchError::Empty)
    ));
}

/// Regression test: `--degree 50` required some hundred gigabytes.
#[test]
fn a_huge_library_is_refused_before_it_is_built() {
    let data = linear(100);
    for degree in [100, 255] {
        let refused = search_of(&data, &grid(degree)).unwrap_err();
        let SearchError::LibraryTooLarge { terms, .. } = refused else { panic!("{refused}") };
        // Monomials in two variables up to degree d: (d + 1)(d + 2)/2.
        assert_eq!(terms, (usize::from(degree) + 1) * (usize::from(degree) + 2) / 2);
    }
    // A library that is too large is skipped if another one is small enough.
    let mut both = grid(1);
    both.structures.push(Library::polynomial(255).into());
    assert_eq!(search_of(&data, &both).unwrap().trials[0].structure.library, Library::polynomial(1));
}

/// The true coefficients of the simple plant, `[equation][term]`, in physical units; the reference has forces in 100 N
/// and the rudder command in 10 N s.
fn simple_plant_truth(terms: &[Term]) -> Vec<f64> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden/simple_coefficients.json");
    let reference: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let (names, scales) = (["u", "v", "r", "P_f", "PP", "RD"], [1.0, 1.0, 1.0, 100.0, 100.0, 10.0]);
    let mut found = 0;
    let mut coefficients = Vec::new();
    for (i, equation) in ["u_dot", "v_dot", "r_dot", "P_f_dot"].into_iter().enumerate() {
        let true_terms = reference["true_coefficients"][equation].as_object().unwrap();
        for term in terms {
            let scaled = true_terms.get(&term.name(&names)).map_or(0.0, |c| c.as_f64().unwrap());
            found += usize::from(scaled != 0.0);
            coefficients.push(scaled * scales[i] / term.value(&scales));
        }
    }
    assert_eq!(found, 14, "the reference names 14 terms, all in the library");
    coefficients
}

/// Two hours of the simple plant under mixed commands: 72,000 samples.
fn simple_plant(seed: u64, noise_scale: f64) -> Trajectory {
    let options = Options { seed, noise_scale, ..Options::new(Craft::simple(), Excitation::Mixed) };
    let record = simulate(&options, &mut |_| ControlFlow::Continue(())).unwrap();
    assert_eq!(record.len(), 72_000);
    record.to_trajectory(&["u", "v", "r", "P_f"]).unwrap()
}

struct Comparison {
    missing: usize,
    spurious: usize,
    mean_error: f64,
}

fn compare(fit: &Fit, truth: &[f64]) -> Comparison {
    let mut result = Comparison { missing: 0, spurious: 0, mean_error: 0.0 };
    for (got, expected) in fit.equations.coefficients().iter().zip(truth) {
        if *expected == 0.0 {
            result.spurious += usize::from(*got != 0.0);
        } else {
            result.missing += usize::from(*got == 0.0);
            result.mean_error += (got / expected - 1.0).abs() / 14.0;
        }
    }
    result
}

#[test]
fn the_simple_plant_without_noise_is_found_exactly() {
    let terms = Library::polynomial(2).terms(&Variables::plain(6, 0));
    let truth = simple_plant_truth(&terms);
    for seed in [0, 1] {
        let data = simple_plant(seed, 0.0);
        for tolerance in [0.001, 0.01, 0.05] {
            let fit = fit(&[&data], &terms, MIDPOINT, Optimizer::Stepwise(tolerance));
            let Comparison { missing, spurious, mean_error } = compare(&fit, &truth);
            assert_eq!((missing, spurious), (0, 0), "seed {seed}, tolerance {tolerance}");
            assert!(mean_error < 0.01, "mean relative error {mean_error}");
        }
    }
}

#[test]
fn the_simple_plant_with_noise_misses_nothing_and_adds_little() {
    let terms = Library::polynomial(2).terms(&Variables::plain(6, 0));
    let truth = simple_plant_truth(&terms);
    for seed in 0..4 {
        let data = simple_plant(seed, 1.0);
        for (intervals, tolerance) in [(10, 0.005), (10, 0.01), (20, 0.005), (20, 0.01), (20, 0.02)] {
            let fit =
                fit(&[&data], &terms, RegressionForm::Midpoint { intervals }, Optimizer::Stepwise(tolerance));
            let Comparison { missing, spurious, mean_error } = compare(&fit, &truth);
            let what = format!("seed {seed}, {intervals} intervals, tolerance {tolerance}");
            assert_eq!(missing, 0, "{what}");
            assert!(spurious <= 3, "{what}: {spurious} spurious terms");
            // 3.0 to 4.0 % are usual: noise at the midpoint attenuates the coefficients.
            assert!(mean_error < 0.06, "{what}: mean relative error {mean_error}");
        }
    }
}
