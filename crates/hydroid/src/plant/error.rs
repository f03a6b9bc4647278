//! Reasons why a model cannot be simulated as a plant.

use hydroid_core::model::CraftModelError;

use crate::boat::BoatError;
use crate::key::key;
use crate::progress::Cancelled;

/// Reason why a model is not a plant, or its inputs are unknown.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum PlantError {
    #[error(
        "a simulated vessel needs the surge velocity u and the yaw rate r; this model has no output '{missing}', only {known}. Identify it with {}",
        key("outputs").is("u,v,r")
    )]
    NoMotion { missing: &'static str, known: String },
    #[error(
        "the output '{name}' is in {unit}, and a simulated vessel needs it in {needed}: state the unit of its column, as in {}, and identify again",
        key("outputs").is(format_args!("{name}={name} [{needed}]"))
    )]
    Unit { name: &'static str, unit: String, needed: &'static str },
    #[error(
        "no input of this model {effect}: under half of their ranges, {inputs} change {output} by less than 1 % of its range. Name the inputs with {}",
        key(option)
    )]
    NoEffect { effect: &'static str, inputs: String, output: &'static str, option: &'static str },
    #[error(
        "'{input}' steers by its name, and pushes the vessel by the response of the model: {response}. State what it is, as in {} or {}",
        key("role").is(format_args!("{input}=thruster")),
        key("role").is(format_args!("{input}=steering"))
    )]
    Contradiction { input: String, response: String },
    #[error(
        "the vessel cannot keep a station: at rest, no combination of its commands ({inputs}) {lacks}. Station keeping needs forces in surge, sway and yaw in both directions; sail around the point with {} instead",
        key("task").is("circle")
    )]
    NoStation { inputs: String, lacks: &'static str },
    #[error("{}: the model has no input '{name}'{}; its inputs are {known}", key(option), nearest.as_ref().map(|n| format!(", did you mean '{n}'?")).unwrap_or_default())]
    UnknownInput { option: &'static str, name: String, nearest: Option<String>, known: String },
    #[error(transparent)]
    Boat(#[from] BoatError),
    #[error("the vessel is invalid: {0}")]
    Vessel(#[from] CraftModelError),
    /// Number out of range.
    #[error("{what} is {value}; {needed}")]
    Option { what: &'static str, value: f64, needed: &'static str },
    #[error("the simulated motion is not finite after {t_s:.1} s: the model is not stable there")]
    Diverged { t_s: f64 },
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
