//! Models: kinds, description, sessions and files.

mod current;
mod file;
mod inversion;
mod jacobian;
mod kinds;
mod latex;
mod members;
mod modes;
mod moved_together;
mod named_equations;
mod text;
mod torch;
mod trial_errors;
mod uncertainty;
mod units;

use std::collections::BTreeMap;
use std::sync::Arc;

use hydroid_core::adapt::Adapter;
use hydroid_core::adapt::ExpertMixtureOptions;
use hydroid_core::current::{Inner, ThroughWater};
use hydroid_core::model::CraftModelError;
use hydroid_core::model::recurrent::Scaling;
use hydroid_core::predict::Predictor;
use hydroid_core::rate_limit::{RateLimited, RateLimiter};
use serde::{Deserialize, Serialize};

use crate::boat::{Boat, BoatError, Raw, Roles};
use crate::evaluate::{DesignRange, PredictionBands};
use crate::key::key;
use crate::log::{Channel, Note, PrepareOptions, Selection, Trajectory};

pub(crate) use current::MOTION;
pub use current::{CurrentError, CurrentEstimate};
pub use file::{ModelError, decode, encode, read, write};
pub(crate) use inversion::{InvertibleModel, WeightMap};
pub(crate) use kinds::NotInvertible;
pub use kinds::{Body, NamedCraft};
pub use members::Members;
pub use moved_together::MovedTogether;
pub use named_equations::NamedEquations;
pub use torch::{NamedTensor, weights_from_torch};
pub use trial_errors::TrialErrors;
pub use uncertainty::CoefficientUncertainty;
#[doc(hidden)]
pub use {
    jacobian::{JacobianEntry, JacobianText},
    kinds::{NamedMember, cell_text},
    latex::{latex_estimate, latex_symbol, latex_text, latex_unit},
    members::MAX_MEMBERS,
    modes::{Mode, Modes, NamedGate},
    uncertainty::NamedCorrelation,
    units::{TermCoefficient, UnitProduct},
};

/// A model with its description.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Channels, preprocessing and provenance.
    pub description: Description,
    /// Structure and numbers.
    pub body: Body,
    /// Ensemble; empty if none was identified or the model has been adapted since.
    pub members: Members,
    /// Online adaptation of the sessions; `None` for a constant model.
    pub learning: Option<Learning>,
}

/// Online adaptation of a model's sessions by an expert mixture.
#[derive(Clone, Debug, PartialEq)]
pub struct Learning {
    /// Options of the mixture.
    pub settings: ExpertMixtureOptions,
    /// Prior: upper triangular `R` with `R'R = Theta'Theta` of the training runs, `terms x terms`.
    pub r_factor: Vec<f64>,
}

/// Description of a model; the JSON in the head of a model file.
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
    /// Roles of the inputs.
    #[serde(default, skip_serializing_if = "Boat::is_empty")]
    pub boat: Boat,
    /// Preprocessing, so that other logs are read in the same way.
    pub reading: Reading,
    /// Provenance.
    pub provenance: Provenance,
    /// Prediction bands, from the errors on runs that were left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bands: Option<PredictionBands>,
    /// Errors of trials in runs that were left out; empty without such trials.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub trial_errors: Vec<TrialErrors>,
    /// Estimate of the current, if the model predicts the motion through the water.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub current: Option<CurrentEstimate>,
}

/// Preprocessing from a log to runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Reading {
    /// Columns.
    pub selection: Selection,
    /// Sampling and alignment of commands.
    pub options: PrepareOptions,
}

/// A channel of a model and its range.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Port {
    /// Name and unit.
    pub channel: Channel,
    /// Design range, if stated; else the training range.
    pub range: DesignRange,
    /// Training range, if a design range was stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training_range: Option<DesignRange>,
    /// Standard deviation of the white measurement noise of an output; `None` for inputs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<f64>,
    /// Largest rate of the actuator behind an input \[unit/s\]: the model takes its positions in place of the commands
    /// ([`RateLimited`]). `None` for no limit, and for outputs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_limit: Option<f64>,
}

/// Provenance of a model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Version of hydroid.
    pub hydroid: String,
    /// Seed.
    pub seed: u64,
    /// Training runs.
    pub training: Vec<String>,
    /// Validation runs.
    pub validation: Vec<String>,
    /// Selected options.
    pub settings: serde_json::Value,
    /// Outputs that the model predicts no better than their means, or with rollouts that diverge, or that the sensors do not
    /// determine, with the figures that say so.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub not_identified: BTreeMap<String, String>,
    /// Inputs that did not move apart in the training runs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub moved_together: Vec<MovedTogether>,
    /// Whether the model was found not to be for trials and control.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub not_for_trials: bool,
}

impl Model {
    /// Why commands may not be chosen freely: inputs that did not move apart in the training runs.
    pub fn moves_together(&self) -> Option<String> {
        let Description { inputs, provenance, .. } = &self.description;
        let together = provenance.moved_together.first()?;
        let [name, names] = [together.name(inputs), together.inputs(inputs).join(" and ")];
        Some(format!(
            "{names} did not move apart in the logs of the model ({name} hardly moved): it does not know what each of them does"
        ))
    }

