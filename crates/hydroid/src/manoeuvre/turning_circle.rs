//! The turning circle.

use std::f64::consts::{FRAC_PI_2, PI};

use serde::Serialize;

use super::approach::Approach;
use super::track::{Run, Track};
use crate::plant::InputMap;

/// Results of a turning circle, positive for either side. Values that the turn does not reach are `None`: the heading
/// changed by less than 90, 180 or 360 degrees.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TurningCircle {
    /// Steering: 1 is hard to starboard.
    pub steering: f64,
    /// Speed over ground at the execute \[m/s\].
    pub approach_speed_m_s: f64,
    /// Distance along the initial course to a change of heading by 90 degrees \[m\].
    pub advance_m: Option<f64>,
    /// Distance across the initial course to a change of heading by 90 degrees \[m\].
    pub transfer_m: Option<f64>,
    /// Distance across the initial course to a change of heading by 180 degrees \[m\].
    pub tactical_diameter_m: Option<f64>,
    /// Time to a change of heading by 90 degrees \[s\].
    pub time_90_s: Option<f64>,
    /// Time to a change of heading by 180 degrees \[s\].
    pub time_180_s: Option<f64>,
    /// The steady turn: means over the last half turn.
    pub steady: Option<SteadyTurn>,
    /// Change of the heading at the end of the trial \[deg\].
    pub turned_deg: f64,
}

/// A steady turn, through the water: in a [current](Track::current), the motion over ground depends on the heading.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SteadyTurn {
    /// Radius of the path, speed over yaw rate \[m\].
    pub radius_m: f64,
    /// Yaw rate \[deg/s\], positive to starboard.
    pub yaw_rate_deg_s: f64,
    /// Speed \[m/s\].
    pub speed_m_s: f64,
    /// Drift angle `-atan2(v, u)` \[deg\]: positive if the bow points to starboard of the path.
    pub drift_deg: f64,
    /// Loss of speed relative to the approach.
    pub speed_loss: f64,
}

/// Change of the heading at which a simulated circle ends \[rad\].
const END: f64 = 3.0 * PI;

/// Simulates a turning circle with the steering `s` (1 hard to starboard, -1 hard to port), until the heading has changed by
/// 540 degrees or `longest_s` have passed.
pub fn turning_circle(approach: &Approach, map: &InputMap, s: f64, longest_s: f64) -> (TurningCircle, Track) {
    let mut run = Run::new(approach, map, s, longest_s);
    turn(&mut run, s.signum());
    (TurningCircle::of(&run.track, s), run.track)
}

/// Turns until the heading has changed by 540 degrees.
pub(super) fn turn(run: &mut Run<'_>, side: f64) {
    while run.turned(side) < END && run.advance() {}
}

impl TurningCircle {
    /// The results of a turn from the execute of a track to its end; `s` is its steering.
    pub fn of(track: &Track, s: f64) -> Self {
        let side = s.signum();
        let heading = |k: usize| track.turned(k, side);
        let reach = |angle: f64| track.crossing(track.execute, angle, heading);
        let (quarter, half) = (reach(FRAC_PI_2), reach(PI));
        let aside = |at| side * track.offset(at)[1];
        let end = track.len() - 1;
        let mut circle = Self {
            steering: s,
            approach_speed_m_s: track.approach()[0].hypot(track.approach()[1]),
            advance_m: quarter.map(|at| track.offset(at)[0]),
            transfer_m: quarter.map(aside),
            tactical_diameter_m: half.map(aside),
            time_90_s: quarter.map(|at| track.time(at)),
            time_180_s: half.map(|at| track.time(at)),
            steady: None,
            turned_deg: heading(end).to_degrees(),
        };
        let whole = heading(end) >= 2.0 * PI;
        let from = whole.then(|| reach(heading(end) - PI)).flatten();
        if let Some(from) = from {
            let samples = from.sample..=end;
            let count = samples.clone().count() as f64;
            let mean = |value: &dyn Fn(usize) -> f64| samples.clone().map(value).sum::<f64>() / count;
            let size = |[u, v]: [f64; 2]| u.hypot(v);
            let speed = mean(&|k| size(track.through_water(k)));
            let rate = mean(&|k| track.nu[k][2]);
            circle.steady = Some(SteadyTurn {
                radius_m: speed / rate.abs(),
                yaw_rate_deg_s: rate.to_degrees(),
                speed_m_s: speed,
                drift_deg: -mean(&|k| {
                    let [u, v] = track.through_water(k);
                    v.atan2(u)
                })
                .to_degrees(),
                speed_loss: 1.0 - speed / size(track.relative(track.approach(), track.execute)),
            });
        }
        circle
    }
}
