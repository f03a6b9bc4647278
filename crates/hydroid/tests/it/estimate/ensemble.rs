use hydroid::log::Trajectory;
use hydroid::sindy::{
    AssemblyOptions, BootstrapOptions, Coefficient, ConstraintError, Constraints, Criterion, Ensemble,
    Equality, FitError, FitOptions, Library, LinearRegression, Optimizer, QrFactor, RegressionForm,
    RegressionOptions, Variables, assemble, assemble_with,
};
use hydroid_core::model::sparse::{Factor, Program, Real, Shape, Signal, Term};

use crate::estimate::made::{DT, driven, options, run, table};

const MIDPOINT: RegressionForm = RegressionForm::Midpoint { intervals: 1 };

fn prepared(runs: &[&Trajectory], degree: u8) -> LinearRegression {
    let preparation = RegressionOptions { groups: 24, ..RegressionOptions::default() };
    LinearRegression::with(
        runs,
        Library::polynomial(degree).terms(&Variables::plain(2, 0)),
        MIDPOINT,
        &preparation,
    )
    .unwrap()
}

#[test]
fn residuals_by_group_add_up() {
    let (one, two) = (driven(7_001, 0.3, 1), driven(503, 0.3, 2));
    let program = Program::new(&Library::polynomial(2).terms(&Variables::plain(2, 0)), 2).unwrap();
    for regression in [MIDPOINT, RegressionForm::Weak { intervals: 20 }, RegressionForm::Central] {
        let streaming = AssemblyOptions { groups: 24, ..AssemblyOptions::default() };
        let grouped = assemble_with(&program, &[&one, &two], regression, &streaming);
        let whole = assemble(&program, &[&one, &two], regression);
        assert_eq!((grouped.groups.len(), whole.groups.len()), (24, 0));
        let rows: Vec<u64> = grouped.groups.iter().map(QrFactor::rows).collect();
        assert_eq!(rows.iter().sum::<u64>(), whole.qr.rows());
        assert!(rows.iter().max().unwrap() - rows.iter().min().unwrap() <= 1, "{rows:?}");
        for i in 0..7 {
            for j in i..7 {
                let (a, b) = (grouped.qr.get(i, j).abs(), whole.qr.get(i, j).abs());
                assert!((a - b).abs() < 1e-9 * whole.qr.column_norm(j), "({i}, {j}): {a} and {b}");
            }
        }
    }
}

/// Intervals of nominally 90 % on `y' = -y + c` with noise on the derivative, against the standard errors of theory:
/// deviation of the noise over the root of rows times variance. The noise is small, because half a step of it at the
/// midpoint causes a bias of second order.
#[test]
fn intervals_cover_the_truth_and_are_as_wide_as_theory_says() {
    let (seeds, samples, process) = (60, 4_000, 0.03);
    let (mut covered, mut width) = (0, 0.0);
    for seed in 0..seeds {
        let data = driven(samples, process, seed);
        let bootstrap = BootstrapOptions { resamples: 60, seed, ..BootstrapOptions::default() };
        let ensemble = prepared(&[&data], 1).ensemble(&options(Optimizer::Stlsq(0.0)), &bootstrap).unwrap();
        for (k, truth) in [(1, -1.0), (2, 1.0)] {
            covered += usize::from(ensemble.low[k] <= truth && truth <= ensemble.high[k]);
        }
        width += ensemble.high[2] - ensemble.low[2];
    }
    let share = covered as f64 / (2 * seeds) as f64;
    println!("coverage of nominal 90 %: {share}");
    assert!((0.75..=0.97).contains(&share), "{share}");
    // c has variance 1, of which 1 - corr^2 = 1/2 remains given y, a first-order lag of 1 s under a command held for 1
    // s. The width is that of the coefficient of c given y.
    let data = driven(200_000, process, 999);
    let mean = |f: &dyn Fn(f64, f64) -> f64| {
        (0..data.len()).map(|k| f(data.outputs.row(k)[0], data.inputs.row(k)[0])).sum::<f64>()
            / data.len() as f64
    };
    let (cc, cy, yy) = (mean(&|_, c| c * c), mean(&|y, c| c * y), mean(&|y, _| y * y));
    let error = process / (samples as f64 * (cc - cy * cy / yy)).sqrt();
    let ratio = width / seeds as f64 / (2.0 * 1.645 * error);
    assert!((0.75..=1.25).contains(&ratio), "{ratio}; sample time {DT}");
}

