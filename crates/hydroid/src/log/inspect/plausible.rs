//! Velocities that are hardly possible for a vessel, for logs without a pose that shows it.

use super::super::note::Note;
use super::super::trajectory::Trajectory;
use super::pose::Compared;
use crate::key::key;

/// Yaw rate that no vessel exceeds for half of its log \[rad/s\]: at 3 rad/s a vessel turns once in 2.1 s. The 1.1 m
/// tug among the real logs, the fastest of them, turns with 0.7 rad/s at most.
const SPINNING_RAD_S: f64 = 3.0;
/// Ratio of the root mean squares of sway and surge above which they may be exchanged. Real logs reach 0.8, also in
/// dynamic positioning, because a hull moves sideways with several times the resistance.
const SIDEWAYS: f64 = 2.0;

/// Warns of an impossible yaw rate and of sway above surge, unless the pose was compared with them.
pub(super) fn check(path: &str, runs: &[Trajectory], compared: Compared, notes: &mut Vec<Note>) {
    let Some(first) = runs.first() else { return };
    let values = |name: &str| {
        let channel = first.outputs.channels().iter().position(|c| c.name == name);
        let all = channel.into_iter().flat_map(|i| runs.iter().flat_map(move |run| run.outputs.column(i)));
        all.filter(|x| x.is_finite()).map(f64::abs)
    };
    let mut rates: Vec<f64> = values("r").collect();
    let middle = rates.len() / 2;
    if !compared.yaw && !rates.is_empty() {
        let median = *rates.select_nth_unstable_by(middle, f64::total_cmp).1;
        if median > SPINNING_RAD_S {
            notes.push(
                Note::warning(format!(
                    "{path}: `r` exceeds {median:.1} rad/s for half of the time: no vessel turns as fast, and its unit seems to be deg/s"
                ))
                .with_remedy(format!("state the unit, as in {}", key("outputs").is("r=COLUMN [deg/s]"))),
            );
        }
    }
    let rms = |name: &str| {
        let (sum, n) = values(name).fold((0.0, 0_usize), |(sum, n), x| (sum + x * x, n + 1));
        (sum / n as f64).sqrt()
    };
    let (surge, sway) = (rms("u"), rms("v"));
    // Without one of the outputs the comparison is false.
    if !compared.path && sway > SIDEWAYS * surge {
        notes.push(
            Note::warning(format!(
                "{path}: the vessel seems to move sideways: the root mean square of `v` is {sway:.2e} m/s and that of `u` {surge:.2e} m/s"
            ))
            .with_remedy("check that the columns of `u` and `v` are not exchanged and that `u` and `v` have the same unit"),
        );
    }
}
