//! What a training is told.

use std::fmt::Display;

use hydroid_core::control::Map;
use hydroid_core::model::direct::{Direct, DirectError, Perceptron};
use hydroid_core::model::recurrent::{Cell, Network, NetworkError};
use serde::{Deserialize, Serialize};

use super::TrainError;

/// Kind of network: the cell of a recurrent one, or none.
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
    /// No cell: a feed-forward network that gives all outputs of a horizon at once
    /// ([`Direct`](hydroid_core::model::direct::Direct)).
    Direct,
    /// No cell: a control-affine network ([`ControlAffine`](hydroid_core::model::affine::ControlAffine)).
    Affine,
}

impl CellKind {
    /// Its name in files, tables and on the command line.
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

/// What the network corrects; see [`Base`](hydroid_core::model::recurrent::Base).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BaseKind {
    /// Nothing: it gives the next outputs themselves.
    #[default]
    Nothing,
    /// The present outputs: it gives increments.
    Hold,
    /// Equations of motion, which the caller gives: it gives what they miss, over a sample, or, as a direct predictor, over
    /// each sample of its horizon.
    Equations,
}

/// Precision in which gradients and weights are computed; the model's weights are in double precision in any case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// Single precision: twice as fast, and as good for noisy logs.
    #[default]
    F32,
    /// Double precision.
    F64,
}

/// How the step size of the optimizer goes over the training; see [`rate`](super::schedule::rate).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Schedule {
    /// The same throughout.
    Constant,
    /// Half a cosine from the peak down to nearly nothing.
    Cosine,
    /// A warm-up to the peak, then half a cosine down to nearly nothing.
    #[default]
    OneCycle,
}

/// Settings of a training. Times are in seconds, so that they mean the same at any sample time; what is not given
/// is taken from the runs (see each field).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
// Switches of a file.
#[allow(clippy::struct_excessive_bools)]
pub struct Settings {
    /// Kind of network.
    pub cell: CellKind,
    /// Cells, or units, of each layer.
    pub hidden: usize,
    /// Layers of a vanilla network (2 where not given), hidden layers of a direct predictor (3 where not given) or of a
    /// control-affine network (1); LSTM and GRU have one.
    pub layers: Option<usize>,
    /// Length to which the LSTM's `h` is projected; not projected where not given.
    pub projection: Option<usize>,
    /// Whether a linear read-out follows the cell; without one the cell shows the outputs themselves.
    pub read_out: bool,
    /// Whether outputs are fed back as inputs: measured while the model walks, predicted in a rollout.
    pub feedback: bool,
    /// What the network corrects.
    pub base: BaseKind,
    /// Time that a window lets the hidden state find itself from zero, without loss \[s\]; 100 samples where not
    /// given, or an eighth of the longest run if that is less. The gradient goes back through it all the same: the
    /// network also learns how to find its state.
    pub wash_out_s: Option<f64>,
    /// Past that a direct predictor sees \[s\], the present sample among it; 40 samples where not given.
    pub history_s: Option<f64>,
    /// Time over which a window compares predictions \[s\]; 200 samples where not given, or a quarter of the longest
    /// run if that is less. Of a direct predictor it is the time that it predicts at once; 20 samples where not given.
    pub window_s: Option<f64>,
    /// Time before its origin over which the state of a window of a control-affine network is drawn towards what is measured
    /// \[s\]; where not given the window begins from what was measured last.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub settle_s: Option<f64>,
    /// Passes over the training runs at the most.
    pub epochs: usize,
    /// Windows of one step of the optimizer; fewer where runs are so short that an epoch would have less than 8 steps.
    pub batch: usize,
    /// Peak step size.
    pub learning_rate: f64,
    /// How the step size goes.
    pub schedule: Schedule,
    /// Decoupled weight decay: each step shrinks the weights by this times the step size.
    pub weight_decay: f64,
    /// Longest gradient; longer ones are shortened to this length. Infinite: none is.
    pub clip: f64,
    /// Trainings from different first weights, in parallel; the best on validation runs is kept.
    pub restarts: usize,
    /// Whether what was chosen is trained once more, over as many epochs, on training and validation runs together; the
    /// model has the last weights of that, unless it went wrong ([`Refit`](super::Refit)).
    pub refit: bool,
    /// Whether the best weights of every restart (of 50 at most) are kept beside the model's ([`Trained::members`](super::Trained)): other
    /// numbers that the data allow as well. For direct predictors; of a control-affine network the model is the mean of all
    /// restarts.
    pub ensemble: bool,
    /// Seed of first weights and of the order of windows.
    pub seed: u64,
    /// Precision of the training.
    pub precision: Precision,
    /// Wall-clock time at the most \[s\]. The number of epochs is made to fit it, so that results depend on the
    /// machine; [`Trained::epochs`](super::Trained::epochs) says how many they were, and the same number under
    /// `epochs` without a budget repeats the training exactly. A training that goes on from a checkpoint keeps its
    /// number of epochs and has the whole time anew.
    pub budget_s: Option<f64>,
    /// Epochs without a better validation error after which a restart gives up; never where not given.
    pub patience: Option<usize>,
    /// Weight of each output's root mean square error in the loss, in the order of outputs, where an error of 1 is a
    /// standard deviation of that output in the training runs; empty: all 1, as in the score. An output with weight 0
    /// is not learned.
    pub channel_weights: Vec<f64>,
    /// How each input's actuator enters the motion of a control-affine network.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub maps: Vec<Map>,
}

impl Default for Settings {
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

impl Settings {
    /// The defaults of a kind of cell.
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

    /// Samples of history and of horizon of a direct predictor, at a sample time.
    pub fn spans(&self, dt: f64) -> (usize, usize) {
        // Longer than any network reads is refused with words; the cast saturates.
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

    /// The network of a direct predictor, for so many inputs and outputs of the model and its history and horizon
    /// \[samples\].
    ///
    /// # Errors
    /// If a setting is not for it, or its sizes cannot be.
    pub fn perceptron(
        &self,
        inputs: usize,
        outputs: usize,
        (history, horizon): (usize, usize),
    ) -> Result<Perceptron, TrainError> {
        for (what, wrong, needed) in [
            ("feedback", !self.feedback, "true, or leave it out: a direct predictor sees its outputs"),
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

    /// The perceptron of a control-affine network for so many inputs and outputs of the model.
    ///
    /// # Errors
    /// If a setting is not for it, or its sizes cannot be.
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
            // The mean of all restarts is one network, with the units of all of them side by side.
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

    /// The recurrent network for so many inputs and outputs of the model.
    ///
    /// # Errors
    /// If its sizes cannot be.
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

    /// Whether the numbers can be.
    ///
    /// # Errors
    /// If one cannot, with what is needed.
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
            return Err(TrainError::Setting {
                what: "channel_weights",
                value,
                needed: "one number for each output, none negative and not all zero",
            });
        }
        Ok(())
    }
}

/// History and horizon of a direct predictor where the settings say nothing \[samples\].
const HISTORY: usize = 40;
/// What is needed of a setting that control-affine networks have.
const OF_AFFINE: &str = "left out: it is for control-affine networks";
const HORIZON: usize = 20;

fn setting(what: &'static str, value: &dyn Display, needed: &'static str) -> TrainError {
    TrainError::Setting { what, value: value.to_string(), needed }
}
