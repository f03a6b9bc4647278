//! Checks of a direct predictor.

use super::model::Direct;
use crate::model::recurrent::{BaseModel, NetworkError, Part, RecurrentError};

/// Reasons why a direct predictor is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum DirectError {
    #[error(transparent)]
    Network(#[from] NetworkError),
    #[error("a {what} of {given} samples is out of range: give 1 to {}", Direct::LONGEST)]
    Span {
        /// `history` or `horizon`.
        what: &'static str,
        given: usize,
    },
    #[error("the network {what} {network} numbers, and outputs, inputs, history and horizon need {model}")]
    Length {
        /// `reads` (input) or `gives` (output).
        what: &'static str,
        network: usize,
        model: usize,
    },
    #[error(transparent)]
    Numbers(RecurrentError),
}

impl Direct {
    /// Checks sizes and numbers.
    ///
    /// # Errors
    /// If sizes contradict one another, a number is not finite, or a scale is not positive.
    pub fn check(&self) -> Result<(), DirectError> {
        self.network.check()?;
        for (what, given) in [("history", self.history), ("horizon", self.horizon)] {
            if !(1..=Self::LONGEST).contains(&given) {
                return Err(DirectError::Span { what, given });
            }
        }
        let (n, m, scaling) = (self.outputs(), self.inputs(), &self.scaling);
        let (reads, gives) = Self::lengths(self.history, self.horizon, n, m);
        for (what, network, model) in
            [("reads", self.network.inputs, reads), ("gives", self.network.outputs, gives)]
        {
            if network != model {
                return Err(DirectError::Length { what, network, model });
            }
        }
        for (part, numbers, expected) in [
            (Part::Weights, &self.weights, self.network.weights()),
            (Part::OutputMean, &scaling.output_mean, n),
            (Part::OutputScale, &scaling.output_scale, n),
            (Part::InputMean, &scaling.input_mean, m),
            (Part::InputScale, &scaling.input_scale, m),
            (Part::CorrectionScale, &scaling.correction_scale, n),
        ] {
            part.check(numbers, expected).map_err(DirectError::Numbers)?;
        }
        if let BaseModel::Equations(equations) = &self.base
            && (equations.inputs(), equations.outputs()) != (m, n)
        {
            let equations = (equations.inputs(), equations.outputs());
            return Err(DirectError::Numbers(RecurrentError::Equations { equations, model: (m, n) }));
        }
        Ok(())
    }
}
