//! Grades of a model on the test runs, and warnings.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::data_summary::ChannelSummary;
use super::options::is_generic;
use super::{Candidate, Job, SindyOptions};
use crate::evaluate::{Evaluation, MIN_WINDOWS, RunErrors};
use crate::key::key;
use crate::log::{Note, Trajectory};
use crate::sindy;
use crate::sindy::{SearchResult, StabilityCheck};

/// Quality of the prediction of an output at the longest horizon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Grade {
    /// The error is at most half of that of the best trivial prediction.
    Good,
    /// The error is at least a tenth below that of the best trivial prediction.
    Usable,
    /// No better than the trivial predictions, or most rollouts diverge: this equation must not be used.
    NotIdentified,
    /// There is no valid comparison, for the [reason](Verdict::reason).
    NotJudged,
}

/// Grade of one output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The output.
    pub channel: String,
    /// The grade.
    pub grade: Grade,
    /// NRMSE at the longest horizon; the mean as prediction gives 1.
    pub nrmse: f64,
    /// NRMSE of persistence at the same horizon.
    pub persistence: f64,
    /// Why the errors give no grade, or only this one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

impl Verdict {
    /// The errors in words.
    fn why(&self, horizon_s: f64) -> String {
        let reason = self.reason.as_ref().map(|reason| format!("; {reason}")).unwrap_or_default();
        format!(
            "over {horizon_s} s its NRMSE is {:.2}, of persistence {:.2}, of the mean 1{reason}",
            self.nrmse, self.persistence
        )
    }
}

/// Outputs that are not identified beside the mean alone, with the figures that say so: over a short horizon, persistence may be as
/// good as a model that tells a trial.
pub(super) fn not_identified(judged: &Evaluation, runs: &[&Trajectory]) -> BTreeMap<String, String> {
    let is_useless = |verdict: &Verdict| {
        let is_no_better = verdict.reason.is_some() || verdict.nrmse > USABLE;
        verdict.grade == Grade::NotIdentified && is_no_better
    };
    let horizon_s = horizon_s(judged);
    let useless = verdicts(judged, &[]).into_iter().enumerate().filter_map(|(channel, verdict)| {
        let why = undetermined(runs, channel);
        let why = why.or_else(|| is_useless(&verdict).then(|| verdict.why(horizon_s)))?;
        Some((verdict.channel, why))
    });
    useless.collect()
}

/// Error relative to that of the best trivial prediction, up to which a prediction is usable.
const USABLE: f64 = 0.9;

/// The longest horizon \[s\], rounded to a millisecond against rounding errors of the product.
fn horizon_s(judged: &Evaluation) -> f64 {
    (1e3 * judged.horizons.last().map_or(0.0, |&h| h as f64 * judged.dt)).round() / 1e3
}

/// Grades each output at the longest horizon against the better of persistence and the mean (NRMSE 1). There is no grade from
/// fewer than [`MIN_WINDOWS`] windows without overlap, and none of an output that the sensors of the runs do not determine: its stated
/// variance exceeds its variance over the runs.
pub fn verdicts(test: &Evaluation, runs: &[&Trajectory]) -> Vec<Verdict> {
    let (Some(errors), Some(kept)) = (test.nrmse.last(), test.persistence.nrmse.last()) else {
        return Vec::new();
    };
    test.channels
        .iter()
        .zip(errors.iter().zip(kept))
        .enumerate()
        .map(|(index, (channel, (&nrmse, &persistence)))| {
            let trivial = if persistence.is_finite() { persistence.min(1.0) } else { 1.0 };
            let (grade, reason) = if test.independent < MIN_WINDOWS {
                let found = test.independent;
                let reason =
                    format!("windows without overlap: {found} of the {MIN_WINDOWS} that a grade needs");
                (Grade::NotJudged, Some(reason))
            } else if nrmse.is_nan() {
                (Grade::NotJudged, Some(String::from("the output does not vary over the judged windows")))
            } else if let Some(reason) = undetermined(runs, index) {
                (Grade::NotJudged, Some(reason))
            } else if 2 * test.diverged > test.windows {
                let reason = format!("{} of {} rollouts diverge", test.diverged, test.windows);
                (Grade::NotIdentified, Some(reason))
            } else if nrmse <= 0.5 * trivial {
                (Grade::Good, None)
            } else if nrmse <= USABLE * trivial {
                (Grade::Usable, None)
            } else {
                (Grade::NotIdentified, None)
            };
            Verdict { channel: channel.clone(), grade, nrmse, persistence, reason }
        })
        .collect()
}

