//! Whether the runs are long enough to judge a model.

use serde::Serialize;

use super::SindyOptions;
use super::{Candidate, CrossValidation, Grade, IdentifyError, IdentifyResult, Job, Verdict};
use super::{is_cross_validated, parts_of};
use crate::committee::ChooseError;
use crate::evaluate::MIN_WINDOWS;
use crate::key::key;
use crate::log::{Channel, Note, Split, Trajectory};
use crate::sindy::{FitError, SearchError};

/// Default longest horizon \[samples\], in long logs.
pub(crate) const HORIZON: usize = 100;

/// The shortest default horizon \[samples\].
const SHORTEST: usize = HORIZON / 4;

/// Default longest horizon \[samples\]: 100, or half of a block, 25 at least, where the folds of a cross-validation are blocks of a
/// log that is too short for that.
pub fn default_horizon(split: &Split, cross_validated: bool) -> usize {
    if !cross_validated {
        return HORIZON;
    }
    let folds = CrossValidation::new(&split.train);
    let longest = folds.runs(&split.train).into_iter().map(|(_, run)| run.len()).max().unwrap_or(0);
    if longest > HORIZON || !folds.has_blocks() { HORIZON } else { (longest / 2).max(SHORTEST) }
}

/// The data that are missing for a judgement.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MissingData {
    /// The runs that are too short: `left-out`, `validation` or `test`.
    pub part: &'static str,
    /// Windows of which no two overlap.
    pub windows: usize,
    /// Fewest of them.
    pub needed: usize,
    /// Length of a window \[s\].
    pub horizon_s: f64,
    /// Length of the missing runs of this kind \[s\].
    pub missing_s: f64,
}

impl MissingData {
    /// What is missing of a part of the split; none if there are windows enough.
    fn of(
        part: &'static str,
        runs: &[&Trajectory],
        blocks: bool,
        windows: usize,
        job: &Job,
        warm_up: usize,
    ) -> Option<Self> {
        let dt = runs.first().filter(|_| windows < MIN_WINDOWS)?.dt;
        let samples = if blocks {
            // Each block of a longer log is longer.
            let each = MIN_WINDOWS.div_ceil(runs.len()).saturating_mul(job.horizon).saturating_add(warm_up);
            runs.len().saturating_mul(each).saturating_sub(runs.iter().map(|run| run.len()).sum())
        } else {
            (MIN_WINDOWS - windows).saturating_mul(job.horizon).saturating_add(warm_up)
        };
        let seconds = |samples: usize| samples as f64 * dt;
        let horizon_s = (1e3 * seconds(job.horizon)).round() / 1e3;
        let missing_s = seconds(samples.max(job.horizon));
        Some(Self { part, windows, needed: MIN_WINDOWS, horizon_s, missing_s })
    }

    /// What is missing to judge candidates on the validation, which chooses the best one, and on the test runs. Without a
    /// candidate, the windows are those of runs without warm-up.
    pub(super) fn for_judgement(job: &Job, candidates: &[Candidate]) -> Option<Self> {
        let [_, validation, test] = parts_of(&job.split);
        let folds = is_cross_validated(job).then(|| CrossValidation::new(&job.split.train));
        let left_out = folds.as_ref().map(|folds| folds.runs(&job.split.train));
        let left_out = left_out.map(|all| all.into_iter().map(|(_, run)| run).collect());
        let name = if folds.is_some() { "left-out" } else { "validation" };
        let warm_up =
            candidates.iter().map(|candidate| candidate.model.session().warm_up()).max().unwrap_or(1);
        let first = candidates.first();
        let missing = |part, runs: &[&Trajectory], blocks, windows: Option<usize>| {
            let all = || runs.iter().map(|run| run.len().saturating_sub(1) / job.horizon.max(1)).sum();
            Self::of(part, runs, blocks, windows.unwrap_or_else(all), job, warm_up)
        };
        let validation: Vec<&Trajectory> = left_out.unwrap_or(validation);
        let blocks = folds.as_ref().is_some_and(CrossValidation::has_blocks);
        let all = [
            missing(name, &validation, blocks, first.map(|one| one.validation.independent)),
            missing(
                "test",
                &test,
                false,
                first.and_then(|one| one.test.as_ref()).map(|test| test.independent),
            ),
        ];
        all.into_iter().flatten().max_by(|a, b| a.missing_s.total_cmp(&b.missing_s))
    }

    /// `not enough data: about N more minutes`, and why.
    pub fn describe(&self) -> String {
        let Self { part, windows, needed, horizon_s, missing_s } = self;
        let minutes = (missing_s / 6.0).ceil() / 10.0;
        let of = if *part == "test" { " of test runs" } else { "" };
        format!(
            "not enough data: about {minutes} more minutes{of}. The {part} runs have {windows} {} of {horizon_s} s that do not overlap, and a judgement needs {needed}, with which the standard error of an NRMSE is a third of it. No model is the best one: persistence remains",
            if *windows == 1 { "window" } else { "windows" }
        )
    }

    pub(super) fn note(&self) -> Note {
        Note::warning(self.describe())
            .with_remedy(format!("log for longer, or set a shorter {}", key("horizon")))
    }
}

impl IdentifyResult {
    /// The result of a job without a model, if the runs are too short for the methods and for a judgement.
    pub(super) fn without_model(job: &Job, error: IdentifyError) -> Result<Self, IdentifyError> {
        let is_short = match &error {
            // A given horizon is a wrong option.
            IdentifyError::Horizon { part: "left-out", horizon, .. } => {
                *horizon == default_horizon(&job.split, true)
            }
            IdentifyError::NotEvaluable { .. } | IdentifyError::Committee(ChooseError::TooShort { .. }) => {
                true
            }
            // Given terms or windows are wrong options.
            IdentifyError::Sindy(SearchError::Fit(FitError::TooFewRows { .. })) => {
                job.sindy == SindyOptions::default()
            }
            _ => false,
        };
        let missing = is_short.then(|| MissingData::for_judgement(job, &[])).flatten();
        let Some(missing) = missing else { return Err(error) };
        let verdict = |channel: &Channel| Verdict {
            channel: channel.name.clone(),
            grade: Grade::NotJudged,
            nrmse: f64::NAN,
            persistence: f64::NAN,
            reason: Some(error.without_method()),
        };
        let mut warnings = job.split.notes.clone();
        warnings.push(Note::warning(format!("no model: {}", error.without_method())));
        warnings.push(missing.note());
        Ok(Self {
            candidates: Vec::new(),
            best: None,
            verdicts: job.split.train[0].outputs.channels().iter().map(verdict).collect(),
            warnings,
            ranges: Vec::new(),
            cross_validation: None,
            currents: None,
            for_trials: None,
            missing: Some(missing),
        })
    }
}
