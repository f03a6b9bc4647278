use hydroid::sindy::{Library, LinearRegression, Optimizer, RegressionForm, RowWeights, Scaling, Variables};

use crate::estimate::made::{driven, options, run};

fn all(size: usize) -> [RegressionForm; 4] {
    [
        RegressionForm::Midpoint { intervals: size },
        RegressionForm::Weak { intervals: size },
        RegressionForm::Smoothed { half: size },
        RegressionForm::Central,
    ]
}

fn norm(kernel: &RowWeights) -> f64 {
    kernel.outputs.iter().map(|g| g * g).sum::<f64>().sqrt()
}

/// A constant has no derivative, a straight line its slope, and the library is averaged.
#[test]
fn weights_are_exact_on_straight_lines() {
    for size in [1, 2, 3, 8, 33, 200] {
        for regression in all(size) {
            let dt = 0.05;
            let RowWeights { outputs, library } = regression.kernel(dt);
            let line = |slope: f64| -> f64 {
                outputs.iter().enumerate().map(|(j, g)| g * (3.0 + slope * dt * j as f64)).sum()
            };
            assert!(line(0.0).abs() < 1e-11, "{regression:?}");
            assert!((line(2.0) - 2.0).abs() < 1e-10, "{regression:?}");
            assert!((library.iter().sum::<f64>() - 1.0).abs() < 1e-14, "{regression:?}");
            assert_eq!(outputs.len(), regression.window() + 1);
            // Both sides refer to the middle of the window.
            let at_samples = matches!(regression, RegressionForm::Central | RegressionForm::Smoothed { .. });
            let shift = if at_samples { 0.0 } else { 0.5 };
            let middle: f64 = library.iter().enumerate().map(|(k, w)| w * (k as f64 + shift)).sum();
            assert!((middle - 0.5 * regression.window() as f64).abs() < 1e-11, "{regression:?}");
        }
    }
}

/// Deviation of a row under white noise of deviation 1: sqrt(2)/T for an increment; 1/sqrt(sum t^2) for a fitted slope;
/// for the weak form `sqrt(dt int phi'^2) / int phi = sqrt(8 I2)/I0 / (T sqrt(W))` with I0 = int (1 - s^2)^4 = 256/315
/// and I2 = int (8 s (1 - s^2)^3)^2 = 64 B(3/2, 7) over -1..1.
#[test]
fn noise_is_amplified_as_theory_says() {
    let dt = 0.02;
    // B(3/2, 7) = 6! / (3/2 5/2 ... 15/2)
    let beta = 720.0 / (0..7).map(|k| 1.5 + f64::from(k)).product::<f64>();
    let factor = (8.0 * 64.0 * beta).sqrt() / (256.0 / 315.0);
    for w in [40usize, 100, 400] {
        let t = w as f64 * dt;
        let weak = norm(&RegressionForm::Weak { intervals: w }.kernel(dt));
        let expected = factor / (t * (w as f64).sqrt());
        assert!((weak / expected - 1.0).abs() < 0.01, "{w}: {weak} for {expected}");
        let increment = norm(&RegressionForm::Midpoint { intervals: w }.kernel(dt));
        assert!((increment * t / 2f64.sqrt() - 1.0).abs() < 1e-12);
        // sum of t^2 over n equidistant samples: dt^2 n (n^2 - 1)/12
        let n = (2 * w + 1) as f64;
        let slope = norm(&RegressionForm::Smoothed { half: w }.kernel(dt));
        assert!((slope * dt * (n * (n * n - 1.0) / 12.0).sqrt() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn rows_of_the_weak_form_cover_the_run() {
    for intervals in [1, 5, 16, 50] {
        let regression = RegressionForm::Weak { intervals };
        for len in 0..=intervals {
            assert!(regression.rows(len, 0.1).is_empty());
        }
        for len in [intervals + 1, 3 * intervals + 2, 500] {
            let rows = &regression.rows(len, 0.1)[0];
            let last = rows.first + (rows.count - 1) * rows.stride + rows.kernel.outputs.len();
            assert!(last <= len && last + rows.stride > len, "{intervals} intervals in {len}");
            assert_eq!(rows.stride, (intervals / 8).max(1));
        }
    }
    let weak = RegressionForm::Weak { intervals: 80 };
    assert_eq!(weak.effective_rows(800), 100.0, "800 rows at stride 10 are 100 windows side by side");
}

#[test]
fn data_that_obey_the_midpoint_rule_satisfy_the_weak_form_exactly() {
    let data = driven(600, 0.0, 1);
    for intervals in [1, 6, 13, 64] {
        let terms = Library::polynomial(2).terms(&Variables::plain(2, 0));
        let prepared = LinearRegression::new(
            &[&data],
            terms,
            RegressionForm::Weak { intervals },
            &Scaling::Contribution,
        )
        .unwrap();
        let fit = prepared.fit(&options(Optimizer::Stepwise(1e-3))).unwrap();
        for (got, expected) in fit.equations.coefficients().iter().zip([0.0, -1.0, 1.0, 0.0, 0.0, 0.0]) {
            assert!((got - expected).abs() < 1e-10, "{intervals}: {got} for {expected}");
        }
    }
}

/// `y' = -y^2` has the solution `1/(1 + t)`: over the same window in seconds the error of the coefficient falls with
/// the square of the sample time.
#[test]
fn the_weak_form_is_of_second_order() {
    let error = |samples: usize| {
        let dt = 4.0 / samples as f64;
        let rows: Vec<Vec<f64>> = (0..=samples).map(|k| vec![1.0 / (1.0 + k as f64 * dt)]).collect();
        let terms = vec![Library::polynomial(2).terms(&Variables::plain(1, 0))[2].clone()];
        let regression = RegressionForm::Weak { intervals: samples / 10 };
        let prepared =
            LinearRegression::new(&[&run(dt, &rows, &[])], terms, regression, &Scaling::Contribution)
                .unwrap();
        prepared.fit(&options(Optimizer::Stlsq(0.0))).unwrap().equations.coefficient(0, 0) + 1.0
    };
    for samples in [80, 160, 320] {
        let ratio = error(samples) / error(2 * samples);
        assert!((ratio - 4.0).abs() < 0.3, "{samples}: {ratio}");
    }
}
