//! Checks of a recurrent model.

use core::fmt;

use super::model::{BaseModel, Recurrent};
use super::network::NetworkError;

/// A part of a recurrent model that holds numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// [`Recurrent::weights`].
    Weights,
    /// [`Scaling::output_mean`](super::Scaling::output_mean).
    OutputMean,
    /// [`Scaling::output_scale`](super::Scaling::output_scale).
    OutputScale,
    /// [`Scaling::input_mean`](super::Scaling::input_mean).
    InputMean,
    /// [`Scaling::input_scale`](super::Scaling::input_scale).
    InputScale,
    /// [`Scaling::correction_scale`](super::Scaling::correction_scale).
    CorrectionScale,
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Weights => "the network's weights",
            Self::OutputMean => "the outputs' means",
            Self::OutputScale => "the outputs' scales",
            Self::InputMean => "the inputs' means",
            Self::InputScale => "the inputs' scales",
            Self::CorrectionScale => "the corrections' scales",
        })
    }
}

/// Reasons why a recurrent model is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum RecurrentError {
    #[error(transparent)]
    Network(#[from] NetworkError),
    #[error("the network has {network} inputs, and the model needs {model}")]
    Inputs {
        network: usize,
        /// Inputs of the model, with feedback also its outputs.
        model: usize,
    },
    #[error("{part}: {expected} numbers expected, {given} given")]
    Length { part: Part, expected: usize, given: usize },
    /// A number is not finite, or not positive (process noise: negative).
    #[error("{part}: number {index} is not a finite {}number", .part.requirement().0)]
    Number { part: Part, index: usize },
    #[error("the base equations have {} inputs and {} outputs, the model {} and {}", .equations.0, .equations.1, .model.0, .model.1)]
    Equations { equations: (usize, usize), model: (usize, usize) },
}

impl Part {
    fn requirement(self) -> (&'static str, fn(f64) -> bool) {
        match self {
            Self::Weights | Self::OutputMean | Self::InputMean => ("", |_| true),
            _ => ("positive ", |x| x > 0.0),
        }
    }

    pub(crate) fn check(self, numbers: &[f64], expected: usize) -> Result<(), RecurrentError> {
        if numbers.len() != expected {
            return Err(RecurrentError::Length { part: self, expected, given: numbers.len() });
        }
        let (_, requirement) = self.requirement();
        let bad = |x: &f64| !x.is_finite() || !requirement(*x);
        numbers.iter().position(bad).map_or(Ok(()), |index| Err(RecurrentError::Number { part: self, index }))
    }
}

impl Recurrent {
    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.network.outputs
    }

    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.scaling.input_mean.len()
    }

    /// Checks sizes and numbers.
    ///
    /// # Errors
    /// If sizes contradict one another, a number is not finite, or a scale or variance is not positive.
    pub fn check(&self) -> Result<(), RecurrentError> {
        self.network.check()?;
        let (inputs, outputs, scaling) = (self.inputs(), self.outputs(), &self.scaling);
        let model = inputs + if self.feedback { outputs } else { 0 };
        if self.network.inputs != model {
            return Err(RecurrentError::Inputs { network: self.network.inputs, model });
        }
        Part::Weights.check(&self.weights, self.network.weights())?;
        Part::OutputMean.check(&scaling.output_mean, outputs)?;
        Part::OutputScale.check(&scaling.output_scale, outputs)?;
        Part::InputMean.check(&scaling.input_mean, inputs)?;
        Part::InputScale.check(&scaling.input_scale, inputs)?;
        Part::CorrectionScale.check(&scaling.correction_scale, outputs)?;
        if let BaseModel::Equations(equations) = &self.base
            && (equations.inputs(), equations.outputs()) != (inputs, outputs)
        {
            let equations = (equations.inputs(), equations.outputs());
            return Err(RecurrentError::Equations { equations, model: (inputs, outputs) });
        }
        Ok(())
    }
}
