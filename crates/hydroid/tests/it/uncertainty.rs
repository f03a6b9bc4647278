//! Standard errors and correlations of the coefficients of identified equations.

use std::sync::Arc;

use hydroid::log::{Channel, Table, Trajectory};
use hydroid::model::{Body, CoefficientUncertainty, Learning, Members, Model, decode, write};
use hydroid::sindy::{
    BootstrapOptions, Constraints, FitOptions, LinearRegression, Optimizer, RegressionForm, RegressionOptions,
};
use hydroid_core::adapt::{ExpertMixtureOptions, InnovationGate};
use hydroid_core::model::sparse::Term;
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::equations::model;

/// `du/dt = -0.412 u - 2e-7 n + 0.5 u |u|`, `dr/dt = 7 r`, with an ensemble.
fn ship(members: &[Vec<f64>]) -> Model {
    let rows: [&[f64]; 2] = [&[-0.412_34, -2e-7, 0.5, 0.0], &[0.0, 0.0, 0.0, 7.0]];
    let terms = ["u", "n", "u |u|", "r"];
    let mut of = model(&[("u", "m/s"), ("r", "rad/s")], &[("n", "rps")], &terms, &rows);
    of.members = Members::new(members);
    of
}

/// The second member leaves `u |u|` out; no member contains `r`.
fn three() -> Vec<Vec<f64>> {
    let member = |u: f64, n: f64, drag: f64| [&[u, n, drag][..], &[0.0; 5]].concat();
    vec![member(-0.4, -2.0e-7, 0.5), member(-0.5, -2.2e-7, 0.0), member(-0.3, -1.8e-7, 1.0)]
}

#[test]
fn standard_errors_and_correlations_are_those_of_the_members() {
    let [surge, yaw] = &ship(&three()).coefficient_uncertainty().unwrap()[..] else {
        panic!("two equations")
    };
    assert_eq!((&surge.terms[..], &yaw.terms[..]), (&[0, 1, 2][..], &[3][..]));
    for (error, expected) in surge.standard_errors.iter().zip([0.1, 2e-8, 0.5]) {
        assert!((error.unwrap() / expected - 1.0).abs() < 1e-12, "{error:?} for {expected}");
    }
    assert!(surge.correlation.concat().iter().all(|r| (r - 1.0).abs() < 1e-12), "{surge:?}");
    // No member contains the term, so that the bootstrap does not determine its standard error.
    assert_eq!((&yaw.standard_errors[..], &yaw.correlation[..]), (&[None][..], &[vec![1.0]][..]));
    let mut constant = three();
    for member in &mut constant {
        member[2] = 0.1 + 0.2;
    }
    let [surge, _] = &ship(&constant).coefficient_uncertainty().unwrap()[..] else { panic!("two equations") };
    assert_eq!(
        (surge.standard_errors[2], surge.correlation[0][2], surge.correlation[2][2]),
        (None, 0.0, 1.0)
    );
    assert_eq!(surge.strongly_correlated().len(), 1);
}

#[test]
fn text_and_latex_round_to_the_standard_error() {
    let of = ship(&three());
    let motion = of.equations().unwrap();
    assert_eq!(
        motion.coefficients_text(),
        [
            "equation  term   coefficient        unit",
            "du/dt     u      -0.41 ± 0.10       1/s",
            "du/dt     n      (-2.00 ± 0.20)e-7  m/s^2/rps",
            "du/dt     u |u|  0.50 ± 0.50        1/m",
            "dr/dt     r      7.000              1/s",
        ]
    );
    assert_eq!(
        motion.correlations_text(),
        ["du/dt: u and n (1.00)", "du/dt: u and u |u| (1.00)", "du/dt: n and u |u| (1.00)"]
    );
    assert_eq!(
        motion.coefficients_latex(),
        r"
% Coefficients and standard errors (block bootstrap).
\begin{tabular}{llrl}
  \hline
  equation & term & coefficient & unit \\
  \hline
  $\dot{u}$ & $u$ & $-0.41 \pm 0.10$ & $\mathrm{s}^{-1}$ \\
  $\dot{u}$ & $n$ & $(-2.00 \pm 0.20) \times 10^{-7}$ & $\mathrm{m}\,\mathrm{s}^{-2}\,\mathrm{rps}^{-1}$ \\
  $\dot{u}$ & $u\,\lvert u\rvert$ & $0.50 \pm 0.50$ & $\mathrm{m}^{-1}$ \\
  $\dot{r}$ & $r$ & $7.000$ & $\mathrm{s}^{-1}$ \\
  \hline
\end{tabular}
"
    );
    let errors: Vec<Option<f64>> = motion.coefficients().iter().map(|c| c.standard_error).collect();
    assert!(errors[..3].iter().all(Option::is_some) && errors[3].is_none());
}

