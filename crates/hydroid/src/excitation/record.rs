//! Both commands of a record.

use hydroid_core::craft::CommandInput;
use hydroid_core::vessel::Command;

use super::compose::Composer;
use super::envelope::Envelope;
use super::error::ExcitationError;
use super::kind::LowSpeed;
use super::streams::{Purpose, stream};
use super::vessel::PropellerRudder;

/// Time scale of the rudder relative to the propeller.
const RUDDER_PACE: f64 = 0.8;

/// `n` commands at step `dt` \[s\] over the full range of both channels, at the time scale of the vessel. Seven of
/// eight propeller commands are forward: a hydrofoil flies about half of the time and passes its transition about every
/// 20 s.
///
/// # Errors
/// As [`Envelope::new`].
pub fn mixed(
    vessel: &PropellerRudder,
    seed: u64,
    dt: f64,
    n: usize,
) -> Result<Vec<Command>, ExcitationError> {
    let envelope = Envelope::new(vessel)?;
    Ok(compose(vessel, vessel.propeller().limits, envelope.time_s, seed, dt, n))
}

/// `n` commands at step `dt` \[s\] that keep the vessel below [`LowSpeed::ceiling`]: the propeller within
/// [`low_speed_range`], the rudder over its full range.
///
/// # Errors
/// As [`low_speed_range`].
pub fn low_speed(
    vessel: &PropellerRudder,
    low: LowSpeed,
    seed: u64,
    dt: f64,
    n: usize,
) -> Result<Vec<Command>, ExcitationError> {
    let envelope = Envelope::new(vessel)?;
    let range = low_speed_range(vessel, low)?;
    Ok(compose(vessel, range, envelope.time_s, seed, dt, n))
}

/// Propeller commands that keep the vessel below the ceiling, and below the transition speed of a hydrofoil. The upper
/// limit balances the drag of the displacement mode at 82 % of that speed, the lower limit is half of it astern, both
/// within the limits of the vessel: -60 to 119 N for the reference hydrofoil.
///
/// # Errors
/// [`ExcitationError::NotPositive`] for the ceiling, [`ExcitationError::NoDrag`].
pub fn low_speed_range(
    vessel: &PropellerRudder,
    LowSpeed { ceiling }: LowSpeed,
) -> Result<[f64; 2], ExcitationError> {
    if !(ceiling.is_finite() && ceiling > 0.0) {
        return Err(ExcitationError::NotPositive { what: "the ceiling of the speed", value: ceiling });
    }
    let ceiling = low_speed_ceiling(vessel, ceiling);
    let [drag, ..] = vessel.dynamics().damping([0.82 * ceiling, 0.0, 0.0]);
    if drag <= 0.0 {
        return Err(ExcitationError::NoDrag);
    }
    let [low, high] = vessel.propeller().limits;
    let [astern, ahead] = [-0.5 * drag, drag].map(|force| vessel.command_of(force));
    // If the limits are on one side of the range, the nearest limit is used.
    Ok([low.max(astern).min(high), high.min(ahead).max(low)])
}

/// The ceiling, limited by the transition speed.
pub(crate) fn low_speed_ceiling(vessel: &PropellerRudder, ceiling: f64) -> f64 {
    vessel.craft().flying.map_or(ceiling, |flying| flying.transition_speed.min(ceiling))
}

fn compose(
    vessel: &PropellerRudder,
    propeller: [f64; 2],
    pace_s: f64,
    seed: u64,
    dt: f64,
    n: usize,
) -> Vec<Command> {
    let duration_s = dt * n as f64;
    let pace_s = pace_s.max(2.0 * dt);
    // Signals are drawn about the neutral values: their signs are those of the effects.
    let signal = |input: &CommandInput, [low, high]: [f64; 2], forward, pace_s, purpose| {
        let neutral = input.neutral;
        let [low, high] = [low - neutral, high - neutral];
        Composer { low, high, forward, pace_s }
            .compose(duration_s, &mut stream(seed, purpose))
            .sample(dt, n)
            .into_iter()
            .map(move |value| value + neutral)
    };
    let (pushes, turns) = (vessel.propeller(), vessel.rudder());
    let pp = signal(pushes, propeller, 0.88, pace_s, Purpose::Propeller);
    let rd = signal(turns, turns.limits, 0.5, RUDDER_PACE * pace_s, Purpose::Rudder);
    pp.zip(rd)
        .map(|(pp, rd)| Command { pp: pp.clamp(propeller[0], propeller[1]), rd: turns.clamp(rd) })
        .collect()
}

/// `n` commands at step `dt` \[s\] from rows of time \[s\] and command, each held until the next.
///
/// # Errors
/// If there are no rows, a number is not finite, time does not increase, or a command is beyond the limits of the
/// vessel (an excess of a millionth of the range is clipped as rounding). Rows are counted from 1.
pub fn held(
    rows: &[(f64, Command)],
    vessel: &PropellerRudder,
    dt: f64,
    n: usize,
) -> Result<Vec<Command>, ExcitationError> {
    let Some(&(start, first)) = rows.first() else { return Err(ExcitationError::NoRows) };
    let channels = [vessel.propeller(), vessel.rudder()];
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
            // Written logs round commands at a limit.
            let rounding = 1e-6 * (high - low);
            if !(low - rounding..=high + rounding).contains(&value) {
                return Err(ExcitationError::OutsideLimits { row, name: name(), value, low, high });
            }
        }
    }

    let mut later = rows[1..].iter().peekable();
    let mut command = first;
    let commands = (0..n).map(|k| {
        // A row at the time of a sample, up to rounding, acts from that sample on.
        let t = start + k as f64 * dt + 1e-6 * dt;
        while let Some(&&(_, next)) = later.peek().filter(|(at, _)| *at <= t) {
            command = next;
            later.next();
        }
        Command { pp: channels[0].clamp(command.pp), rd: channels[1].clamp(command.rd) }
    });
    Ok(commands.collect())
}
