//! Figures 1 to 3: drawings of the two modes, the direct predictor, and the adaptation.

use serde::{Deserialize, Serialize};

use super::super::outcome::{Outcome, Picture, Shown};

/// A drawing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schematic {
    /// Subject of the drawing.
    pub of: Drawing,
}

/// Subjects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Drawing {
    /// The two modes of the hydrofoil.
    Modes,
    Predictor,
    Adaptation,
}

impl Schematic {
    pub(super) fn run(&self) -> Outcome {
        let (name, svg, caption) = match self.of {
            Drawing::Modes => ("modes", include_str!("modes.svg"), MODES),
            Drawing::Predictor => ("predictor", include_str!("predictor.svg"), PREDICTOR),
            Drawing::Adaptation => ("adaptation", include_str!("adaptation.svg"), ADAPTATION),
        };
        let picture = Picture::Drawing(svg.to_owned());
        let mut outcome = Outcome::default();
        outcome.pictures.push(Shown { name: name.to_owned(), picture, caption: caption.to_owned() });
        outcome
    }
}

const MODES: &str = "The hydrofoil of the thesis (eq. 7 to 12): below 2.5 m/s it floats with high drag, above it flies with low drag. A sigmoid of the speed blends the two modes. The force of the propeller follows its command with a lag of 1 s and is not measured.";
const PREDICTOR: &str = "The direct predictor (eq. 13 to 17). Inputs: the last 4 outputs, the last 4 commands and the next 19 commands. Outputs: the next 20 samples of all outputs at once.";
const ADAPTATION: &str = "Online adaptation (eq. 18). At each sample the filter corrects hidden state and weights from the difference between measurement and prediction. The guard compares the adapted model with the reference model and selects the model that predicts.";
