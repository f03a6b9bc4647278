//! Errors of predicted trials in runs that were left out of a model.

use super::figure::Figure;
use super::measured::{Comparison, compare_alone};
use super::recognised::RecognisedKind;
use crate::log::Trajectory;
use crate::model::{Model, TrialErrors};

/// Units of figures of trials.
const UNITS: [&str; 6] = ["m", "s", "deg", "deg/s", "m/s", "%"];

/// The errors of models in the trials of runs that they were identified without, by kind of trial and unit.
pub(crate) fn trial_errors(left_out: &[(Model, &Trajectory)]) -> Vec<TrialErrors> {
    let of = |(model, run): &(Model, &Trajectory)| compare_alone(model, run).unwrap_or_default();
    let comparisons: Vec<Comparison> = left_out.iter().flat_map(of).collect();
    let kinds = [RecognisedKind::TurningCircle, RecognisedKind::Zigzag];
    let each = kinds.iter().flat_map(|kind| UNITS.iter().map(move |unit| (*kind, *unit)));
    each.filter_map(|(kind, unit)| {
        let of_kind = comparisons.iter().filter(|comparison| comparison.trial.kind == kind);
        let errors: Vec<Vec<f64>> =
            of_kind.map(|comparison| errors(comparison, unit)).filter(|errors| !errors.is_empty()).collect();
        TrialErrors::new(kind.name(), unit, &errors)
    })
    .collect()
}

/// Errors of the figures with a unit, infinite where the prediction does not reach a measured figure.
fn errors(comparison: &Comparison, unit: &str) -> Vec<f64> {
    let pairs = comparison.measured.iter().zip(&comparison.predicted);
    let error = |(measured, predicted): (&Figure, &Figure)| {
        let measured_value = measured.value.filter(|_| measured.name_and_unit().1 == unit)?;
        let Some(value) = predicted.value else { return Some(f64::INFINITY) };
        let scale = if TrialErrors::is_relative(unit) { value.abs() } else { 1.0 };
        Some((measured_value - value).abs() / scale)
    };
    pairs.filter_map(error).collect()
}

/// Widens the intervals of a trial's figures by the errors of trials that were left out, and gives the number of these trials.
pub(super) fn widen(figures: &mut [Figure], kind: RecognisedKind, errors: &[TrialErrors]) -> usize {
    let errors: Vec<&TrialErrors> = errors.iter().filter(|errors| errors.trial == kind.name()).collect();
    for figure in figures {
        let Some(value) = figure.value.filter(|_| figure.no_interval.is_none()) else { continue };
        let unit = figure.name_and_unit().1;
        let Some(errors) = errors.iter().find(|errors| errors.unit == unit) else { continue };
        let Some(half_width) = errors.about(value) else {
            figure.interval = None;
            figure.no_interval = Some(format!(
                "predictions of {} trials that were left out of the fit do not reach all such figures",
                errors.trials
            ));
            continue;
        };
        let [low, high] = figure.interval.unwrap_or([value; 2]);
        figure.interval = Some([low.min(value - half_width), high.max(value + half_width)]);
    }
    errors.iter().map(|errors| errors.trials).max().unwrap_or(0)
}

/// What intervals hold, in words; none without intervals.
pub fn interval_words(members: usize, left_out_trials: usize) -> Option<String> {
    let of_members = (members > 0).then(|| format!("5 % to 95 % of {members} members"));
    let trials = if left_out_trials == 1 { "trial that was" } else { "trials that were" };
    let of_trials = (left_out_trials > 0).then(|| {
        let level = 100.0 * TrialErrors::LEVEL;
        format!("{level:.0} % by the errors of {left_out_trials} {trials} left out of the fit")
    });
    match (of_members, of_trials) {
        (None, None) => None,
        (Some(members), None) => Some(format!("{members}; errors that all of them share are not in them")),
        (None, Some(trials)) => Some(trials),
        (Some(members), Some(trials)) => Some(format!("{members}, and {trials}")),
    }
}
