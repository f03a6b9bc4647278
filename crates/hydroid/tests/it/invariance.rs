//! Identification does not depend on units and on the order of terms and inputs, and finds random sparse systems
//! exactly.

use hydroid::log::{Channel, Table, Trajectory};
use hydroid::sindy::{
    Constraints, Family, Fit, FitOptions, Library, LinearRegression, Optimizer, RegressionForm, Scaling,
    Variables,
};
use hydroid_core::model::sparse::{Factor, Term};
use proptest::prelude::*;

const DT: f64 = 0.1;
const OUTPUTS: usize = 3;
const INPUTS: usize = 2;
const WEAK: RegressionForm = RegressionForm::Weak { intervals: 10 };

/// Monomials up to degree 2 and signed squares: homogeneous, each in every variable.
fn terms() -> Vec<Term> {
    Library::polynomial(2).with(Family::SignedSquares).terms(&Variables::plain(OUTPUTS, INPUTS))
}

/// Random equations over the library: `outputs x terms`.
#[derive(Clone, Debug)]
struct System {
    terms: Vec<Term>,
    coefficients: Vec<f64>,
}

impl System {
    fn rate(&self, y: &[f64], c: &[f64]) -> Vec<f64> {
        let point = [y, c].concat();
        let theta: Vec<f64> = self.terms.iter().map(|term| term.value(&point)).collect();
        let rows = self.coefficients.chunks_exact(self.terms.len());
        rows.map(|row| row.iter().zip(&theta).map(|(x, t)| x * t).sum()).collect()
    }

    fn active(&self) -> usize {
        self.coefficients.iter().filter(|c| **c != 0.0).count()
    }
}

/// RMS error of the accelerations along a run, relative to their RMS, for each output.
fn relative_errors(system: &System, found: &System, run: &Trajectory) -> [f64; OUTPUTS] {
    let (mut errors, mut squares) = ([0.0; OUTPUTS], [0.0; OUTPUTS]);
    for k in 0..run.len() {
        let (y, c) = (run.outputs.row(k), run.inputs.row(k));
        let (truth, got) = (system.rate(y, c), found.rate(y, c));
        for i in 0..OUTPUTS {
            errors[i] += (got[i] - truth[i]).powi(2);
            squares[i] += truth[i].powi(2);
        }
    }
    std::array::from_fn(|i| (errors[i] / squares[i]).sqrt())
}

/// Every output has damping and a command, and up to two more terms, quadratic drag and a steady force.
fn system() -> impl Strategy<Value = System> {
    let terms = terms();
    let count = terms.len();
    let place = |term: Term| terms.iter().position(|t| *t == term).unwrap();
    let variable = |j: usize| u16::try_from(j).unwrap();
    let damping: Vec<usize> = (0..OUTPUTS).map(|i| place(Term::monomial(&[variable(i)]))).collect();
    let drag: Vec<usize> =
        (0..OUTPUTS).map(|i| place(Term::signed_square(variable(i), variable(i)))).collect();
    let command: Vec<usize> =
        (0..OUTPUTS).map(|i| place(Term::monomial(&[variable(OUTPUTS + i % INPUTS)]))).collect();
    let either = |low: f64, high: f64| prop_oneof![low..high, -high..-low];
    let equation = (
        0.8..1.5f64,
        either(0.8, 1.5),
        prop::option::of(0.3..0.8f64),
        prop::option::of(either(0.1, 0.3)),
        prop::collection::vec((1 + OUTPUTS + INPUTS..count, either(0.15, 0.3)), 0..3),
    );
    prop::collection::vec(equation, OUTPUTS).prop_map(move |equations| {
        let mut coefficients = vec![0.0; OUTPUTS * count];
        for (i, (linear, thrust, quadratic, steady, others)) in equations.into_iter().enumerate() {
            let row = &mut coefficients[i * count..(i + 1) * count];
            for (term, value) in others {
                row[term] = value;
            }
            row[0] = steady.unwrap_or(0.0);
            row[damping[i]] = -linear;
            row[command[i]] = thrust;
            if let Some(quadratic) = quadratic {
                row[drag[i]] = -quadratic;
            }
        }
        System { terms: terms.clone(), coefficients }
    })
}

/// Pseudo-random numbers in -1..1.
fn wild(k: usize, seed: usize) -> f64 {
    ((1.0 + 12.9898 * k as f64 + 78.233 * seed as f64).sin() * 43_758.545) % 1.0
}

fn trajectory(outputs: Vec<f64>, inputs: Vec<f64>, dt: f64) -> Trajectory {
    let channels = |name: &str, width| (0..width).map(|j| Channel::new(format!("{name}{j}"), "")).collect();
    let (first, second): (Vec<Channel>, Vec<Channel>) = (channels("y", OUTPUTS), channels("c", INPUTS));
    Trajectory {
        name: String::from("made"),
        t0: 0.0,
        dt,
        outputs: Table::new(first, outputs),
        inputs: Table::new(second, inputs),
        truth: None,
        heading: None,
        position: None,
    }
}

