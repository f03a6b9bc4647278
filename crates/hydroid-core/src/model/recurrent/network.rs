//! Structure of a recurrent network and the order of its weights.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
/// A recurrent cell. `x` is the input of a step, `h` the visible part of the state, `s` the logistic function, `.` the
/// element-wise product. Gates are in PyTorch's order, with two bias vectors per layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(tag = "cell", rename_all = "snake_case", deny_unknown_fields))]
pub enum Cell {
    /// Long short-term memory, as `torch.nn.LSTM` with one layer:
    ///
    /// ```text
    /// [i f g o] = W_ih x + b_ih + W_hh h + b_hh
    /// c+ = s(f) . c + s(i) . tanh(g)
    /// h+ = s(o) . tanh(c+)                     without projection
    /// h+ = W_hr (s(o) . tanh(c+))              with one (proj_size)
    /// ```
    ///
    /// State `[c h]`. (Hochreiter and Schmidhuber 1997; projection: Sak, Senior and Beaufays 2014.)
    Lstm {
        /// Number of cells, the length of `c`.
        hidden: usize,
        /// Length of the projected `h`; without projection `h` is as long as `c`.
        #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
        projection: Option<usize>,
    },
    /// Gated recurrent unit, as `torch.nn.GRU` with one layer:
    ///
    /// ```text
    /// a = W_ih x + b_ih,  b = W_hh h + b_hh    blocks r, z, n
    /// r = s(a_r + b_r),  z = s(a_z + b_z),  n = tanh(a_n + r . b_n)
    /// h+ = (1 - z) . n + z . h
    /// ```
    ///
    /// State `h`. (Cho et al. 2014.)
    Gru {
        /// Length of `h`.
        hidden: usize,
    },
    /// Elman network, as `torch.nn.RNN` with tanh; each layer after the first reads the new state of the layer before
    /// it.
    ///
    /// ```text
    /// h_l+ = tanh(W_ih x_l + b_ih + W_hh h_l + b_hh),   x_0 = x,  x_l = h_{l-1}+
    /// ```
    ///
    /// State `[h_0 h_1 ..]`. (Elman 1990.)
    Vanilla {
        /// Length of each layer's state.
        hidden: usize,
        /// Number of layers.
        layers: usize,
    },
}

/// A recurrent network: a step `state+ = f(state, x)`, `y = g(state+)`, with transition `f` and observation `g`. Its
/// weights are one flat slice: the [`tensors`](Self::tensors) one after the other, each row by row, with PyTorch's
/// names for exchange in both directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Network {
    /// The cell.
    pub cell: Cell,
    /// Length of the input `x` of a step.
    pub inputs: usize,
    /// Length of the output `y`.
    pub outputs: usize,
    /// `y = W h + b` (`torch.nn.Linear` on the last layer's `h`) where true; else `y = h`.
    pub read_out: bool,
}

/// A tensor in the flat weights: a matrix, or a vector (`columns` is 1 and `vector` true).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tensor {
    /// PyTorch's name.
    pub name: String,
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Whether PyTorch stores a vector of `rows` numbers.
    pub vector: bool,
    /// Offset in the flat weights.
    pub offset: usize,
}

impl Tensor {
    /// Number of weights.
    pub fn len(&self) -> usize {
        self.rows * self.columns
    }

    /// Whether there are no weights.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Range in the flat weights.
    pub fn range(&self) -> core::ops::Range<usize> {
        self.offset..self.offset + self.len()
    }

    /// Shape in PyTorch.
    pub fn shape(&self) -> Vec<usize> {
        if self.vector { [self.rows].into() } else { [self.rows, self.columns].into() }
    }
}

/// Reasons why a network is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum NetworkError {
    #[error("a network needs {0}: give at least 1")]
    Empty(&'static str),
    /// A size exceeds its limit: name, value, limit. Guards against files that would exhaust the memory.
    #[error("{1} {0} are more than the {2} that a network may have")]
    Huge(&'static str, usize, usize),
    #[error(
        "without read-out the cell gives {shown} numbers for {outputs} outputs: add the read-out, or project to {outputs}"
    )]
    Shown {
        /// Length of `h`.
        shown: usize,
        outputs: usize,
    },
    #[error("{hidden} cells cannot be projected to {projection} numbers: give fewer than {hidden}")]
    Projection { hidden: usize, projection: usize },
}

