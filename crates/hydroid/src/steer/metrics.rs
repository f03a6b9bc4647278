//! Figures of a voyage.

use std::collections::BTreeMap;

use hydroid_core::control::Status;
use serde::Serialize;

use super::sail::{Moment, Voyage};

/// Time that commands took \[us\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Times {
    /// Half took less.
    pub median: f64,
    /// The longest.
    pub max: f64,
}

/// What a voyage was worth. Errors are those of the point that is to be on the path, from `from_s` on; root mean squares
/// unless they say otherwise. They are infinite where there is nothing to count, and where the vessel's state stopped being a
/// number: so a voyage that came to nothing is the worst of any, in each of its figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Metrics {
    /// Distance from the reference \[m\].
    pub rms_position: f64,
    /// Distance from the path \[m\].
    pub rms_cross_track: f64,
    /// Speed over ground less the one asked for \[m/s\].
    pub rms_speed: f64,
    /// Largest distance from the path \[m\].
    pub max_cross_track: f64,
    /// Time from which the reference was never again farther than the tolerance \[s\]; none if it was at the end.
    pub settled_after: Option<f64>,
    /// Share of the samples with a command at its limit.
    pub saturated: f64,
    /// Time for a command, with all that is learned before it.
    pub us_per_command: Times,
    /// Samples with each status, of those that came up.
    pub status: BTreeMap<&'static str, usize>,
    /// From when on errors count \[s\].
    pub from_s: f64,
    /// How long the voyage took \[s\].
    pub duration_s: f64,
    /// Whether the end of the path was reached; none for one without an end.
    pub arrived: Option<bool>,
    /// Whether the vessel's state stopped being a number.
    pub diverged: bool,
    /// Commands that were no number, beyond a limit, or changed faster than they may. There must be none.
    pub violations: usize,
    /// Samples farther from the reference than the tolerance without a status that says so. There must be none.
    pub unsaid: usize,
    /// Whether the vessel held its course: settled by the time from which errors count, with a sample at least that counts, and
    /// came to the end of the path.
    pub held: bool,
}

impl Metrics {
    /// Of a voyage; errors count from a time on.
    pub fn of(voyage: &Voyage, from_s: f64) -> Self {
        let all = &voyage.moments;
        let counted = || all.iter().filter(|m| m.t >= from_s - 1e-9);
        let rms = |of: fn(&Moment) -> f64| {
            let (sum, n) = counted().fold((0.0, 0.0), |(sum, n), m| (sum + of(m).powi(2), n + 1.0));
            or_worst(voyage, (sum / n).sqrt())
        };
        let most = counted().map(|m| or_worst(voyage, m.cross_track.abs())).reduce(f64::max);
        // What is no number is beyond, too.
        let beyond = |m: &Moment| m.distance.is_nan() || m.distance > voyage.tolerance;
        let settled_after = match all.iter().rposition(beyond) {
            None => all.first().map(|m| m.t),
            Some(last) => all.get(last + 1).map(|m| m.t),
        }
        .filter(|_| !voyage.diverged);
        let mut status = BTreeMap::new();
        for moment in all {
            *status.entry(moment.status.name()).or_insert(0) += 1;
        }
        let at_limit = |m: &&Moment| {
            (0..2).any(|i| !(voyage.limits[i].low < m.command[i] && m.command[i] < voyage.limits[i].high))
        };
        let held = settled_after.is_some_and(|settled| settled <= from_s + 1e-9)
            && counted().next().is_some()
            && voyage.arrived != Some(false);
        let last = all.last().map_or(0.0, |m| m.t + voyage.dt_s);
        Self {
            rms_position: rms(|m| m.distance),
            rms_cross_track: rms(|m| m.cross_track),
            rms_speed: rms(|m| m.speed_error),
            max_cross_track: most.unwrap_or(f64::INFINITY),
            settled_after,
            saturated: all.iter().filter(at_limit).count() as f64 / (all.len() as f64).max(1.0),
            us_per_command: times(all),
            status,
            from_s,
            duration_s: last,
            arrived: voyage.arrived,
            diverged: voyage.diverged,
            violations: violations(voyage),
            unsaid: all.iter().filter(|m| beyond(m) && m.status < Status::Lost).count(),
            held,
        }
    }
}

