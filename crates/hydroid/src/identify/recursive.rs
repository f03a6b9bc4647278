//! Equations that keep learning.

use std::sync::Arc;

use hydroid_core::adapt::{BlendSettings, Gate};
use hydroid_core::model::sparse::{Equations, Term};

use super::options::intervals;
use super::{IdentifyError, Job, Parts, equations};
use crate::model::{Learning, Model};
use crate::progress::Progress;
use crate::sindy::{
    FitError, LinearRegression, RegressionForm, RegressionOptions, SearchError, SearchResult,
};

/// What the equations from shore are worth at each pace, in horizons. Five paces between these do no better on the
/// development runs (a tug, a tanker) than these three, and one alone chosen by validation clearly worse.
const PRIOR_HORIZONS: [f64; 3] = [60.0, 6.0, 0.6];

/// Memory, in horizons; 12 did no better.
const FORGETTING_HORIZONS: f64 = 60.0;

/// Span of an increment, in horizons; 0.05 and 0.2 did no better.
const INCREMENT_HORIZONS: f64 = 0.1;

/// Part of the prior in which terms have nothing to do with each other. (0.2 to 1: more is better for a vessel that
/// has changed, and worse for one that has not.)
const SHRINKAGE: f64 = 0.2;

/// Equations with all terms that learn at several paces; where the `sparse` ones of another search have a lag or
/// a change of mode, these as they are. Where there are none (too few rows, or all diverge), it is
/// the `sparse` ones of another search that learn.
pub(super) fn recursive_model(
    job: &Job,
    parts: &Parts<'_>,
    sparse: Option<&Arc<SearchResult>>,
    describe: impl Fn(&SearchResult, Equations) -> Model,
    progress: Progress<'_>,
) -> Result<(Arc<SearchResult>, Model), IdentifyError> {
    // LagOption and modes that were found are worth more than all the terms without them.
    let hidden = sparse.filter(|found| found.trials[found.chosen].structure.parameters() > 0);
    let whole = hidden.map_or_else(|| equations::whole(job, parts, progress), |found| Ok(Arc::clone(found)));
    let found = match (whole, sparse) {
        (Err(IdentifyError::Sindy(SearchError::Cancelled(cancelled))), _) => {
            return Err(SearchError::Cancelled(cancelled).into());
        }
        (Err(_), Some(sparse)) => Arc::clone(sparse),
        (found, _) => found?,
    };
    let horizon_s = job.horizon as f64 * parts.train[0].dt;
    let window = intervals(INCREMENT_HORIZONS * job.horizon as f64);
    let (equations, r_factor) =
        identifiable(&found.fit.equations, parts, window).map_err(SearchError::Fit)?;
    let settings = BlendSettings {
        priors_s: PRIOR_HORIZONS.iter().map(|prior| prior * horizon_s).collect(),
        forgetting_s: FORGETTING_HORIZONS * horizon_s,
        window,
        horizon: job.horizon,
        gate: Gate::default(),
    };
    let mut model = describe(&found, equations);
    model.learning = Some(Learning { settings, r_factor });
    Ok((found, model))
}

/// The equations without the terms that the training runs say nothing of, and what they say of the others.
fn identifiable(of: &Equations, parts: &Parts<'_>, window: usize) -> Result<(Equations, Vec<f64>), FitError> {
    // A weak form averages about as much as an increment over half of its window.
    let regression = RegressionForm::Weak { intervals: 2 * window };
    let preparation = RegressionOptions { signals: of.signals(), ..RegressionOptions::default() };
    let prepare = |terms| LinearRegression::with(&parts.train, terms, regression, &preparation);
    let lost = prepare(of.terms().to_vec())?.unidentifiable().to_vec();
    let kept: Vec<usize> = (0..of.terms().len()).filter(|j| !lost.contains(j)).collect();
    let terms: Vec<Term> = kept.iter().map(|&j| of.terms()[j].clone()).collect();
    let root = prepare(terms.clone())?.r_factor(SHRINKAGE);
    let row = |i: usize| kept.iter().map(move |&j| of.coefficient(i, j));
    let coefficients = (0..of.outputs()).flat_map(row).collect();
    let (signals, dt) = (of.signals().to_vec(), of.dt());
    let own =
        Equations::with_signals(terms, coefficients, of.outputs(), of.inputs(), signals, dt, of.substeps())?;
    Ok((own, root))
}
