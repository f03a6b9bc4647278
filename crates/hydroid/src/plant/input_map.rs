//! Which inputs push a vessel, and which turn it.

use std::f64::consts::FRAC_PI_2;

use serde::Serialize;

use super::error::PlantError;
use super::roles::{find_roles, operating_point, tested, values_by};
use super::simulation::{Simulation, middle};
use crate::boat::{HARD_OVER_DEG, Role, Value};
use crate::model::{Model, Port};
use crate::toml_file::nearest;

/// Propulsion and steering as directions in the space of the commands:
///
/// ```text
/// c = neutral + p push + s turn,    within the limits
/// ```
///
/// with the propulsion `p` (1: full ahead) and the steering `s`. The vessel turns to starboard for `s > 0` while it moves
/// ahead. `s` is 1 or -1 on the side to which the inputs that turn the vessel reach farther; the other side may end before
/// ([`hard_over`](Self::hard_over)).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InputMap {
    /// Commands without propulsion and steering.
    pub neutral: Vec<f64>,
    /// Change of the commands from none to full propulsion.
    pub push: Vec<f64>,
    /// Change of the commands from neutral to `s = 1`.
    pub turn: Vec<f64>,
    /// Lower and upper limit of each command. An input that is not commanded has one value.
    pub limits: Vec<[f64; 2]>,
    /// Name of each input.
    pub names: Vec<String>,
    /// Unit of each input; empty if unknown.
    pub units: Vec<String>,
    /// Role of each input; none if it is not known.
    pub roles: Vec<Option<Role>>,
    /// Neutral value and limits of each input with their evidence.
    pub values: Vec<Value>,
}

/// How the steering is stated: as an angle, positive to starboard, if the inputs that turn the vessel are angles of one size,
/// otherwise in percent of hard over.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Steering {
    /// `deg` or `%`.
    pub unit: &'static str,
    /// Stated value of `s = 1`.
    pub full: f64,
}

/// Least effect of an input relative to the greatest one. An input with less is taken to have none: the side force of a
/// propeller, the drag of a rudder.
pub const LEAST_SHARE: f64 = 0.25;

/// Least effect relative to the range of the output.
pub(super) const LEAST_EFFECT: f64 = 0.01;

/// Length of the test \[samples\] for models without prediction bands.
const HORIZON: usize = 200;

impl InputMap {
    /// Finds the directions. The [role](find_roles) of an input says whether it may push or turn the vessel, or is not
    /// commanded. Its share is its effect on the simulated motion: the change of the surge velocity, and then, while the
    /// vessel moves ahead, of the yaw rate, between half of the range in which the model was seen above and below the
    /// operating point, in proportion to the [limits](crate::boat::Boat::value) of the input.
    /// A vessel that no input may push has no propulsion. For inputs that do both, like two thrusters, the directions are the
    /// smallest commands that have one of the effects alone (the pseudo-inverse, T. I. Fossen, *Handbook of Marine Craft
    /// Hydrodynamics and Motion Control*, 2nd edition, 2021, section 11.2).
    ///
    /// # Errors
    /// If no input turns the vessel, or those that should push it do not.
    pub fn find(model: &Model) -> Result<Self, PlantError> {
        Self::with(model, &[], &[])
    }

