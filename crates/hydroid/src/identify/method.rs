//! Ways to a model.

use serde::{Deserialize, Serialize};

use crate::train::CellKind;

/// A way to a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// A search for sparse equations of motion.
    Sindy,
    /// The same with outputs and inputs of some time ago among the variables.
    Lagged,
    /// Equations that keep learning by recursive least squares at several paces: those of another search where
    /// they have a lag or a change of mode, else equations with all terms.
    Recursive,
    /// A recurrent network with LSTM cells.
    Lstm,
    /// A recurrent network with GRU cells.
    Gru,
    /// A vanilla recurrent network.
    Rnn,
    /// A feed-forward network that gives all outputs of a horizon at once.
    Direct,
    /// A feed-forward network of the rates, affine in known maps of the inputs, which control laws invert.
    Affine,
}

impl Method {
    /// Its name in tables and model files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sindy => "sindy",
            Self::Lagged => "lagged",
            Self::Recursive => "recursive",
            Self::Lstm | Self::Gru | Self::Rnn | Self::Direct | Self::Affine => {
                self.cell().map_or("", CellKind::name)
            }
        }
    }

    /// The kind of a network; none for equations.
    pub fn cell(self) -> Option<CellKind> {
        match self {
            Self::Sindy | Self::Lagged | Self::Recursive => None,
            Self::Lstm => Some(CellKind::Lstm),
            Self::Gru => Some(CellKind::Gru),
            Self::Rnn => Some(CellKind::Rnn),
            Self::Direct => Some(CellKind::Direct),
            Self::Affine => Some(CellKind::Affine),
        }
    }
}
