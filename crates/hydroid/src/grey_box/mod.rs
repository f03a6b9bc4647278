//! Grey box: the numbers of a vessel file, estimated from logs.
//!
//! The numbers `p` that the file marks are the minimum of
//!
//! ```text
//! sum over windows of  sum_i ((y_i(0) - x_i) / n_i)^2 + sum_{k = 1..H, i} ((y_i(k) - x_i(k)) / s_i)^2
//!   + sum_j (w_j / prior_j)^2
//! p_j = p0_j exp(w_j)  for a number of fixed sign,    p_j = p0_j + |p0_j| w_j  for another one
//! ```
//!
//! with the outputs `x(k)` that the equations of the vessel ([`hydroid_core::craft`]) give under the logged commands from the
//! start `x(0)` of each window: output-error identification (Ljung, *System Identification*, 1999, section 7.5) by multiple
//! shooting, with a normal prior at the given numbers `p0` (maximum a posteriori). `n_i` is the sensor noise, `s_i` the RMS
//! prediction error, which is found in repeated fits (iteratively reweighted least squares). Derivatives come from dual
//! numbers. Windows overlap by one half, so that each error counts one half.

mod error;
mod shooting;

use hydroid_core::craft::CraftParameter;

pub use error::GreyBoxError;

use self::shooting::FreeNumbers;
use crate::craft::CraftFile;
use crate::evaluate::DesignRange;
use crate::log::Trajectory;
use crate::progress::{self, Progress};
use crate::sindy::noise_std;
use crate::sindy::refine::{LinearConstraints, Linearization, Prior, Windows, levenberg_marquardt};

/// Distance between the starts of consecutive windows, in window lengths.
const STRIDE: f64 = 0.5;

/// Fits with new weights.
const REWEIGHTINGS: usize = 3;

/// Residuals smaller than this share of the outputs are rounding.
const ROUNDING_FLOOR: f64 = 1e-6;

/// An estimate whose standard deviation is above this share of that of its prior was not determined by the logs.
const UNINFORMED: f64 = 0.7;

/// A fitted vessel.
#[derive(Clone, Debug)]
pub struct GreyBox {
    /// The vessel with the estimates and their standard deviations.
    pub file: CraftFile,
    /// The estimates.
    pub estimates: Vec<Estimated>,
    /// Number of iterations.
    pub steps: usize,
}

/// An estimated number.
#[derive(Clone, Debug)]
pub struct Estimated {
    /// The number.
    pub parameter: CraftParameter,
    /// Given value.
    pub given: f64,
    /// Estimate.
    pub value: f64,
    /// Standard deviation of the estimate.
    pub deviation: f64,
    /// Whether the logs determined it: its standard deviation is well below that of the prior.
    pub informed: bool,
}

/// Data and options of a fit.
#[derive(Clone, Debug)]
pub struct GreyBoxOptions<'a> {
    /// Training runs with the outputs `u`, `v`, `r` and the commands of the vessel as inputs, in its order.
    pub runs: &'a [&'a Trajectory],
    /// Design ranges of the outputs: a rollout that leaves ten times these has diverged.
    pub ranges: &'a [DesignRange],
    /// Length of a window \[samples\].
    pub horizon: usize,
    /// Numbers of the vessel at which the iteration starts, in place of the given ones. The minimum does not depend on it.
    pub start: Option<&'a CraftFile>,
}

/// Estimates the marked numbers of a vessel file.
///
/// # Errors
/// If nothing is marked, the channels do not fit, the runs are too short, the motion of the given vessel diverges, or the
/// work was interrupted.
pub fn fit(
    file: &CraftFile,
    options: &GreyBoxOptions<'_>,
    progress: Progress<'_>,
) -> Result<GreyBox, GreyBoxError> {
    if file.estimate.is_empty() {
        return Err(GreyBoxError::NothingMarked);
    }
    let Some(first) = options.runs.first() else { return Err(GreyBoxError::NoStart) };
    check_channels(file, first)?;
    let free = FreeNumbers::new(file, first.dt)?;
    let mut windows = windows(options);
    let mut values = options.start.map_or_else(|| vec![0.0; free.len()], |start| free.values(start));
    let norms: Vec<f64> = file.estimate.iter().map(|estimate| 1.0 / estimate.prior).collect();
    let prior = Prior { centre: vec![0.0; free.len()], norms: norms.clone(), strength: 1.0 };
    let constraints = LinearConstraints { equalities: Vec::new(), signs: vec![0.0; free.len()] };
    let mut linear = windows.linearise(&free, &values).ok_or(GreyBoxError::NoStart)?;
    let mut steps = 0;
    for round in 0..REWEIGHTINGS {
        reweight(&mut windows, &linear, options);
        linear = windows.linearise(&free, &values).ok_or(GreyBoxError::NoStart)?;
        let from = (values, linear);
        let mut tell = |f: f64| progress((round as f64 + f) / REWEIGHTINGS as f64);
        let end = levenberg_marquardt(&windows, &free, from, &prior, &constraints, &mut tell)?;
        steps += end.steps;
        (values, linear) = (end.values, end.linear);
    }
    progress::report(progress, 1.0)?;
    let deviations = deviations(&linear, &norms);
    let mut fitted = file.clone();
    fitted.set_numbers(&free.numbers(&values));
    let given = file.craft.parameters();
    let after = fitted.craft.parameters();
    let mut estimates = Vec::new();
    for (estimate, (slope, deviation)) in
        fitted.estimate.iter_mut().zip(free.slopes(&values).into_iter().zip(deviations))
    {
        let sigma = slope.abs() * deviation;
        estimate.deviation = Some(sigma);
        estimates.push(Estimated {
            parameter: given[estimate.index].0.clone(),
            given: given[estimate.index].1,
            value: after[estimate.index].1,
            deviation: sigma,
            informed: deviation < UNINFORMED * estimate.prior,
        });
    }
    Ok(GreyBox { file: fitted, estimates, steps })
}