    /// As [`find`](Self::find), with given inputs for propulsion and steering, whatever their roles; each is found if its
    /// list is empty. A name after `-` is an input that turns to port or pushes astern.
    ///
    /// # Errors
    /// As [`find`](Self::find), or if there is no such input.
    pub fn with(model: &Model, push: &[String], turn: &[String]) -> Result<Self, PlantError> {
        let inputs = &model.description.inputs;
        let names: Vec<String> = inputs.iter().map(|port| port.channel.name.clone()).collect();
        let units = inputs.iter().map(|port| port.channel.unit.clone()).collect();
        let given = [stated(push, &names, "push")?, stated(turn, &names, "turn")?];
        let mut boat = find_roles(model);
        let is_stated = |c: usize| given.iter().flatten().any(|direction| direction[c] != 0.0);
        let mut doubtful = (0..names.len()).filter(|&c| !is_stated(c));
        if let Some((input, response)) =
            doubtful.find_map(|c| Some((names[c].clone(), boat.contradiction(&names[c])?.to_owned())))
        {
            return Err(PlantError::Contradiction { input, response });
        }
        // An input that is named is commanded.
        for (_, name) in names.iter().enumerate().filter(|(c, _)| is_stated(*c)) {
            if let Some(input) = boat.inputs.get_mut(name) {
                input.role = input.role.filter(|role| role.is_commanded());
            }
        }
        let roles: Vec<Option<Role>> = names.iter().map(|name| boat.role(name)).collect();
        let values = values_by(&boat, model)?;
        let limits = tested(model, &values);
        let half = half_ranges(model, &limits);
        let operating = operating_point(&limits, &values, &roles);
        let mut test = Test::new(model)?;

        let no_effect = |effect, output, option| {
            let inputs = names.join(", ");
            move || PlantError::NoEffect { effect, inputs, output, option }
        };
        let [push_given, turn_given] = given;
        let may =
            |of: fn(Role) -> bool| -> Vec<bool> { roles.iter().map(|role| role.is_some_and(of)).collect() };
        let [may_push, may_turn] = [may(Role::pushes), may(Role::turns)];
        let surge = if let Some(given) = push_given {
            given
        } else if may_push.contains(&true) {
            let effects = test.effects(&operating, &half, &limits, &may_push, |nu| nu[0]);
            significant(effects, test.range("u")).ok_or_else(no_effect("pushes the vessel", "u", "push"))?
        } else {
            vec![0.0; inputs.len()]
        };
        let yaw = if let Some(given) = turn_given {
            given
        } else {
            let sign = |push: f64| if push == 0.0 { 0.0 } else { push.signum() };
            let ahead =
                operating.iter().zip(&half).zip(&surge).map(|((m, h), push)| m + 0.5 * h * sign(*push));
            let ahead: Vec<f64> = ahead.collect();
            test.settle(&ahead);
            let effects = test.effects(&ahead, &half, &limits, &may_turn, |nu| nu[2]);
            significant(effects, test.range("r")).ok_or_else(no_effect("turns the vessel", "r", "turn"))?
        };
        // From half of the range of the test to the reach of the actuator.
        let reach: Vec<f64> = values.iter().map(reach).collect();
        let scaled = |effects: &[f64]| -> Vec<f64> {
            let share = |((effect, half), reach): ((&f64, &f64), &f64)| {
                if *half > 0.0 { effect * reach / half } else { 0.0 }
            };
            effects.iter().zip(&half).zip(&reach).map(share).collect()
        };
        let (push_alone, turn_alone) = directions(&scaled(&surge), &scaled(&yaw));
        // Stated inputs are used as they are.
        let push = if push.is_empty() { push_alone } else { surge };
        let turn = if turn.is_empty() { turn_alone } else { yaw };
        // Full propulsion ahead reaches the limit on its side.
        let push = push.iter().zip(&values).map(|(p, value)| p.abs() * reach_to(value, *p)).collect();
        let turn = turn.iter().zip(&reach).map(|(s, reach)| s * reach).collect();
        let neutral = values.iter().map(|value| value.neutral).collect();
        let limits = values.iter().map(|value| value.limits).collect();
        Ok(Self { neutral, push, turn, limits, names, units, roles, values })
    }

    /// The map over the ranges in which a model was seen: its directions end there.
    pub(super) fn within(mut self, model: &Model) -> Self {
        self.limits = self.seen(model);
        let share = |direction: &[f64], sides: &[f64]| {
            let most = sides.iter().map(|side| self.most(direction, *side, &self.limits)).fold(0.0, f64::max);
            if most > 0.0 { most.min(1.0) } else { 1.0 }
        };
        let (push, turn) = (share(&self.push, &[1.0]), share(&self.turn, &[-1.0, 1.0]));
        self.push.iter_mut().for_each(|part| *part *= push);
        self.turn.iter_mut().for_each(|part| *part *= turn);
        self
    }

