//! What became of a refinement, for reports.

use serde::{Deserialize, Serialize};

/// What became of the refinement of equations that a search has chosen.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Refinement {
    /// How it ended.
    pub outcome: Outcome,
    /// What the regression's predictions over a horizon miss the measurements by (RMS), in units of the noise of the
    /// sensor, of each output.
    pub excess: Option<Vec<f64>>,
    /// Score of the regression's estimate; see [`Trial::score`](crate::sindy::Trial::score).
    pub before: Option<f64>,
    /// What was tried.
    pub attempts: Vec<Attempt>,
    /// Which of these was taken.
    pub taken: Option<usize>,
}

/// How a refinement ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Nobody asked for one.
    #[default]
    Off,
    /// Rollouts of the regression's estimate diverge on the training runs, or these have no whole window: the estimate
    /// stays.
    NoStart,
    /// Not tried: predictions miss the measurements by so much more than the noise that forces which no term has must be
    /// at work, so that the regression's estimate stays.
    FarFromNoise,
    /// No attempt predicts better: the regression's estimate stays.
    NoBetter,
    /// One predicts better, and was taken.
    Taken,
}

/// One length of the windows and one strength of the pull.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Attempt {
    /// Length of a window \[samples\].
    pub horizon: usize,
    /// Strength of the pull towards the regression's estimate.
    pub strength: f64,
    /// Steps of the descent.
    pub steps: usize,
    /// As [`Trial::score`](crate::sindy::Trial::score).
    pub score: Option<f64>,
}

/// A number with two digits that count, or all before the point.
fn two_digits(x: f64) -> String {
    if x < 10.0 { format!("{x:.1}") } else { format!("{x:.0}") }
}

impl Refinement {
    /// The max_excess of the outputs' excesses.
    pub fn max_excess(&self) -> Option<f64> {
        self.excess.iter().flatten().copied().max_by(f64::total_cmp)
    }

    /// In a sentence for people, for samples of `dt` seconds; none where nobody asked.
    pub fn describe(&self, dt: f64) -> Option<String> {
        let before = self.before.map_or_else(String::new, |before| format!(" {before:.4}"));
        let taken = self.taken.and_then(|at| self.attempts.get(at));
        Some(match (self.outcome, taken) {
            (Outcome::Off, _) => return None,
            (Outcome::NoStart, _) => String::from(
                "not refined: rollouts of the regression's estimate diverge on the training runs, or no run is as long as a horizon",
            ),
            (Outcome::FarFromNoise, _) => format!(
                "not refined: predictions miss the measurements by {} times the noise in them, so that what the equations lack rules, not the noise",
                self.max_excess().map_or_else(|| String::from("many"), two_digits)
            ),
            (Outcome::Taken, Some(Attempt { horizon, strength, score: Some(score), .. })) => format!(
                "refined by predictions over {} s: score {score:.4}, the regression's estimate{before} (pull towards it {strength})",
                two_digits(*horizon as f64 * dt),
            ),
            _ => format!(
                "not refined: in none of {} attempts better than the regression's estimate{before}",
                self.attempts.len()
            ),
        })
    }
}
