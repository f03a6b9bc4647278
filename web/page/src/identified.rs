//! The result of an identification.

use hydroid::identify::{IdentifyResult, Job};
use hydroid::log::Note;
use hydroid::model;
use hydroid_report::Context;
use wasm_bindgen::prelude::*;

use crate::error::failed;

/// Models with their errors, and the report.
#[wasm_bindgen]
pub struct Identified {
    result: IdentifyResult,
    notes: Vec<Note>,
    report: String,
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
        Ok(Self { result, notes, report })
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

    /// Names of the models, the best one first.
    pub fn models(&self) -> Vec<String> {
        let name = |index: usize| self.result.candidates[index].model.description.name.clone();
        let others = (0..self.result.candidates.len()).filter(|index| Some(*index) != self.result.best);
        self.result.best.into_iter().chain(others).map(name).collect()
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
