use hydroid::log::Trajectory;
use hydroid::sindy::{
    Bagging, Criterion, Ensemble, FitError, Library, Optimizer, Preparation, Prepared, Regression, Streaming,
    Triangle, Variables, assemble, assemble_with,
};
use hydroid_core::model::sparse::Program;

use crate::made::{DT, driven, options};

const MIDPOINT: Regression = Regression::Midpoint { intervals: 1 };

fn prepared(runs: &[&Trajectory], degree: u8) -> Prepared {
    let preparation = Preparation { groups: 24, ..Preparation::default() };
    Prepared::with(runs, Library::polynomial(degree).terms(&Variables::plain(2, 0)), MIDPOINT, &preparation)
        .unwrap()
}

#[test]
fn groups_are_parts_of_the_whole() {
    let (one, two) = (driven(7_001, 0.3, 1), driven(503, 0.3, 2));
    let program = Program::new(&Library::polynomial(2).terms(&Variables::plain(2, 0)), 2).unwrap();
    for regression in [MIDPOINT, Regression::Weak { intervals: 20 }, Regression::Central] {
        let streaming = Streaming { groups: 24, ..Streaming::default() };
        let grouped = assemble_with(&program, &[&one, &two], regression, &streaming);
        let whole = assemble(&program, &[&one, &two], regression);
        assert_eq!((grouped.groups.len(), whole.groups.len()), (24, 0));
        let rows: Vec<u64> = grouped.groups.iter().map(Triangle::rows).collect();
        assert_eq!(rows.iter().sum::<u64>(), whole.triangle.rows());
        assert!(rows.iter().max().unwrap() - rows.iter().min().unwrap() <= 1, "{rows:?}");
        for i in 0..7 {
            for j in i..7 {
                let (a, b) = (grouped.triangle.get(i, j).abs(), whole.triangle.get(i, j).abs());
                assert!((a - b).abs() < 1e-9 * whole.triangle.column_norm(j), "({i}, {j}): {a} and {b}");
            }
        }
    }
}

/// Intervals of nominally 90 % on `y' = -y + c` with noise on the derivative, for which theory gives the
/// standard errors: deviation of the noise over the root of the rows and of the variable's variance. (The
/// noise is small because the mid-state holds half a step of it, a bias of second order in the noise.)
#[test]
fn intervals_cover_the_truth_and_are_as_wide_as_theory_says() {
    let (seeds, samples, process) = (60, 4_000, 0.03);
    let (mut covered, mut width) = (0, 0.0);
    for seed in 0..seeds {
        let data = driven(samples, process, seed);
        let bagging = Bagging { bags: 60, seed, ..Bagging::default() };
        let ensemble = prepared(&[&data], 1).ensemble(&options(Optimizer::Stlsq(0.0)), &bagging).unwrap();
        for (k, truth) in [(1, -1.0), (2, 1.0)] {
            covered += usize::from(ensemble.low[k] <= truth && truth <= ensemble.high[k]);
        }
        width += ensemble.high[2] - ensemble.low[2];
    }
    let share = covered as f64 / (2 * seeds) as f64;
    println!("coverage of nominal 90 %: {share}");
    assert!((0.75..=0.97).contains(&share), "{share}");
    // c has variance 1; c and y share one half, 1 - corr^2 of c remains: y of a first-order lag of time
    // constant 1 s under a command held for 1 s. The width is that of the coefficient of c given y.
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
fn true_terms_are_always_included_and_junk_seldom() {
    let data = driven(6_000, 0.3, 5);
    let fit = options(Optimizer::Criterion(Criterion::Bic));
    for leave_out in [0.0, 0.3] {
        let bagging = Bagging { bags: 200, leave_out, ..Bagging::default() };
        let ensemble = prepared(&[&data], 2).ensemble(&fit, &bagging).unwrap();
        let junk = [0, 3, 4, 5].map(|k| ensemble.inclusion[k]);
        assert!(ensemble.inclusion[2] > 0.99, "{:?}", ensemble.inclusion);
        // Where the command is left out nothing tells damping from chance.
        let least = if leave_out == 0.0 { 0.99 } else { 0.6 };
        assert!(ensemble.inclusion[1] > least, "{:?}", ensemble.inclusion);
        // Without a true term the junk stands in for it: bagging of the library is there to show that.
        let most = if leave_out == 0.0 { 0.25 } else { 0.5 };
        println!("junk {junk:?}");
        assert!(junk.iter().all(|p| *p < most), "{junk:?}");
        if leave_out == 0.0 {
            assert!((ensemble.median[1] + 1.0).abs() < 0.06 && (ensemble.mean[2] - 1.0).abs() < 0.06);
        }
        assert!(ensemble.low.iter().zip(&ensemble.high).all(|(low, high)| low <= high));
        let without = ensemble.members.iter().filter(|member| member[2] == 0.0).count();
        // Binomial: 200 members, 30 %, six deviations of 6.5.
        assert!(if leave_out == 0.0 { without == 0 } else { (21..=99).contains(&without) }, "{without}");
    }
}

#[test]
fn the_same_seed_gives_the_same_numbers_on_any_number_of_threads() {
    let data = driven(9_000, 0.3, 8);
    let draw = |threads: usize, seed: u64| -> Ensemble {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let bagging = Bagging { bags: 20, seed, leave_out: 0.1, ..Bagging::default() };
        pool.install(|| {
            prepared(&[&data], 2).ensemble(&options(Optimizer::Criterion(Criterion::Aic)), &bagging).unwrap()
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
    let good = Bagging::default();
    for bagging in [
        Bagging { bags: 0, ..good.clone() },
        Bagging { leave_out: 1.0, ..good.clone() },
        Bagging { quantiles: (0.9, 0.1), ..good.clone() },
        Bagging { leave_out: f64::NAN, ..good.clone() },
    ] {
        let refused = prepared(&[&data], 1).ensemble(&fit, &bagging);
        assert!(matches!(refused, Err(FitError::Setting(_))), "{bagging:?}");
    }
    let bare = Prepared::with(
        &[&data],
        Library::polynomial(1).terms(&Variables::plain(2, 0)),
        MIDPOINT,
        &Preparation::default(),
    );
    assert!(matches!(bare.unwrap().ensemble(&fit, &good), Err(FitError::Setting(_))));
}
