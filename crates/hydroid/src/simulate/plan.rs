//! Lawn-mower and circle as path segments with speeds.

use std::f64::consts::{FRAC_PI_2, PI};

use rand::{Rng, RngExt as _};

use super::path::{Piece, Side};
use crate::excitation::{
    Circle, Envelope, ExcitationError, LawnMower, PropellerRudder, Purpose, Turn, stream,
};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stage {
    pub(super) piece: Piece,
    /// Speed \[m/s\].
    pub(super) speed: f64,
    /// Speed at the end \[m/s\], if lower.
    pub(super) end_speed: f64,
}

/// Largest random speed relative to the top speed; the margin is for the controller.
const FASTEST: f64 = 0.92;
/// Smallest random speed relative to the top speed; also the speed of a sharp turn.
const SLOWEST: f64 = 0.25;
/// Band around the transition without random speeds: the drag decreases there with speed, so equilibria are unstable.
const UNSTABLE: [f64; 2] = [0.9, 1.2];

pub(super) fn circle(plan: &Circle, envelope: &Envelope) -> Result<Vec<Stage>, ExcitationError> {
    let radius = positive("the radius", plan.radius.unwrap_or(2.0 * envelope.top_speed * envelope.time_s))?;
    let speed = reachable(plan.speed.unwrap_or(0.6 * envelope.top_speed), envelope)?;
    let piece = Piece::Arc { centre: [0.0, radius], radius, side: Side::Starboard, exit: None };
    Ok(vec![Stage { piece, speed, end_speed: speed }])
}

/// Stages of a lawn-mower: legs and connections.
pub(super) fn lawn_mower(
    plan: &LawnMower,
    vessel: &PropellerRudder,
    envelope: &Envelope,
    seed: u64,
    duration_s: f64,
) -> Result<Vec<Stage>, ExcitationError> {
    let leg =
        positive("the length of a leg", plan.leg.unwrap_or(10.0 * envelope.top_speed * envelope.time_s))?;
    // Upper bound of the number of legs.
    let shortest = 1e-6 * envelope.top_speed * duration_s;
    if leg < shortest {
        return Err(ExcitationError::LegTooShort { leg, shortest });
    }
    let spacing = positive("the distance between legs", plan.spacing.unwrap_or(0.25 * leg))?;
    let between = match plan.turn {
        Turn::Arc => None,
        Turn::Sharp { speed } => Some(reachable(speed.unwrap_or(SLOWEST * envelope.top_speed), envelope)?),
    };
    let speeds = if plan.speeds.is_empty() {
        drawn_speeds(vessel, envelope, leg, seed, duration_s)
    } else {
        plan.speeds.iter().map(|&speed| reachable(speed, envelope)).collect::<Result<_, _>>()?
    };

    let mut stages = Vec::with_capacity(2 * speeds.len());
    for (k, &speed) in speeds.iter().enumerate() {
        let east = k as f64 * spacing;
        let north_bound = k % 2 == 0;
        let (course, side) = if north_bound { (0.0, Side::Starboard) } else { (PI, Side::Port) };
        let (from, to) = if north_bound { (0.0, leg) } else { (leg, 0.0) };
        let line = Piece::Line { start: [from, east], course, length: leg };
        let last = k + 1 == speeds.len();
        let end_speed = if last { speed } else { between.map_or(speed, |slow| slow.min(speed)) };
        stages.push(Stage { piece: line, speed, end_speed });
        if last {
            break;
        }
        let (piece, speed) = match between {
            None => {
                let radius = 0.5 * spacing;
                let exit = Some(PI - course);
                (Piece::Arc { centre: [to, east + radius], radius, side, exit }, speed)
            }
            Some(slow) => {
                (Piece::Line { start: [to, east], course: FRAC_PI_2, length: spacing }, slow.min(speed))
            }
        };
        stages.push(Stage { piece, speed, end_speed: speed });
    }
    Ok(stages)
}

/// Random speeds for at least the duration, slow and fast in alternation.
fn drawn_speeds(
    vessel: &PropellerRudder,
    envelope: &Envelope,
    leg: f64,
    seed: u64,
    duration_s: f64,
) -> Vec<f64> {
    let (slowest, fastest) = (SLOWEST * envelope.top_speed, FASTEST * envelope.top_speed);
    // Without a reachable foil-borne mode, slow and fast are separated in the middle.
    let [slow_end, fast_start] = match &vessel.craft().flying {
        Some(flying)
            if slowest < UNSTABLE[0] * flying.transition_speed
                && UNSTABLE[1] * flying.transition_speed < fastest
                && takes_off(vessel, flying.transition_speed) =>
        {
            UNSTABLE.map(|factor| factor * flying.transition_speed)
        }
        _ => [0.5 * (slowest + fastest); 2],
    };
    let mut rng = stream(seed, Purpose::Legs);
    let speed = |fast: bool, rng: &mut dyn Rng| {
        if fast { rng.random_range(fast_start..=fastest) } else { rng.random_range(slowest..=slow_end) }
    };
    let mut speeds = vec![speed(false, &mut rng), speed(true, &mut rng)];
    let mut time_s: f64 = speeds.iter().map(|speed| leg / speed).sum();
    while time_s < duration_s {
        let fast = rng.random();
        let next = speed(fast, &mut rng);
        time_s += leg / next;
        speeds.push(next);
    }
    speeds
}

/// Whether full force overcomes the drag below the transition.
fn takes_off(vessel: &PropellerRudder, transition: f64) -> bool {
    let force = vessel.force_of(vessel.propeller().limits[1]);
    (0..=100).all(|k| vessel.dynamics().holding_force(transition * f64::from(k) / 100.0) < force)
}

fn positive(what: &'static str, value: f64) -> Result<f64, ExcitationError> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(ExcitationError::NotPositive { what, value })
    }
}

fn reachable(speed: f64, envelope: &Envelope) -> Result<f64, ExcitationError> {
    positive("the speed", speed)?;
    if speed <= envelope.top_speed {
        Ok(speed)
    } else {
        Err(ExcitationError::OutOfReach { speed, top: envelope.top_speed })
    }
}
