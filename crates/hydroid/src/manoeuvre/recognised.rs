//! Trials in logs, recognised by commands and heading.

use std::f64::consts::FRAC_PI_2;

use serde::Serialize;

use super::measured::{filled, heading, line, output};
use crate::boat::{Boat, Role};
use crate::log::{Channel, Trajectory, median, shortest_change};
use crate::model::MOTION;

/// A trial in a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Recognised {
    /// Kind of the trial.
    pub kind: RecognisedKind,
    /// Samples at which the commands change, the first of which begins the trial.
    pub executes: Vec<usize>,
    /// Last sample.
    pub end: usize,
    /// Change of the heading in a turn, or at which a zigzag is reversed (the mean) \[deg\]; positive if the vessel turns to
    /// starboard first.
    pub heading_deg: f64,
    /// Changes of the heading at the reversals of a zigzag \[deg\], positive to starboard.
    pub reversals_deg: Vec<f64>,
    /// The first commands of the inputs that turn the vessel.
    pub turned_by: Vec<Ordered>,
    /// Size of the yaw rate before the trial, relative to the mean one in its turn or first leg.
    pub turning_before: f64,
}

/// A command of an input.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ordered {
    /// The input.
    pub input: Channel,
    /// Its value, in the unit of the input.
    pub value: f64,
}

/// Kind of a recognised trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RecognisedKind {
    /// A turn by at least 90 degrees under constant commands.
    TurningCircle,
    /// Commands that alternate between two values, and are reversed at about the same change of heading to either side.
    Zigzag,
}

impl RecognisedKind {
    /// Its name, as in JSON.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::TurningCircle => "turning-circle",
            Self::Zigzag => "zigzag",
        }
    }
}

impl Recognised {
    /// Why the vessel is not known to sail straight before the trial.
    pub(super) fn straight_doubt(&self) -> Option<String> {
        (self.turning_before > STRAIGHT).then(|| {
            format!(
                "the course of the approach is not straight: the vessel turns before the order at {:.0} % of the mean yaw rate in the first leg",
                100.0 * self.turning_before
            )
        })
    }

    /// Kind and size of the trial, and its commands, in words: `zigzag of 20 deg, first to port by delta -20 deg`.
    pub fn title(&self) -> String {
        let side = if self.heading_deg > 0.0 { "starboard" } else { "port" };
        let size = self.heading_deg.abs();
        let commands = self.turned_by.iter().map(|Ordered { input, value }| {
            let (value, unit) = match input.unit.as_str() {
                "rad" => (value.to_degrees(), "deg"),
                unit => (*value, unit),
            };
            format!("{} {} {unit}", input.name, (10.0 * value).round() / 10.0).trim_end().to_owned()
        });
        let by = commands.collect::<Vec<_>>().join(", ");
        match self.kind {
            RecognisedKind::TurningCircle => format!("turn by {size:.0} deg to {side} by {by}"),
            RecognisedKind::Zigzag => {
                let sizes = || self.reversals_deg.iter().map(|angle| angle.abs());
                let (least, most) = (sizes().fold(f64::INFINITY, f64::min), sizes().fold(0.0, f64::max));
                let size = if most - least > UNEQUAL * size {
                    format!("reversed at {least:.0} to {most:.0} deg")
                } else {
                    format!("of {size:.0} deg")
                };
                format!("zigzag {size}, first to {side} by {by}")
            }
        }
    }
}

/// Change of a command, relative to its largest value, that is a new command: of one that steers, and of one that only pushes,
/// whose measured shaft speed falls in a turn.
const SAME: [f64; 2] = [0.05, 0.2];

/// Deviations of the noise of a measured command that are no change.
const NOISE: f64 = 4.0;

/// Part of a change at which a command has left its value, and part at which its speed is measured.
const LEFT: f64 = 0.1;
const HALF: f64 = 0.5;

/// Yaw rate before a trial, relative to the mean one in its turn or first leg, on a straight course.
const STRAIGHT: f64 = 0.1;

