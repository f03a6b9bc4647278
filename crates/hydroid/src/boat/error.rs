//! Errors of the description of a boat.

use super::Role;
use crate::key::key;
use crate::log::units::UnitError;

fn in_unit(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(" in {unit}") }
}

/// Wrong description of a boat.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum BoatError {
    #[error(
        "a role is stated of '{name}', and there is no such input{}; the inputs are {known}",
        nearest.as_ref().map(|n| format!(", did you mean '{n}'?")).unwrap_or_default()
    )]
    UnknownInput { name: String, nearest: Option<String>, known: String },
    #[error("two roles are stated of '{name}', {} and {}: leave one", roles[0], roles[1])]
    TwoRoles { name: String, roles: [Role; 2] },
    #[error("'{0}' is not INPUT=ROLE, as in delta=steering")]
    NoRole(String),
    #[error("'{0}' is not a role: write propulsion, steering, thruster, disturbance or setting")]
    UnknownRole(String),
    #[error(
        "{key} in [boat.particulars] is {value}: give a number{} greater than 0, or leave the line out",
        in_unit(unit)
    )]
    Particular { key: &'static str, value: f64, unit: &'static str },
    #[error("the input '{input}' has the number {number} in [boat.inputs.{input}]: give finite numbers")]
    NotFinite { input: String, number: f64 },
    #[error("limits of {input} are {low} to {high}: give the lower one first, as in limits = [1100, 1900]")]
    NotAscending { input: String, low: f64, high: f64 },
    #[error(
        "neutral of {input} is {neutral}, outside of its limits {low} to {high}: correct one of them in [boat.inputs.{input}], or by {} or {}",
        key("neutral"),
        key("limit")
    )]
    NeutralOutside { input: String, neutral: f64, low: f64, high: f64 },
    #[error("scale of {0} is 0: give the raw change that is 1 in the model, as in scale = 400")]
    NoScale(String),
    #[error(
        "scale of {0} is stated and its neutral value is not: the model's input is (raw - neutral) / scale; add neutral = VALUE to [boat.inputs.{0}]"
    )]
    ScaleAlone(String),
    #[error("unit of {input}, [{unit}]: {error}")]
    Unit { input: String, unit: String, error: UnitError },
    #[error(
        "limits of {input} are {low} to {high}, and the log commands {logged}: correct the limits in [boat.inputs.{input}], or the column of the input"
    )]
    Exceeded { input: String, low: f64, high: f64, logged: f64 },
    #[error(
        "limits of {input} are {} to {} in the unit of the model, which was seen from {} to {}: they have no value in common; state them as `hydroid inspect MODEL` shows them",
        limits[0], limits[1], range[0], range[1]
    )]
    Apart { input: String, limits: [f64; 2], range: [f64; 2] },
    #[error("{what} of {input}: not known; add {line}, or {option}")]
    Missing { input: String, what: &'static str, line: String, option: String },
    #[error(
        "role of {input}: {why}, and what is sent to the vessel depends on it; add role = \"steering\" (or propulsion, thruster, disturbance, setting) to [boat.inputs.{input}] in the configuration of identify, or {}",
        key("role").is(format_args!("{input}=steering"))
    )]
    RoleNotKnown { input: String, why: String },
    #[error(
        "{what} of {input}: only what the log contains is known, which may not decide what is sent to the vessel; add {line} to the configuration of identify, in place of a line `found`, or {option}"
    )]
    Weak { input: String, what: &'static str, line: String, option: String },
    #[error(
        "the input '{name}' has a formula in two places, '{spec}' in [log] inputs, and neutral, limits or scale of its raw values in [boat.inputs.{name}]: keep those of the boat, and write the column alone, or remove them there"
    )]
    TwoFormulas { name: String, spec: String },
    #[error(
        "the input '{name}' has two units, '{spec}' in [log] inputs and {unit} in [boat.inputs.{name}]: neutral, limits and scale are in the unit of the boat; correct one of them"
    )]
    OtherUnit { name: String, spec: String, unit: String },
    #[error(
        "[boat.inputs] has a scale, and [log] names no inputs: name each with the column of its raw values, as in inputs = [\"left=pwm_left\"]"
    )]
    NoColumns,
    #[error(
        "the input '{name}' has a scale in [boat.inputs.{name}], and the vessel file has a neutral value and a gain of its command '{name}'"
    )]
    OfVessel { name: String },
}
