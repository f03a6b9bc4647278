//! Prediction bands of an ensemble (rollouts of its members) and their coverage.

use hydroid_core::predict::{Predictor, Workspace};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Against, Options, Origin};
use crate::log::{Table, Trajectory};

/// Share of the members between the edges of a band.
const LEVEL: f64 = 0.9;
/// Lower and upper quantile of a band.
pub const BAND: (f64, f64) = (0.05, 0.95);

/// Largest number of origins of [`band_coverage`].
const ORIGINS: usize = 200;

/// Band over the steps after an origin, row by row; NaN without a finite member.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Band {
    /// Lower edge.
    pub low: Vec<f64>,
    /// Upper edge.
    pub high: Vec<f64>,
}

/// Coverage of a band.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BandCoverage {
    /// Share of the members between the edges.
    pub level: f64,
    /// Number of members.
    pub members: usize,
    /// Number of origins.
    pub origins: usize,
    /// Horizons \[samples\].
    pub horizons: Vec<usize>,
    /// Share of points inside the band, per horizon and output.
    pub share: Vec<Vec<f64>>,
}

/// Band of the rollouts of ensemble members from origins of a run, at given steps (ascending, from 1). Each member
/// observes its warm-up before an origin, so that its signal memory matches the model.
pub fn bands(
    members: &[Box<dyn Predictor>],
    run: &Trajectory,
    seen: &Table,
    origins: &[usize],
    steps: &[usize],
) -> Vec<Band> {
    let (Some(first), Some(&last)) = (members.first(), steps.last()) else { return Vec::new() };
    let n = first.outputs();
    let rollouts: Vec<Vec<f64>> = members
        .par_iter()
        .map(|member| {
            let (mut session, mut work) = (member.fork(), Workspace::new());
            let mut y = vec![0.0; last * n];
            let mut chosen = Vec::with_capacity(origins.len() * steps.len() * n);
            for &origin in origins {
                session.reset();
                for k in (origin + 1).saturating_sub(session.warm_up())..origin {
                    session.observe(seen.row(k));
                    session.advance(run.inputs.row(k));
                }
                session.observe(seen.row(origin));
                session.rollout(run.inputs.rows(origin, origin + last), &mut work, &mut y);
                for step in steps {
                    chosen.extend_from_slice(&y[(step - 1) * n..step * n]);
                }
            }
            chosen
        })
        .collect();
    let size = steps.len() * n;
    let edges = |at: usize| {
        let mut values: Vec<f64> = rollouts.iter().map(|y| y[at]).filter(|v| v.is_finite()).collect();
        values.sort_unstable_by(f64::total_cmp);
        (quantile(&values, BAND.0), quantile(&values, BAND.1))
    };
    let band = |i: usize| {
        let (low, high) = (i * size..(i + 1) * size).map(edges).unzip();
        Band { low, high }
    };
    (0..origins.len()).map(band).collect()
}

/// Coverage of the ensemble band for measurements (or truth) at given horizons, at origins spread over the runs.
pub fn band_coverage(
    members: &[Box<dyn Predictor>],
    runs: &[&Trajectory],
    options: &Options,
    horizons: &[usize],
) -> Option<BandCoverage> {
    let first = members.first()?;
    let (n, last) = (first.outputs(), *horizons.last()?);
    let warm_up = options.warm_up.max(first.warm_up()).max(1);
    let possible = |run: &Trajectory| run.len().saturating_sub(warm_up - 1 + last);
    let stride =
        options.origin_stride.max(runs.iter().map(|run| possible(run)).sum::<usize>() / ORIGINS).max(1);
    let mut inside = vec![(0usize, 0usize); horizons.len() * n];
    let mut count = 0;
    for run in runs {
        let pick = |truth: bool| run.truth.as_ref().filter(|_| truth).unwrap_or(&run.outputs);
        let (seen, target) = (pick(options.origin == Origin::True), pick(options.against == Against::Truth));
        let origins: Vec<usize> = (0..possible(run)).step_by(stride).map(|k| k + warm_up - 1).collect();
        count += origins.len();
        for (origin, band) in origins.iter().zip(bands(members, run, seen, &origins, horizons)) {
            for (h, horizon) in horizons.iter().enumerate() {
                for (c, value) in target.row(origin + horizon).iter().enumerate() {
                    let (low, high) = (band.low[h * n + c], band.high[h * n + c]);
                    if !value.is_nan() && low <= high {
                        let (within, all) = &mut inside[h * n + c];
                        *within += usize::from((low..=high).contains(value));
                        *all += 1;
                    }
                }
            }
        }
    }
    let share = |&(within, all): &(usize, usize)| within as f64 / all as f64;
    Some(BandCoverage {
        level: LEVEL,
        members: members.len(),
        origins: count,
        horizons: horizons.to_vec(),
        share: inside.chunks(n).map(|row| row.iter().map(share).collect()).collect(),
    })
}

/// Quantile of sorted values by linear interpolation; NaN without values.
pub(crate) fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = share * last as f64;
    // The rank is between 0 and the number of values.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let below = (place as usize).min(last);
    let above = (below + 1).min(last);
    sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
}
