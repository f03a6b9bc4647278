//! Identified models: what they are, and their file.

mod file;
mod jacobian;
mod latex;
mod members;
mod modes;
mod motion;
mod network;
mod plant;
mod recurrent;
mod text;
mod units;

use std::sync::Arc;

use hydroid_core::adapt::BlendSettings;
use hydroid_core::model::affine::{ControlAffine, ControlAffineSession};
use hydroid_core::model::direct::{Direct, DirectSession};
use hydroid_core::model::recurrent::{Recurrent, RecurrentSession};
use hydroid_core::model::sparse::{Equations, EquationsSession};
use hydroid_core::model::{PlantModel, PlantSession};
use hydroid_core::predict::Predictor;
use serde::{Deserialize, Serialize};

use crate::evaluate::DesignRange;
use crate::log::{Channel, Note, PrepareOptions, Selection, Trajectory};

pub use file::{ModelError, decode, encode, read, write};
pub use jacobian::{JacobianEntry, JacobianText};
pub use members::{MOST_MEMBERS, Members};
pub use modes::{Mode, Modes, NamedGate};
pub use motion::Motion;
pub use plant::PLANT_DT_S;
pub use recurrent::{NamedTensor, cell_text, weights_from_torch};
pub use units::{TermCoefficient, UnitProduct};

/// A model with all that is needed to use it on another log.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// What the numbers mean.
    pub description: Description,
    /// The numbers.
    pub body: Body,
    /// Other numbers that the data allow as well; none where nobody asked for them, or where the model has
    /// learned since.
    pub members: Members,
    /// How its sessions learn on the way; none for a model that stays as it is.
    pub learning: Option<Learning>,
}

/// How a model's sessions learn on the way.
#[derive(Clone, Debug, PartialEq)]
pub struct Learning {
    /// How fast.
    pub settings: BlendSettings,
    /// What the training runs knew of the coefficients: the upper triangle of the second moments of the library in
    /// them, `terms x terms` ([`LinearRegression::r_factor`](crate::sindy::LinearRegression::r_factor)).
    pub root: Vec<f64>,
}

/// What the numbers of a model mean; the JSON in the head of a model file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// Short name in tables and figures: `sindy`, `gru` ...
    pub name: String,
    /// Sample time \[s\].
    pub dt: f64,
    /// Outputs, in the order of the model.
    pub outputs: Vec<Port>,
    /// Inputs, in the order of the model.
    pub inputs: Vec<Port>,
    /// How a log's columns become the model's channels, so that another log is read in the same way.
    pub reading: Reading,
    /// Where the model comes from.
    pub provenance: Provenance,
}

/// How a log becomes runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Reading {
    /// Which columns.
    pub selection: Selection,
    /// On which clock, and how commands are aligned with it.
    pub options: PrepareOptions,
}

/// A channel of a model and the range it is meant for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Port {
    /// Name and unit.
    pub channel: Channel,
    /// Range that it is meant for, if one was stated; else that of the training runs.
    pub range: DesignRange,
    /// Range of the training runs, where another was stated. (Older files do not have it.)
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visited: Option<DesignRange>,
    /// Standard deviation of the white noise of an output in the training runs. (Inputs and older files do not have it.)
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<f64>,
}

/// Where a model comes from: enough to make it again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Version of hydroid that made it.
    pub hydroid: String,
    /// Seed of the run.
    pub seed: u64,
    /// Runs that the coefficients or weights come from.
    pub training: Vec<String>,
    /// Runs that settings were chosen on.
    pub validation: Vec<String>,
    /// Settings that were chosen.
    pub settings: serde_json::Value,
}

/// The numbers of a model, by kind.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// Sparse equations of motion.
    Equations(Arc<Equations>),
    /// A recurrent network, on its own or on top of equations.
    Recurrent(Arc<Recurrent>),
    /// A feed-forward network that gives all outputs of a horizon at once.
    Direct(Arc<Direct>),
    /// A feed-forward network of the rates that is affine in known maps of the inputs.
    Affine(Arc<ControlAffine>),
    /// A vessel with given parameters.
    Plant(Arc<PlantModel>),
}