    /// Which of some outputs is not identified, and why: what follows from it is not valid.
    pub fn not_identified(&self, outputs: &[&str]) -> Option<String> {
        let not_identified = &self.description.provenance.not_identified;
        let (name, why) = outputs.iter().find_map(|name| not_identified.get_key_value(*name))?;
        Some(format!("{name} is not identified: {why}"))
    }

    /// Kind of the model, as in the file.
    pub fn kind(&self) -> &'static str {
        self.body.kind().name(self)
    }

    /// Kind of the model in words.
    pub fn title(&self) -> &'static str {
        self.body.kind().title(self)
    }

    /// Number of weights of a network, or of non-zero coefficients or parameters.
    pub fn weights(&self) -> usize {
        self.body.kind().weights()
    }

    /// A session at the start of a run.
    ///
    /// # Panics
    /// If the body is an inconsistent network or the options of the current are invalid, which reading and training exclude.
    pub fn session(&self) -> Box<dyn Predictor> {
        let kind = self.body.kind();
        match kind.learning_session(self) {
            Some(session) => self.whole_adapter(session),
            None => self.whole_session(kind.session(self)),
        }
    }

    /// A session of the motion that the model predicts, with constant weights and positions of the actuators as inputs:
    /// through the water for a model of that motion, without an estimate of the current.
    pub(crate) fn motion_session(&self) -> Box<dyn Predictor> {
        let frozen = self.frozen();
        frozen.body.kind().session(&frozen)
    }

    /// A session of the body as a session of the model: with commands as inputs, and of the motion over ground.
    pub(crate) fn whole_session(&self, session: Box<dyn Predictor>) -> Box<dyn Predictor> {
        let session: Box<dyn Predictor> = match self.in_current(session) {
            Ok(session) => Box::new(session),
            Err(session) => session,
        };
        match self.rate_limiter() {
            Some(limiter) => Box::new(RateLimited::new(session, limiter)),
            None => session,
        }
    }

    /// As [`whole_session`](Self::whole_session), for an adapter.
    pub(crate) fn whole_adapter(&self, adapter: Box<dyn Adapter>) -> Box<dyn Adapter> {
        let adapter: Box<dyn Adapter> = match self.in_current(adapter) {
            Ok(session) => Box::new(session),
            Err(adapter) => adapter,
        };
        match self.rate_limiter() {
            Some(limiter) => Box::new(RateLimited::new(adapter, limiter)),
            None => adapter,
        }
    }

    /// The actuators in front of the model; `None` if no input has a rate limit.
    pub(crate) fn rate_limiter(&self) -> Option<RateLimiter> {
        let d = &self.description;
        RateLimiter::new(d.inputs.iter().map(|port| port.rate_limit), d.dt)
    }

    /// A session with an estimate of the current; the session itself for a model of the motion over ground.
    ///
    /// # Panics
    /// If the options of the current are invalid, which reading and training exclude.
    fn in_current<P: Inner + ?Sized>(&self, session: Box<P>) -> Result<ThroughWater<P>, Box<P>> {
        let Some(current) = &self.description.current else { return Err(session) };
        match ThroughWater::new(session, current.options(&self.description.outputs, self.description.dt)) {
            Some(session) => Ok(session),
            None => panic!("options of the current: {current:?}"),
        }
    }

    /// The model with constant weights: its sessions do not learn.
    #[must_use]
    pub fn frozen(&self) -> Self {
        let body = match &self.body {
            Body::Committee(committee) => Body::Committee(Arc::new(committee.frozen())),
            body => body.clone(),
        };
        Self { body, learning: None, ..self.clone() }
    }

    /// Whether the model is a network.
    pub fn is_network(&self) -> bool {
        self.scaling().is_some()
    }

    /// Scaling of the channels of a network.
    pub fn scaling(&self) -> Option<&Scaling> {
        self.body.kind().scaling()
    }

    /// Description of a network or a committee, line by line; empty for other models.
    pub fn network_text(&self) -> Vec<String> {
        let mut text = self.body.kind().network_text(&self.description);
        if !text.is_empty() {
            text.extend(self.description.rate_limits_text());
        }
        text
    }

    /// Scaling of the channels of a network, line by line; empty for other models.
    pub fn scaling_text(&self) -> Vec<String> {
        let Some(s) = self.scaling() else { return Vec::new() };
        let d = &self.description;
        let line = |kind: &str, name: &str, mean: f64, scale: f64| {
            let sign = if mean < 0.0 { '+' } else { '-' };
            format!("{kind:<7} {name:<12} ({name} {sign} {:.5}) / {scale:.5}", mean.abs())
        };
        let outputs = d.outputs.iter().zip(s.output_mean.iter().zip(&s.output_scale));
        let inputs = d.inputs.iter().zip(s.input_mean.iter().zip(&s.input_scale));
        let lines = outputs.map(|(port, (&m, &k))| line("output", &port.channel.name, m, k));
        lines.chain(inputs.map(|(port, (&m, &k))| line("input", &port.channel.name, m, k))).collect()
    }

    pub(crate) fn invert(&self, motion: [usize; 3]) -> Result<InvertibleModel, NotInvertible> {
        self.body.kind().invert(self, motion)
    }

    pub(crate) fn weight_map(&self) -> Option<WeightMap> {
        self.body.kind().weight_map()
    }

    /// Checks that runs have the channels, units and sample time of the model.
    ///
    /// # Errors
    /// The first difference.
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

    /// The model for runs: a vessel with their sample time. The runs are checked, with a heading where the model estimates
    /// the current.
    ///
    /// # Errors
    /// The first difference.
    pub fn for_runs(self, runs: &[Trajectory]) -> Result<Self, Mismatch> {
        let model = match runs.first() {
            Some(run) => self.at_step(run.dt)?,
            None => self,
        };
        model.check(runs)?;
        model.check_heading(runs)?;
        Ok(model)
    }

    /// Checks that runs have a heading if the model estimates the current.
    ///
    /// # Errors
    /// The first run without a heading.
    pub fn check_heading(&self, runs: &[Trajectory]) -> Result<(), Mismatch> {
        match runs.iter().find(|run| run.heading.is_none()) {
            Some(run) if self.description.current.is_some() => {
                Err(Mismatch::NoHeading { run: run.name.clone() })
            }
            _ => Ok(()),
        }
    }

    /// A warning if runs leave the training range by more than a tenth of its width.
    pub fn outside(&self, runs: &[Trajectory]) -> Option<Note> {
        let beyond = |port: &Port, values: &mut dyn Iterator<Item = f64>| {
            let range = port.training_range.unwrap_or(port.range);
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
        (!outside.is_empty()).then(|| {
            Note::warning(format!(
                "these runs leave the training range of the model in {}",
                outside.join(", ")
            ))
            .with_remedy(
                "predictions are unreliable outside the training range; check the unit of a channel that is off by a factor",
            )
        })
    }

    /// The model with stated roles of inputs, in place of those that it contains.
    ///
    /// # Errors
    /// If there is no such input.
    pub fn with_roles(mut self, roles: &Roles) -> Result<Self, BoatError> {
        let d = &mut self.description;
        let names: Vec<&str> = d.inputs.iter().map(|port| port.channel.name.as_str()).collect();
        d.boat.state(roles, &names)?;
        Ok(self)
    }

    /// Design ranges of the outputs.
    pub fn output_ranges(&self) -> Vec<DesignRange> {
        self.description.outputs.iter().map(|port| port.range).collect()
    }
}

