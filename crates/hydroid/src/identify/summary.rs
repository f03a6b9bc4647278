//! The result of an identification as a document.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::IdentifyResult;
use crate::log::Note;

impl IdentifyResult {
    /// Models, errors, verdicts, ranges, currents and warnings: `identify.json` without the files of the models. `notes`
    /// are those on the logs.
    pub fn summary(&self, notes: &[Note]) -> Value {
        let model = |candidate: &super::Candidate| {
            json!({
                "kind": candidate.model.kind(),
                "name": candidate.model.description.name,
                "weights": candidate.model.weights(),
                "boat": candidate.model.description.boat,
                "refinement": candidate.found().map(|found| &found.refinement),
                "noise_ratio": candidate.found().and_then(|found| found.noise_ratio.as_ref()),
                "train_seconds": candidate.train_seconds,
                "training": candidate.training.network().map(|trained| json!({
                    "epochs": trained.history.len(),
                    "best_epoch": trained.best_epoch,
                    "restart": trained.restart,
                    "restarts": trained.restarts,
                    "ending": trained.ending,
                    "refit": trained.refit.as_ref().map(|refit| refit.outcome),
                    "history": trained.history,
                })),
                "validation": candidate.validation,
                "test": candidate.test,
            })
        };
        let mut document = json!({
            "models": self.candidates.iter().map(model).collect::<Vec<_>>(),
            "cross_validated": self.cross_validation.is_some(),
            "verdicts": self.verdicts,
            "ranges": self.ranges,
            "currents": self.currents,
            "warnings": notes.iter().chain(&self.warnings).collect::<Vec<_>>(),
        });
        // Without a best model there is no such key.
        if let Some(best) = self.best {
            document["best"] = json!(self.candidates[best].model.description.name);
        }
        if let Some(found) = &self.for_trials {
            let name = |i: usize| self.candidates[i].model.description.name.clone();
            let reasons = found.not_valid.iter().enumerate();
            let reasons = reasons.filter_map(|(i, reason)| Some((name(i), reason.clone()?)));
            document["for_trials"] = json!({
                "model": found.best.map(name),
                "not_valid": reasons.collect::<BTreeMap<_, _>>(),
            });
        }
        if let Some(missing) = &self.missing {
            document["not_enough_data"] = json!(missing);
            document["not_enough_data"]["message"] = json!(missing.describe());
        }
        document
    }
}
