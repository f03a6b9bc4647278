//! What is known of the sensors of a vessel from earlier recordings.

use std::f64::consts::PI;

use hydroid_core::navigation::{Mounting, Noise, Prior, State};

use crate::log::{KnownSensors, LogError, Sensors};
use crate::navigate::{self, CALIBRATED, CONSTANTS, Calibration, Kind, Sensor, Smoothed, Statistics};

/// A sensor of the runs.
pub(super) struct Placed {
    pub(super) sensor: Sensor,
    /// Kind of its position fixes.
    pub(super) quality: Option<f64>,
}

/// The sensors of a vessel. Their first standard deviations are those that are known, else usual ones.
pub(super) fn placed(sensors: &Sensors, qualities: &[f64]) -> Vec<Placed> {
    let known = sensors.known.as_ref();
    let place = |m: [f64; 3]| Mounting { forward: m[0], starboard: m[1] };
    let (antenna, imu) = (place(sensors.antenna_m), place(sensors.imu_m));
    let of =
        |kind, mounting, deviation| Placed { sensor: Sensor { kind, mounting, deviation }, quality: None };
    let fixes = known.map_or(&[][..], |known| &known.position);
    // Fixes of a kind that has not been seen are taken as the worst.
    let worst = fixes.iter().map(|(_, deviation)| *deviation).reduce(f64::max).unwrap_or(0.3);
    let position = |quality: Option<f64>| {
        let deviation =
            fixes.iter().find(|(of, _)| *of == quality).map_or(worst, |(_, deviation)| *deviation);
        Placed { quality, ..of(Kind::Position, antenna, [deviation; 2]) }
    };
    let one = |of: fn(&KnownSensors) -> Option<f64>, usual: f64| known.and_then(of).unwrap_or(usual);
    let mut all: Vec<Placed> = if qualities.is_empty() {
        vec![position(None)]
    } else {
        qualities.iter().map(|quality| position(Some(*quality))).collect()
    };
    all.push(of(Kind::Velocity, antenna, [one(|known| known.velocity, 0.1); 2]));
    let heading = one(|known| known.heading, 0.5 * PI / 180.0);
    all.push(of(Kind::Heading, Mounting::default(), [heading, 0.0]));
    all.push(of(Kind::YawRate, Mounting::default(), [one(|known| known.yaw_rate, 5e-3), 0.0]));
    all.push(of(Kind::SpecificForce, imu, known.and_then(|known| known.acceleration).unwrap_or([0.1; 2])));
    all
}

/// What the recordings tell of the sensors: the statistics, and the constants at the end of the last run.
pub(super) fn of(placed: &[Placed], statistics: &Statistics, end: &Smoothed) -> KnownSensors {
    let of_kind = |kind: Kind| {
        let all = placed.iter().zip(&statistics.deviations);
        all.filter(move |(placed, _)| placed.sensor.kind == kind)
            .map(|(placed, deviation)| (placed.quality, *deviation))
    };
    let one = |kind: Kind| of_kind(kind).next().map(|(_, deviation)| deviation[0]);
    KnownSensors {
        noise: statistics.noise,
        position: of_kind(Kind::Position).map(|(quality, deviation)| (quality, deviation[0])).collect(),
        velocity: one(Kind::Velocity),
        heading: one(Kind::Heading),
        yaw_rate: one(Kind::YawRate),
        acceleration: of_kind(Kind::SpecificForce).next().map(|(_, deviation)| deviation),
        constants: CONSTANTS.iter().map(|state| end.end[*state as usize]).collect(),
    }
}

/// Refuses numbers that no estimate has, as in a model file that was changed by hand.
pub(super) fn check(known: &KnownSensors, path: &str) -> Result<(), LogError> {
    let fixes = known.position.iter().map(|(_, deviation)| *deviation);
    let single = [known.velocity, known.heading, known.yaw_rate].into_iter().flatten();
    let deviations = fixes.chain(single).chain(known.acceleration.into_iter().flatten());
    let statistics = known.noise.numbers().into_iter().chain(deviations);
    let mut constants = known.constants.iter();
    let sound = statistics.into_iter().all(|x| x.is_finite() && x > 0.0)
        && constants
            .all(|(value, deviation)| value.is_finite() && deviation.is_finite() && *deviation >= 0.0)
        && known.constants.len() == CONSTANTS.len();
    if sound {
        return Ok(());
    }
    Err(LogError::Unusable {
        path: path.to_owned(),
        reason:
            "what is stated to be known of its sensors has numbers that are not positive, or not all of them"
                .to_owned(),
        remedy: "leave `known` of the section [log.sensors] out: it is estimated from the recordings"
            .to_owned(),
    })
}

/// The prior of a run, with the constants of earlier ones. Those of the sensors are fixed.
pub(super) fn prior(known: &KnownSensors, prior: &Prior) -> Prior {
    let constants = CONSTANTS.iter().zip(&known.constants);
    constants.fold(prior.clone(), |prior, (&state, &(value, deviation))| {
        let deviation = if CALIBRATED.contains(&state) { 0.0 } else { deviation };
        prior.with(state, value, deviation).linearized_at(state, value)
    })
}

/// What is known of the constants of some sensors.
pub(super) fn calibrations(known: &KnownSensors, sensors: &[Sensor]) -> Vec<Calibration> {
    let of = |state: State| {
        let at = CONSTANTS.iter().position(|of| *of == state)?;
        let whole = *known.constants.get(at)?;
        Some(Calibration { state, whole, halves: [whole; 2], is_determined: whole.0 != 0.0 })
    };
    navigate::calibrated(sensors).filter_map(of).collect()
}

/// Statistics with the standard deviations of [`placed`] sensors, and without those of the motion.
pub(super) fn usual(sensors: &[Sensor]) -> Statistics {
    let deviations = sensors.iter().map(|sensor| sensor.deviation).collect();
    Statistics { noise: Noise::default(), deviations }
}
