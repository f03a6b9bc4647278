//! Equations with recursive least squares.

use std::sync::Arc;

use hydroid_core::adapt::{ExpertMixtureOptions, InnovationGate};
use hydroid_core::model::sparse::{Equations, Term};

use super::options::intervals;
use super::{IdentifyError, Job, Parts, equations};
use crate::model::{Learning, Model};
use crate::progress::Progress;
use crate::sindy::{
    FitError, LinearRegression, RegressionForm, RegressionOptions, SearchError, SearchResult,
};

/// Information of the reference model for each expert, in horizons (selected on runs of a tug and a tanker).
const PRIOR_HORIZONS: [f64; 3] = [60.0, 6.0, 0.6];

const FORGETTING_HORIZONS: f64 = 60.0;

const INCREMENT_HORIZONS: f64 = 0.1;

const SHRINKAGE: f64 = 0.2;

/// Equations with several priors: the `sparse` ones of another search if they have a lag or a gate, or if
/// no equations with all terms can be fitted; otherwise equations with all terms of the library.
pub(super) fn recursive_model(
    job: &Job,
    parts: &Parts<'_>,
    sparse: Option<&Arc<SearchResult>>,
    describe: impl Fn(&SearchResult, Equations) -> Model,
    progress: Progress<'_>,
) -> Result<(Arc<SearchResult>, Model), IdentifyError> {
    // Lags and modes are preferred to a library of all terms without them.
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
    let settings = ExpertMixtureOptions {
        priors_s: PRIOR_HORIZONS.iter().map(|prior| prior * horizon_s).collect(),
        forgetting_s: FORGETTING_HORIZONS * horizon_s,
        window,
        horizon: job.horizon,
        gate: InnovationGate::default(),
    };
    let mut model = describe(&found, equations);
    model.learning = Some(Learning { settings, r_factor });
    Ok((found, model))
}

/// The equations without unidentifiable terms, and the R factor of the moments of the others.
fn identifiable(of: &Equations, parts: &Parts<'_>, window: usize) -> Result<(Equations, Vec<f64>), FitError> {
    // The weak form over twice the window averages about as much as an increment.
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
