//! Errors of predicted trials in runs that were left out of a model.

use super::figure::Figure;
use super::measured::{Comparison, compare_alone};
use super::recognised::RecognisedKind;
use crate::log::Trajectory;
use crate::model::{Model, TrialErrors};

/// The errors of models in the trials of runs that they were identified without, by kind of trial and figure.
pub(crate) fn trial_errors(left_out: &[(Model, &Trajectory)]) -> Vec<TrialErrors> {
    let of = |(model, run): &(Model, &Trajectory)| compare_alone(model, run).unwrap_or_default();
    let comparisons: Vec<Comparison> = left_out.iter().flat_map(of).collect();
    let kinds = [RecognisedKind::TurningCircle, RecognisedKind::Zigzag];
    kinds.iter().flat_map(|kind| of_kind(*kind, &comparisons)).collect()
}

fn of_kind(kind: RecognisedKind, all: &[Comparison]) -> Vec<TrialErrors> {
    let all: Vec<&Comparison> = all.iter().filter(|comparison| comparison.trial.kind == kind).collect();
    let Some(first) = all.first() else { return Vec::new() };
    let of = |(place, figure): (usize, &Figure)| {
        let errors = all.iter().filter_map(|trial| error(&trial.measured[place], &trial.predicted[place]));
        TrialErrors::new(kind.name(), &figure.name, errors.collect())
    };
    first.measured.iter().enumerate().filter_map(of).collect()
}

/// The error of a figure that was measured, infinite where the prediction does not reach it.
fn error(measured: &Figure, predicted: &Figure) -> Option<f64> {
    let value = measured.value?;
    let unit = measured.name_and_unit().1;
    Some(predicted.value.map_or(f64::INFINITY, |predicted| TrialErrors::error(unit, value, predicted)))
}

/// Joins the intervals of figures with those of the errors of trials that were left out.
pub(super) fn widen(figures: &mut [Figure], kind: RecognisedKind, errors: &[TrialErrors]) {
    for figure in figures {
        let known = errors.iter().find(|of| of.trial == kind.name() && of.figure == figure.name);
        // Members that do not reach a figure may lie anywhere.
        let value = figure.value.filter(|_| figure.no_interval.is_none());
        let (Some(value), Some(errors)) = (value, known) else { continue };
        let (_, unit) = figure.name_and_unit();
        if let Some([low, high]) = errors.about(unit, value) {
            let [least, most] = figure.interval.unwrap_or([value; 2]);
            // An overshoot is not negative.
            let bound = if figure.name.ends_with("overshoot_deg") { 0.0 } else { f64::NEG_INFINITY };
            figure.interval = Some([low.min(least).max(bound), high.max(most)]);
            figure.left_out_trials = errors.trials;
        } else {
            figure.interval = None;
            figure.no_interval = Some(format!(
                "in {} trials that were left out of the fit, predictions too often do not reach it, or have another sign",
                errors.trials
            ));
        }
    }
}

/// What the intervals of a trial hold, in words; none without intervals.
pub fn interval_words(figures: &[Figure], members: usize) -> Option<String> {
    let with = figures.iter().filter(|figure| figure.interval.is_some());
    let [left_out, alone] = with.fold([0, 0], |[left_out, alone], figure| match figure.left_out_trials {
        0 => [left_out, alone + 1],
        _ => [left_out + 1, alone],
    });
    let by_trials =
        "90 % by the errors of trials that were left out of the fit, whose number stands in brackets";
    let shared = "errors that all members share are not in them";
    match (members, left_out, alone) {
        (_, 0, 0) => None,
        (0, _, _) => Some(by_trials.to_owned()),
        (_, 0, _) => Some(format!("5 % to 95 % of {members} members; {shared}")),
        (_, _, 0) => Some(format!("5 % to 95 % of {members} members, joined with {by_trials}")),
        _ => Some(format!(
            "5 % to 95 % of {members} members, joined with {by_trials}; without brackets, {shared}"
        )),
    }
}

impl Figure {
    /// The number of trials in whose errors its interval rests, in brackets; empty without such trials.
    pub fn left_out_text(&self) -> String {
        match self.left_out_trials {
            0 => String::new(),
            trials => format!(" [{trials}]"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_is_joined_where_members_reach_the_figure_and_trials_have_it() {
        let errors = |figure: &str, errors: Vec<f64>| TrialErrors::new("zigzag", figure, errors).unwrap();
        let known = [
            errors("first_overshoot_deg", vec![2.0; 9]),
            errors("second_overshoot_deg", vec![2.0; 9]),
            errors("reach_s", vec![f64::INFINITY; 2]),
        ];
        let figure = |name: &str, interval| Figure { interval, ..Figure::new(name, 1.0) };
        let missed = Figure {
            no_interval: Some("3 of 9 members do not reach it".to_owned()),
            ..Figure::new("second_overshoot_deg", 1.0)
        };
        let mut figures = [
            figure("first_overshoot_deg", Some([0.5, 4.0])),
            missed.clone(),
            figure("reach_s", Some([0.9, 1.1])),
            figure("period_s", Some([0.9, 1.1])),
        ];
        widen(&mut figures, RecognisedKind::Zigzag, &known);
        let [first, second, reach, period] = figures;
        assert_eq!((first.interval, first.left_out_trials), (Some([0.0, 4.0]), 9));
        assert_eq!(second, missed);
        assert_eq!(reach.interval, None);
        assert!(reach.no_interval.unwrap().starts_with("in 2 trials that were left out of the fit"));
        assert_eq!((period.interval, period.left_out_trials), (Some([0.9, 1.1]), 0));
        let other = &mut [figure("first_overshoot_deg", None)];
        widen(other, RecognisedKind::TurningCircle, &known);
        assert_eq!(other[0].interval, None);
    }
}
