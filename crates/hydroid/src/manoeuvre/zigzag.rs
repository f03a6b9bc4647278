//! The zigzag trial.

use serde::Serialize;

use super::approach::Approach;
use super::track::{Instant, Run, Track};
use crate::plant::InputMap;

/// Results of a zigzag trial.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Zigzag {
    /// Steering of the first execute: 1 is hard to starboard.
    pub steering: f64,
    /// Change of heading at which the steering is reversed \[deg\].
    pub heading_deg: f64,
    /// Times of the executes since the first one \[s\].
    pub executes_s: Vec<f64>,
    /// Overshoot angles: changes of heading in the old direction after the second, third .. execute \[deg\].
    pub overshoots_deg: Vec<f64>,
    /// Times of the largest changes of heading \[s\].
    pub peaks_s: Vec<f64>,
    /// Initial turning ability: time from the first execute to the heading of the trial, or to the second execute in a log \[s\].
    pub initial_turning_time_s: Option<f64>,
    /// Length of the path in this time \[m\].
    pub initial_turning_distance_m: Option<f64>,
    /// Reach: time from the first execute until the heading is the initial one, after the second execute \[s\].
    pub reach_s: Option<f64>,
    /// Period: time from the first to the third crossing of the initial heading after the first execute \[s\].
    pub period_s: Option<f64>,
}

/// Number of executes of a simulated trial: it ends after the third overshoot.
const EXECUTES: usize = 5;

/// Simulates a zigzag trial: the steering `s` (positive: first to starboard) is reversed each time the heading has changed by
/// `heading` \[rad\] from the initial one. A trial ends with the fifth execute, or after `longest_s`.
pub fn zigzag(approach: &Approach, map: &InputMap, s: f64, heading: f64, longest_s: f64) -> (Zigzag, Track) {
    let mut run = Run::new(approach, map, s, longest_s);
    let mut executes = vec![0];
    let mut steering = s;
    while executes.len() < EXECUTES && run.advance() {
        if run.turned(steering.signum()) >= heading {
            executes.push(run.track.len() - 1);
            steering = -steering;
            run.steer(steering);
        }
    }
    let track = run.track;
    let mut result = Zigzag::of(&track, &executes, s, heading);
    // The second execute is the sample after the heading of the trial.
    if let Some(at) = track.crossing(0, heading, |k| track.turned(k, s.signum())) {
        result.initial_turning_time_s = Some(track.time(at));
        result.initial_turning_distance_m = Some(track.path_length(0, at));
    }
    (result, track)
}

impl Zigzag {
    /// The results of a track with executes at given samples, the first of which has the steering `s`; the heading of the
    /// trial \[rad\] is only reported.
    pub fn of(track: &Track, executes: &[usize], s: f64, heading: f64) -> Self {
        let first = s.signum();
        let time = |sample: usize| (sample - executes[0]) as f64 * track.dt;
        let overshoot = |(i, pair): (usize, &[usize])| {
            let side = if i % 2 == 0 { first } else { -first };
            let at = pair[0];
            let until = pair.get(1).copied().unwrap_or(track.len() - 1);
            let (peak, instant) = track.peak(at, side)?;
            (instant.sample <= until)
                .then(|| ((peak - track.turned(at, side)).to_degrees(), track.time(instant) - time(0)))
        };
        let later: Vec<&[usize]> =
            (1..executes.len()).map(|i| &executes[i..executes.len().min(i + 2)]).collect();
        // Crossings of the initial heading, in turn.
        let mut crossings = Vec::new();
        let mut from = executes.get(1).copied();
        let mut side = -first;
        while let Some(at) = from.and_then(|from| track.crossing(from, 0.0, |k| track.turned(k, side))) {
            crossings.push(track.time(at) - time(0));
            side = -side;
            from = executes.get(crossings.len() + 1).copied();
        }
        let (overshoots_deg, peaks_s) = later.into_iter().enumerate().map_while(overshoot).unzip();
        Self {
            steering: s,
            heading_deg: heading.to_degrees(),
            executes_s: executes.iter().map(|&sample| time(sample)).collect(),
            overshoots_deg,
            peaks_s,
            initial_turning_time_s: executes.get(1).map(|&second| time(second)),
            initial_turning_distance_m: executes
                .get(1)
                .map(|&sample| track.path_length(executes[0], Instant { sample, share: 0.0 })),
            reach_s: crossings.first().copied(),
            period_s: crossings.get(1).copied(),
        }
    }
}
