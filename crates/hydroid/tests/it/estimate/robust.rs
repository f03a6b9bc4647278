use hydroid::log::{Table, Trajectory};
use hydroid::sindy::{
    AssemblyOptions, FitError, Library, LinearRegression, Loss, Optimizer, RegressionForm, RegressionOptions,
    Variables, assemble_with,
};
use hydroid_core::model::sparse::Program;

use crate::estimate::made::{Normal, driven, options};

/// Measurement noise, and spikes of a given size on one sample in a hundred where the command steps, towards its side,
/// as from a switching drive. Spikes at random affect least squares in second order only.
fn measured(run: &Trajectory, noise: f64, spike: f64, seed: u64) -> (Trajectory, Vec<f64>) {
    let mut normal = Normal::new(seed);
    let mut weights = vec![1.0; run.len()];
    let values = run
        .outputs
        .column(0)
        .enumerate()
        .map(|(k, y)| {
            let spiked = k % 100 == 40 && spike > 0.0;
            let extra = if spiked { spike * run.inputs.row(k)[0].signum() } else { 0.0 };
            weights[k] = if spiked { 0.0 } else { 1.0 };
            y + noise * (normal.next() + extra)
        })
        .collect();
    (Trajectory { outputs: Table::new(run.outputs.channels().to_vec(), values), ..run.clone() }, weights)
}

fn error(run: &Trajectory, preparation: &RegressionOptions<'_>) -> f64 {
    let regression = RegressionForm::Midpoint { intervals: 1 };
    let prepared = LinearRegression::with(
        &[run],
        Library::polynomial(1).terms(&Variables::plain(2, 0)),
        regression,
        preparation,
    )
    .unwrap();
    let fit = prepared.fit(&options(Optimizer::Stlsq(0.0))).unwrap();
    let truth = [0.0, -1.0, 1.0];
    fit.equations.coefficients().iter().zip(truth).map(|(x, t)| (x - t).abs()).fold(0.0, f64::max)
}

#[test]
fn spikes_hardly_move_the_coefficients() {
    let huber = RegressionOptions { loss: Loss::Huber(1.345), ..RegressionOptions::default() };
    for seed in 0..5 {
        let (spiked, _) = measured(&driven(20_000, 0.0, seed), 0.005, 50.0, seed);
        let (plain, robust) = (error(&spiked, &RegressionOptions::default()), error(&spiked, &huber));
        println!("least squares {plain:.5}, Huber {robust:.5}");
        assert!(robust < 0.01 && plain > 10.0 * robust, "seed {seed}: {robust} for {plain}");
    }
}

/// The Huber loss costs little on Gaussian noise, and nothing on exact data.
#[test]
fn without_outliers_the_huber_fit_is_least_squares() {
    let huber = RegressionOptions { loss: Loss::Huber(1.345), ..RegressionOptions::default() };
    let run = driven(20_000, 0.0, 1);
    assert!(error(&run, &huber) < 1e-9);
    let (noisy, _) = measured(&run, 0.005, 0.0, 1);
    let (plain, robust) = (error(&noisy, &RegressionOptions::default()), error(&noisy, &huber));
    assert!((robust - plain).abs() < 1e-3, "{robust} and {plain}");
    let nowhere = RegressionOptions { loss: Loss::Huber(1e6), ..RegressionOptions::default() };
    assert_eq!(error(&noisy, &nowhere), plain, "a bound that nothing reaches changes nothing");
    let wrong = RegressionOptions { loss: Loss::Huber(0.0), ..RegressionOptions::default() };
    let refused = LinearRegression::with(
        &[&run],
        Library::polynomial(1).terms(&Variables::plain(2, 0)),
        RegressionForm::default(),
        &wrong,
    );
    assert!(matches!(refused, Err(FitError::Setting(_))));
}

#[test]
fn a_sample_with_weight_zero_equals_a_missing_sample() {
    let (mut spiked, weights) = measured(&driven(5_000, 0.0, 3), 0.005, 50.0, 3);
    let program = Program::new(&Library::polynomial(1).terms(&Variables::plain(2, 0)), 2).unwrap();
    for regression in [RegressionForm::Midpoint { intervals: 1 }, RegressionForm::Weak { intervals: 10 }] {
        let samples = [weights.clone()];
        let streaming = AssemblyOptions { weights: &samples, ..AssemblyOptions::default() };
        let weighted = assemble_with(&program, &[&spiked], regression, &streaming);
        let mut missing = spiked.clone();
        let values =
            spiked.outputs.column(0).zip(&weights).map(|(y, w)| if *w == 0.0 { f64::NAN } else { y });
        missing.outputs = Table::new(spiked.outputs.channels().to_vec(), values.collect());
        let left_out = assemble_with(&program, &[&missing], regression, &AssemblyOptions::default());
        assert_eq!(weighted.qr, left_out.qr);
        assert_eq!((weighted.skipped, left_out.skipped > 0), (0, true));
    }
    // A uniform weight of 4 gives the same fit and a factor twice as large.
    let samples = [vec![4.0; spiked.len()]];
    let streaming = AssemblyOptions { weights: &samples, ..AssemblyOptions::default() };
    let four = assemble_with(&program, &[&spiked], RegressionForm::default(), &streaming).qr;
    let one = assemble_with(&program, &[&spiked], RegressionForm::default(), &AssemblyOptions::default()).qr;
    assert!((four.column_norm(3) / one.column_norm(3) - 2.0).abs() < 1e-12);
    spiked.name = String::from("log7");
    for wrong in [vec![1.0; 3], vec![-1.0; spiked.len()], vec![f64::NAN; spiked.len()]] {
        let preparation = RegressionOptions { weights: &[wrong], ..RegressionOptions::default() };
        let refused = LinearRegression::with(
            &[&spiked],
            Library::polynomial(1).terms(&Variables::plain(2, 0)),
            RegressionForm::default(),
            &preparation,
        );
        assert_eq!(refused.unwrap_err(), FitError::Weights(String::from("log7")));
    }
}