/// A run under commands held for five samples; none if it diverges.
fn driven(samples: usize, seed: usize, next: impl Fn(&[f64], &[f64]) -> Vec<f64>) -> Option<Trajectory> {
    let mut y = vec![0.0; OUTPUTS];
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    for k in 0..samples {
        let c: Vec<f64> = (0..INPUTS).map(|j| 2.5 * wild(k / 5 * INPUTS + j, seed)).collect();
        outputs.extend_from_slice(&y);
        y = next(&y, &c);
        inputs.extend(c);
        if y.iter().any(|y| y.is_nan() || y.abs() > 6.0) {
            return None;
        }
    }
    Some(trajectory(outputs, inputs, DT))
}

/// Samples that satisfy the midpoint rule, `y+ = y + dt f((y + y+)/2, c)`: a regression without discretisation error.
fn by_midpoints(system: &System, samples: usize, seed: usize) -> Option<Trajectory> {
    driven(samples, seed, |y, c| {
        let mut next = y.to_vec();
        for _ in 0..200 {
            let middle: Vec<f64> = y.iter().zip(&next).map(|(a, b)| 0.5 * (a + b)).collect();
            let rate = system.rate(&middle, c);
            let after: Vec<f64> = y.iter().zip(&rate).map(|(y, f)| y + DT * f).collect();
            let change = after.iter().zip(&next).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            next = after;
            if change <= 1e-14 {
                return next;
            }
        }
        // Too stiff for this iteration.
        vec![f64::NAN; OUTPUTS]
    })
}