    /// The limits within the ranges in which a model was seen.
    fn seen(&self, model: &Model) -> Vec<[f64; 2]> {
        let of = |(&[low, high], port): (&[f64; 2], &Port)| {
            let seen = [low.max(port.range.low), high.min(port.range.high)];
            if seen[0] <= seen[1] { seen } else { [low, high] }
        };
        self.limits.iter().zip(&model.description.inputs).map(of).collect()
    }

    /// Multiple of a direction to a side at which its last input is at a limit.
    fn most(&self, direction: &[f64], side: f64, limits: &[[f64; 2]]) -> f64 {
        let of = |c: usize| {
            let end = if side * direction[c] > 0.0 { limits[c][1] } else { limits[c][0] };
            (end - self.neutral[c]) / (side * direction[c])
        };
        (0..direction.len()).filter(|&c| direction[c] != 0.0).map(of).fold(0.0, f64::max)
    }

    /// Steering to a side at which the last input that turns the vessel leaves the range in which a model was seen, up to
    /// [`hard_over`](Self::hard_over).
    pub(crate) fn seen_over(&self, model: &Model, side: f64) -> f64 {
        let (hard, seen) = (self.hard_over(side), self.most(&self.turn, side, &self.seen(model)));
        if seen > 0.0 { seen.min(hard) } else { hard }
    }

    /// Steering at which the inputs that turn the vessel end: hard over to starboard for a positive `side`, else to port; 1
    /// on the side to which they reach farther.
    pub fn hard_over(&self, side: f64) -> f64 {
        let share = |(turn, value): (&f64, &Value)| {
            if *turn == 0.0 { 0.0 } else { reach_to(value, side * turn).abs() / turn.abs() }
        };
        self.turn.iter().zip(&self.values).map(share).fold(0.0, f64::max).min(1.0)
    }

    /// What is said of neutral values and limits that only follow from the logs.
    pub fn notes(&self) -> Vec<String> {
        self.values.iter().filter_map(Value::note).collect()
    }

    /// The command for propulsion `p` and steering `s`, within the limits.
    pub fn command(&self, p: f64, s: f64) -> Vec<f64> {
        let mut command = vec![0.0; self.neutral.len()];
        self.write_command(p, s, &mut command);
        command
    }

    /// As [`command`](Self::command), without allocation.
    ///
    /// # Panics
    /// If `command` is shorter than the inputs.
    pub fn write_command(&self, p: f64, s: f64, command: &mut [f64]) {
        for (c, [low, high]) in self.limits.iter().enumerate() {
            command[c] = (self.neutral[c] + p * self.push[c] + s * self.turn[c]).clamp(*low, *high);
        }
    }

    /// Why there is no propulsion: no input pushes the vessel. `None` if there is one.
    pub fn no_propulsion(&self) -> Option<String> {
        if self.push.iter().any(|push| *push != 0.0) {
            return None;
        }
        let role = |(name, role): (&String, &Option<Role>)| {
            format!("{name} ({})", role.map_or("no known role", Role::name))
        };
        let roles: Vec<String> = self.names.iter().zip(&self.roles).map(role).collect();
        Some(format!("no input pushes the vessel: {}", roles.join(", ")))
    }

    /// Largest propulsion astern, relative to full ahead; 0 if no input that pushes can be reversed.
    pub fn astern(&self) -> f64 {
        let each =
            self.push.iter().zip(&self.neutral).zip(&self.limits).filter(|((push, _), _)| **push != 0.0);
        let reach = each.map(|((push, neutral), [low, high])| {
            (if *push > 0.0 { neutral - low } else { high - neutral }) / push.abs()
        });
        let most = reach.fold(0.0, f64::max);
        if most.is_finite() { most } else { 0.0 }
    }