/// Why the sensors do not determine an output: the stated variance of its values exceeds their variance over the runs, so that less
/// than half of its motion is measured.
fn undetermined(runs: &[&Trajectory], channel: usize) -> Option<String> {
    let (mut squares, mut samples, mut values) = (0.0, 0.0, Vec::new());
    for run in runs {
        squares += run.outputs.deviation(channel)?.powi(2) * run.len() as f64;
        samples += run.len() as f64;
        values.extend(run.outputs.column(channel).filter(|x| x.is_finite()));
    }
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let spread = (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt();
    let stated = (squares / samples).sqrt();
    let unit = &runs.first()?.outputs.channels()[channel].unit;
    (stated > spread).then(|| {
        format!("the sensors do not determine it (standard deviation {stated:.2e} {unit}, spread over the runs {spread:.2e} {unit})")
    })
}

const MIN_SPIKE_SHARE: f64 = 0.005;

pub(super) fn spikes(training: &[&Trajectory], settings: &SindyOptions) -> Option<Note> {
    if settings.huber.is_some() {
        return None;
    }
    let channels = training.first()?.outputs.channels();
    let told: Vec<String> = sindy::spike_share(training)
        .into_iter()
        .zip(channels)
        .filter(|(share, _)| *share > MIN_SPIKE_SHARE)
        .map(|(share, channel)| format!("{} ({:.1} % of the samples)", channel.name, 100.0 * share))
        .collect();
    (!told.is_empty()).then(|| {
        Note::warning(format!("the training runs have spikes in {}", told.join(", "))).with_remedy(format!(
            "set {} to limit their weight, or blank them in the log; the search for lags and gates is less reliable with spikes: give known ones ({}, {})",
            key("huber").is(1.345),
            key("lag"),
            key("gate")
        ))
    })
}

/// Notes on data without velocities of a vessel: the libraries, and equations that are right and diverge.
pub(super) fn of_no_vessel(job: &Job, shown: &Candidate) -> Vec<Note> {
    let mut notes = Vec::new();
    let Some(found) = shown.found() else { return notes };
    let SindyOptions { library, degree, terms, gate, .. } = &job.sindy;
    let is_chosen = library.is_some() || degree.is_some() || !terms.is_empty() || gate.is_some();
    if !is_chosen && job.split.train.first().is_some_and(is_generic) {
        notes.push(
            Note::info("no output is called u, v or r, or has a unit of velocity: polynomials up to degree 3 were tried, and no change of mode")
                .with_remedy(format!("for a vessel give the outputs these names or units, or set {} and {}", key("library"), key("gate"))),
        );
    }
    if found.grid.noise.is_some() && found.noise_ratio.is_none() {
        notes.push(
            Note::warning("the equations explain a part of the training runs to within their noise, and all of them together not")
                .with_remedy(format!("{} selects equations by their rollouts", key("ridge"))),
        );
    }
    let of_test = shown.test.as_ref();
    let diverged = shown.validation.diverged + of_test.map_or(0, |test| test.diverged);
    let windows = shown.validation.windows + of_test.map_or(0, |test| test.windows);
    if found.noise_ratio.is_some() && diverged > 0 {
        notes.push(
            Note::warning(format!(
                "the equations explain the training runs to within their noise, and {diverged} of {windows} rollouts from measured states diverge: no model is selected as best"
            ))
            .with_remedy(format!("start simulations from filtered states; {} selects other equations by their rollouts", key("ridge"))),
        );
    }
    notes
}

pub(super) fn warnings(
    candidate: &Candidate,
    verdicts: &[Verdict],
    data: &[ChannelSummary],
    test_runs: &[Trajectory],
) -> Vec<Note> {
    let mut notes = Vec::new();
    let test = candidate.judged();
    let horizon_s = horizon_s(test);
    for verdict in verdicts.iter().filter(|v| v.grade == Grade::NotIdentified) {
        notes.push(
            Note::warning(format!("'{}' is not identified: {}", verdict.channel, verdict.why(horizon_s))).with_remedy(
                "do not use predictions of this output; check the sensor (hydroid inspect), and log runs in which the commands excite this output",
            ),
        );
    }
    notes.extend(contradictions(test, verdicts));
    // Too few windows are a note of their own.
    let is_constant = |v: &&Verdict| v.grade == Grade::NotJudged && test.independent >= MIN_WINDOWS;
    for verdict in verdicts.iter().filter(is_constant) {
        let reason = verdict.reason.as_deref().unwrap_or_default();
        let remedy = if verdict.nrmse.is_nan() {
            "leave it out of the outputs, or log runs in which it varies"
        } else {
            "what follows from it is not valid; record velocities, or the accelerations of an inertial unit"
        };
        notes.push(
            Note::warning(format!("'{}' is not judged: {reason}", verdict.channel)).with_remedy(remedy),
        );
    }
    let of_test = candidate.test.as_ref().map(|test| (test, "test"));
    let judged = if candidate.left_out.is_empty() { "validation" } else { "left-out" };
    for (evaluation, part) in [(&candidate.validation, judged)].into_iter().chain(of_test) {
        if evaluation.runs.unused > 0 {
            notes.push(
                Note::warning(format!(
                    "{} of the {part} runs ({} samples) are too short for a horizon of {horizon_s} s and are not evaluated",
                    evaluation.runs.unused, evaluation.runs.unused_samples
                ))
                .with_remedy(format!(
                    "set a shorter {}, or a longer {} if gaps cut the log",
                    key("horizon"),
                    key("max_gap")
                )),
            );
        }
        if evaluation.diverged > 0 && candidate.found().is_none_or(|found| found.noise_ratio.is_none()) {
            let place = evaluation.divergences.first().map_or_else(String::new, |d| {
                format!(
                    ", first in {} from {:.1} s at step {} in '{}'",
                    d.run, d.origin_s, d.horizon, d.channel
                )
            });
            notes.push(
                Note::warning(format!(
                    "{} of {} {part} rollouts diverge{place}: no model is selected as best",
                    evaluation.diverged, evaluation.windows
                ))
                .with_remedy("add training runs that cover these speeds and commands, or reduce the degree"),
            );
        }
    }
    notes.extend(candidate.model.outside(test_runs));
    for summary in data {
        let width = summary.parts[0].max - summary.parts[0].min;
        if summary.input && width == 0.0 {
            notes.push(
                Note::warning(format!(
                    "input '{}' never moves in the training runs: its effect cannot be identified",
                    summary.channel.name
                ))
                .with_remedy(format!("remove it from {}, or log a run in which it moves", key("inputs"))),
            );
        }
    }
    if let Some(found) = candidate.found() {
        search_warnings(found, &mut notes);
    }
    notes
}

/// Multiple of the error of persistence in a part of the runs from which a model that is better on the whole contradicts it.
const CONTRADICTS: f64 = 3.0;

/// Parts of the runs in which an output does not follow the commands as it does elsewhere: the model is worse there than on the
/// whole, and by far worse than no change.
fn contradictions(judged: &Evaluation, verdicts: &[Verdict]) -> Vec<Note> {
    let is_predicted = |verdict: &Verdict| [Grade::Good, Grade::Usable].contains(&verdict.grade);
    let of_run = |run: &RunErrors| {
        let errors = verdicts.iter().zip(run.nrmse.iter().zip(&run.persistence));
        let worse = errors.filter(|(verdict, (nrmse, persistence))| {
            is_predicted(verdict) && **nrmse > verdict.nrmse && **nrmse > CONTRADICTS * **persistence
        });
        let texts: Vec<String> = worse
            .map(|(verdict, (nrmse, persistence))| {
                format!(
                    "the NRMSE of {} is {nrmse:.2} and that of persistence {persistence:.2}",
                    verdict.channel
                )
            })
            .collect();
        (!texts.is_empty()).then(|| {
            Note::warning(format!(
                "{}: the motion does not follow the commands as elsewhere: {}",
                run.run,
                texts.join(", ")
            ))
            .with_remedy(format!(
                "if the vessel was not sailed there, as with its propulsion switched off, moored or on a trailer, leave this part out ({})",
                key("exclude")
            ))
        })
    };
    // Of a single run, there is no elsewhere.
    judged.by_run.iter().filter(|_| judged.by_run.len() > 1).filter_map(of_run).collect()
}

fn search_warnings(found: &SearchResult, notes: &mut Vec<Note>) {
    let ridges = || found.trials.iter().map(|trial| trial.ridge);
    let (largest, smallest) = (ridges().fold(0.0, f64::max), ridges().fold(f64::INFINITY, f64::min));
    if let Some(chosen) = found.trials.get(found.chosen)
        && chosen.ridge == largest
        && largest > smallest
    {
        notes.push(
            Note::warning(format!(
                "the selected ridge ({largest}) is the largest in the search: the coefficients are shrunk to about {:.0} %, and these logs do not determine the right amount",
                100.0 / (1.0 + largest)
            ))
            .with_remedy(format!(
                "log runs in which each input moves independently; compare with {}",
                key("ridge").is(0.1)
            )),
        );
    }
    let StabilityCheck { rollouts, unbounded } = found.stability;
    if unbounded > 0 {
        notes.push(
            Note::warning(format!(
                "{unbounded} of {rollouts} rollouts from random states and commands inside the training envelope diverge: the equations are not stable everywhere"
            ))
            .with_remedy(format!(
                "keep controllers and simulations inside the training range; try {}, a smaller library, or logs that cover more of the envelope",
                key("dissipative")
            )),
        );
    }
    if found.condition > 1e6 {
        notes.push(
            Note::warning(format!(
                "the library is nearly collinear on the training runs (condition number {:.1e}): coefficients may be large and cancel",
                found.condition
            ))
            .with_remedy("choose a smaller degree, or log runs in which the inputs move independently"),
        );
    }
}
