//! A model on the page: what it is, its trials, and its exports.

use std::ops::ControlFlow;
use std::path::Path;

use hydroid::config::Manoeuvre;
use hydroid::model::{self, Model};
use hydroid::plant::{Commands, InputMap, RecordOptions, record};
use hydroid_export::coefficients::CoefficientOptions;
use hydroid_export::{Format, Options, Precision, export, identifier};
use hydroid_report::driving;
use serde_json::Value;
use wasm_bindgen::prelude::*;

use crate::error::{failed, from_json, message, to_json};

/// A model.
#[wasm_bindgen]
pub struct Vessel(pub(crate) Model);

#[wasm_bindgen]
impl Vessel {
    /// A model from its file, or a vessel from the text of its file.
    ///
    /// # Errors
    /// If the bytes are not those of a model.
    pub fn read(name: &str, bytes: &[u8]) -> Result<Self, JsError> {
        model::decode(bytes, Path::new(name)).map(Self).map_err(failed)
    }

    /// What the driving view needs of the model.
    ///
    /// # Errors
    /// If a number cannot be written as JSON.
    pub fn describe(&self) -> Result<String, JsError> {
        let map = InputMap::find(&self.0).map_err(|error| message(&error));
        to_json(&driving::vessel(&self.0, map.as_ref().map_err(String::as_str), None))
    }

    /// Runs trials. `settings` are those of `hydroid manoeuvre`.
    ///
    /// # Errors
    /// If the settings do not fit the vessel, or a trial cannot be run.
    pub fn trials(&self, settings: &str) -> Result<String, JsError> {
        let mut settings: Manoeuvre = from_json(settings)?;
        // The page shows the vessel of the logs, and not its ship.
        settings.scale.get_or_insert(1.0);
        let plan = settings.plan(&self.0).map_err(failed)?;
        let trials = plan.run(&self.0, &mut |_| ControlFlow::Continue(())).map_err(failed)?;
        let Some(trials) = trials else { return Err(JsError::new("the trials were cancelled")) };
        let shown: Vec<Value> =
            trials.trials.iter().filter_map(|trial| driving::trial(trial, &trials)).collect();
        to_json(&shown)
    }

    /// A log of the simulated vessel under changing commands, with measurement noise, in CSV.
    ///
    /// # Errors
    /// If the model cannot be simulated.
    pub fn simulate(&self, duration_s: f64, seed: u32) -> Result<Vec<u8>, JsError> {
        let commands = Commands::Mixed { duration_s };
        let options =
            RecordOptions { commands, seed: seed.into(), noise: 1.0, process_noise: 0.0, current: [0.0; 2] };
        let record = record(&self.0, None, &options, &mut |_| ControlFlow::Continue(())).map_err(failed)?;
        let mut text = Vec::new();
        record.write_csv(&mut text).map_err(failed)?;
        Ok(text)
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
            "mss" => Format::Mss,
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
}
