//! Options of a training.

use std::fmt::Display;

use hydroid_core::actuator::Map;
use hydroid_core::model::direct::{Direct, DirectError, Perceptron};
use hydroid_core::model::recurrent::{Cell, Network, NetworkError};
use serde::{Deserialize, Serialize};

use super::TrainError;

/// Kind of network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CellKind {
    /// Long short-term memory.
    #[default]
    Lstm,
    /// Gated recurrent unit.
    Gru,
    /// Vanilla (Elman) network.
    Rnn,
    /// Direct predictor ([`Direct`](hydroid_core::model::direct::Direct)): a feed-forward network with all outputs of a
    /// horizon.
    Direct,
    /// Control-affine network ([`ControlAffine`](hydroid_core::model::affine::ControlAffine)).
    Affine,
}

impl CellKind {
    /// Name in files, tables and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lstm => "lstm",
            Self::Gru => "gru",
            Self::Rnn => "rnn",
            Self::Direct => "direct",
            Self::Affine => "affine",
        }
    }

    /// Whether it is a recurrent network.
    pub fn is_recurrent(self) -> bool {
        matches!(self, Self::Lstm | Self::Gru | Self::Rnn)
    }
}

/// Base of the network; see [`Base`](hydroid_core::model::recurrent::BaseModel).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BaseKind {
    /// No base: the network outputs the next outputs.
    #[default]
    Nothing,
    /// Present outputs: the network outputs increments.
    Hold,
    /// Equations of motion, given by the caller: the network outputs their residual over a sample, or over each sample
    /// of the horizon of a direct predictor.
    Equations,
}

/// Precision of weights and gradients in training; the weights of the model are in double precision.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// Single precision: twice as fast, sufficient for noisy logs.
    #[default]
    F32,
    /// Double precision.
    F64,
}

/// Step-size schedule; see [`rate`](super::schedule::rate).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Schedule {
    /// Constant.
    Constant,
    /// Half a cosine from the peak to nearly zero.
    Cosine,
    /// Warm-up to the peak, then half a cosine to nearly zero.
    #[default]
    OneCycle,
}

/// Options of a training. Times are in seconds; `None` is derived from the runs as stated at each field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
// Switches of the options file.
#[allow(clippy::struct_excessive_bools)]
pub struct TrainOptions {
    /// Kind of network.
    pub cell: CellKind,
    /// Cells or units of each layer.
    pub hidden: usize,
    /// Hidden layers; default 2 (vanilla network), 3 (direct predictor), 1 (control-affine, LSTM, GRU).
    pub layers: Option<usize>,
    /// Length of the projection of the LSTM's `h`; `None` for no projection.
    pub projection: Option<usize>,
    /// Whether a linear output layer follows the cell; otherwise the hidden state is the output.
    pub read_out: bool,
    /// Whether outputs are fed back as inputs: measured in the wash-out, predicted in a rollout.
    pub feedback: bool,
    /// Base of the network.
    pub base: BaseKind,
    /// Wash-out \[s\], in which the hidden state converges from zero without loss; default 100 samples, at most an
    /// eighth of the longest run. The gradient includes the wash-out.
    pub wash_out_s: Option<f64>,
    /// History of a direct predictor \[s\], the present sample included; default 40 samples.
    pub history_s: Option<f64>,
    /// Compared time of a window \[s\]; default 200 samples, at most a quarter of the longest run. For a direct
    /// predictor its horizon; default 20 samples.
    pub window_s: Option<f64>,
    /// Time before the origin over which an observer estimates the initial state of a control-affine network \[s\];
    /// `None` to start from the last measurement.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub settle_s: Option<f64>,
    /// Largest number of passes over the training runs.
    pub epochs: usize,
    /// Windows of an optimizer step; fewer if an epoch would have less than 8 steps.
    pub batch: usize,
    /// Peak step size.
    pub learning_rate: f64,
    /// Step-size schedule.
    pub schedule: Schedule,
    /// Decoupled weight decay: each step shrinks the weights by this times the step size.
    pub weight_decay: f64,
    /// Largest norm of the gradient; larger ones are clipped. Infinite for no clipping.
    pub clip: f64,
    /// Number of trainings from different initial weights; the one with the least validation error is selected.
    pub restarts: usize,
    /// Whether the selected restart is trained again on training and validation runs ([`Refit`](super::Refit)).
    pub refit: bool,
    /// Whether the best weights of all restarts (at most 50) form an ensemble of direct predictors
    /// ([`Trained::members`](super::Trained)), or the average that is a control-affine network.
    pub ensemble: bool,
    /// Seed of initial weights and of the order of windows.
    pub seed: u64,
    /// Precision of the training.
    pub precision: Precision,
    /// Largest wall-clock time \[s\]. The number of epochs is chosen to fit it and depends on the machine; it is
    /// reported in [`Trained::epochs`](super::Trained::epochs). A resumed training keeps its number of epochs and has
    /// the whole time again.
    pub budget_s: Option<f64>,
    /// Epochs without a better validation error after which a restart stops; `None` for never.
    pub patience: Option<usize>,
    /// Weight of the RMS error of each output in the loss; empty for all 1. An output with weight 0 is not learned.
    pub channel_weights: Vec<f64>,
    /// Static map of each input's actuator in a control-affine network.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub maps: Vec<Map>,
}