impl Description {
    /// Raw values of each input: by the boat, else by the column of the training logs; `None` if they are those of the model.
    pub fn raw_inputs(&self) -> Vec<Option<Raw>> {
        let column = |name: &str| self.reading.selection.inputs.iter().find(|spec| spec.name == name);
        let of = |port: &Port| self.boat.raw_input(&port.channel, column(&port.channel.name));
        self.inputs.iter().map(of).collect()
    }

    /// Channels with a stated design range.
    pub fn stated(&self) -> Vec<&str> {
        let given = self.provenance.settings["ranges_given"].as_array();
        given.into_iter().flatten().filter_map(serde_json::Value::as_str).collect()
    }

    /// Rate limits of the inputs, line by line: `delta follows its command at 4.000 deg/s at most`.
    pub fn rate_limits_text(&self) -> Vec<String> {
        let line = |port: &Port| {
            let rate = port.rate_limit?;
            let (rate, unit) = match port.channel.unit.as_str() {
                "rad" => (rate.to_degrees(), "deg/s".to_owned()),
                "" | "1" => (rate, "1/s".to_owned()),
                unit => (rate, format!("{unit}/s")),
            };
            Some(format!("{} follows its command at {rate:.3} {unit} at most", port.channel.name))
        };
        self.inputs.iter().filter_map(line).collect()
    }

    /// Design ranges of outputs, then inputs.
    pub fn ranges(&self) -> Vec<(f64, f64)> {
        self.outputs.iter().chain(&self.inputs).map(|port| (port.range.low, port.range.high)).collect()
    }
}

/// Difference between a run and a model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Mismatch {
    /// Another sample time.
    #[error(
        "the model has a sample time of {model} s, and run '{run}' has {given} s: resample it with {}",
        key("dt").is(model)
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
        "the model's {what} are {model}, those of run '{run}' are {given}: name the log's columns, as in {}",
        key(what).is("NAME=COLUMN")
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
    /// The sample time is not one of a vessel.
    #[error(transparent)]
    Vessel(#[from] CraftModelError),
    /// A model with an estimate of the current, and a run without a heading.
    #[error(
        "{run}: the estimate of the current needs a heading that changes with the yaw rate r: name its column, as in {}",
        key("heading").is("yaw [deg]")
    )]
    NoHeading {
        /// The run.
        run: String,
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
