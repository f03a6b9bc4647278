//! The heading of the vessel beside its motion.

use std::f64::consts::TAU;

use super::csv::RawLog;
use super::note::Note;
use super::resolve::Resolved;
use super::selection::{ChannelSpec, Selection};
use super::trajectory::Trajectory;

/// Length of the windows over which the heading is compared with the yaw rate \[s\].
const WINDOW_S: f64 = 10.0;

/// Ratios of the turns by heading and yaw rate that are taken as equal.
const EQUAL: std::ops::Range<f64> = 0.8..1.25;

/// Least standard deviation of the turns in a window from which their ratio is known \[rad\].
const LEAST_TURN: f64 = 0.02;

/// Keeps the heading of runs if its change is the yaw rate, and gives the specification of its column. A named heading is
/// kept in any case. Runs without a measured heading have none.
pub(super) fn choose(
    selection: &Selection,
    resolved: &Resolved,
    log: &RawLog,
    runs: &mut [Trajectory],
    notes: &mut Vec<Note>,
) -> Option<ChannelSpec> {
    let (source, named) = resolved.heading.as_ref()?;
    let column = &log.columns[source.column].name;
    let yaw = resolved.outputs.iter().position(|output| output.channel.name == "r");
    let ratio = yaw.and_then(|yaw| turn_ratio(runs, yaw));
    let complete = runs.iter().all(|run| run.heading.is_some());
    if *named {
        if let Some(ratio) = ratio.filter(|ratio| !EQUAL.contains(ratio)) {
            let message = format!(
                "the heading `{column}` changes by {ratio:.2} times the integral of the yaw rate `r`"
            );
            notes.push(Note::warning(message).with_remedy(
                "both are positive clockwise, seen from above: state the unit of the heading, or multiply it by -1",
            ));
        }
        return selection.heading.clone();
    }
    if complete && ratio.is_some_and(|ratio| EQUAL.contains(&ratio)) {
        let unit = if source.unit_factor() == 1.0 { "rad" } else { "deg" };
        return Some(ChannelSpec { unit: Some(unit.to_owned()), ..ChannelSpec::renamed("psi", column) });
    }
    for run in runs {
        run.heading = None;
    }
    None
}

/// Slope of the change of the heading over windows against the integral of the yaw rate; `None` if the runs hardly turn.
pub(crate) fn turn_ratio(runs: &[Trajectory], yaw: usize) -> Option<f64> {
    let (mut products, mut squares, mut windows) = (0.0, 0.0, 0_u32);
    for run in runs {
        let heading = run.heading.as_ref()?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let window = ((WINDOW_S / run.dt).round() as usize).clamp(1, run.len().max(2) - 1);
        for start in (0..run.len().saturating_sub(window)).step_by(window) {
            let step = |k: usize| {
                let change = heading[k + 1] - heading[k];
                let rate = 0.5 * (run.outputs.row(k)[yaw] + run.outputs.row(k + 1)[yaw]);
                (change - TAU * (change / TAU).round(), rate * run.dt)
            };
            let (by_heading, by_rate) = (start..start + window)
                .map(step)
                .fold((0.0, 0.0), |sum, step| (sum.0 + step.0, sum.1 + step.1));
            if by_heading.is_finite() && by_rate.is_finite() {
                products += by_heading * by_rate;
                squares += by_rate * by_rate;
                windows += 1;
            }
        }
    }
    (squares > f64::from(windows) * LEAST_TURN * LEAST_TURN).then(|| products / squares)
}
