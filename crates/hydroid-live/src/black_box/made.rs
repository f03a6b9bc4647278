//! How an adapter is made, so that it can be made again without the log that it was made on.

use serde::Serialize;

use super::head::{Head, ModelFile};
use crate::stream::differences;
use hydroid::adapt::{AdaptError, KalmanOptions, Options, adapter};
use hydroid::log::Trajectory;
use hydroid::model::Model;
use hydroid_core::adapt::Adapter;

/// How far ahead the farther prediction of a step is \[s\].
const AHEAD_S: f64 = 2.0;

/// Segments of the ring, and the share of the minutes asked for that each of them holds. One is being overwritten at the worst,
/// and a service that is started again begins another: two hold what was asked for.
const SEGMENTS: usize = 4;
const SHARE: f64 = 0.5;

/// Options with everything that was estimated from the runs as a number.
fn resolved(options: &Options, model: &Model, runs: &[&Trajectory]) -> Options {
    // A noise that is unknown is unknown in a replay too, and is handled alike.
    let noise = options.kalman.noise_of(model, runs).ok();
    Options { kalman: KalmanOptions { noise, ..options.kalman.clone() }, ..options.clone() }
}

impl Head {
    /// Of an adapter that [`adapter`] made of these.
    pub(super) fn of(
        model: &Model,
        file: ModelFile,
        adapter: &dyn Adapter,
        (options, runs): (&Options, &[&Trajectory]),
        settings: &impl Serialize,
        minutes: f64,
    ) -> Result<Self, String> {
        let description = &model.description;
        let dt = description.dt;
        // Casts saturate, and NaN is 0.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let samples = |time_s: f64| (time_s / dt).ceil().max(1.0) as usize;
        let mut horizons = vec![1, samples(AHEAD_S - 0.5 * dt).min(1000)];
        horizons.dedup();
        let channels = |ports: &[hydroid::model::Port]| {
            ports.iter().map(|port| port.channel.clone()).collect::<Vec<_>>()
        };
        let head = Self {
            hydroid: env!("CARGO_PKG_VERSION").to_owned(),
            model: file,
            named: [description.name.clone(), model.kind().to_owned()],
            runs: Vec::new(),
            settings: serde_json::to_value(settings).map_err(|e| e.to_string())?,
            options: toml::to_string(&resolved(options, model, runs)).map_err(|e| e.to_string())?,
            dt,
            outputs: channels(&description.outputs),
            inputs: channels(&description.inputs),
            horizons,
            memory: adapter.memory_len(),
            segments: SEGMENTS,
            steps: samples(60.0 * SHARE * minutes),
        };
        head.check().map_err(|e| format!("it would have {e}; give fewer minutes"))?;
        Ok(head)
    }

    /// Whether what another head says goes on where this one stopped.
    pub(super) fn fits(&self, other: &Self) -> Result<(), String> {
        let value = |head: &Self| {
            // The source may be another file of the same stream.
            let head = Self { runs: Vec::new(), ..head.clone() };
            serde_json::to_value(head).unwrap_or_default()
        };
        let mut others = Vec::new();
        differences("", &value(self), &value(other), &mut others);
        if others.is_empty() {
            return Ok(());
        }
        Err(format!(
            "it is there, of another model or other settings ({}), and is not overwritten: put it aside, or name another file",
            others.join("; ")
        ))
    }

    /// The adapter again.
    pub(super) fn adapter(&self, model: &Model) -> Result<Box<dyn Adapter>, String> {
        let (adapter, _) = adapter(model, &self.options()?, &[]).map_err(|e: AdaptError| e.to_string())?;
        let sizes = (adapter.outputs(), adapter.inputs(), adapter.memory_len());
        if sizes != (self.outputs.len(), self.inputs.len(), self.memory) {
            return Err("the model has other sizes".to_owned());
        }
        Ok(adapter)
    }
}
