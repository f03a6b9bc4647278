//! Methods of identification.

use serde::{Deserialize, Serialize};

use crate::train::CellKind;

/// Method of identification.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// A search for sparse equations of motion.
    Sindy,
    /// Sparse equations with past outputs and inputs among the variables.
    Lagged,
    /// Equations with recursive least squares from several priors: those of another search if they have a lag
    /// or a gate, else equations with all terms.
    Recursive,
    /// A committee of difference equations, chosen by cross-validation over runs.
    Committee,
    /// The marked numbers of a vessel file.
    GreyBox,
    /// A recurrent network with LSTM cells.
    Lstm,
    /// A recurrent network with GRU cells.
    Gru,
    /// A vanilla recurrent network.
    Rnn,
    /// Feed-forward network that predicts all outputs over a horizon at once.
    Direct,
    /// Feed-forward network of the rates, affine in known maps of the inputs, so that control laws can invert it.
    Affine,
}

impl Method {
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
