//! Logs that were dropped on the page.

use std::ops::ControlFlow;

use hydroid::config::{Config, Logs, default_horizon, default_origin_stride};
use hydroid::identify::{Method, identify_with_stages};
use hydroid::log::{self, RawLog, Trajectory};
use hydroid::manoeuvre::compare;
use hydroid::model::Reading;
use hydroid::recording::{self, is_recording, read_logs, survey};
use hydroid_io::LogFile;
use hydroid_report::driving;
use serde::Deserialize;
use serde_json::{Value, json};
use wasm_bindgen::prelude::*;

use crate::error::{failed, from_json, message, to_json};
use crate::identified::Identified;
use crate::readings::Readings;
use crate::series::Series;
use crate::vessel::Vessel;

/// Parts of a series in a plot.
const PARTS: usize = 600;

/// Files in memory.
#[wasm_bindgen]
#[derive(Default)]
pub struct Files {
    list: Vec<LogFile>,
    readings: Readings,
}

/// What the page asks for: names of files, methods, and the sections of `hydroid.toml`.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Request {
    train: Vec<String>,
    validate: Vec<String>,
    test: Vec<String>,
    methods: Vec<Method>,
    config: Config,
    title: String,
    /// Only the first seconds of the runs to learn from.
    first_s: Option<f64>,
}

#[wasm_bindgen]
impl Files {
    /// No files.
    #[wasm_bindgen(constructor)]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a file, or replaces the one of this name.
    pub fn add(&mut self, name: &str, content: Vec<u8>) {
        self.remove(name);
        self.list.push(LogFile::in_memory(name, content));
    }

    /// Removes a file.
    pub fn remove(&mut self, name: &str) {
        self.list.retain(|file| file.name() != name);
        self.readings.forget(name);
    }

    /// What is in a file, and what its columns look like: the survey and the proposal of a recording, the inspection of a
    /// table, or the error. `config` has the sections `[log]` and `[boat]`. `told` is called with `reading` and the part that is done.
    ///
    /// # Errors
    /// If the file is unknown, or `config` has a wrong form.
    pub fn inspect(&self, name: &str, config: &str, told: &js_sys::Function) -> Result<String, JsError> {
        let file = self.file(name)?;
        let Reading { mut selection, options } = from_json::<Config>(config)?.reading().map_err(failed)?;
        selection.parts = selection.parts.of_log(name);
        let mut document = json!({ "name": name });
        let mut seen = || -> Result<(), log::LogError> {
            let recording = is_recording(file)?;
            let survey = survey(file, selection.time.as_deref())?;
            document["proposal"] = json!(survey.proposal());
            if recording {
                document["survey"] = json!(survey);
                if selection.outputs.is_empty() && selection.sensors.is_none() && survey.topics.len() != 1 {
                    return Ok(());
                }
            }
            let (inspection, runs) = if recording {
                let mut selection = selection.clone();
                let (files, mut tell) = (std::slice::from_ref(file), |done| tell(told, "reading", done));
                let (mut logs, notes) = self.readings.read(files, &mut selection, &options, &mut tell)?;
                document["reading"] = json!(notes);
                log::inspect_owned(logs.remove(0), &selection, &options)?
            } else {
                log::inspect_file(file, &selection, &options)?
            };
            document["inspection"] = json!(inspection);
            document["runs"] = json!(runs.iter().map(curves).collect::<Vec<Value>>());
            Ok(())
        };
        if let Err(error) = seen() {
            document["error"] = json!(message(&error));
        }
        to_json(&document)
    }

