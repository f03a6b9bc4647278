//! Methods of identification.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::train::CellKind;

/// Method of identification.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "arguments", derive(clap::ValueEnum))]
pub enum Method {
    /// Sparse equations of motion
    Sindy,
    /// Equations with past outputs and inputs
    Lagged,
    /// Equations with recursive adaptation, from several priors
    Recursive,
    /// Difference equations that are combined by cross-validation and learn along a run
    Committee,
    /// The marked numbers of a vessel file
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

impl FromStr for Method {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|method| method.name() == text);
        found.ok_or_else(|| format!("'{text}' is not a method: {}", Self::ALL.map(Self::name).join(", ")))
    }
}

impl Method {
    const ALL: [Self; 10] = [
        Self::Sindy,
        Self::Lagged,
        Self::Recursive,
        Self::Committee,
        Self::GreyBox,
        Self::Lstm,
        Self::Gru,
        Self::Rnn,
        Self::Direct,
        Self::Affine,
    ];

    /// Its name in tables and model files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sindy => "sindy",
            Self::Lagged => "lagged",
            Self::Recursive => "recursive",
            Self::Committee => "committee",
            Self::GreyBox => "grey-box",
            Self::Lstm | Self::Gru | Self::Rnn | Self::Direct | Self::Affine => {
                self.cell().map_or("", CellKind::name)
            }
        }
    }

    /// Whether models of this method are cross-validated over the runs; the others need validation and test runs.
    pub fn is_cross_validated(self) -> bool {
        matches!(self, Self::Sindy | Self::Committee | Self::GreyBox)
    }

    /// The kind of network; none for equations.
    pub fn cell(self) -> Option<CellKind> {
        match self {
            Self::Sindy | Self::Lagged | Self::Recursive | Self::Committee | Self::GreyBox => None,
            Self::Lstm => Some(CellKind::Lstm),
            Self::Gru => Some(CellKind::Gru),
            Self::Rnn => Some(CellKind::Rnn),
            Self::Direct => Some(CellKind::Direct),
            Self::Affine => Some(CellKind::Affine),
        }
    }
}
