//! Members of committees that learn.

use std::sync::Arc;

use hydroid::key::key;
use hydroid::model::Model;
use hydroid_core::adapt::{CommitteeSession, LearnerConstants};
use hydroid_core::model::committee::Committee;

use super::{Adapter, Method};
use crate::ExportError;
use crate::state_space::{Channels, committee};

/// A member that learns.
#[derive(Clone, Debug)]
pub(crate) struct MemberLearner {
    pub(crate) constants: LearnerConstants,
    pub(crate) outputs: usize,
    /// `(state) -> [scaled terms a clock step ago, outputs now less those a clock step ago]`.
    pub(crate) increment: usize,
    /// Consecutive samples without a missing value that an increment needs.
    pub(crate) needed: usize,
    /// Length of a clock step \[s\].
    pub(crate) clock_s: f64,
}

pub(super) fn adapter(model: &Model, committee: &Arc<Committee>) -> Result<Adapter, ExportError> {
    let session = CommitteeSession::new(Arc::clone(committee)).map_err(|_| super::refusal(model))?;
    if committee.learned() == 0 {
        return Err(ExportError::Unsupported {
            model: model.title(),
            format: "C with an adapter",
            reason: String::from(
                "none of its members learns, because constant members predicted best in training",
            ),
            remedy: format!(
                "export it without {}, or identify equations ({}), which learn",
                key("adapter"),
                key("methods").is("lagged")
            ),
        });
    }
    let mut space = committee::state_space(committee, &Channels::of(model));
    let learner = |constants: LearnerConstants| {
        let shape = *committee.members()[constants.member].equations.shape();
        MemberLearner {
            outputs: shape.outputs,
            increment: committee::increment(&mut space, committee, constants.member, &constants.scales),
            needed: shape.span() + shape.clock + 1,
            clock_s: shape.clock as f64 * shape.dt,
            constants,
        }
    };
    let method = Method::Committee(session.learners().into_iter().map(learner).collect());
    let (space, limit) = space.behind_limits(model);
    Ok(Adapter { space, weights: committee.learned(), limit, method })
}
