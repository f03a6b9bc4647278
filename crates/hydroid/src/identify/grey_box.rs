//! The numbers of a vessel file as a method of identification.

use std::sync::Arc;

use hydroid_core::model::CraftModel;
use serde_json::{Map, Value, json};

use super::{CrossValidation, IdentifyError, Job, Parts};
use crate::craft::CraftFile;
use crate::evaluate::DesignRange;
use crate::grey_box::{Estimated, GreyBox, GreyBoxError, GreyBoxOptions, fit};
use crate::log::{Note, Trajectory};
use crate::model::{Body, Model, NamedCraft};
use crate::progress::Progress;

/// Distance from the given number beyond which an estimate is doubtful, in standard deviations of the prior.
const FAR: f64 = 2.0;

/// The vessel fitted to all runs, and for each fold the one fitted without it.
pub(super) fn train(
    job: &Job,
    parts: &Parts<'_>,
    describe: impl Fn(Body, Value) -> Model,
    notes: &mut Vec<Note>,
    progress: Progress<'_>,
) -> Result<(Model, GreyBox, Vec<Model>), IdentifyError> {
    let file = job.vessel.as_ref().ok_or(IdentifyError::NoVessel)?;
    let folds = parts.folds.map_or(0, CrossValidation::folds);
    let mut fitted = |runs: &[&Trajectory], start: Option<&CraftFile>, number: usize| {
        let options = GreyBoxOptions { runs, ranges: &parts.ranges, horizon: job.horizon, start };
        fit(file, &options, &mut |f| progress((number as f64 + f) / (folds + 1) as f64))
    };
    let found = fitted(&parts.train, None, 0)?;
    notes.extend(notes_of(file, &found));
    let body = |file: &CraftFile| {
        let model = CraftModel::new(file.craft.clone(), parts.train[0].dt).map_err(GreyBoxError::from)?;
        Ok::<Body, IdentifyError>(Body::Craft(Arc::new(NamedCraft { model, file: file.clone() })))
    };
    let settings = json!({ "estimates": estimates(&found), "horizon": job.horizon });
    let mut model = describe(body(&found.file)?, settings);
    // The vessel file states the limits of its commands.
    for (port, command) in model.description.inputs.iter_mut().zip(&file.craft.commands) {
        let [low, high] = command.limits;
        port.training_range = port.training_range.or(Some(port.range));
        port.range = DesignRange { low, high };
    }
    let mut left_out = Vec::new();
    for fold in 0..folds {
        let runs = parts.folds.map(|folds| folds.without(fold, &job.split.train)).unwrap_or_default();
        let runs: Vec<&Trajectory> = runs.iter().map(AsRef::as_ref).collect();
        left_out
            .push(Model { body: body(&fitted(&runs, Some(&found.file), fold + 1)?.file)?, ..model.clone() });
    }
    Ok((model, found, left_out))
}

fn estimates(found: &GreyBox) -> Map<String, Value> {
    let entry = |estimated: &Estimated| {
        let entry = json!({
            "given": estimated.given,
            "value": estimated.value,
            "deviation": estimated.deviation,
            "unit": estimated.parameter.unit,
            "informed": estimated.informed,
        });
        (estimated.parameter.path.clone(), entry)
    };
    found.estimates.iter().map(entry).collect()
}

/// Warnings of numbers that the logs do not determine, and of those far from the given ones.
fn notes_of(file: &CraftFile, found: &GreyBox) -> Vec<Note> {
    let names = |which: &dyn Fn(usize) -> bool| -> Option<String> {
        let named = (0..found.estimates.len()).filter(|&i| which(i));
        let named: Vec<&str> = named.map(|i| found.estimates[i].parameter.path.as_str()).collect();
        (!named.is_empty()).then(|| named.join(", "))
    };
    let mut notes = Vec::new();
    if let Some(names) = names(&|i| !found.estimates[i].informed) {
        let message = format!("the logs do not determine {names} by themselves");
        let remedy = "leave them out of estimate, or add logs with motions on which they act";
        notes.push(Note::warning(message).with_remedy(remedy));
    }
    let far = |i: usize| {
        let Estimated { parameter, given, value, .. } = &found.estimates[i];
        let moved = if parameter.signed { (value - given) / given.abs() } else { (value / given).ln() };
        moved.abs() > FAR * file.estimate[i].prior
    };
    if let Some(names) = names(&far) {
        let message = format!(
            "the estimates of {names} are more than {FAR} standard deviations of their priors from the given numbers"
        );
        let remedy = "check the sign of the orders, the law of the thrust and the mass: estimated numbers make up for what is wrong elsewhere; their standard deviations do not contain the error of the model";
        notes.push(Note::warning(message).with_remedy(remedy));
    }
    notes
}