#[test]
fn true_terms_have_inclusion_one_and_false_terms_a_low_one() {
    let data = driven(6_000, 0.3, 5);
    let fit = options(Optimizer::Criterion(Criterion::Bic));
    for term_dropout in [0.0, 0.3] {
        let bootstrap = BootstrapOptions { resamples: 200, term_dropout, ..BootstrapOptions::default() };
        let ensemble = prepared(&[&data], 2).ensemble(&fit, &bootstrap).unwrap();
        let junk = [0, 3, 4, 5].map(|k| ensemble.inclusion[k]);
        assert!(ensemble.inclusion[2] > 0.99, "{:?}", ensemble.inclusion);
        // Without the command, damping is not distinguishable from chance.
        let least = if term_dropout == 0.0 { 0.99 } else { 0.6 };
        assert!(ensemble.inclusion[1] > least, "{:?}", ensemble.inclusion);
        // Without a true term an irrelevant one replaces it; library bootstrap shows that.
        let most = if term_dropout == 0.0 { 0.25 } else { 0.5 };
        println!("junk {junk:?}");
        assert!(junk.iter().all(|p| *p < most), "{junk:?}");
        if term_dropout == 0.0 {
            assert!((ensemble.median[1] + 1.0).abs() < 0.06 && (ensemble.mean[2] - 1.0).abs() < 0.06);
        }
        assert!(ensemble.low.iter().zip(&ensemble.high).all(|(low, high)| low <= high));
        let without = ensemble.members.iter().filter(|member| member[2] == 0.0).count();
        // Binomial: 200 members, 30 %, six deviations of 6.5.
        assert!(if term_dropout == 0.0 { without == 0 } else { (21..=99).contains(&without) }, "{without}");
    }
}

#[test]
fn the_same_seed_gives_the_same_numbers_on_any_number_of_threads() {
    let data = driven(9_000, 0.3, 8);
    let draw = |threads: usize, seed: u64| -> Ensemble {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let bootstrap =
            BootstrapOptions { resamples: 20, seed, term_dropout: 0.1, ..BootstrapOptions::default() };
        pool.install(|| {
            prepared(&[&data], 2)
                .ensemble(&options(Optimizer::Criterion(Criterion::Aic)), &bootstrap)
                .unwrap()
        })
    };
    let one = draw(1, 4);
    assert_eq!(draw(3, 4), one);
    assert_ne!(draw(1, 5).members, one.members);
}

#[test]
fn settings_out_of_range_are_refused() {
    let data = driven(500, 0.3, 8);
    let fit = options(Optimizer::Stlsq(0.0));
    let good = BootstrapOptions::default();
    for bootstrap in [
        BootstrapOptions { resamples: 0, ..good.clone() },
        BootstrapOptions { term_dropout: 1.0, ..good.clone() },
        BootstrapOptions { quantiles: (0.9, 0.1), ..good.clone() },
        BootstrapOptions { term_dropout: f64::NAN, ..good.clone() },
    ] {
        let refused = prepared(&[&data], 1).ensemble(&fit, &bootstrap);
        assert!(matches!(refused, Err(FitError::Setting(_))), "{bootstrap:?}");
    }
    let bare = LinearRegression::with(
        &[&data],
        Library::polynomial(1).terms(&Variables::plain(2, 0)),
        MIDPOINT,
        &RegressionOptions::default(),
    );
    assert!(matches!(bare.unwrap().ensemble(&fit, &good), Err(FitError::Setting(_))));
}

