//! A model, and what is made of it.

use std::ffi::CString;
use std::path::Path;

use hydroid::adapt::{self, AdaptError, Options};
use hydroid::fingerprint::Fingerprint;
use hydroid::model;

use crate::error::{Error, Outcome, Status, c_text};
use crate::session::{Learner, Session};

/// A model: constant after it was read, so that any number of threads can use it.
pub struct Model {
    pub(crate) content: model::Model,
    pub(crate) name: CString,
    pub(crate) kind: CString,
    pub(crate) outputs: Vec<Channel>,
    pub(crate) inputs: Vec<Channel>,
}

/// Texts of an output or an input.
pub(crate) struct Channel {
    pub(crate) name: CString,
    pub(crate) unit: CString,
}

fn file(error: impl std::fmt::Display) -> Error {
    Error::new(Status::File, error.to_string())
}

impl Model {
    pub(crate) fn of(model: model::Model) -> Self {
        let channels = |ports: &[model::Port]| {
            let channels = ports.iter().map(|port| &port.channel);
            channels.map(|c| Channel { name: c_text(&c.name), unit: c_text(&c.unit) }).collect()
        };
        Self {
            name: c_text(&model.description.name),
            kind: c_text(model.kind()),
            outputs: channels(&model.description.outputs),
            inputs: channels(&model.description.inputs),
            content: model,
        }
    }

    pub(crate) fn read(path: &str) -> Outcome<Self> {
        model::read(Path::new(path)).map(Self::of).map_err(file)
    }

    pub(crate) fn decode(bytes: &[u8], name: &str) -> Outcome<Self> {
        model::decode(bytes, Path::new(name)).map(Self::of).map_err(file)
    }

    pub(crate) fn write(&self, path: &str) -> Outcome {
        model::write(&self.content, Path::new(path)).map_err(file)
    }

    /// A vessel at another sample time.
    pub(crate) fn at_step(&self, dt: f64) -> Outcome<Self> {
        let invalid = |message: String| Error::new(Status::Value, message);
        let own = self.content.description.dt;
        let model = self.content.clone().at_step(dt).map_err(|error| invalid(error.to_string()))?;
        if model.description.dt == dt {
            return Ok(Self::of(model));
        }
        Err(invalid(format!(
            "a sample time of {dt} s is for vessels: this model was identified with one of {own} s"
        )))
    }

    pub(crate) fn frozen(&self) -> Self {
        Self::of(self.content.frozen())
    }

    pub(crate) fn session(&self) -> Session {
        Session::of(self.content.session())
    }

    /// A session that learns.
    pub(crate) fn adapter(&self, options: &Options) -> Outcome<Session> {
        let (model, options) = (self.content.clone(), options.clone());
        let (adapter, used) = adapt::adapter(&model, &options, &[]).map_err(|error| self.told(error))?;
        let identity = identity(&model, &options)?;
        Ok(Session::learning(Learner { adapter, model, options, used, identity }))
    }

    /// An error of an adaptation, with the remedies of this library.
    fn told(&self, error: AdaptError) -> Error {
        match error {
            AdaptError::Kind { kind } => Error::new(
                Status::Unsupported,
                format!(
                    "a model of kind '{kind}' cannot be adapted: give one of equations, a committee, a recurrent network, \
                    a direct predictor or a vessel; hydroid_model_session predicts without adaptation"
                ),
            ),
            AdaptError::NoNoise => Error::new(
                Status::Options,
                "the measurement noise is unknown, because the model file does not state it: give standard deviations in \
                `noise` of hydroid_model_adapter",
            ),
            AdaptError::Noise { channel, std } => Error::new(
                Status::Options,
                format!(
                    "the noise of '{channel}' has a standard deviation of {std}: `noise` needs {} positive numbers, one for \
                    each output",
                    self.outputs.len()
                ),
            ),
            AdaptError::Forgetting { given_s, least_s } => Error::new(
                Status::Options,
                format!(
                    "the forgetting time is {given_s} s: at least {least_s:.3} s are needed, which are 9.5 samples; set the \
                    option least_squares.forgetting_s"
                ),
            ),
            other => Error::new(Status::Options, other.to_string()),
        }
    }
}

/// A fingerprint of all on which the memory of an adapter depends, in whole numbers, which no copy changes.
fn identity(model: &model::Model, options: &Options) -> Outcome<[f64; 2]> {
    let internal = |error: &dyn std::fmt::Display| Error::new(Status::Internal, error.to_string());
    let mut fingerprint = Fingerprint::new();
    fingerprint.text(env!("CARGO_PKG_VERSION"));
    fingerprint.bytes(&model::encode(model).map_err(|error| internal(&error))?);
    fingerprint.numbers(&[model.description.dt]);
    fingerprint.text(&serde_json::to_string(options).map_err(|error| internal(&error))?);
    let value = fingerprint.value();
    let halves = [value >> 32, value & 0xffff_ffff];
    Ok(halves.map(|half| half as f64))
}