impl Default for TrainOptions {
    fn default() -> Self {
        Self {
            cell: CellKind::Lstm,
            hidden: 18,
            layers: None,
            projection: None,
            read_out: true,
            feedback: false,
            base: BaseKind::Nothing,
            wash_out_s: None,
            history_s: None,
            window_s: None,
            settle_s: None,
            epochs: 500,
            batch: 32,
            learning_rate: 0.03,
            schedule: Schedule::OneCycle,
            weight_decay: 0.0,
            clip: 1.0,
            restarts: 1,
            refit: false,
            ensemble: false,
            seed: 0,
            precision: Precision::F32,
            budget_s: None,
            patience: None,
            channel_weights: Vec::new(),
            maps: Vec::new(),
        }
    }
}

impl TrainOptions {
    /// Defaults of a kind of network.
    pub fn of(cell: CellKind) -> Self {
        match cell {
            CellKind::Lstm | CellKind::Gru | CellKind::Rnn => Self { cell, ..Self::default() },
            CellKind::Direct => Self {
                cell,
                hidden: 256,
                feedback: true,
                epochs: 60,
                batch: 256,
                learning_rate: 0.002,
                ..Self::default()
            },
            CellKind::Affine => Self {
                cell,
                hidden: 64,
                feedback: true,
                epochs: 150,
                batch: 32,
                learning_rate: 0.03,
                ..Self::default()
            },
        }
    }

