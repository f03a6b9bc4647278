//! The result of an identification.

use std::ops::ControlFlow;

use hydroid::evaluate::{Evaluation, Options, evaluate};
use hydroid::identify::{Candidate, IdentifyResult, Job};
use hydroid::log::{Note, Trajectory};
use hydroid::model;
use hydroid_report::Context;
use serde_json::{Value, json};
use wasm_bindgen::prelude::*;

use crate::error::failed;

/// Models with their errors, and the report.
#[wasm_bindgen]
pub struct Identified {
    result: IdentifyResult,
    notes: Vec<Note>,
    report: String,
    models: Vec<Value>,
}

impl Identified {
    pub(crate) fn new(
        result: IdentifyResult,
        job: &Job,
        notes: Vec<Note>,
        title: String,
        sources: Vec<String>,
    ) -> Result<Self, JsError> {
        let context = Context {
            title: if title.is_empty() { String::from("Identification") } else { title },
            command: String::from("hydroid in the browser"),
            sources,
            notes: notes.clone(),
            seed: job.seed,
            ..Context::default()
        };
        let report = hydroid_report::identification(&result, &job.split, &context).map_err(failed)?;
        let best = result.best.map(|best| &result.candidates[best]);
        let models = result.candidates.iter().map(|one| overview(one, best, job)).collect();
        Ok(Self { result, notes, report, models })
    }
}

#[wasm_bindgen]
impl Identified {
    /// The page of the report.
    pub fn report(&self) -> String {
        self.report.clone()
    }

    /// The document `identify.json`.
    pub fn summary(&self) -> String {
        self.result.summary(&self.notes).to_string()
    }

    /// The models: names, and errors at the longest horizon on the runs that they were fitted to and on those that judge.
    pub fn models(&self) -> String {
        Value::from(self.models.clone()).to_string()
    }

    /// The file of a model.
    ///
    /// # Errors
    /// If there is no such model.
    pub fn file(&self, name: &str) -> Result<Vec<u8>, JsError> {
        model::encode(self.model(name)?).map_err(failed)
    }

    fn model(&self, name: &str) -> Result<&model::Model, JsError> {
        let mut models = self.result.candidates.iter().map(|candidate| &candidate.model);
        models
            .find(|model| model.description.name == name)
            .ok_or_else(|| JsError::new(&format!("there is no model '{name}' in this result")))
    }
}

/// Origins of the rollouts on the runs that a model was fitted to.
const ORIGINS: usize = 1000;

/// A model beside others.
fn overview(candidate: &Candidate, best: Option<&Candidate>, job: &Job) -> Value {
    let Candidate { model, .. } = candidate;
    let runs: Vec<&Trajectory> = job.split.train.iter().collect();
    let samples: usize = runs.iter().map(|run| run.len()).sum();
    let origin_stride = samples.div_ceil(ORIGINS).max(job.origin_stride);
    let options = Options { horizon: job.horizon, origin_stride, ..Options::default() };
    let name = &model.description.name;
    let mut session = model.session();
    let fitted = evaluate(name, session.as_mut(), &model.output_ranges(), &runs, &options, &mut |_| {
        ControlFlow::Continue(())
    });
    let last = |evaluation: &Evaluation| evaluation.nrmse.last().cloned();
    let judged = candidate.judged();
    json!({
        "name": name,
        "best": best.is_some_and(|best| std::ptr::eq(best, candidate)),
        "weights": model.weights(),
        "channels": judged.channels,
        "horizon_s": judged.horizons.last().map(|&steps| steps as f64 * judged.dt),
        "fitted": fitted.ok().as_ref().and_then(last),
        "judged": last(judged),
        "diverged": judged.diverged,
    })
}