/// The largest one before a zigzag. A leg that is not the first one begins at the rate of the one before.
const ZIGZAG_STRAIGHT: f64 = 0.5;

/// Least number of samples of a held command.
const LEAST_SAMPLES: usize = 3;

/// Least number of commands of a zigzag.
const LEAST_COMMANDS: usize = 3;

/// Spread of the headings at which a zigzag is reversed, relative to their mean, that is stated.
const UNEQUAL: f64 = 0.2;

/// Least change of heading at which a zigzag is reversed \[rad\].
const LEAST_HEADING: f64 = 0.03;

/// An input that is commanded.
struct Command {
    values: Vec<f64>,
    /// Changes up to this one are none.
    same: f64,
    /// Samples in which the fastest change, with its noise, passes twice as much: a part of a ramp is at most twice as long.
    passing: usize,
}

/// A part of a run with held commands.
#[derive(Clone, Debug)]
struct Held {
    /// Sample at which the commands leave the former ones.
    execute: usize,
    /// Samples in which they are held: the first one, and that after the last one.
    from: usize,
    to: usize,
    /// Medians of the commands.
    level: Vec<f64>,
}

/// Turning circles and zigzags in a run. The roles of its inputs are those of a boat. A run without the yaw rate `r`, or
/// without an input that turns the vessel, has none.
///
/// A command is held while it stays within 5 % of its largest value, or four deviations of its noise, of its mean; one that only
/// pushes, within 20 %. A trial begins where the commands leave the former ones: the order, or the first motion of a rudder that
/// is measured. Disturbances and settings do not count.
pub fn recognise(run: &Trajectory, boat: &Boat) -> Vec<Recognised> {
    let Some(heading) = heading(run).filter(|_| output(run, MOTION[2]).is_some()) else { return Vec::new() };
    let rates: Vec<f64> = output(run, MOTION[2]).map_or_else(Vec::new, |r| {
        filled(run.outputs.column(r)).into_iter().map(|rate| rate * run.dt).collect()
    });
    let channels = run.inputs.channels().iter();
    let roles: Vec<Option<Role>> = channels.map(|channel| boat.role(&channel.name)).collect();
    if !roles.iter().any(|role| role.is_none_or(Role::turns)) {
        return Vec::new();
    }
    let commanded: Vec<usize> =
        (0..roles.len()).filter(|c| roles[*c].is_none_or(Role::is_commanded)).collect();
    let commands: Vec<Command> =
        commanded.iter().map(|&c| Command::new(run.inputs.column(c).collect(), roles[c])).collect();
    let turned_by = |held: &Held| {
        let turning = commanded.iter().zip(&held.level).filter(|(c, _)| roles[**c].is_none_or(Role::turns));
        turning.map(|(&c, &value)| Ordered { input: run.inputs.channels()[c].clone(), value }).collect()
    };
    let held = held(&commands, run.len());
    let same = |a: &Held, b: &Held| {
        a.level.iter().zip(&b.level).zip(&commands).all(|((a, b), command)| (a - b).abs() <= command.same)
    };
    let end = |k: usize| {
        let next: Option<&Held> = held.get(k + 1);
        next.map_or(held[k].to - 1, |next| next.execute.min(held[k].to))
    };
    let turns: Vec<bool> = commanded.iter().map(|&c| roles[c].is_none_or(Role::turns)).collect();
    // A trial begins with an order that steers; the one before the first sample is not known.
    let begins = |i: usize| {
        let Some(before) = i.checked_sub(1).map(|i| &held[i].level) else { return true };
        let levels = before.iter().zip(&held[i].level).zip(&commands).zip(&turns);
        levels.into_iter().any(|(((a, b), command), turns)| *turns && (a - b).abs() > command.same)
    };
    let mut found = Vec::new();
    let mut i = 0;
    while i < held.len() {
        if !begins(i) {
            i += 1;
            continue;
        }
        let mut zigzag = zigzag_length(&held[i..], &heading, same);
        let turning = |end: usize| turning_before(&heading, &rates, held[i].execute, end);
        let before_leg = held.get(i + 1).map_or(f64::INFINITY, |next| turning(next.execute));
        if before_leg > ZIGZAG_STRAIGHT {
            zigzag = 0;
        }
        if zigzag >= LEAST_COMMANDS {
            let part = &held[i..i + zigzag];
            let start = heading[part[0].execute];
            let at = |held: &Held| heading[held.execute] - start;
            let reversals_deg: Vec<f64> = part[1..].iter().map(|held| at(held).to_degrees()).collect();
            let mean = reversals_deg.iter().map(|angle| angle.abs()).sum::<f64>() / (zigzag - 1) as f64;
            found.push(Recognised {
                kind: RecognisedKind::Zigzag,
                executes: part.iter().map(|held| held.execute).collect(),
                end: end(i + zigzag - 1),
                heading_deg: mean * at(&part[1]).signum(),
                reversals_deg,
                turned_by: turned_by(&part[0]),
                turning_before: before_leg,
            });
            i += zigzag;
            continue;
        }
        let change = heading[end(i)] - heading[held[i].execute];
        let turning_before = turning(end(i));
        if change.abs() >= FRAC_PI_2 && turning_before <= STRAIGHT {
            found.push(Recognised {
                kind: RecognisedKind::TurningCircle,
                executes: vec![held[i].execute],
                end: end(i),
                heading_deg: change.to_degrees(),
                reversals_deg: Vec::new(),
                turned_by: turned_by(&held[i]),
                turning_before,
            });
        }
        i += 1;
    }
    found
}

