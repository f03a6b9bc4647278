//! Rebuilding an adapter without its log.

use serde::Serialize;

use super::head::{Head, ModelFile};
use crate::stream::differences;
use hydroid::adapt::{AdaptError, KalmanOptions, Options, adapter};
use hydroid::log::Trajectory;
use hydroid::model::Model;
use hydroid_core::adapt::Adapter;

/// Second horizon of the recorded predictions \[s\].
const SECOND_HORIZON_S: f64 = 2.0;

/// Segments of the ring; two of them hold the requested minutes. In the worst case one segment is being overwritten and
/// a restarted service has begun another.
const SEGMENTS: usize = 4;
const SHARE: f64 = 0.5;

/// Options with all estimated values as numbers.
fn resolved(options: &Options, model: &Model, runs: &[&Trajectory]) -> Options {
    // An unknown noise is also unknown in a replay.
    let noise = options.kalman.noise_of(model, runs).ok();
    Options { kalman: KalmanOptions { noise, ..options.kalman.clone() }, ..options.clone() }
}

impl Head {
    /// Header of an adapter created from these arguments.
    pub(super) fn of(
        model: &Model,
        file: ModelFile,
        adapter: &mut dyn Adapter,
        (options, runs): (&Options, &[&Trajectory]),
        settings: &impl Serialize,
        minutes: f64,
    ) -> Result<Self, String> {
        let description = &model.description;
        let dt = description.dt;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // a whole number of at least 1; a cast saturates
        let samples = |time_s: f64| (time_s / dt).ceil().max(1.0) as usize;
        let mut horizons = vec![1, samples(SECOND_HORIZON_S - 0.5 * dt).min(1000)];
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
        head.check().map_err(|e| format!("the file would have {e}; give fewer minutes"))?;
        Ok(head)
    }

    /// Whether a recording with another header continues this one.
    pub(super) fn fits(&self, other: &Self) -> Result<(), String> {
        let value = |head: &Self| {
            // The stream may have another name.
            let head = Self { runs: Vec::new(), ..head.clone() };
            serde_json::to_value(head).unwrap_or_default()
        };
        let mut others = Vec::new();
        differences("", &value(self), &value(other), &mut others);
        if others.is_empty() {
            return Ok(());
        }
        Err(format!(
            "the file exists with another model or other settings ({}) and is not overwritten: move it, or name another file",
            others.join("; ")
        ))
    }

    pub(super) fn adapter(&self, model: &Model) -> Result<Box<dyn Adapter>, String> {
        let (mut adapter, _) =
            adapter(model, &self.options()?, &[]).map_err(|e: AdaptError| e.to_string())?;
        let sizes = (adapter.outputs(), adapter.inputs(), adapter.memory_len());
        if sizes != (self.outputs.len(), self.inputs.len(), self.memory) {
            return Err("the model has other sizes".to_owned());
        }
        Ok(adapter)
    }
}
