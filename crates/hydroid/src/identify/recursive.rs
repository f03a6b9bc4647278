//! Equations that keep learning: how fast, is chosen on the validation runs.

use serde::{Deserialize, Serialize};

use std::sync::Arc;
use hydroid_core::adapt::BlendSettings;
use hydroid_core::model::sparse::{Equations, Term};
use super::{IdentifyError, Job, Parts, equations};
use crate::evaluate::{self, evaluate};
use crate::adapt::AdaptError;
use crate::model::{Body, Learning, Model};
use crate::progress::{self, Progress};
use crate::sindy::{Found, Prepared, Preparation, Regression, SearchError};

/// A way of learning that was tried.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pace {
    /// Time that an increment spans \[s\].
    pub window_s: f64,
    /// What the equations from shore are worth \[s\].
    pub prior_s: f64,
    /// Time after which a sample counts `1/e` \[s\].
    pub forgetting_s: f64,
    /// Mean NRMSE over channels and horizons on the validation runs; null where a rollout diverged.
    pub score: Option<f64>,
}

/// Times that are tried, in horizons: what the shore is worth, the cautious ones first ...
const PRIORS: [f64; 5] = [60.0, 20.0, 6.0, 2.0, 0.6];
/// ... memory ...
const MEMORIES: [f64; 2] = [60.0, 12.0];
/// ... and increments.
const WINDOWS: [f64; 2] = [0.5, 0.1];

fn x(name: &str, default: &str) -> Vec<f64> {
    let v = std::env::var(name).unwrap_or(default.to_owned());
    v.split(',').map(|s| s.parse().unwrap()).collect()
}

pub(super) fn learning(
    job: &Job,
    parts: &Parts<'_>,
    describe: impl Fn(&Found) -> Model,
    progress: Progress<'_>,
) -> Result<(Model, Arc<Found>, Vec<Pace>), IdentifyError> {
    let mut best: Option<(f64, Model, Arc<Found>)> = None;
    let mut failed = None;
    for both in x("X_BOTH", "0,1") {
        for past in x("X_PAST", "0.1") {
        for ridge in x("X_RIDGE", "0.1,0.3,1") {
            let found = match equations::full(job, parts, both > 0.0, past, ridge, progress) {
                Ok(found) => found,
                Err(error) => { failed = Some(error); continue; }
            };
            let model = learner(&describe(&found), &found, job, parts)?;
            let mut session = model.session();
            let quick = evaluate::Options { warm_up: session.warm_up(), ..equations::quick(job, parts) };
            let judged = evaluate("recursive", session.as_mut(), &parts.ranges, &parts.validation, &quick, &mut progress::silent()).unwrap();
            let mut score = judged.score();
            if std::env::var("X_LAST").is_ok() { score = judged.nrmse.last().unwrap().iter().sum::<f64>(); }
            if std::env::var("X_FROZEN").is_ok() { score = found.score; }
            if best.as_ref().is_none_or(|b| score < b.0) { best = Some((score, model, found)); }
        }
        }
    }
    match best { Some((_, m, f)) => Ok((m, f, vec![])), None => Err(failed.unwrap()) }
}
fn learner(
    model: &Model,
    found: &Found,
    job: &Job,
    parts: &Parts<'_>,
) -> Result<Model, IdentifyError> {
    let horizon_s = job.horizon as f64 * model.description.dt;
    let e = &found.fit.equations;
    let window = (x("X_RWIN", "0.1")[0] * job.horizon as f64).max(1.0) as usize;
    let regression = Regression::Weak { intervals: 2 * window };
    let preparation = Preparation { signals: e.signals(), ..Preparation::default() };
    let prepare = |terms: Vec<Term>| Prepared::with(&parts.train, terms, regression, &preparation).map_err(SearchError::Fit);
    let all = prepare(e.terms().to_vec())?;
    let kept: Vec<usize> = (0..e.terms().len()).filter(|j| !all.unidentifiable().contains(j)).collect();
    let terms: Vec<Term> = kept.iter().map(|&j| e.terms()[j].clone()).collect();
    let coefficients = (0..e.outputs()).flat_map(|i| kept.iter().map(move |&j| e.coefficient(i, j))).collect();
    let own = Equations::with_signals(terms.clone(), coefficients, e.outputs(), e.inputs(), e.signals().to_vec(), e.dt(), e.substeps()).unwrap();
    let root = prepare(terms)?.moments(x("X_DIAG", "0.2")[0]);
    let settings = BlendSettings {
        priors_s: x("X_N0", "60,20,6,2,0.6").iter().map(|n| n * horizon_s).collect(),
        forgetting_s: x("X_MEM", "60")[0] * horizon_s,
        window,
        horizon: job.horizon,
        gate: hydroid_core::adapt::Gate{ inflate: x("X_KP","-6")[0], reject: x("X_KM","1e9")[0] },
    };
    Ok(Model { body: Body::Equations(Arc::new(own)), learning: Some(Learning { settings, root }), ..model.clone() })
}

impl From<AdaptError> for IdentifyError {
    fn from(error: AdaptError) -> Self {
        Self::Learning(Box::new(error))
    }
}
