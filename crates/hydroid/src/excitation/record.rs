//! Both commands over a whole record.

use hydroid_core::vessel::{Command, Plant, VesselParams};

use super::compose::Composer;
use super::envelope::Envelope;
use super::error::ExcitationError;
use super::kind::LowSpeed;
use super::streams::{Purpose, stream};

/// The rudder turns a vessel quicker than the propeller moves it.
const RUDDER_PACE: f64 = 0.8;

/// `n` commands at step `dt` \[s\] over the full range of both channels, at the vessel's own pace.
///
/// The propeller pushes forward seven times in eight, so that a hydrofoil spends about as long flying as not,
/// and goes through the transition every 20 s or so.
///
/// # Errors
/// What [`Envelope::new`] finds.
pub fn mixed(
    params: &VesselParams,
    plant: &Plant,
    seed: u64,
    dt: f64,
    n: usize,
) -> Result<Vec<Command>, ExcitationError> {
    let envelope = Envelope::new(params, plant)?;
    Ok(compose(params, params.commands.propeller.limits, envelope.time_s, seed, dt, n))
}

/// `n` commands at step `dt` \[s\] that keep the vessel below [`LowSpeed::ceiling`]: the propeller within
/// [`low_speed_range`], the rudder over its full range.
///
/// # Errors
/// What [`low_speed_range`] finds.
pub fn low_speed(
    params: &VesselParams,
    plant: &Plant,
    low: LowSpeed,
    seed: u64,
    dt: f64,
    n: usize,
) -> Result<Vec<Command>, ExcitationError> {
    let envelope = Envelope::new(params, plant)?;
    let range = low_speed_range(params, plant, low)?;
    Ok(compose(params, range, envelope.time_s, seed, dt, n))
}

/// Propeller commands that keep the vessel below the ceiling, and below the transition speed of a
/// hydrofoil.
///
/// Forward the force that the drag of the normal mode balances at 82 % of that speed, astern half of it,
/// both within the vessel's limits: -60 to 119 N for the reference hydrofoil (its limits for low-speed
/// training are -60 to 120 N).
///
/// # Errors
/// [`ExcitationError::NotPositive`] for the ceiling, [`ExcitationError::NoDrag`].
pub fn low_speed_range(
    params: &VesselParams,
    plant: &Plant,
    LowSpeed { ceiling }: LowSpeed,
) -> Result<[f64; 2], ExcitationError> {
    if !(ceiling.is_finite() && ceiling > 0.0) {
        return Err(ExcitationError::NotPositive { what: "the ceiling of the speed", value: ceiling });
    }
    let ceiling = low_speed_ceiling(params, ceiling);
    let [drag, ..] = plant.drag([0.82 * ceiling, 0.0, 0.0]);
    if drag <= 0.0 {
        return Err(ExcitationError::NoDrag);
    }
    let [low, high] = params.commands.propeller.limits;
    // Where the limits lie wholly on one side of what is wanted, the nearest limit is all that is left.
    Ok([low.max(-0.5 * drag).min(high), high.min(drag).max(low)])
}

/// The ceiling, or the transition speed where that is lower.
pub(crate) fn low_speed_ceiling(params: &VesselParams, ceiling: f64) -> f64 {
    params.flying.map_or(ceiling, |flying| flying.transition_speed.min(ceiling))
}

fn compose(
    params: &VesselParams,
    propeller: [f64; 2],
    pace_s: f64,
    seed: u64,
    dt: f64,
    n: usize,
) -> Vec<Command> {
    let duration_s = dt * n as f64;
    // A vessel quicker than the samples would be asked for more than can be commanded.
    let pace_s = pace_s.max(2.0 * dt);
    let [low, high] = propeller;
    let pp = Composer { low, high, forward: 0.88, pace_s }
        .compose(duration_s, &mut stream(seed, Purpose::Propeller))
        .sample(dt, n);
    let [low, high] = params.commands.rudder.limits;
    let rd = Composer { low, high, forward: 0.5, pace_s: RUDDER_PACE * pace_s }
        .compose(duration_s, &mut stream(seed, Purpose::Rudder))
        .sample(dt, n);
    pp.into_iter()
        .zip(rd)
        .map(|(pp, rd)| Command {
            pp: pp.clamp(propeller[0], propeller[1]),
            rd: params.commands.rudder.clamp(rd),
        })
        .collect()
}

/// `n` commands at step `dt` \[s\] from rows of time \[s\] and command, each held until the next (the last
/// one to the end). Time counts from the first row.
///
/// # Errors
/// No rows, a number that is not finite, time that does not increase, a command beyond the vessel's limits;
/// rows are counted from 1. A millionth of the range beyond a limit passes for rounding and is clipped.
pub fn held(
    rows: &[(f64, Command)],
    params: &VesselParams,
    dt: f64,
    n: usize,
) -> Result<Vec<Command>, ExcitationError> {
    let Some(&(start, first)) = rows.first() else { return Err(ExcitationError::NoRows) };
    let channels = [&params.commands.propeller, &params.commands.rudder];
    for (k, &(t, command)) in rows.iter().enumerate() {
        let row = k + 1;
        if !t.is_finite() {
            return Err(ExcitationError::NotFinite { row, what: "time".into() });
        }
        if k > 0 && t <= rows[k - 1].0 {
            return Err(ExcitationError::TimeNotIncreasing { row, time: t, before: rows[k - 1].0 });
        }
        for (channel, value) in channels.into_iter().zip([command.pp, command.rd]) {
            let [low, high] = channel.limits;
            let name = || channel.name.clone();
            if !value.is_finite() {
                return Err(ExcitationError::NotFinite { row, what: name() });
            }
            // A log written with nine digits may round a command at its limit to beyond it.
            let rounding = 1e-6 * (high - low);
            if !(low - rounding..=high + rounding).contains(&value) {
                return Err(ExcitationError::OutsideLimits { row, name: name(), value, low, high });
            }
        }
    }

    let mut later = rows[1..].iter().peekable();
    let mut command = first;
    let commands = (0..n).map(|k| {
        // A row at a sample's time, but for rounding, acts from that sample on.
        let t = start + k as f64 * dt + 1e-6 * dt;
        while let Some(&&(_, next)) = later.peek().filter(|(at, _)| *at <= t) {
            command = next;
            later.next();
        }
        Command { pp: channels[0].clamp(command.pp), rd: channels[1].clamp(command.rd) }
    });
    Ok(commands.collect())
}
