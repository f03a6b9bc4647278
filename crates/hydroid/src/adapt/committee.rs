//! Adaptation of committees: the members that learn.

use std::sync::Arc;

use hydroid_core::adapt::CommitteeSession;
use hydroid_core::model::committee::Committee;
use serde::Serialize;

use super::AdaptError;
use super::metrics::BAND_80;
use crate::model::{Body, Model};

/// Resolved options.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ResolvedCommittee {
    /// Votes of the members that learn, as a share of all votes.
    pub learning_votes: f64,
}

pub(super) fn adapter(
    model: &Model,
    committee: &Arc<Committee>,
) -> Result<(CommitteeSession, ResolvedCommittee), AdaptError> {
    let votes = |learns: bool| -> u32 {
        let members = committee.members().iter().filter(|member| !learns || member.prior.is_some());
        members.map(|member| member.votes).sum()
    };
    let learning_votes = f64::from(votes(true)) / f64::from(votes(false));
    let adapter =
        CommitteeSession::new(Arc::clone(committee)).map_err(|_| AdaptError::Kind { kind: model.kind() })?;
    Ok((adapter.with_deviations(deviations(model)), ResolvedCommittee { learning_votes }))
}

/// Standard deviations of normal errors whose band of 80 % is the prediction band of the model, for each horizon and
/// output; empty without bands.
fn deviations(model: &Model) -> Vec<f64> {
    let Some(bands) = &model.description.bands else { return Vec::new() };
    let level = bands.levels.iter().position(|level| *level == 0.8);
    let (Some(level), Some(&last)) = (level, bands.horizons.last()) else { return Vec::new() };
    let outputs = model.description.outputs.len();
    (1..=last)
        .flat_map(|horizon| (0..outputs).map(move |c| bands.half_width(level, horizon, c) / BAND_80))
        .collect()
}

pub(super) fn learned(model: &Model, committee: &Committee, weights: &[f64]) -> Result<Model, AdaptError> {
    let own = committee.with_learned(weights).map_err(|_| AdaptError::Weights)?;
    Ok(Model { body: Body::Committee(Arc::new(own)), ..model.clone() })
}