/// The value ends at the second significant digit of the standard error.
#[test]
fn digits_of_a_coefficient() {
    let estimate = |value: f64, error: f64| {
        let mut of = model(&[("u", "")], &[], &["1"], &[&[value]]);
        // The sample standard deviation of two values is their difference over the root of 2.
        of.members = Members::new(&[vec![0.0], vec![error * std::f64::consts::SQRT_2]]);
        let line = of.equations().unwrap().coefficients_text().remove(1);
        line.trim_start_matches("du/dt     1     ").trim_end_matches("[u]/s").trim().to_owned()
    };
    for (value, error, expected) in [
        (-0.412_34, 0.0131, "-0.412 ± 0.013"),
        (-0.412_34, 0.009_96, "-0.412 ± 0.010"),
        (12.345, 1.26, "12.3 ± 1.3"),
        (1234.5, 12.6, "1234 ± 13"),
        (1234.5, 126.0, "(1.23 ± 0.13)e3"),
        (-1.0, 3456.0, "(0.0 ± 3.5)e3"),
        (-1e-9, 0.013, "0.000 ± 0.013"),
        (1.234e-7, 1.5e-9, "(1.234 ± 0.015)e-7"),
        (9.999e-7, 2e-8, "(1.000 ± 0.020)e-6"),
        (1e300, 1e299, "(1.00 ± 0.10)e300"),
        (5e-310, 1e-309, "(0.5 ± 1.0)e-309"),
    ] {
        assert_eq!(estimate(value, error), expected, "{value} and {error}");
    }
}

#[test]
fn models_without_an_ensemble_have_no_standard_errors() {
    for members in [&[][..], &three()[..1]] {
        let of = ship(members);
        let motion = of.equations().unwrap();
        assert_eq!((of.coefficient_uncertainty(), motion.correlations()), (None, None));
        assert!(motion.coefficients_text().is_empty() && motion.correlations_text().is_empty());
        assert!(motion.coefficients_latex().is_empty() && motion.coefficients()[0].standard_error.is_none());
    }
    let settings = ExpertMixtureOptions {
        priors_s: vec![1.0],
        forgetting_s: 1.0,
        window: 1,
        horizon: 1,
        gate: InnovationGate::default(),
    };
    let learning = Some(Learning { settings, r_factor: vec![0.0; 16] });
    assert_eq!(Model { learning, ..ship(&three()) }.coefficient_uncertainty(), None);
}

#[test]
fn a_model_file_keeps_the_statistics() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ship.safetensors");
    let of = ship(&three());
    write(&of, &path).unwrap();
    let read = decode(&std::fs::read(&path).unwrap(), &path).unwrap();
    assert_eq!(read.coefficient_uncertainty(), of.coefficient_uncertainty());
}

const DT: f64 = 0.1;
const TRUTH: [f64; 2] = [-0.5, 0.8];

/// `dy/dt = a y + b c` under random steps, with white process and measurement noise.
fn run(seed: u64) -> Trajectory {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = |std: f64| -> f64 { std * Distribution::<f64>::sample(&StandardNormal, &mut rng) };
    let (mut y, mut c) = (0.0, 0.0);
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    let decay = (TRUTH[0] * DT).exp();
    for k in 0..3000 {
        if k % 30 == 0 {
            c = normal(1.0);
        }
        outputs.push(y + normal(0.003));
        inputs.push(c);
        y = decay * y + TRUTH[1] / TRUTH[0] * (decay - 1.0) * c + normal(0.01);
    }
    let table = |name: &str, values| Table::new(vec![Channel::new(name, "")], values);
    let (outputs, inputs) = (table("y", outputs), table("c", inputs));
    Trajectory {
        name: String::new(),
        t0: 0.0,
        dt: DT,
        outputs,
        inputs,
        truth: None,
        heading: None,
        position: None,
    }
}

