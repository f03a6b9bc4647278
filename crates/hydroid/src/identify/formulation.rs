//! Selection of the formulation of a network by short trainings.
//!
//! Networks of the inputs alone or with output feedback are the best on a simulated vessel with white measurement
//! noise, networks that predict increments on real ships with wind and waves (`docs/networks.md`).

use std::path::Path;

use super::{IdentifyError, Method};
use crate::log::Note;
use crate::train::{self, BaseKind, CellKind, TrainError, TrainOptions};

/// Share of the epochs, or of the time budget, of each short training.
const TRIAL_SHARE: f64 = 0.1;

const FORMULATIONS: [(bool, BaseKind, &str); 3] = [
    (false, BaseKind::Nothing, "inputs alone"),
    (true, BaseKind::Nothing, "outputs fed back"),
    (true, BaseKind::Hold, "outputs fed back, increments"),
];

pub(super) fn formulations(
    settings: &TrainOptions,
    given: bool,
    inputs: usize,
) -> Vec<(TrainOptions, &'static str)> {
    if given {
        return vec![(settings.clone(), "as given")];
    }
    let with = |(feedback, base, name)| (TrainOptions { feedback, base, ..settings.clone() }, name);
    let must = inputs == 0 || settings.cell == CellKind::Direct;
    let can_be = |&(feedback, _, _): &(bool, BaseKind, &str)| feedback || !must;
    FORMULATIONS.into_iter().filter(can_be).map(with).collect()
}

/// The options with the smallest validation error after short trainings, and the share of the whole training that these
/// took. A training stored in `checkpoint` keeps its options.
pub(super) fn select_formulation(
    task: &train::Job<'_>,
    mut choices: Vec<(TrainOptions, &'static str)>,
    (method, checkpoint): (Method, Option<&Path>),
    notes: &mut Vec<Note>,
    watch: train::ProgressCallback<'_>,
) -> Result<(TrainOptions, f64), IdentifyError> {
    let kept =
        |settings: &TrainOptions| checkpoint.is_some_and(|file| task.is_kept_in(settings, file) == [true; 2]);
    if let Some(begun) = choices.iter().position(|(settings, _)| kept(settings)) {
        return Ok((choices.swap_remove(begun).0, 0.0));
    }
    if choices.len() == 1 {
        return Ok((choices.swap_remove(0).0, 0.0));
    }
    let whole = 1.0 + TRIAL_SHARE * choices.len() as f64;
    let mut tried: Vec<(f64, usize)> = Vec::new();
    let mut failure = None;
    for (i, (settings, _)) in choices.iter().enumerate() {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count")]
        let epochs = ((TRIAL_SHARE * settings.epochs as f64) as usize).max(1);
        let budget_s = settings.budget_s.map(|budget| TRIAL_SHARE * budget);
        let short =
            TrainOptions { epochs, budget_s, restarts: 1, patience: None, refit: false, ..settings.clone() };
        let tell = &mut |status: &train::Status| {
            watch(&train::Status { fraction: TRIAL_SHARE * (i as f64 + status.fraction) / whole, ..*status })
        };
        match train::train(task, &short, None, tell) {
            Ok(trained) => tried.push((trained.validation, i)),
            Err(error @ TrainError::Cancelled(_)) => return Err(IdentifyError::Train { method, error }),
            Err(error) => failure = Some(error),
        }
    }
    let best = tried.iter().copied().reduce(|best, next| if next.0 < best.0 { next } else { best });
    let Some((_, best)) = best else {
        let settings = choices.swap_remove(0).0;
        return match failure {
            Some(error) => Err(IdentifyError::Train { method, error }),
            None => Ok((settings, 0.0)),
        };
    };
    let told: Vec<String> = tried.iter().map(|&(score, i)| format!("{} {score:.3}", choices[i].1)).collect();
    notes.push(Note::info(format!(
        "{}: {}, by the validation error after short trainings: {}; set feedback and base in [network] to override",
        method.name(),
        choices[best].1,
        told.join(", ")
    )));
    let left = 2.0 - whole;
    let (mut settings, _) = choices.swap_remove(best);
    settings.budget_s = settings.budget_s.map(|budget| budget * left);
    Ok((settings, 1.0 - 1.0 / whole))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_inputs_a_network_must_hear_its_outputs() {
        let names = |given, inputs| -> Vec<&str> {
            formulations(&TrainOptions::default(), given, inputs).into_iter().map(|(_, name)| name).collect()
        };
        assert_eq!(names(false, 2), ["inputs alone", "outputs fed back", "outputs fed back, increments"]);
        assert_eq!(names(false, 0), ["outputs fed back", "outputs fed back, increments"]);
        assert_eq!(names(true, 0), ["as given"]);
    }
}
