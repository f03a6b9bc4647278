//! Record of a refinement.

use serde::{Deserialize, Serialize};

/// Record of the refinement of the selected equations.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Refinement {
    /// The outcome.
    pub outcome: Outcome,
    /// RMS prediction error over a horizon relative to the sensor noise, for each output, before the refinement.
    pub excess: Option<Vec<f64>>,
    /// Score of the regression estimate; see [`Trial::score`](crate::sindy::Trial::score).
    pub before: Option<f64>,
    /// All attempts.
    pub attempts: Vec<Attempt>,
    /// Index of the accepted attempt.
    pub taken: Option<usize>,
}

/// Outcome of a refinement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Not requested.
    #[default]
    Off,
    /// Not possible: rollouts of the regression estimate diverge on the training runs, or no run has a whole window.
    NoStart,
    /// Not tried: the prediction errors exceed the sensor noise by far, so model error dominates.
    FarFromNoise,
    /// No attempt has a lower score.
    NoBetter,
    /// An attempt was accepted.
    Taken,
}

/// One window length and one strength of the prior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Attempt {
    /// Length of a window \[samples\].
    pub horizon: usize,
    /// Strength of the prior.
    pub strength: f64,
    /// Number of iterations.
    pub steps: usize,
    /// As [`Trial::score`](crate::sindy::Trial::score).
    pub score: Option<f64>,
}

/// Two significant digits, or all digits before the point.
fn two_digits(x: f64) -> String {
    if x < 10.0 { format!("{x:.1}") } else { format!("{x:.0}") }
}

impl Refinement {
    /// The largest excess of the outputs.
    pub fn max_excess(&self) -> Option<f64> {
        self.excess.iter().flatten().copied().max_by(f64::total_cmp)
    }

    /// Description for the user, for a sample time of `dt` seconds; none if no refinement was requested.
    pub fn describe(&self, dt: f64) -> Option<String> {
        let before = self.before.map_or_else(|| String::from(" diverges"), |before| format!(" {before:.4}"));
        let taken = self.taken.and_then(|at| self.attempts.get(at));
        Some(match (self.outcome, taken) {
            (Outcome::Off, _) => return None,
            (Outcome::NoStart, _) => String::from(
                "not refined: rollouts of the regression's estimate diverge on the training runs, or no run is as long as a horizon",
            ),
            (Outcome::FarFromNoise, _) => format!(
                "not refined: the prediction errors are {} times the sensor noise, so that model error dominates",
                self.max_excess().map_or_else(|| String::from("many"), two_digits)
            ),
            (Outcome::Taken, Some(Attempt { horizon, strength, score: Some(score), .. })) => format!(
                "refined by predictions over {} s: score {score:.4}, the regression's estimate{before} (prior strength {strength})",
                two_digits(*horizon as f64 * dt),
            ),
            _ => format!(
                "not refined: none of {} attempts is better than the regression's estimate{before}",
                self.attempts.len()
            ),
        })
    }
}
