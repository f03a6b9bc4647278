//! What the thesis says, judged by what was measured.

use std::collections::BTreeMap;

use serde::Serialize;

use super::outcome::Outcome;
use super::plan::{Bound, Claim};

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
    /// The experiment gave no such figure.
    NotMeasured,
}

impl Holds {
    /// In words.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Reproduced => "reproduced",
            Self::InPart => "in part",
            Self::NotReproduced => "not reproduced",
            Self::NotMeasured => "not measured",
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
    /// The figure, if the experiment gave it.
    pub figure: Option<f64>,
    /// Whether it is so.
    pub verdict: Holds,
    /// By what factor the figure keeps the bound of *reproduced*; below 1 where it does not.
    pub margin: Option<f64>,
    /// What it is reproduced by, and what in part.
    pub bounds: [Bound; 2],
    /// Why.
    pub because: String,
}

/// The claims whose experiment was made.
pub(super) fn judge(claims: &[Claim], outcomes: &BTreeMap<&str, &Outcome>) -> Vec<Judged> {
    let one = |claim: &Claim| {
        let outcome = outcomes.get(claim.experiment.as_str())?;
        let figure = outcome.measures.get(&claim.measure).copied();
        let verdict = match figure {
            None => Holds::NotMeasured,
            Some(figure) if claim.reproduced.holds(figure) => Holds::Reproduced,
            Some(figure) if claim.partly.holds(figure) => Holds::InPart,
            Some(_) => Holds::NotReproduced,
        };
        Some(Judged {
            claim: claim.claim.clone(),
            experiment: claim.experiment.clone(),
            measured: claim.measured.clone(),
            figure,
            verdict,
            margin: figure.map(|figure| claim.reproduced.margin(figure)),
            bounds: [claim.reproduced, claim.partly],
            because: claim.because.clone(),
        })
    };
    claims.iter().filter_map(one).collect()
}
