//! Verdicts on the claims of the thesis.

use std::collections::BTreeMap;

use serde::Serialize;

use super::outcome::Outcome;
use super::plan::{Bound, Claim};

/// Verdict on a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Holds {
    /// Within the bound of *reproduced*.
    Reproduced,
    /// Within the bound of *in part*.
    InPart,
    /// Outside both bounds.
    NotReproduced,
    /// The experiment did not produce the value.
    NotMeasured,
}

impl Holds {
    /// The verdict in words.
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
    /// Text of the claim.
    pub claim: String,
    /// Name of the experiment.
    pub experiment: String,
    /// Description of the measured value.
    pub measured: String,
    /// Measured value, if the experiment produced it.
    pub figure: Option<f64>,
    pub verdict: Holds,
    /// Ratio of the value to the bound of *reproduced*, at least 1 if the bound holds.
    pub margin: Option<f64>,
    /// Bounds of *reproduced* and *in part*.
    pub bounds: [Bound; 2],
    /// Reason for the verdict.
    pub because: String,
}

/// Verdicts on the claims whose experiment was run.
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