/// Size of the yaw rate before a turn, or the first leg of a zigzag, relative to its mean rate there: over as many samples as a tenth
/// of it has, or the run has before it. Without any, a straight line through the first rates shows the one at the order: those in the
/// first twentieth, and before half of the mean rate.
fn turning_before(heading: &[f64], rates: &[f64], execute: usize, end: usize) -> f64 {
    let samples = execute.min((end - execute).div_ceil(10));
    let rate = |from: usize, to: usize| (heading[to] - heading[from]) / (to - from).max(1) as f64;
    let mean = rate(execute, end);
    let before = if samples >= LEAST_SAMPLES {
        rate(execute - samples, execute)
    } else {
        let rising = rates[execute..].iter().position(|rate| rate.abs() >= 0.5 * mean.abs());
        let first = (end - execute).div_ceil(20).min(rising.unwrap_or(usize::MAX)).max(LEAST_SAMPLES);
        line(rates[execute..].iter().take(first).enumerate().map(|(k, rate)| (k as f64, *rate)))[0]
    };
    if before == 0.0 { 0.0 } else { (before / mean).abs() }
}

impl Command {
    fn new(values: Vec<f64>, role: Option<Role>) -> Self {
        let largest = values.iter().map(|x| x.abs()).fold(0.0, f64::max);
        let [steers, pushes] = SAME;
        let part = if role == Some(Role::Propulsion) { pushes } else { steers };
        // Ramps have no second differences. Those of white noise have six times its variance, and a normal number is beyond
        // 0.6745 deviations as often as not.
        let second = values.windows(3).map(|x| (x[2] - 2.0 * x[1] + x[0]).abs());
        let deviation = median(second.collect()).unwrap_or(0.0) / (0.6745 * 6.0_f64.sqrt());
        let same = (part * largest).max(NOISE * deviation);
        let passing = shortest_change(values.iter().copied(), 2.0 * same).filter(|_| same > 0.0).unwrap_or(0);
        Self { values, same, passing }
    }

    fn level(&self, from: usize, to: usize) -> f64 {
        median(self.values[from..to].to_vec()).unwrap_or(0.0)
    }