    /// How the steering is stated.
    pub fn steering(&self) -> Steering {
        let mut involved = (0..self.turn.len()).filter(|&c| self.turn[c] != 0.0);
        let angle = |c: usize| (self.units[c] == "rad").then(|| self.turn[c].abs());
        if let Some(first) = involved.next().and_then(angle)
            && involved.all(|c| angle(c).is_some_and(|other| (other / first - 1.0).abs() < 1e-9))
        {
            return Steering { unit: "deg", full: first.to_degrees() };
        }
        Steering { unit: "%", full: 100.0 }
    }
}

/// Half of the range of each input, up to hard over.
pub(super) fn half_ranges(model: &Model, limits: &[[f64; 2]]) -> Vec<f64> {
    let half = |(port, [low, high]): (&Port, &[f64; 2])| hard_over(0.5 * (high - low), &port.channel.unit);
    model.description.inputs.iter().zip(limits).map(half).collect()
}

/// Hard over of an angle beyond a quarter turn, such as that of an azimuth thruster, is that of a rudder.
fn hard_over(reach: f64, unit: &str) -> f64 {
    if unit == "rad" && reach > FRAC_PI_2 { HARD_OVER_DEG.to_radians() } else { reach }
}

/// Signed way from the neutral value to the limit above it for a positive `side`, else to the one below.
fn reach_to(value: &Value, side: f64) -> f64 {
    let [low, high] = value.limits;
    let way = if side > 0.0 { (high - value.neutral).max(0.0) } else { (low - value.neutral).min(0.0) };
    way.signum() * hard_over(way.abs(), &value.unit)
}

/// Way to the farther limit.
fn reach(value: &Value) -> f64 {
    reach_to(value, 1.0).max(-reach_to(value, -1.0))
}

/// Directions with the effects `(1, 0)` and `(0, 1)` in (surge, yaw), scaled to a largest component of one.
fn directions(surge: &[f64], yaw: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (uu, ur, rr) = (dot(surge, surge), dot(surge, yaw), dot(yaw, yaw));
    // One input does both: it cannot do one alone.
    let alone = uu * rr - ur * ur > 1e-6 * uu * rr;
    let without = |a: &[f64], b: &[f64], share: f64| -> Vec<f64> {
        let raw: Vec<f64> = a.iter().zip(b).map(|(a, b)| if alone { a - share * b } else { *a }).collect();
        let largest = raw.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        raw.iter().map(|x| if x.abs() > 1e-3 * largest { x / largest } else { 0.0 }).collect()
    };
    (without(surge, yaw, ur / rr), without(yaw, surge, ur / uu))
}

/// The effects relative to the greatest one; `None` if all are small. Minor effects are zero.
fn significant(effects: Vec<f64>, range: f64) -> Option<Vec<f64>> {
    let most = effects.iter().fold(0.0_f64, |most, effect| most.max(effect.abs()));
    let share = |effect: f64| if effect.abs() < LEAST_SHARE * most { 0.0 } else { effect / most };
    (most > LEAST_EFFECT * range).then(|| effects.into_iter().map(share).collect())
}

fn stated(given: &[String], names: &[String], option: &'static str) -> Result<Option<Vec<f64>>, PlantError> {
    if given.is_empty() {
        return Ok(None);
    }
    let mut direction = vec![0.0; names.len()];
    for name in given {
        let (sign, name) = name.strip_prefix('-').map_or((1.0, name.as_str()), |name| (-1.0, name));
        let place = names.iter().position(|known| known == name).ok_or_else(|| PlantError::UnknownInput {
            option,
            name: name.to_owned(),
            nearest: nearest(name, names.iter().map(String::as_str)),
            known: names.join(", "),
        })?;
        direction[place] = sign;
    }
    Ok(Some(direction))
}