impl Model {
    /// The kind, as it stands in the file.
    pub fn kind(&self) -> &'static str {
        match self.body {
            Body::Equations(_) if self.learning.is_some() => "recursive_equations",
            Body::Equations(_) => "sparse_equations",
            Body::Recurrent(_) => "recurrent",
            Body::Direct(_) => "direct",
            Body::Affine(_) => "control_affine",
            Body::Plant(_) => "plant",
        }
    }

    /// Number of coefficients or parameters that are not zero; of a network, number of weights.
    pub fn weights(&self) -> usize {
        match &self.body {
            Body::Equations(equations) => equations.active_terms(),
            Body::Recurrent(recurrent) => recurrent.weights.len(),
            Body::Direct(direct) => direct.weights.len(),
            Body::Affine(affine) => affine.weights.len() + affine.effectors.len(),
            Body::Plant(plant) => plant.numbers().iter().filter(|number| **number != 0.0).count(),
        }
    }

    /// A session at the start of a run.
    ///
    /// # Panics
    /// If the body is a network whose parts contradict each other, as [`Recurrent::check`] or [`Direct::check`] tells; those that were read
    /// or trained do not.
    pub fn session(&self) -> Box<dyn Predictor> {
        // Settings were checked when the model was made.
        if let (Some(learning), Some(motion)) = (&self.learning, self.equations())
            && let Ok(learner) = motion.blended(learning)
        {
            return Box::new(learner);
        }
        match &self.body {
            Body::Equations(equations) => Box::new(EquationsSession::new(Arc::clone(equations))),
            Body::Recurrent(recurrent) => match RecurrentSession::new(Arc::clone(recurrent)) {
                Ok(session) => Box::new(session),
                Err(error) => panic!("{error}"),
            },
            Body::Direct(direct) => match DirectSession::new(Arc::clone(direct)) {
                Ok(session) => Box::new(session),
                Err(error) => panic!("{error}"),
            },
            Body::Affine(affine) => match ControlAffineSession::new(Arc::clone(affine)) {
                Ok(session) => Box::new(session),
                Err(error) => panic!("{error}"),
            },
            Body::Plant(plant) => Box::new(PlantSession::new(plant)),
        }
    }

    /// Whether runs can be put through the model as they are.
    ///
    /// # Errors
    /// If channels or sample time are not the model's.
    pub fn check(&self, runs: &[Trajectory]) -> Result<(), Mismatch> {
        let d = &self.description;
        for run in runs {
            let name = || run.name.clone();
            if (run.dt / d.dt - 1.0).abs() > 1e-3 {
                return Err(Mismatch::Step { run: name(), model: d.dt, given: run.dt });
            }
            for (what, ports, channels) in [
                ("outputs", &d.outputs, run.outputs.channels()),
                ("inputs", &d.inputs, run.inputs.channels()),
            ] {
                let list = |names: Vec<&str>| names.join(", ");
                let model = list(ports.iter().map(|p| p.channel.name.as_str()).collect());
                let given = list(channels.iter().map(|c| c.name.as_str()).collect());
                if model != given {
                    return Err(Mismatch::Channels { run: name(), what, model, given });
                }
                for (port, channel) in ports.iter().zip(channels) {
                    let (model, given) = (&port.channel.unit, &channel.unit);
                    if model != given && !model.is_empty() && !given.is_empty() {
                        let (channel, model, given) = (channel.name.clone(), model.clone(), given.clone());
                        return Err(Mismatch::Unit { run: name(), channel, model, given });
                    }
                }
            }
        }
        Ok(())
    }

    /// A warning where runs leave the range of the training runs by more than a tenth of its width: a range that was stated
    /// teaches a model nothing. A file that has the stated range alone is taken at its word.
    pub fn outside(&self, runs: &[Trajectory]) -> Option<Note> {
        let beyond = |port: &Port, values: &mut dyn Iterator<Item = f64>| {
            let range = port.visited.unwrap_or(port.range);
            let (low, high) = values.fold((f64::NAN, f64::NAN), |(a, b), x| (a.min(x), b.max(x)));
            let far = (range.low - low).max(high - range.high) > 0.1 * (range.high - range.low);
            let name = &port.channel.name;
            far.then(|| {
                format!("{name} ({low:.3} to {high:.3} against {:.3} to {:.3})", range.low, range.high)
            })
        };
        let outputs = self
            .description
            .outputs
            .iter()
            .enumerate()
            .filter_map(|(c, port)| beyond(port, &mut runs.iter().flat_map(|run| run.outputs.column(c))));
        let inputs = self
            .description
            .inputs
            .iter()
            .enumerate()
            .filter_map(|(c, port)| beyond(port, &mut runs.iter().flat_map(|run| run.inputs.column(c))));
        let outside: Vec<String> = outputs.chain(inputs).collect();
        let ports = self.description.outputs.iter().chain(&self.description.inputs);
        let old = !self.description.stated().is_empty() && ports.clone().all(|port| port.visited.is_none());
        (!outside.is_empty()).then(|| {
            Note::warning(format!(
                "these runs leave the range that the model {}, in {}",
                if old { "is meant for" } else { "was trained on" },
                outside.join(", ")
            ))
            .with_remedy(
                "it is not to be trusted there; where a channel is off by a factor, look at its unit",
            )
        })
    }

    /// Design ranges of the outputs.
    pub fn output_ranges(&self) -> Vec<DesignRange> {
        self.description.outputs.iter().map(|port| port.range).collect()
    }
}

impl Description {
    /// Channels whose range was stated; that of the others is the range of the training runs.
    pub fn stated(&self) -> Vec<&str> {
        let given = self.provenance.settings["ranges_given"].as_array();
        given.into_iter().flatten().filter_map(serde_json::Value::as_str).collect()
    }

    /// Design ranges of outputs, then inputs.
    pub fn ranges(&self) -> Vec<(f64, f64)> {
        self.outputs.iter().chain(&self.inputs).map(|port| (port.range.low, port.range.high)).collect()
    }
}

/// Runs that are not what a model was made for.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Mismatch {
    /// Another sample time.
    #[error(
        "the model steps {model} s, run '{run}' has a sample time of {given} s: resample it with --dt {model}"
    )]
    Step {
        /// The run.
        run: String,
        /// Of the model \[s\].
        model: f64,
        /// Of the run \[s\].
        given: f64,
    },
    /// Other channels.
    #[error(
        "the model's {what} are {model}, those of run '{run}' are {given}: name the log's columns with --{what}, as in --{what} NAME=COLUMN"
    )]
    Channels {
        /// The run.
        run: String,
        /// `outputs` or `inputs`.
        what: &'static str,
        /// Of the model.
        model: String,
        /// Of the run.
        given: String,
    },
    /// Another unit.
    #[error("the model has '{channel}' in {model}, run '{run}' in {given}")]
    Unit {
        /// The run.
        run: String,
        /// The channel.
        channel: String,
        /// Of the model.
        model: String,
        /// Of the run.
        given: String,
    },
}
