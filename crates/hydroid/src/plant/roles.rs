//! Roles of inputs from the response of a model.

use super::input_map::{LEAST_EFFECT, LEAST_SHARE, StepResponse, Test, half_ranges};
use crate::boat::{Boat, BoatError, Evidence, Role, Value};
use crate::log::Channel;
use crate::model::{Model, Port};

/// Largest even part of the change of the surge velocity, relative to the odd part, of an input that pushes. A rudder
/// slows the vessel down to both sides.
const MOST_EVEN: f64 = 1.0;

/// The boat of a model with the roles of all inputs, as far as they can be found: those that it states or contains, those that
/// follow from names and units, and those that its response to the other inputs shows.
///
/// An input turns the vessel if the yaw rate changes its sign with it, and pushes it if the surge velocity rises on one side
/// and falls on the other. An input with less than a quarter of the greatest effect, or less than 1 % of the range of
/// the output, has none.
///
/// An input that steers by its name and by the response pushes, alone or beside others that push, is [contradicted](Evidence::Contradicted). An
/// angle has the role that the response shows.
pub fn find_roles(model: &Model) -> Boat {
    let inputs = &model.description.inputs;
    let mut boat = model.description.boat.clone();
    let name = |c: usize| inputs[c].channel.name.as_str();
    let open: Vec<usize> = (0..inputs.len()).filter(|&c| boat.role(name(c)).is_none()).collect();
    let channels: Vec<Channel> = inputs.iter().map(|port| port.channel.clone()).collect();
    boat.find(&channels);
    let unsure = |boat: &Boat, c: usize| boat.role(name(c)).is_none_or(|role| role == Role::Steering);
    let open: Vec<usize> = open.into_iter().filter(|&c| unsure(&boat, c)).collect();
    if open.is_empty() {
        return boat;
    }
    // A model without a motion has no response.
    let Ok(mut test) = Test::new(model) else { return boat };
    let roles: Vec<Option<Role>> = channels.iter().map(|channel| boat.role(&channel.name)).collect();
    // What contradicts itself is an error where the values are used.
    let Ok(values) = values_by(&boat, model) else { return boat };
    let limits = tested(model, &values);
    let half = half_ranges(model, &limits);
    let operating = operating_point(&limits, &values, &roles);
    let range = [test.range("u"), test.range("r")];
    let surge = test.responses(&operating, &half, &limits, |nu| nu[0]);
    let greatest = |of: &[StepResponse], but: Option<usize>| {
        let others = of.iter().enumerate().filter(|(c, _)| Some(*c) != but);
        others.map(|(_, response)| response.odd().abs()).fold(0.0, f64::max)
    };
    let pushes = |c: usize| {
        let odd = surge[c].odd();
        let is_large = odd.abs() > (LEAST_SHARE * greatest(&surge, None)).max(LEAST_EFFECT * range[0]);
        is_large && surge[c].even().abs() <= MOST_EVEN * odd.abs()
    };
    let pushing: Vec<bool> =
        (0..inputs.len()).map(|c| roles[c].map_or_else(|| pushes(c), Role::pushes)).collect();
    let ahead: Vec<f64> = (0..inputs.len())
        .map(|c| {
            let step = 0.5 * half[c] * surge[c].odd().signum();
            operating[c] + if pushing[c] && surge[c].odd() != 0.0 { step } else { 0.0 }
        })
        .collect();
    test.settle(&ahead);
    let yaw = test.responses(&ahead, &half, &limits, |nu| nu[2]);
    for c in open {
        let turns = yaw[c].odd().abs() > (LEAST_SHARE * greatest(&yaw, None)).max(LEAST_EFFECT * range[1]);
        let share = |odd: f64, range: f64| (100.0 * odd.abs() / range).round();
        let response = format!(
            "over half of its range, u changes by {} % of its range and r by {} %",
            share(surge[c].odd(), range[0]),
            share(yaw[c].odd(), range[1])
        );
        let role = match (pushes(c), turns) {
            (true, true) => Role::Thruster,
            (true, false) => Role::Propulsion,
            (false, true) => Role::Steering,
            (false, false) => continue,
        };
        if roles[c].is_none() {
            boat.found_role(name(c), role, Evidence::Response(response));
        } else if role == Role::Propulsion
            || role == Role::Thruster && greatest(&surge, Some(c)) > LEAST_EFFECT * range[0]
        {
            // The drag of a rudder, which a model of a few logs may show on one side more than on the other, is not taken for
            // propulsion if no other input pushes.
            boat.doubt(name(c), role, response);
        }
    }
    boat
}

/// Neutral value and limits of each input of a model, in its units, by its [boat](Boat::value).
///
/// # Errors
/// If the boat contradicts itself.
pub fn input_values(model: &Model) -> Result<Vec<Value>, BoatError> {
    values_by(&find_roles(model), model)
}

/// Name of each input of a model, and its neutral value and limits in words. A boat that contradicts itself has none.
pub fn described_inputs(model: &Model) -> Vec<(String, String)> {
    let values = input_values(model).unwrap_or_default();
    let raws = model.description.raw_inputs();
    values.iter().zip(&raws).map(|(value, raw)| (value.name.clone(), value.describe(raw.as_ref()))).collect()
}

/// As [`input_values`], by a boat with roles.
pub(crate) fn values_by(boat: &Boat, model: &Model) -> Result<Vec<Value>, BoatError> {
    let of = |port: &Port| boat.value(&port.channel, Some([port.range.low, port.range.high]));
    model.description.inputs.iter().map(of).collect()
}

/// Ranges in which inputs are tested: those in which the model was seen; the value of an input that is not commanded.
pub(super) fn tested(model: &Model, values: &[Value]) -> Vec<[f64; 2]> {
    let of = |(port, value): (&Port, &Value)| {
        if value.is_commanded { [port.range.low, port.range.high] } else { value.limits }
    };
    model.description.inputs.iter().zip(values).map(of).collect()
}

/// Commands about which inputs are tested: steering at its neutral position, others in the middle of their ranges. An input
/// without a role may be a rudder.
pub(super) fn operating_point(ranges: &[[f64; 2]], values: &[Value], roles: &[Option<Role>]) -> Vec<f64> {
    let of = |((&[low, high], value), role): ((&[f64; 2], &Value), &Option<Role>)| match role {
        Some(Role::Steering) => value.neutral.max(low).min(high),
        None if low < value.neutral && value.neutral < high => value.neutral,
        _ => 0.5 * (low + high),
    };
    ranges.iter().zip(values).zip(roles).map(of).collect()
}
