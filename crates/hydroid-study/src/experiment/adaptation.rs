//! A network along a record: frozen, with its state filtered, and adapted.

use serde::{Deserialize, Serialize};

use super::super::StudyError;
use super::super::runner::{Learned, LoadedRecord, Runner};
use hydroid::adapt::{self, Options};
use hydroid::evaluate::{self, Against, Evaluation};

/// Longest horizon \[samples\].
pub(super) const HORIZON: usize = 100;

/// Mean and largest error against the truth, by horizon and output.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Errors {
    pub(super) mean: Vec<Vec<f64>>,
    pub(super) max: Vec<Vec<f64>>,
    /// Diverged rollouts, which are excluded from all means.
    pub(super) diverged: usize,
}

impl Errors {
    fn of(evaluation: Evaluation) -> Self {
        Self { mean: evaluation.mae, max: evaluation.max, diverged: evaluation.diverged }
    }
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Along {
    pub(super) frozen: Errors,
    /// State filtered, weights frozen; `None` for models without a state filter.
    pub(super) filtered: Option<Errors>,
    pub(super) adapted: Errors,
}

/// Options of `hydroid adapt`, with or without guard.
pub(super) fn options(guarded: bool, learned: &Learned) -> Options {
    let evaluate = evaluate::Options {
        horizon: HORIZON,
        origin_stride: 5,
        against: Against::Truth,
        warm_up: 100,
        ..evaluate::Options::default()
    };
    let options = Options { evaluate, ..Options::of(&learned.model) };
    if guarded { options.guarded(&learned.model) } else { options }
}

pub(super) fn adaptation(
    runner: &Runner<'_>,
    learned: &Learned,
    loaded: &LoadedRecord,
    guarded: bool,
) -> Result<Along, StudyError> {
    runner.fits(learned, loaded)?;
    let key = runner.store.key("adaptation", &guarded, &[learned.key, loaded.key]);
    runner.store.get("adaptation", key, || {
        let options = options(guarded, learned);
        let adapted =
            adapt::adapt(&learned.model, &[&loaded.run], &options, &mut runner.progress("adapting"))?.report;
        Ok(Along {
            frozen: Errors::of(adapted.frozen),
            filtered: adapted.frozen_filtered.map(Errors::of),
            adapted: Errors::of(adapted.adapted),
        })
    })
}
