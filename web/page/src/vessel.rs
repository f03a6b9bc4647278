//! A model on the page: what it is, its trials, and its exports.

use std::path::Path;

use hydroid::config::Manoeuvre;
use hydroid::manoeuvre::Track;
use hydroid::model::{self, Model};
use hydroid::plant::InputMap;
use hydroid_export::coefficients::CoefficientOptions;
use hydroid_export::{Format, Options, Precision, export, identifier};
use serde_json::{Value, json};
use wasm_bindgen::prelude::*;

use crate::drive::Drive;
use crate::error::{failed, from_json, message, to_json};

/// Points of a track in a plot.
const POINTS: usize = 800;

/// A model.
#[wasm_bindgen]
pub struct Vessel(Model);

#[wasm_bindgen]
impl Vessel {
    /// A model from its file, or a vessel from the text of its file.
    ///
    /// # Errors
    /// If the bytes are not those of a model.
    pub fn read(name: &str, bytes: &[u8]) -> Result<Self, JsError> {
        model::decode(bytes, Path::new(name)).map(Self).map_err(failed)
    }

    /// Name, kind, channels with ranges, and which inputs push and turn the vessel.
    ///
    /// # Errors
    /// If a number cannot be written as JSON.
    pub fn describe(&self) -> Result<String, JsError> {
        let Self(model) = self;
        let d = &model.description;
        let map = InputMap::find(model);
        to_json(&json!({
            "name": d.name,
            "kind": model.kind(),
            "title": model.title(),
            "dt": d.dt,
            "outputs": d.outputs,
            "inputs": d.inputs,
            "weights": model.weights(),
            "steering": map.as_ref().ok().map(InputMap::steering),
            "not_driven": map.err().map(|error| message(&error)),
        }))
    }

    /// Runs trials. `settings` are those of `hydroid manoeuvre`. The result has the document and the tracks.
    ///
    /// # Errors
    /// If the settings do not fit the vessel, or a trial cannot be run.
    pub fn trials(&self, settings: &str) -> Result<String, JsError> {
        let settings: Manoeuvre = from_json(settings)?;
        let plan = settings.plan(&self.0).map_err(failed)?;
        let trials = plan.run(&self.0, &mut |_| std::ops::ControlFlow::Continue(())).map_err(failed)?;
        let Some(trials) = trials else { return Err(JsError::new("the trials were cancelled")) };
        let mut document = trials.document(&self.0.description.name, &self.0, &plan.options);
        for (of, trial) in trials.trials.iter().enumerate() {
            document["trials"][of]["tracks"] = trial.tracks.iter().map(track).collect();
        }
        to_json(&document)
    }

    /// The files of an export: names and contents, one after the other.
    ///
    /// # Errors
    /// If the format is unknown, or cannot express the model.
    pub fn export(&self, format: &str, name: &str) -> Result<Vec<JsValue>, JsError> {
        let format = match format {
            "c" => Format::C(Precision::Double.into()),
            "casadi" => Format::Casadi,
            "onnx" => Format::Onnx(Precision::Double),
            "sdf" => Format::Sdf(CoefficientOptions::default()),
            "mss" => Format::Mss(CoefficientOptions::default()),
            "latex" => Format::Latex(CoefficientOptions::default()),
            other => return Err(JsError::new(&format!("the format '{other}' is unknown"))),
        };
        let files = export(&self.0, &format, &Options { name: identifier(name) }).map_err(failed)?;
        Ok(files
            .into_iter()
            .flat_map(|file| {
                let content = js_sys::Uint8Array::from(&file.content[..]);
                [JsValue::from_str(&file.name), JsValue::from(content)]
            })
            .collect())
    }

    /// The vessel in motion in a current (velocity of the water, north and east \[m/s\]).
    ///
    /// # Errors
    /// If the model cannot be driven.
    pub fn drive(&self, north: f64, east: f64) -> Result<Drive, JsError> {
        Drive::new(&self.0, [north, east]).map_err(failed)
    }
}

/// Positions of a track, north and east \[m\], with the heading \[rad\] and the time since the order \[s\].
fn track(track: &Track) -> Value {
    let step = track.len().div_ceil(POINTS).max(1);
    let point = |k: usize| {
        let [x, y, psi] = track.eta[k];
        json!([track.time_s(k), x, y, psi])
    };
    (0..track.len()).step_by(step).map(point).collect()
}