fn identified(seed: u64) -> Model {
    let terms = vec![Term::monomial(&[0]), Term::monomial(&[1])];
    let form = RegressionForm::Weak { intervals: 10 };
    let options = RegressionOptions { groups: 24, ..RegressionOptions::default() };
    let regression = LinearRegression::with(&[&run(seed)], terms, form, &options).unwrap();
    let options = FitOptions {
        optimizer: Optimizer::Stepwise(0.0),
        ridge: 0.0,
        substeps: 1,
        constraints: Constraints::default(),
    };
    let bootstrap = BootstrapOptions { resamples: 50, seed, ..BootstrapOptions::default() };
    let members = regression.ensemble(&options, &bootstrap).unwrap().members;
    let equations = Arc::new(regression.fit(&options).unwrap().equations);
    let of = model(&[("y", "")], &[("c", "")], &["y", "c"], &[&[1.0, 1.0]]);
    Model { body: Body::Equations(equations), members: Members::new(&members), ..of }
}

/// Spread and correlation of the estimates over independent repetitions of the experiment.
#[test]
fn the_bootstrap_agrees_with_independent_repetitions() {
    let models: Vec<Model> = (0..200).map(identified).collect();
    let uncertainty: Vec<CoefficientUncertainty> =
        models.iter().map(|of| of.coefficient_uncertainty().unwrap().remove(0)).collect();
    let count = models.len() as f64;
    let estimates =
        |j: usize| models.iter().map(move |of| of.equations().unwrap().equations().coefficient(0, j));
    let deviations = [0, 1].map(|j| {
        let mean = estimates(j).sum::<f64>() / count;
        assert!((mean / TRUTH[j] - 1.0).abs() < 0.1, "{mean} for {}", TRUTH[j]);
        estimates(j).map(|x| x - mean).collect::<Vec<f64>>()
    });
    let sum = |i: usize, j: usize| deviations[i].iter().zip(&deviations[j]).map(|(a, b)| a * b).sum::<f64>();
    for j in [0, 1] {
        let spread = (sum(j, j) / (count - 1.0)).sqrt();
        let mean_square =
            uncertainty.iter().map(|of| of.standard_errors[j].unwrap().powi(2)).sum::<f64>() / count;
        let ratio = mean_square.sqrt() / spread;
        let held = |(x, of): &(f64, &CoefficientUncertainty)| {
            (x - TRUTH[j]).abs() < 2.0 * of.standard_errors[j].unwrap()
        };
        let share = estimates(j).zip(&uncertainty).filter(held).count() as f64 / count;
        println!(
            "coefficient {j}: standard error over spread {ratio:.2}; {share:.3} within two standard errors"
        );
        assert!((0.8..1.25).contains(&ratio) && share > 0.88, "coefficient {j}: {ratio}, {share}");
    }
    let true_correlation = sum(0, 1) / (sum(0, 0) * sum(1, 1)).sqrt();
    let correlation = uncertainty.iter().map(|of| of.correlation[0][1]).sum::<f64>() / count;
    println!("correlation {correlation:.2}, of the repetitions {true_correlation:.2}");
    assert!(true_correlation < -0.3 && (correlation - true_correlation).abs() < 0.2);
}

proptest! {
    #[test]
    fn statistics_are_finite_whatever_the_members_are(
        members in prop::collection::vec(prop::collection::vec(prop_oneof![
            Just(0.0), Just(f64::MAX), Just(f64::MIN), Just(5e-324), Just(1.0), any::<f64>(), any::<i8>().prop_map(f64::from),
        ], 8), 0..8),
    ) {
        let of = ship(&members);
        for equation in of.coefficient_uncertainty().into_iter().flatten() {
            prop_assert!(equation.standard_errors.iter().flatten().all(|x| x.is_finite() && *x >= 0.0));
            for (i, row) in equation.correlation.iter().enumerate() {
                prop_assert!(row.iter().all(|r| (-1.0..=1.0).contains(r)) && row[i] == 1.0);
                prop_assert!((0..row.len()).all(|j| row[j] == equation.correlation[j][i]));
            }
        }
        let motion = of.equations().unwrap();
        prop_assert!(!motion.coefficients_latex().contains("NaN"));
        let _ = (motion.coefficients_text(), motion.correlations_text());
    }
}
