//! Reasons why a model cannot be simulated as a plant.

use hydroid_core::model::PlantModelError;

use crate::progress::Cancelled;

/// Reason why a model is not a plant, or its inputs are unknown.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlantError {
    /// The surge velocity or the yaw rate is missing.
    #[error(
        "a simulated vessel needs the surge velocity u and the yaw rate r; this model has no output '{missing}', only {known}. Identify it with --outputs u,v,r"
    )]
    NoMotion {
        /// The missing output.
        missing: &'static str,
        /// Outputs of the model.
        known: String,
    },
    /// An output of the motion has another unit than the equations of motion.
    #[error(
        "the output '{name}' is in {unit}, and a simulated vessel needs it in {needed}: state the unit of its column, as in --outputs '{name}={name} [{needed}]', and identify again"
    )]
    Unit {
        /// The output.
        name: &'static str,
        /// Of the model.
        unit: String,
        /// Needed.
        needed: &'static str,
    },
    /// No input has the effect.
    #[error(
        "no input of this model {effect}: under half of their ranges, {inputs} change {output} by less than 1 % of its range. Name the inputs with {option}"
    )]
    NoEffect {
        /// What an input should do.
        effect: &'static str,
        /// All inputs.
        inputs: String,
        /// Output that should change.
        output: &'static str,
        /// Option that names the inputs.
        option: &'static str,
    },
    /// The vessel cannot keep a station.
    #[error(
        "the vessel cannot keep a station: at rest, no combination of its commands ({inputs}) {lacks}. Station keeping needs forces in surge, sway and yaw in both directions; sail around the point with --task circle instead"
    )]
    NoStation {
        /// All inputs.
        inputs: String,
        /// What the commands cannot do.
        lacks: &'static str,
    },
    /// Unknown input.
    #[error("{option}: the model has no input '{name}'{}; its inputs are {known}", nearest.as_ref().map(|n| format!(", did you mean '{n}'?")).unwrap_or_default())]
    UnknownInput {
        /// The option.
        option: &'static str,
        /// Given name.
        name: String,
        /// A name like it.
        nearest: Option<String>,
        /// All inputs.
        known: String,
    },
    /// The parameters of a vessel are invalid.
    #[error("the vessel is invalid: {0}")]
    Vessel(#[from] PlantModelError),
    /// Number out of range.
    #[error("{what} is {value}; {needed}")]
    Option {
        /// Quantity.
        what: &'static str,
        /// Given value.
        value: f64,
        /// Permitted values.
        needed: &'static str,
    },
    /// The model diverges.
    #[error("the simulated motion is not finite after {t_s:.1} s: the model is not stable there")]
    Diverged {
        /// Time since the start \[s\].
        t_s: f64,
    },
    /// Cancelled by the callback.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