/// Samples of the system itself, integrated with RK4 in steps of 10 ms.
fn integrated(system: &System, samples: usize, seed: usize) -> Option<Trajectory> {
    let along =
        |y: &[f64], k: &[f64], h: f64| -> Vec<f64> { y.iter().zip(k).map(|(y, k)| y + h * k).collect() };
    driven(samples, seed, |y, c| {
        let mut y = y.to_vec();
        let h = 0.1 * DT;
        for _ in 0..10 {
            let k1 = system.rate(&y, c);
            let k2 = system.rate(&along(&y, &k1, 0.5 * h), c);
            let k3 = system.rate(&along(&y, &k2, 0.5 * h), c);
            let k4 = system.rate(&along(&y, &k3, h), c);
            for i in 0..OUTPUTS {
                y[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
            }
        }
        y
    })
}

fn with_noise(mut run: Trajectory) -> Trajectory {
    let noisy =
        run.outputs.rows(0, run.len()).iter().enumerate().map(|(k, y)| y + 0.01 * wild(k, 77)).collect();
    run.outputs = Table::new(run.outputs.channels().to_vec(), noisy);
    run
}

fn fit(
    run: &Trajectory,
    terms: &[Term],
    regression: RegressionForm,
    optimizer: Optimizer,
    ridge: f64,
) -> Fit {
    let options = FitOptions { optimizer, ridge, substeps: 1, constraints: Constraints::default() };
    LinearRegression::new(&[run], terms.to_vec(), regression, &Scaling::Contribution)
        .unwrap()
        .fit(&options)
        .unwrap()
}

fn columns(table: &Table, scales: &[f64]) -> Vec<f64> {
    (0..table.len())
        .flat_map(|k| table.row(k).iter().zip(scales).map(|(x, s)| x * s).collect::<Vec<_>>())
        .collect()
}

fn moved(term: &Term, to: &[u16]) -> Term {
    let factors = term.factors().iter().map(|f| Factor { variable: to[usize::from(f.variable)], ..*f });
    Term::new(factors.collect())
}

/// Agreement to `1e-7`, relative where a coefficient is not tiny.
fn same(a: f64, b: f64) -> bool {
    (a == 0.0) == (b == 0.0) && (a - b).abs() <= 1e-7 * a.abs().max(1e-3)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// The equations do not depend on the units of length, force and time.
    #[test]
    fn units_do_not_matter(
        system in system(),
        powers in prop::collection::vec(-4.0..4.0f64, OUTPUTS + INPUTS),
        clock in -3.0..3.0f64,
        ridge in prop_oneof![Just(0.0), Just(1e-3), Just(0.3)],
    ) {
        let run = by_midpoints(&system, 800, 1).map(with_noise);
        prop_assume!(run.is_some());
        let run = run.unwrap();
        let scales: Vec<f64> = powers.iter().map(|p| 10f64.powf(*p)).collect();
        let second = 10f64.powf(clock);
        let other = trajectory(
            columns(&run.outputs, &scales[..OUTPUTS]),
            columns(&run.inputs, &scales[OUTPUTS..]),
            DT * second,
        );
        let optimizer = Optimizer::Stepwise(0.01);
        let one = fit(&run, &system.terms, WEAK, optimizer, ridge).equations;
        let two = fit(&other, &system.terms, WEAK, optimizer, ridge).equations;
        for i in 0..OUTPUTS {
            for (j, term) in system.terms.iter().enumerate() {
                // A coefficient has the unit of the output over those of the term and of time.
                let unit = scales[i] / term.value(&scales) / second;
                let (a, b) = (one.coefficient(i, j), two.coefficient(i, j) / unit);
                prop_assert!(same(a, b), "({i}, {j}): {a} and {b}");
            }
        }
    }

    /// The order of the terms in a library has no effect.
    #[test]
    fn the_order_of_terms_does_not_matter(
        system in system(),
        order in Just((0..terms().len()).collect::<Vec<_>>()).prop_shuffle(),
    ) {
        let run = by_midpoints(&system, 800, 2).map(with_noise);
        prop_assume!(run.is_some());
        let run = run.unwrap();
        let shuffled: Vec<Term> = order.iter().map(|&j| system.terms[j].clone()).collect();
        for optimizer in [Optimizer::Stepwise(0.01), Optimizer::Stlsq(0.05)] {
            let one = fit(&run, &system.terms, WEAK, optimizer, 1e-6).equations;
            let two = fit(&run, &shuffled, WEAK, optimizer, 1e-6).equations;
            for i in 0..OUTPUTS {
                for (place, &j) in order.iter().enumerate() {
                    let (a, b) = (one.coefficient(i, j), two.coefficient(i, place));
                    prop_assert!(same(a, b), "({i}, {j}): {a} and {b}");
                }
            }
        }
    }

    /// The order of the columns in a log has no effect.
    #[test]
    fn the_order_of_inputs_does_not_matter(system in system()) {
        let run = by_midpoints(&system, 800, 3).map(with_noise);
        prop_assume!(run.is_some());
        let run = run.unwrap();
        let swapped = (0..run.len()).flat_map(|k| [run.inputs.row(k)[1], run.inputs.row(k)[0]]).collect();
        let other = trajectory(columns(&run.outputs, &[1.0; OUTPUTS]), swapped, DT);
        for optimizer in [Optimizer::Stepwise(0.01), Optimizer::Stlsq(0.05)] {
            let one = fit(&run, &system.terms, WEAK, optimizer, 1e-6).equations;
            let two = fit(&other, &system.terms, WEAK, optimizer, 1e-6).equations;
            for (j, term) in system.terms.iter().enumerate() {
                let twin = moved(term, &[0, 1, 2, 4, 3]);
                let twin = system.terms.iter().position(|t| *t == twin).unwrap();
                for i in 0..OUTPUTS {
                    let (a, b) = (one.coefficient(i, j), two.coefficient(i, twin));
                    prop_assert!(same(a, b), "({i}, {j}): {a} and {b}");
                }
            }
        }
    }

    /// Exact data of a random sparse system give its terms and coefficients to eight digits. Backward elimination may
    /// drop terms that explain less than 1e-5 of the accelerations: it then has fewer terms, and the accelerations to 1
    /// %.
    #[test]
    fn a_random_sparse_system_is_found_exactly(system in system(), seed in 10usize..1000) {
        let run = by_midpoints(&system, 1_500, seed);
        prop_assume!(run.is_some());
        let run = run.unwrap();
        for regression in [RegressionForm::Midpoint { intervals: 1 }, RegressionForm::Weak { intervals: 12 }] {
            for optimizer in [Optimizer::Stepwise(1e-3), Optimizer::Stlsq(1e-6)] {
                let found = fit(&run, &system.terms, regression, optimizer, 0.0).equations;
                let found = System { terms: system.terms.clone(), coefficients: found.coefficients().to_vec() };
                let exact = found.coefficients.iter().zip(&system.coefficients).all(|(got, expected)| {
                    (*got == 0.0) == (*expected == 0.0) && (got - expected).abs() <= 1e-8
                });
                let simpler = matches!(optimizer, Optimizer::Stepwise(_))
                    && found.active() < system.active()
                    && relative_errors(&system, &found, &run).iter().all(|error| *error <= 0.01);
                prop_assert!(exact || simpler, "{found:?}, {regression:?}, {optimizer:?}");
            }
        }
    }

    /// On a motion that satisfies the midpoint rule to second order in the sample time, the accelerations are found to
    /// 2 %. Coefficients are not compared: if a steady force keeps an output positive, `y^2` equals `y |y|`.
    #[test]
    fn a_random_sparse_system_is_found_in_its_integrated_motion(system in system(), seed in 10usize..1000) {
        let run = integrated(&system, 1_500, seed);
        prop_assume!(run.is_some());
        let run = run.unwrap();
        let found = fit(&run, &system.terms, WEAK, Optimizer::Stepwise(0.05), 0.0).equations;
        let found = System { terms: system.terms.clone(), coefficients: found.coefficients().to_vec() };
        let errors = relative_errors(&system, &found, &run);
        prop_assert!(errors.iter().all(|error| *error <= 0.02), "{errors:?}");
    }
}