impl Cell {
    /// Length of `h` (of one layer).
    pub fn shown(&self) -> usize {
        match *self {
            Self::Lstm { hidden, projection } => projection.unwrap_or(hidden),
            Self::Gru { hidden } | Self::Vanilla { hidden, .. } => hidden,
        }
    }

    /// Length of the state.
    pub fn state_len(&self) -> usize {
        match *self {
            Self::Lstm { hidden, .. } => hidden + self.shown(),
            Self::Gru { hidden } => hidden,
            Self::Vanilla { hidden, layers } => hidden * layers,
        }
    }

    /// Number of layers.
    pub fn layers(&self) -> usize {
        if let Self::Vanilla { layers, .. } = *self { layers } else { 1 }
    }

    /// Rows of all gates of a layer.
    pub fn gate_rows(&self) -> usize {
        match *self {
            Self::Lstm { hidden, .. } => 4 * hidden,
            Self::Gru { hidden } => 3 * hidden,
            Self::Vanilla { hidden, .. } => hidden,
        }
    }

    /// Name in files and tables.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Lstm { .. } => "lstm",
            Self::Gru { .. } => "gru",
            Self::Vanilla { .. } => "rnn",
        }
    }
}

impl Network {
    /// Largest size in a network.
    pub const MOST: usize = 4096;

    /// Checks the sizes.
    ///
    /// # Errors
    /// If a size is zero, exceeds [`MOST`](Self::MOST), or contradicts another.
    pub fn check(&self) -> Result<(), NetworkError> {
        let (Cell::Lstm { hidden, .. } | Cell::Gru { hidden } | Cell::Vanilla { hidden, .. }) = self.cell;
        for (what, size) in [
            ("inputs", self.inputs),
            ("outputs", self.outputs),
            ("cells", hidden),
            ("layers", self.cell.layers()),
            ("projected numbers", self.cell.shown()),
        ] {
            match size {
                0 => return Err(NetworkError::Empty(what)),
                size if size > Self::MOST => return Err(NetworkError::Huge(what, size, Self::MOST)),
                _ => {}
            }
        }
        if self.cell.layers() > 64 {
            return Err(NetworkError::Huge("layers", self.cell.layers(), 64));
        }
        if let Cell::Lstm { hidden, projection: Some(projection) } = self.cell
            && projection >= hidden
        {
            return Err(NetworkError::Projection { hidden, projection });
        }
        let shown = self.cell.shown();
        if !self.read_out && shown != self.outputs {
            return Err(NetworkError::Shown { shown, outputs: self.outputs });
        }
        Ok(())
    }

    /// Length of the state.
    pub fn state_len(&self) -> usize {
        self.cell.state_len()
    }

    /// Number of weights.
    pub fn weights(&self) -> usize {
        self.tensors().last().map_or(0, |tensor| tensor.range().end)
    }

    /// The tensors of the weights, in their order: for each layer `weight_ih_l`, `weight_hh_l`, `bias_ih_l`,
    /// `bias_hh_l`, then `weight_hr_l0` of a projection, then `linear.weight` and `linear.bias` of the read-out.
    pub fn tensors(&self) -> Vec<Tensor> {
        let (gates, shown) = (self.cell.gate_rows(), self.cell.shown());
        let mut shapes = Vec::new();
        for layer in 0..self.cell.layers() {
            let read = if layer == 0 { self.inputs } else { shown };
            shapes.push((format!("weight_ih_l{layer}"), gates, read, false));
            shapes.push((format!("weight_hh_l{layer}"), gates, shown, false));
            shapes.push((format!("bias_ih_l{layer}"), gates, 1, true));
            shapes.push((format!("bias_hh_l{layer}"), gates, 1, true));
        }
        if let Cell::Lstm { hidden, projection: Some(projection) } = self.cell {
            shapes.push((String::from("weight_hr_l0"), projection, hidden, false));
        }
        if self.read_out {
            shapes.push((String::from("linear.weight"), self.outputs, shown, false));
            shapes.push((String::from("linear.bias"), self.outputs, 1, true));
        }
        let mut offset = 0;
        let place = |(name, rows, columns, vector): (String, usize, usize, bool)| {
            let tensor = Tensor { name, rows, columns, vector, offset };
            offset += tensor.len();
            tensor
        };
        shapes.into_iter().map(place).collect()
    }
}
