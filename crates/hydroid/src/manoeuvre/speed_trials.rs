//! Acceleration and stopping.

use serde::Serialize;

use super::approach::Approach;
use super::track::{Run, Track};
use crate::plant::InputMap;

/// Results of an acceleration from rest.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Acceleration {
    /// Steady speed of the approach \[m/s\].
    pub speed_m_s: f64,
    /// Time to 63.2 % of it \[s\].
    pub time_63_s: Option<f64>,
    /// Time to 95 % of it \[s\].
    pub time_95_s: Option<f64>,
    /// Distance sailed up to 95 % \[m\].
    pub distance_95_m: Option<f64>,
}

/// Results of a stopping trial.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stopping {
    /// Speed at the order \[m/s\].
    pub approach_speed_m_s: f64,
    /// Propulsion: -1 is full astern, 0 none.
    pub propulsion: f64,
    /// Speed ahead at which the trial ends \[m/s\]: 0 under astern power, 20 % of the approach without.
    pub end_speed_m_s: f64,
    /// Time to the end \[s\]; `None` if it is not reached.
    pub time_s: Option<f64>,
    /// Track reach: length of the path \[m\].
    pub track_reach_m: Option<f64>,
    /// Head reach: distance along the initial course \[m\].
    pub head_reach_m: Option<f64>,
    /// Lateral deviation, positive to starboard \[m\].
    pub lateral_deviation_m: Option<f64>,
    /// Change of the heading, positive to starboard \[deg\].
    pub heading_change_deg: Option<f64>,
}

/// Speed at which a trial without astern power ends, relative to the approach.
const COASTED: f64 = 0.2;

/// Simulates an acceleration from rest with the propulsion and the steering of the approach.
pub fn acceleration(approach: &Approach, map: &InputMap, longest_s: f64) -> (Acceleration, Track) {
    let mut simulation = approach.simulation.clone();
    let mut outputs = simulation.outputs().to_vec();
    simulation.at_rest(&mut outputs);
    simulation.start([0.0; 3], &outputs, &map.command(0.0, approach.steering));
    let mut run = Run::of(simulation, map, approach.propulsion, approach.steering, longest_s);
    let end = 0.95 * approach.speed_m_s;
    while run.track.nu[run.track.len() - 1][0] < end && run.advance() {}
    let track = run.track;
    let reach = |share: f64| track.crossing(0, share * approach.speed_m_s, |k| track.nu[k][0]);
    let whole = reach(0.95);
    let result = Acceleration {
        speed_m_s: approach.speed_m_s,
        time_63_s: reach(0.632).map(|at| track.time(at)),
        time_95_s: whole.map(|at| track.time(at)),
        distance_95_m: whole.map(|at| track.path_length(0, at)),
    };
    (result, track)
}

/// Simulates a stopping trial from the approach: full astern if the propulsion can be reversed, otherwise none; the steering
/// stays.
pub fn stopping(approach: &Approach, map: &InputMap, longest_s: f64) -> (Stopping, Track) {
    let propulsion = -map.astern();
    let end = if propulsion < 0.0 { 0.0 } else { COASTED * approach.speed_m_s };
    let mut run = Run::of(approach.simulation.clone(), map, propulsion, approach.steering, longest_s);
    while run.track.nu[run.track.len() - 1][0] > end && run.advance() {}
    let track = run.track;
    let last = track.len() - 1;
    let at = track.crossing(0, -end, |k| -track.nu[k][0]);
    let offset = at.map(|at| track.offset(at));
    let result = Stopping {
        approach_speed_m_s: approach.speed_m_s,
        propulsion,
        end_speed_m_s: end,
        time_s: at.map(|at| track.time(at)),
        track_reach_m: at.map(|at| track.path_length(0, at)),
        head_reach_m: offset.map(|offset| offset[0]),
        lateral_deviation_m: offset.map(|offset| offset[1]),
        heading_change_deg: at.map(|_| track.turned(last, 1.0).to_degrees()),
    };
    (result, track)
}
