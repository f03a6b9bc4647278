//! Claims as data: measures, bounds, reasons.

use serde::{Deserialize, Serialize};

/// A claim of the thesis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// Text of the claim.
    pub claim: String,
    /// Name of the experiment.
    pub experiment: String,
    /// The measured values of the sentence. The worst of their verdicts is that of the claim.
    pub measures: Vec<Measure>,
    /// Reason for each verdict.
    pub because: Reasons,
}

/// Measured values of a claim with common bounds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measure {
    /// Name of the measured value; `*` stands for each of the outputs.
    pub measure: String,
    /// What the values belong to, if the claim has several kinds, such as the name of a network.
    #[serde(default)]
    pub of: String,
    /// Outputs in place of `*`.
    #[serde(default)]
    pub outputs: Vec<String>,
    /// Description of the measured value.
    pub measured: String,
    /// Bound of *reproduced*.
    pub reproduced: Bound,
    /// Bound of *in part*.
    pub partly: Bound,
}

impl Measure {
    /// Outputs and names of the values; a name without `*` has no output.
    pub(super) fn names(&self) -> Vec<(&str, String)> {
        if self.outputs.is_empty() {
            return vec![("", self.measure.clone())];
        }
        self.outputs.iter().map(|output| (output.as_str(), self.measure.replace('*', output))).collect()
    }
}

/// Reason for each verdict, with measured values in braces: `{NAME}`, or `{NAME %}` as a percentage. A name with `*`
/// stands for the values of u, v and r.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reasons {
    pub reproduced: String,
    pub partly: String,
    pub not: String,
}

/// A bound on a measured value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Bound {
    AtMost(f64),
    AtLeast(f64),
    Between(f64, f64),
}

impl Bound {
    /// Whether a value is within the bound; false for NaN.
    pub fn holds(self, figure: f64) -> bool {
        match self {
            Self::AtMost(most) => figure <= most,
            Self::AtLeast(least) => figure >= least,
            Self::Between(least, most) => (least..=most).contains(&figure),
        }
    }

    /// The bound in words.
    pub fn words(self) -> String {
        match self {
            Self::AtMost(most) => format!("≤ {most}"),
            Self::AtLeast(least) => format!("≥ {least}"),
            Self::Between(least, most) => format!("{least} to {most}"),
        }
    }

    /// Ratio of value and bound, at least 1 within the bound.
    pub fn margin(self, figure: f64) -> f64 {
        match self {
            Self::AtMost(most) => most / figure,
            Self::AtLeast(least) => figure / least,
            Self::Between(least, most) => (figure / least).min(most / figure),
        }
    }
}