    /// The sample at which a change to a level begins that ends at a sample: back as long as the command moves as fast as an
    /// order. Helm that was given slowly before is none.
    fn begins(&self, new: f64, first: usize, end: usize) -> Option<usize> {
        let step = 2 * self.passing.max(1);
        let away = |k: usize| (self.values[k] - new).abs();
        let mut k = end;
        while k >= first + step && away(k - step) > away(k) + self.same {
            k -= step;
        }
        let earliest = k.saturating_sub(step.max(LEAST_SAMPLES)).max(first);
        (k < end).then(|| self.leaves(self.level(earliest, k + 1), new, earliest, end))
    }

    /// The sample at which the command leaves a level on its way to another one, before a sample at which it is there: the way
    /// from a tenth to the half of the change, extended back to its beginning. Steps have none.
    fn leaves(&self, before: f64, after: f64, from: usize, to: usize) -> usize {
        let last_within = |part: f64| {
            let limit = part * (after - before).abs();
            (from..to).rev().find(|k| (self.values[*k] - before).abs() <= limit).unwrap_or(from)
        };
        let (left, half) = (last_within(LEFT), last_within(HALF));
        let back = (half.saturating_sub(left) as f64 * LEFT / (HALF - LEFT)).round();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of samples")]
        let begin = left.saturating_sub(back as usize).max(from);
        begin + 1
    }
}

/// Parts with held commands, in their order.
fn held(commands: &[Command], samples: usize) -> Vec<Held> {
    let mut all: Vec<Held> = Vec::new();
    let mut from = 0;
    while from < samples {
        let mut sums = vec![0.0; commands.len()];
        let mut to = from;
        while to < samples {
            let count = (to - from) as f64;
            let stays = commands
                .iter()
                .zip(&sums)
                .all(|(command, sum)| to == from || (command.values[to] - sum / count).abs() <= command.same);
            if !stays {
                break;
            }
            for (sum, command) in sums.iter_mut().zip(commands) {
                *sum += command.values[to];
            }
            to += 1;
        }
        // A value that is not a number is a part of its own.
        let to = to.max(from + 1);
        let half = from + (to - from) / 2;
        let is_held = to - from >= LEAST_SAMPLES
            && commands.iter().all(|command| to - from > 2 * command.passing)
            && commands.iter().all(|command| {
                let moved = command.level(half, to) - command.level(from, half);
                moved.abs() <= 0.5 * command.same
            });
        if is_held {
            let level: Vec<f64> = commands.iter().map(|command| command.level(from, to)).collect();
            let execute = all.last().map_or(from, |before: &Held| {
                let begins =
                    commands.iter().zip(&level).filter_map(|(c, new)| c.begins(*new, before.from, from));
                begins.min().unwrap_or(from)
            });
            let split = all.last_mut().filter(|before| {
                let near = before.level.iter().zip(&level).zip(commands);
                from <= before.to + LEAST_SAMPLES
                    && near.into_iter().all(|((a, b), c)| (a - b).abs() <= c.same)
            });
            // An outlier does not end a command.
            match split {
                Some(before) => before.to = to,
                None => all.push(Held { execute, from, to, level }),
            }
        }
        from = to;
    }
    all
}

/// Number of parts at the beginning that are a zigzag.
fn zigzag_length(held: &[Held], heading: &[f64], same: impl Fn(&Held, &Held) -> bool) -> usize {
    let Some(first) = held.first() else { return 0 };
    let turned = |k: usize| heading[held[k].execute] - heading[first.execute];
    let mut length = 1;
    while length < held.len() {
        let reversed = !same(&held[length], &held[length - 1]);
        let alternates = length < 2 || same(&held[length], &held[length - 2]);
        let (now, first) = (turned(length), turned(1));
        let alike = (0.5 * first.abs()..=2.0 * first.abs()).contains(&now.abs());
        let sides = now.abs() >= LEAST_HEADING
            && alike
            && (length < 2 || now.signum() != turned(length - 1).signum());
        if !(reversed && alternates && sides) {
            break;
        }
        length += 1;
    }
    length
}