/// A figure of a voyage. A mean of nothing is NaN, whose sign, and so its place in an order, depends on the machine.
const fn or_worst(voyage: &Voyage, figure: f64) -> f64 {
    if voyage.diverged || figure.is_nan() { f64::INFINITY } else { figure }
}

fn times(all: &[Moment]) -> Times {
    let mut times: Vec<f64> = all.iter().map(|m| m.time_us).collect();
    times.sort_unstable_by(f64::total_cmp);
    let at = |index: usize| times.get(index).copied().unwrap_or(0.0);
    Times { median: at(times.len() / 2), max: at(times.len().saturating_sub(1)) }
}

/// Commands outside of limits and rate limits; before the first sample they are at rest.
fn violations(voyage: &Voyage) -> usize {
    let mut last = voyage.limits.map(|limits| 0.0_f64.clamp(limits.low, limits.high));
    let mut count = 0;
    for moment in &voyage.moments {
        for ((command, last), limits) in moment.command.iter().zip(&mut last).zip(&voyage.limits) {
            let inside = (limits.low..=limits.high).contains(command);
            // A sum that was rounded may be off by its last digit.
            let allowed = limits.rate * voyage.dt_s * (1.0 + 1e-9);
            if !(inside && (*command - *last).abs() <= allowed) {
                count += 1;
            }
            *last = *command;
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use hydroid_core::control::Limits;
    use hydroid_core::guidance::{Pose, Reference};
    use hydroid_core::vessel::State;

    use super::*;

    /// Half a metre off, for so many samples of 0.1 s.
    fn voyage(samples: usize) -> Voyage {
        let pose = Pose { position: [0.0; 2], course: 0.0, curvature: 0.0 };
        let reference = Reference::new(0.0, &pose, 1.0, 0.0);
        let moment = |k: usize| Moment {
            t: 0.1 * k as f64,
            state: State::REST,
            measured: [0.0; 4],
            reference,
            distance: 0.5,
            cross_track: -0.5,
            speed_error: 0.1,
            command: [0.0; 2],
            status: Status::Tracking,
            time_us: 1.0,
        };
        Voyage {
            moments: (0..samples).map(moment).collect(),
            dt_s: 0.1,
            limits: [Limits::between([-1.0, 1.0]); 2],
            tolerance: 2.0,
            arrived: None,
            diverged: false,
        }
    }

    fn figures(m: &Metrics) -> [f64; 4] {
        [m.rms_position, m.rms_cross_track, m.rms_speed, m.max_cross_track]
    }

    #[test]
    fn what_came_to_nothing_is_the_worst() {
        let sound = Metrics::of(&voyage(100), 5.0);
        assert!(sound.held && (sound.rms_position - 0.5).abs() < 1e-12 && sound.max_cross_track == 0.5);
        // It ended before errors count.
        let early = Metrics::of(&voyage(20), 5.0);
        assert!(!early.held && figures(&early) == [f64::INFINITY; 4], "{early:?}");
        let told = serde_json::to_value(&early).unwrap();
        assert!(told["rms_position"].is_null() && told["max_cross_track"].is_null());
        let lost = Metrics::of(&Voyage { diverged: true, ..voyage(100) }, 5.0);
        assert!(!lost.held && figures(&lost) == [f64::INFINITY; 4], "{lost:?}");
        let mut broken = voyage(100);
        broken.moments[80].cross_track = f64::NAN;
        let broken = Metrics::of(&broken, 5.0);
        assert_eq!((broken.rms_cross_track, broken.max_cross_track), (f64::INFINITY, f64::INFINITY));
    }
}
