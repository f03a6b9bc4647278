//! The model for trials and control: the best one that stays where it can be believed when it is steered.

use super::Candidate;
use super::evaluation::select_among;
use crate::log::Trajectory;
use crate::manoeuvre::{Approach, Options, Track, not_valid, turning_circle, zigzag};
use crate::model::{MOTION, Model};
use crate::plant::{InputMap, PlantError, Simulation};

/// Change of heading at which the zigzag is reversed \[rad\]: 20 degrees.
const REVERSED: f64 = 0.35;

/// Why a vessel has no trials ahead.
const ASTERN: &str = "in the training runs the vessel moves astern for most of the time: check the signs of u and of the heading";

/// Longest trial \[s\].
const LONGEST_S: f64 = 3_600.0;

/// The model for trials and control.
///
/// From the speed that a quarter of the training samples exceed, each model does a turning circle to both sides and a zigzag with the
/// largest steering of the training runs. One that cannot hold a straight course, or leaves the range in which it can be believed, is
/// not for trials and control, however small its errors of prediction.
#[derive(Clone, Debug, PartialEq)]
pub struct ForTrials {
    /// Index of the best model among those whose trials are valid; none if there is none.
    pub best: Option<usize>,
    /// For each model, why its trials are not valid.
    pub not_valid: Vec<Option<String>>,
}

impl ForTrials {
    /// `None` where no model has a motion that inputs steer. The verdicts become part of the models.
    pub(super) fn of(candidates: &mut [Candidate], train: &[&Trajectory]) -> Option<Self> {
        let speed_m_s = usual_speed(train)?;
        let maps: Vec<_> = candidates.iter().map(|candidate| InputMap::find(&candidate.model)).collect();
        if maps.iter().all(Result::is_err) {
            return None;
        }
        let why = |(candidate, map): (&Candidate, Result<InputMap, PlantError>)| match map {
            _ if speed_m_s <= 0.0 => Some(ASTERN.to_owned()),
            Ok(map) => why_not(&candidate.model, &map, speed_m_s),
            Err(error) => Some(error.to_string()),
        };
        let not_valid: Vec<Option<String>> = candidates.iter().zip(maps).map(why).collect();
        let best = select_among(candidates, |i| not_valid[i].is_none());
        for (candidate, reason) in candidates.iter_mut().zip(&not_valid) {
            candidate.model.description.provenance.not_for_trials = reason.is_some();
        }
        Some(Self { best, not_valid })
    }
}

/// The speed that a quarter of the samples exceed.
fn usual_speed(train: &[&Trajectory]) -> Option<f64> {
    let of = |run: &&Trajectory| run.outputs.channels().iter().position(|channel| channel.name == MOTION[0]);
    let place = train.first().and_then(of)?;
    let mut speeds: Vec<f64> =
        train.iter().flat_map(|run| run.outputs.column(place)).filter(|u| u.is_finite()).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.get(3 * speeds.len() / 4).copied()
}

/// Why the trials of a model are not valid.
fn why_not(model: &Model, map: &InputMap, speed_m_s: f64) -> Option<String> {
    if let Some(reason) = not_valid(model) {
        return Some(reason);
    }
    let speed_m_s = map.no_propulsion().is_none().then_some(speed_m_s);
    let options = Options { speed_m_s, ..Options::default() };
    let simulation = match Simulation::new(model) {
        Ok(simulation) => simulation,
        Err(error) => return Some(error.to_string()),
    };
    let approach = match Approach::new(model, map, simulation, &options) {
        Ok(approach) => approach,
        Err(error) => return Some(error.to_string()),
    };
    let left = |what: &str, track: &Track| {
        let reason = track.not_valid.as_ref()?;
        Some(format!("{what} from {:.1} s on: {reason}", track.time_s(track.len()).max(0.0)))
    };
    let sides = [(1.0, "in a turn to starboard"), (-1.0, "in a turn to port")];
    sides
        .iter()
        .find_map(|(side, what)| {
            let steering = side * map.seen_over(model, *side);
            left(what, &turning_circle(&approach, map, steering, LONGEST_S).1)
        })
        .or_else(|| {
            let steering = map.seen_over(model, 1.0).min(map.seen_over(model, -1.0));
            left("in a zigzag", &zigzag(&approach, map, steering, REVERSED, LONGEST_S).1)
        })
}