fn check_channels(file: &CraftFile, run: &Trajectory) -> Result<(), GreyBoxError> {
    let names = |channels: &[crate::log::Channel]| -> Vec<String> {
        channels.iter().map(|channel| channel.name.clone()).collect()
    };
    let needed: Vec<String> = file.craft.commands.iter().map(|command| command.name.clone()).collect();
    for (what, given, needed) in [
        ("outputs", names(run.outputs.channels()), crate::model::MOTION.map(str::to_owned).to_vec()),
        ("inputs", names(run.inputs.channels()), needed),
    ] {
        if given != needed {
            let (given, needed) = (given.join(", "), needed.join(", "));
            return Err(GreyBoxError::Channels { what, given, needed });
        }
    }
    for (command, channel) in file.craft.commands.iter().zip(run.inputs.channels()) {
        if !command.unit.is_empty() && !channel.unit.is_empty() && command.unit != channel.unit {
            return Err(GreyBoxError::Unit {
                name: command.name.clone(),
                given: channel.unit.clone(),
                needed: command.unit.clone(),
            });
        }
    }
    Ok(())
}

fn windows<'a>(options: &GreyBoxOptions<'a>) -> Windows<'a> {
    // A positive number far below 2^53.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of samples")]
    let stride = (STRIDE * options.horizon as f64).ceil().max(1.0) as usize;
    let sizes = sizes(options);
    let noise = noise_std(options.runs);
    let start =
        noise.iter().zip(&sizes).map(|(noise, size)| STRIDE.sqrt() / noise.max(ROUNDING_FLOOR * size));
    Windows {
        runs: options.runs,
        horizon: options.horizon,
        stride,
        weights: sizes.iter().map(|size| STRIDE.sqrt() / size).collect(),
        start: start.collect(),
        ranges: options.ranges,
        huber: None,
    }
}

/// A fifth of the ranges of the outputs, for a first estimate of their errors.
fn sizes(options: &GreyBoxOptions<'_>) -> Vec<f64> {
    options.ranges.iter().map(|range| ((range.high - range.low) / 5.0).max(f64::MIN_POSITIVE)).collect()
}

fn rms(linear: &Linearization) -> Vec<f64> {
    linear.squares.iter().map(|(sum, count)| (sum / (*count).max(1) as f64).sqrt()).collect()
}

/// Weights from the errors of the present estimate.
fn reweight(windows: &mut Windows<'_>, linear: &Linearization, options: &GreyBoxOptions<'_>) {
    for (i, (rms, size)) in rms(linear).into_iter().zip(sizes(options)).enumerate() {
        windows.weights[i] = STRIDE.sqrt() / rms.max(ROUNDING_FLOOR * size);
    }
}

/// Standard deviations of the parameters, from the information of the windows and of the prior.
fn deviations(linear: &Linearization, norms: &[f64]) -> Vec<f64> {
    let Some(merged) = linear.merged() else { return vec![f64::NAN; norms.len()] };
    let p = norms.len();
    let factor = merged.with_ridge(&norms.iter().copied().chain([0.0]).collect::<Vec<f64>>());
    // The covariance is R^-1 R^-T: rows of the inverse, column by column.
    let mut variances = vec![0.0; p];
    for column in 0..p {
        let mut x = vec![0.0; p];
        for row in (0..=column).rev() {
            let known: f64 = (row + 1..=column).map(|k| factor.get(row, k) * x[k]).sum();
            let unit = if row == column { 1.0 } else { 0.0 };
            x[row] = (unit - known) / factor.get(row, row);
        }
        for (variance, x) in variances.iter_mut().zip(&x) {
            *variance += x * x;
        }
    }
    variances.into_iter().map(f64::sqrt).collect()
}
