//! Equations that keep learning: how fast, is chosen on the validation runs.

use serde::{Deserialize, Serialize};

use super::{IdentifyError, Job, Parts};
use crate::adapt::{self, AdaptError};
use crate::evaluate::{EvaluateError, evaluate};
use crate::model::Model;
use crate::progress::{self, Progress};
use crate::sindy::{Losses, SearchError};

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

/// Lets equations learn on the validation runs at several paces, and takes the most cautious of those that
/// the rollouts cannot tell from the best. Gives the model that learns, and all that was tried.
pub(super) fn learning(
    model: &Model,
    job: &Job,
    parts: &Parts<'_>,
    progress: Progress<'_>,
) -> Result<(Model, Vec<Pace>), IdentifyError> {
    let horizon_s = job.horizon as f64 * model.description.dt;
    let quick = super::equations::quick(job, parts);
    let mut tried: Vec<(Pace, Losses, Model)> = Vec::new();
    let count = PRIORS.len() * MEMORIES.len() * WINDOWS.len();
    for prior in PRIORS {
        for memory in MEMORIES {
            for window in WINDOWS {
                progress::report(progress, tried.len() as f64 / count as f64)
                    .map_err(SearchError::Cancelled)?;
                let [window_s, prior_s, forgetting_s] = [window, prior, memory].map(|t| t * horizon_s);
                let options = adapt::Options {
                    forgetting_s,
                    window_s: Some(window_s.max(model.description.dt)),
                    prior_s,
                    ..adapt::Options::default()
                };
                let learning = adapt::settings(model, &options)?;
                let next = Model { learning: Some(learning), ..model.clone() };
                let mut session = next.session();
                let silent = &mut progress::silent();
                let judged =
                    evaluate("recursive", session.as_mut(), &parts.ranges, &parts.validation, &quick, silent)
                        .map_err(|error| match error {
                            EvaluateError::Cancelled(c) => IdentifyError::Sindy(SearchError::Cancelled(c)),
                            error => IdentifyError::Evaluate { part: "validation", error },
                        })?;
                let score = judged.score();
                let pace =
                    Pace { window_s, prior_s, forgetting_s, score: score.is_finite().then_some(score) };
                tried.push((pace, Losses { validation: judged.blocks, training: Vec::new() }, next));
            }
        }
    }
    let score = |pace: &Pace| pace.score.unwrap_or(f64::INFINITY);
    let best = (0..tried.len()).min_by(|&a, &b| score(&tried[a].0).total_cmp(&score(&tried[b].0)));
    let best = best.unwrap_or(0);
    // They stand in the order of caution.
    let chosen = (0..tried.len()).find(|&i| i == best || tried[i].1.is_as_good_as(&tried[best].1));
    let paces = tried.iter().map(|(pace, ..)| *pace).collect();
    let (_, _, model) = tried.swap_remove(chosen.unwrap_or(best));
    Ok((model, paces))
}

impl From<AdaptError> for IdentifyError {
    fn from(error: AdaptError) -> Self {
        Self::Learning(Box::new(error))
    }
}
