//! What the thesis says, judged by what was measured.

use std::collections::BTreeMap;

use serde::Serialize;

use super::outcome::Outcome;
use super::plan::Claim;

/// Whether a claim is so.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Holds {
    /// It is.
    Reproduced,
    /// In part.
    InPart,
    /// It is not.
    NotReproduced,
}

impl Holds {
    /// In words.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Reproduced => "reproduced",
            Self::InPart => "in part",
            Self::NotReproduced => "not reproduced",
        }
    }
}

/// A claim with its verdict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// What is claimed.
    pub claim: String,
    /// The experiment that measures it.
    pub experiment: String,
    /// What the figure is.
    pub measured: String,
    /// The figure.
    pub figure: f64,
    /// Whether it is so.
    pub verdict: Holds,
    /// By what factor the figure keeps the bound of *reproduced*; below 1 where it does not.
    pub margin: f64,
    /// Why.
    pub because: String,
}

/// The claims whose experiment was made.
pub(super) fn judge(claims: &[Claim], outcomes: &BTreeMap<&str, &Outcome>) -> Vec<Judged> {
    let one = |claim: &Claim| {
        let outcome = outcomes.get(claim.experiment.as_str())?;
        let figure = *outcome.measures.get(&claim.measure)?;
        let verdict = if claim.reproduced.holds(figure) {
            Holds::Reproduced
        } else if claim.partly.holds(figure) {
            Holds::InPart
        } else {
            Holds::NotReproduced
        };
        Some(Judged {
            claim: claim.claim.clone(),
            experiment: claim.experiment.clone(),
            measured: claim.measured.clone(),
            figure,
            verdict,
            margin: claim.reproduced.margin(figure),
            because: claim.because.clone(),
        })
    };
    claims.iter().filter_map(one).collect()
}