    /// Identifies models. `told` is called with the stage and its fraction of the whole.
    ///
    /// # Errors
    /// If the request has a wrong form, or as the command.
    pub fn identify(&self, request: &str, told: &js_sys::Function) -> Result<Identified, JsError> {
        let mut request: Request = from_json(request)?;
        request.config.identify.methods = request.methods;
        let mut reading = request.config.reading().map_err(failed)?;
        let tell = |stage: &str, done: f64| tell(told, stage, done);
        let names = Logs { train: request.train, validate: request.validate, test: request.test };
        let files =
            names.all().map(|name| self.file(name).cloned()).collect::<Result<Vec<LogFile>, JsError>>()?;
        let mut progress = |done| tell("reading", done);
        let (raw, read) = self
            .readings
            .read(&files, &mut reading.selection, &reading.options, &mut progress)
            .map_err(failed)?;
        let mut raw = raw.into_iter();
        let raw = names.map(|_| raw.next().unwrap_or_else(|| RawLog::without_rows("", Vec::new())));
        let horizon = request.config.identify.horizon;
        let (mut job, mut notes) = request.config.job(reading, &raw, None).map_err(failed)?;
        drop(raw);
        if let Some(seconds) = request.first_s {
            job.split.train = log::beginning(&job.split.train, seconds);
            let cross_validated = job.split.validation.is_empty()
                && job.methods.iter().all(|method| method.is_cross_validated());
            if horizon.is_none() {
                job.horizon = default_horizon(&job.split, cross_validated);
            }
            job.origin_stride = default_origin_stride(&job.split, cross_validated);
        }
        notes.splice(0..0, read);
        let result = identify_with_stages(&job, &mut |stage| {
            tell(stage.method.map_or("evaluation", Method::name), stage.fraction)
        })
        .map_err(failed)?;
        let _ = tell("report", 1.0);
        let sources = names.all().cloned().collect();
        Identified::new(result, &job, notes, request.title, sources)
    }

    /// The table that a file becomes, in CSV: time, outputs and inputs in SI units. `config` has the sections `[log]` and
    /// `[boat]`.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn converted(&self, name: &str, config: &str) -> Result<Vec<u8>, JsError> {
        let Reading { mut selection, options } = from_json::<Config>(config)?.reading().map_err(failed)?;
        let file = std::slice::from_ref(self.file(name)?);
        let (raw, mut notes) =
            self.readings.read(file, &mut selection, &options, &mut quiet).map_err(failed)?;
        let mut text = Vec::new();
        for table in &raw {
            let table = recording::converted(table, &selection, &mut notes).map_err(failed)?;
            table.write_csv(&mut text).map_err(failed)?;
        }
        Ok(text)
    }

    /// Trials in files beside their predictions by a model, which states how the files are read.
    ///
    /// # Errors
    /// If a file cannot be read, or does not fit the model.
    pub fn compare(&self, vessel: &Vessel, names: Vec<String>) -> Result<String, JsError> {
        let mut reading = vessel.0.description.reading.clone();
        let files =
            names.iter().map(|name| self.file(name).cloned()).collect::<Result<Vec<LogFile>, JsError>>()?;
        let (raw, _) =
            read_logs(&files, &mut reading.selection, &reading.options, &mut quiet).map_err(failed)?;
        let runs = log::prepare(&raw, &reading.selection, &reading.options).map_err(failed)?.runs;
        let mut model = vessel.0.clone().for_runs(&runs).map_err(failed)?;
        // The page shows the vessel of the logs, and not its ship.
        model.description.boat.particulars.scale = None;
        let found = compare(&model, &runs, &mut quiet).map_err(failed)?;
        to_json(&found.iter().map(driving::comparison).collect::<Vec<Value>>())
    }

    fn file(&self, name: &str) -> Result<&LogFile, JsError> {
        let found = self.list.iter().find(|file| file.name() == name);
        found.ok_or_else(|| {
            JsError::new(&format!("{name}: the page has no such file any more; drop it again"))
        })
    }
}

/// Tells the page what is done. An error of the page does not stop the work.
fn tell(told: &js_sys::Function, stage: &str, done: f64) -> ControlFlow<()> {
    let _ = told.call2(&JsValue::NULL, &JsValue::from_str(stage), &JsValue::from_f64(done));
    ControlFlow::Continue(())
}

fn quiet(_: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Outputs and commands of a prepared run.
fn curves(run: &Trajectory) -> Value {
    let of = |table: &log::Table| -> Vec<Series> {
        table
            .channels()
            .iter()
            .enumerate()
            .map(|(i, channel)| {
                let point = |k: usize| (run.t0 + k as f64 * run.dt, table.row(k)[i]);
                Series::of(&channel.name, &channel.unit, run.len(), PARTS, point)
            })
            .collect()
    };
    json!({
        "name": run.name,
        "dt": run.dt,
        "samples": run.len(),
        "outputs": of(&run.outputs),
        "inputs": of(&run.inputs),
    })
}