/// Changes of the mean motion with an input, from below its operating point to it and from there to above. Limits may shorten
/// the steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepResponse {
    changes: [f64; 2],
    /// Steps relative to a whole one.
    steps: [f64; 2],
}

impl StepResponse {
    /// Changes for whole steps; that of a side without a step is that of the other side.
    fn whole(&self) -> [f64; 2] {
        let side = |i: usize| (self.steps[i] > 0.0).then(|| self.changes[i] / self.steps[i]);
        let (below, above) = (side(0), side(1));
        [below.or(above).unwrap_or(0.0), above.or(below).unwrap_or(0.0)]
    }

    /// Change from below to above; zero if it is not finite.
    pub(super) fn odd(&self) -> f64 {
        let [below, above] = self.whole();
        let change = below + above;
        if change.is_finite() { change } else { 0.0 }
    }

    /// Change on both sides in common.
    pub(super) fn even(&self) -> f64 {
        let [below, above] = self.whole();
        above - below
    }
}

/// Tests of the inputs one by one.
pub(super) struct Test<'a> {
    model: &'a Model,
    simulation: Simulation,
    start: Vec<f64>,
    samples: usize,
}

impl<'a> Test<'a> {
    pub(super) fn new(model: &'a Model) -> Result<Self, PlantError> {
        let simulation = Simulation::new(model)?;
        let bands = model.description.bands.as_ref();
        let samples = bands.and_then(|bands| bands.horizons.last().copied()).unwrap_or(HORIZON).max(2);
        let start = middle(model);
        Ok(Self { model, simulation, start, samples })
    }

    pub(super) fn range(&self, name: &str) -> f64 {
        let port = self.model.description.outputs.iter().find(|port| port.channel.name == name);
        port.map_or(1.0, |port| port.range.high - port.range.low)
    }

    /// Lets the motion settle under a command.
    pub(super) fn settle(&mut self, command: &[f64]) {
        self.simulation.start([0.0; 3], &self.start, command);
        for _ in 0..self.samples {
            self.simulation.advance(command);
        }
        if self.simulation.check().is_ok() {
            self.start.copy_from_slice(self.simulation.outputs());
        }
    }

    /// Change of the mean motion per input; zero for those that may have none.
    fn effects(
        &mut self,
        operating: &[f64],
        half: &[f64],
        limits: &[[f64; 2]],
        may: &[bool],
        read: impl Fn([f64; 3]) -> f64,
    ) -> Vec<f64> {
        let responses = self.responses(operating, half, limits, read);
        responses.iter().zip(may).map(|(response, may)| if *may { response.odd() } else { 0.0 }).collect()
    }

    /// Mean motion over the second half of the test, per input.
    pub(super) fn responses(
        &mut self,
        operating: &[f64],
        half: &[f64],
        limits: &[[f64; 2]],
        read: impl Fn([f64; 3]) -> f64,
    ) -> Vec<StepResponse> {
        let mut mean = |command: &[f64]| {
            self.simulation.start([0.0; 3], &self.start, operating);
            let mut sum = 0.0;
            for k in 0..self.samples {
                self.simulation.advance(command);
                if 2 * k >= self.samples {
                    sum += read(self.simulation.nu());
                }
            }
            sum / (self.samples - self.samples / 2) as f64
        };
        let at = mean(operating);
        let mut response = |c: usize| {
            let [low, high] = limits[c];
            let (whole, place) = (0.5 * half[c], operating[c]);
            let steps = [whole.min(place - low), whole.min(high - place)];
            let mut changed = |step: f64| {
                let mut command = operating.to_vec();
                command[c] = place + step;
                mean(&command)
            };
            let changes = [at - changed(-steps[0]), changed(steps[1]) - at];
            StepResponse { changes, steps: steps.map(|step| if whole > 0.0 { step / whole } else { 0.0 }) }
        };
        (0..operating.len()).map(&mut response).collect()
    }
}