    /// Samples of history and horizon of a direct predictor.
    pub fn spans(&self, dt: f64) -> (usize, usize) {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive, and it saturates"
        )]
        let samples = |seconds: Option<f64>, default: usize| {
            seconds.map_or(default, |s| ((s / dt).round().min(1e12) as usize).max(1))
        };
        (samples(self.history_s, HISTORY), samples(self.window_s, HORIZON))
    }

    /// Network of a direct predictor with `(history, horizon)` in samples.
    ///
    /// # Errors
    /// If an option does not apply or the sizes are invalid.
    pub fn perceptron(
        &self,
        inputs: usize,
        outputs: usize,
        (history, horizon): (usize, usize),
    ) -> Result<Perceptron, TrainError> {
        for (what, wrong, needed) in [
            ("feedback", !self.feedback, "true, or leave it out: a direct predictor receives its outputs"),
            ("read_out", !self.read_out, "true, or leave it out: a direct predictor has a read-out"),
        ] {
            if wrong {
                return Err(setting(what, &"false", needed));
            }
        }
        if let Some(projection) = self.projection {
            return Err(setting("projection", &projection, "left out: only lstm has a projection"));
        }
        if let Some(seconds) = self.settle_s {
            return Err(setting("settle_s", &seconds, OF_AFFINE));
        }
        if let Some(seconds) = self.wash_out_s {
            let needed = "left out: a direct predictor has history_s";
            return Err(setting("wash_out_s", &seconds, needed));
        }
        for (what, given) in [("history", history), ("horizon", horizon)] {
            if given > Direct::LONGEST {
                return Err(TrainError::Network { error: DirectError::Span { what, given }.to_string() });
            }
        }
        let (reads, gives) = Direct::lengths(history, horizon, outputs, inputs);
        let layers = self.layers.unwrap_or(3);
        if layers > Perceptron::DEEPEST {
            return Err(setting("layers", &layers, "at most 64"));
        }
        let network = Perceptron { inputs: reads, hidden: vec![self.hidden; layers], outputs: gives };
        network.check().map_err(|error| TrainError::Network { error: error.to_string() })?;
        Ok(network)
    }

    /// Perceptron of a control-affine network.
    ///
    /// # Errors
    /// If an option does not apply or the sizes are invalid.
    pub fn control_affine(&self, inputs: usize, outputs: usize) -> Result<Perceptron, TrainError> {
        for (what, given) in [
            ("feedback", !self.feedback),
            ("read_out", !self.read_out),
            ("base", self.base != BaseKind::Nothing),
            ("projection", self.projection.is_some()),
            ("history_s", self.history_s.is_some()),
        ] {
            if given {
                return Err(setting(what, &"given", "left out: a control-affine network has none to choose"));
            }
        }
        if self.maps.len() != inputs {
            let needed = "one map for each input: identity, sine or signed_square";
            return Err(setting("maps", &self.maps.len(), needed));
        }
        let layers = self.layers.unwrap_or(1);
        if layers > Perceptron::DEEPEST {
            return Err(setting("layers", &layers, "at most 64"));
        }
        let network = Perceptron {
            inputs: outputs,
            hidden: vec![self.hidden; layers],
            outputs: outputs * (1 + inputs),
        };
        network.check().map_err(|error| TrainError::Network { error: error.to_string() })?;
        if self.ensemble {
            // The average of all restarts is one network with the units of all of them.
            if layers == 0 {
                return Err(setting("layers", &layers, "1 or more for an ensemble"));
            }
            let mean = Perceptron {
                hidden: vec![self.restarts.saturating_mul(self.hidden); layers],
                ..network.clone()
            };
            if let Err(error) = mean.check() {
                let error = format!(
                    "the mean of {} restarts has {error}: fewer of them, or of units, are possible",
                    self.restarts
                );
                return Err(TrainError::Network { error });
            }
        }
        Ok(network)
    }

    /// Recurrent network.
    ///
    /// # Errors
    /// If the sizes are invalid.
    pub fn network(&self, inputs: usize, outputs: usize) -> Result<Network, TrainError> {
        let hidden = self.hidden;
        let cell = match self.cell {
            CellKind::Lstm => Cell::Lstm { hidden, projection: self.projection },
            CellKind::Gru => Cell::Gru { hidden },
            CellKind::Rnn => Cell::Vanilla { hidden, layers: self.layers.unwrap_or(2) },
            CellKind::Direct | CellKind::Affine => {
                return Err(setting("cell", &self.cell.name(), "lstm, gru or rnn for a recurrent network"));
            }
        };
        if self.history_s.is_some() || self.ensemble {
            let what = if self.ensemble { "ensemble" } else { "history_s" };
            return Err(setting(what, &"given", "left out: it is for direct predictors"));
        }
        if let Some(seconds) = self.settle_s {
            return Err(setting("settle_s", &seconds, OF_AFFINE));
        }
        if self.cell != CellKind::Rnn && self.layers.is_some_and(|layers| layers != 1) {
            let needed = "1 for lstm and gru: only rnn has layers";
            return Err(setting("layers", &self.layers.unwrap_or(0), needed));
        }
        if self.cell != CellKind::Lstm && self.projection.is_some() {
            let needed = "left out: only lstm has a projection";
            return Err(setting("projection", &self.projection.unwrap_or(0), needed));
        }
        let inputs = inputs + if self.feedback { outputs } else { 0 };
        let network = Network { cell, inputs, outputs, read_out: self.read_out };
        network.check().map_err(|error: NetworkError| TrainError::Network { error: error.to_string() })?;
        Ok(network)
    }

    /// Checks the ranges of all numbers.
    ///
    /// # Errors
    /// The first invalid option.
    pub fn check(&self, outputs: usize) -> Result<(), TrainError> {
        for (what, value) in [("epochs", self.epochs), ("batch", self.batch), ("restarts", self.restarts)] {
            if value == 0 {
                return Err(setting(what, &value, "at least 1"));
            }
        }
        if self.ensemble && self.restarts < 2 {
            return Err(setting("restarts", &self.restarts, "2 or more for an ensemble"));
        }
        if self.ensemble && self.refit && self.cell == CellKind::Affine {
            let needed = "false with an ensemble of control-affine networks: it trains one network again";
            return Err(setting("refit", &true, needed));
        }
        if self.patience == Some(0) {
            return Err(setting("patience", &0, "at least 1, or leave it out to train to the end"));
        }
        for (what, value, most) in [
            ("batch", self.batch, 1 << 20),
            ("restarts", self.restarts, 1 << 12),
            ("epochs", self.epochs, 1 << 30),
        ] {
            if value > most {
                return Err(setting(what, &value, "fewer"));
            }
        }
        let positive = |value: f64| value.is_finite() && value > 0.0;
        if !positive(self.learning_rate) {
            return Err(setting("learning_rate", &self.learning_rate, "a positive number, such as 0.01"));
        }
        if self.clip.is_nan() || self.clip <= 0.0 {
            return Err(setting("clip", &self.clip, "a positive number, such as 1"));
        }
        if !(self.weight_decay.is_finite() && self.weight_decay >= 0.0) {
            return Err(setting("weight_decay", &self.weight_decay, "zero or a positive number"));
        }
        for (what, value) in [
            ("wash_out_s", self.wash_out_s),
            ("history_s", self.history_s),
            ("window_s", self.window_s),
            ("settle_s", self.settle_s),
            ("budget_s", self.budget_s),
        ] {
            if let Some(value) = value
                && !positive(value)
            {
                return Err(setting(what, &value, "a positive number of seconds"));
            }
        }
        let weights = &self.channel_weights;
        let usable = |weight: &f64| weight.is_finite() && *weight >= 0.0;
        if !weights.is_empty()
            && (weights.len() != outputs || !weights.iter().all(usable) || weights.iter().all(|w| *w == 0.0))
        {
            let value = format!("{weights:?}");
            return Err(TrainError::InvalidOption {
                what: "channel_weights",
                value,
                needed: "one number for each output, none negative and not all zero",
            });
        }
        Ok(())
    }
}

/// Default history and horizon of a direct predictor \[samples\].
const HISTORY: usize = 40;
const OF_AFFINE: &str = "left out: it is for control-affine networks";
const HORIZON: usize = 20;

fn setting(what: &'static str, value: &dyn Display, needed: &'static str) -> TrainError {
    TrainError::InvalidOption { what, value: value.to_string(), needed }
}