/// Regression test: a draw without the only rows in which an input moves failed the identification.
#[test]
fn infeasible_bootstrap_samples_are_skipped_and_counted() {
    let mut data = driven(2_000, 0.3, 9);
    let commands = data.inputs.column(0).enumerate();
    let commands: Vec<Vec<f64>> = commands.map(|(k, c)| vec![if k < 40 { c } else { 0.0 }]).collect();
    data.inputs = table("c", &commands);
    let on_input = Coefficient { equation: 0, term: 2 };
    let constraints = Constraints {
        equalities: vec![Equality { weights: vec![(on_input, 1.0)], value: 0.001 }],
        ..Constraints::default()
    };
    let fit = FitOptions { constraints, ..options(Optimizer::Stlsq(0.0)) };
    let bootstrap = BootstrapOptions { resamples: 60, ..BootstrapOptions::default() };
    let ensemble = prepared(&[&data], 1).ensemble(&fit, &bootstrap).unwrap();
    // The moving group is in a draw with probability 1 - (1 - 1/24)^24 = 0.64.
    assert!((25..55).contains(&ensemble.members.len()), "{}", ensemble.members.len());
    assert_eq!(ensemble.draws.len(), ensemble.members.len());
    assert!(ensemble.draws.is_sorted() && ensemble.draws.iter().all(|draw| *draw < 60));
    assert!(ensemble.members.iter().all(|member| (member[2] - 0.001).abs() < 1e-9));
    // An equality that is infeasible on all draws is an error.
    data.inputs = table("c", &vec![vec![0.0]; 2_000]);
    let refused = prepared(&[&data], 1).ensemble(&fit, &bootstrap);
    assert!(
        matches!(refused, Err(FitError::Constraints(ConstraintError::Contradiction { .. }))),
        "{refused:?}"
    );
}

#[test]
fn a_library_without_terms_is_refused() {
    let data = driven(500, 0.3, 8);
    let refused = LinearRegression::with(&[&data], Vec::new(), MIDPOINT, &RegressionOptions::default());
    assert!(matches!(refused, Err(FitError::Setting(_))));
}

#[test]
fn a_pole_between_samples_or_behind_a_lag_is_reported() {
    let made = |outputs: &[f64], inputs: &[f64], variable: u16, shape: Shape, signals: &[Signal]| {
        let rows = |values: &[f64]| (0..40).map(|k| vec![values[k % values.len()]]).collect::<Vec<_>>();
        let data = run(DT, &rows(outputs), &rows(inputs));
        let terms = vec![Term::constant(), Term::new(vec![Factor { variable, shape }])];
        let preparation = RegressionOptions { signals, ..RegressionOptions::default() };
        match LinearRegression::with(&[&data], terms, MIDPOINT, &preparation) {
            Err(FitError::Undefined { channel, time_s, .. }) => Some((channel, time_s)),
            Err(other) => panic!("{other}"),
            Ok(_) => None,
        }
    };
    let (moving, still) = ([1.0, 2.0, 1.5], [1.0]);
    // The midpoint is 0, or the pole lies between samples.
    for outputs in [[2.0, 1.0, -1.0], [2.0, 1.0, -0.3]] {
        let told = made(&outputs, &still, 0, Shape::Reciprocal, &[]).unwrap();
        assert_eq!(told, (String::from("y0"), DT));
    }
    assert_eq!(made(&moving, &still, 0, Shape::Reciprocal, &[]), None);
    // A held command has no values between samples.
    assert_eq!(made(&moving, &[1.0, -1.0], 1, Shape::Reciprocal, &[]), None);
    let lag = [Signal::Lag { input: 1, time_constant_s: Real(0.1) }];
    for shape in [Shape::Reciprocal, Shape::Log] {
        let (channel, time_s) = made(&moving, &[1.0, 1.0, -3.0], 2, shape, &lag).unwrap();
        assert!(channel.starts_with("lag(c0") && time_s > 0.5, "{channel} at {time_s} s");
    }
    let past = [Signal::Past { variable: 1, samples: 2 }];
    assert_eq!(made(&moving, &[1.0, 0.0], 2, Shape::Reciprocal, &past).unwrap().0, "c0(-0.2 s)");
    assert_eq!(made(&moving, &[1.0, -1.0], 2, Shape::Reciprocal, &past), None);
}
