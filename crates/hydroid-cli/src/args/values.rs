//! Types of option values.

use clap::ValueEnum;
use hydroid::identify;
use hydroid::log::CommandTiming;

pub(super) fn parse_timing(text: &str) -> Result<CommandTiming, String> {
    match text {
        "before" => Ok(CommandTiming::Before),
        "after" => Ok(CommandTiming::After),
        _ => Err(String::from(
            "write before (the command of a row acts from this row on) or after (it acted until this row)",
        )),
    }
}

/// Methods of identification.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// Sparse equations of motion
    Sindy,
    /// Equations with past outputs and inputs
    Lagged,
    /// Equations with recursive adaptation
    Recursive,
    /// Difference equations that are combined by cross-validation and learn along a run
    Committee,
    /// The marked numbers of the vessel file in --vessel
    GreyBox,
    /// A recurrent network with LSTM cells
    Lstm,
    /// A recurrent network with GRU cells
    Gru,
    /// A vanilla recurrent network
    Rnn,
    /// A feed-forward network that predicts all steps of a horizon at once
    Direct,
    /// A feed-forward network of the accelerations, affine in the inputs: for control laws that invert the model
    Affine,
}

impl From<Method> for identify::Method {
    fn from(method: Method) -> Self {
        match method {
            Method::Sindy => Self::Sindy,
            Method::Lagged => Self::Lagged,
            Method::Recursive => Self::Recursive,
            Method::Committee => Self::Committee,
            Method::GreyBox => Self::GreyBox,
            Method::Lstm => Self::Lstm,
            Method::Gru => Self::Gru,
            Method::Rnn => Self::Rnn,
            Method::Direct => Self::Direct,
            Method::Affine => Self::Affine,
        }
    }
}

/// Outputs that the model observes before the origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Origin {
    /// The measurements
    Measured,
    /// The true outputs of a simulated log
    True,
}

/// Reference of the errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Against {
    /// The measurements
    Measurement,
    /// The true outputs of a simulated log
    Truth,
}
