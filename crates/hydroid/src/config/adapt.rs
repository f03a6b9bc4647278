//! Options of online adaptation.
// Help texts come from the comments of the options; brackets are units.
#![expect(rustdoc::broken_intra_doc_links, reason = "the comments are help texts, too")]

use serde::Deserialize;

use super::SettingError;
use crate::adapt::{self, CovarianceForm, InnovationGate, Method, Rehearse};
#[cfg(feature = "arguments")]
use crate::config::value::named;
use crate::key::key;
use crate::model::Model;
use crate::written;

#[cfg(feature = "arguments")]
mod headings {
    pub(super) const LEAST_SQUARES: &str = "Recursive least squares (equations, direct predictors)";
    pub(super) const KALMAN: &str =
        "Extended Kalman filter (recurrent networks, vessels, and equations with learner kalman)";
    pub(super) const GUARD: &str = "Guard and training logs";
}
#[cfg(feature = "arguments")]
use headings::{GUARD, KALMAN, LEAST_SQUARES};

/// Options of online adaptation, of the command, of the section `[adapt]` of a file, and of Python. One that is not given has
/// the default of the kind of the model.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[cfg_attr(feature = "arguments", derive(clap::Args), group(id = "AdaptOptions"))]
#[expect(clippy::struct_excessive_bools, reason = "flags")]
pub struct Adapt {
    /// Method of adaptation (default: least-squares for equations and direct predictors, kalman for networks and vessels)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "METHOD", value_enum))]
    pub learner: Option<Method>,
    /// Forgetting time: age at which a sample has the weight 1/e [s]; inf: none (default: 60; direct predictors 300; kalman inf)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "S", allow_negative_numbers = true))]
    pub forgetting: Option<f64>,
    /// Take the model as one of the motion through the water, and estimate the current beside its weights: standard deviation
    /// of the components of the current at the start of a run [m/s], as in 0.3. Needs a heading
    #[cfg_attr(feature = "arguments", arg(long, value_name = "M/S", allow_negative_numbers = true))]
    pub estimate_current: Option<f64>,
    /// Window of the increments that equations learn from [s] (default: the window of the identification, or 1)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "S", allow_negative_numbers = true, help_heading = LEAST_SQUARES))]
    pub window: Option<f64>,
    /// Weight of the initial model: seconds of excited data that it counts for (default: 10; direct predictors 0.003)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "S", allow_negative_numbers = true, help_heading = LEAST_SQUARES))]
    pub prior: Option<f64>,
    /// Keep coefficients that the data no longer excites, instead of their slow return to the initial model
    #[cfg_attr(feature = "arguments", arg(long, help_heading = LEAST_SQUARES))]
    pub no_leak: bool,
    /// Adapt all terms of the library, also those that the identification left out of an equation (equations)
    #[cfg_attr(feature = "arguments", arg(long, help_heading = LEAST_SQUARES))]
    pub all_terms: bool,
    /// Give outliers the same weight as all other samples (equations)
    #[cfg_attr(feature = "arguments", arg(long, help_heading = LEAST_SQUARES))]
    pub no_gate: bool,
    /// Standard deviation of the noise of each output, in its SI unit: u=0.01,v=0.01,r=0.02 (default: that of the training logs)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "NAME=STD", value_delimiter = ',', value_parser = named::<f64>, help_heading = KALMAN))]
    #[serde(deserialize_with = "written::named")]
    pub noise: Vec<(String, f64)>,
    /// Factor on the variance of the noise; it accounts for model error (default: 3; equations and vessels 1)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "X", help_heading = KALMAN))]
    pub noise_factor: Option<f64>,
    /// Initial variance of each weight of the scaled model (default: 0.02; equations 0.001; vessels 0.01, relative: 10 %)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "P0", help_heading = KALMAN))]
    pub weight_variance: Option<f64>,
    /// Process noise of each weight: variance per second (default: 6e-7; equations and vessels 1e-6)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "Q", help_heading = KALMAN))]
    pub weight_noise: Option<f64>,
    /// Initial variance of each hidden state of a network, scaled (default: 1)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "P0", help_heading = KALMAN))]
    pub state_variance: Option<f64>,
    /// Process noise of each component of the state: variance per second (default: 1e-4; equations 1e-3; vessels 1e-5)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "Q", help_heading = KALMAN))]
    pub state_noise: Option<f64>,
    /// Time constant of the return of the weights to the initial model [s]; inf: no return (default: 33000; equations, vessels inf)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "S", help_heading = KALMAN))]
    pub leak: Option<f64>,
    /// Huber threshold of the innovations [standard deviations]; larger innovations have less weight (default: inf)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "X", help_heading = KALMAN))]
    pub huber: Option<f64>,
    /// Form of the covariance of the weights: full, blocks:GROUP (neighbouring units) (default: full)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "FORM", value_parser = str::parse::<CovarianceForm>, help_heading = KALMAN))]
    #[serde(deserialize_with = "written::text")]
    pub covariance: Option<CovarianceForm>,
    /// Rehearsal of windows of training logs.
    #[cfg_attr(feature = "arguments", arg(skip))]
    pub rehearsal: Option<Rehearse>,
    /// Switch the guard off: learn from every measurement, and always predict with the adapted model
    #[cfg_attr(feature = "arguments", arg(long, help_heading = GUARD))]
    pub no_guard: bool,
}

macro_rules! first {
    ($self:ident, $($option:ident)*) => {
        [$((stringify!($option), $self.$option != Self::default().$option)),*]
            .into_iter()
            .find_map(|(name, is_given)| is_given.then_some(name))
    };
}

impl Adapt {
    /// Options of the adaptation of a model.
    ///
    /// # Errors
    /// If an option is for another kind of models.
    pub fn options(&self, model: &Model) -> Result<adapt::Options, SettingError> {
        let mut options = adapt::Options::of(model);
        options.current_m_s = self.estimate_current;
        let (equations, direct) = (model.equations().is_some(), model.direct().is_some());
        let least_squares = first!(self, window prior no_leak all_terms no_gate);
        let kalman = first!(
            self,
            noise noise_factor weight_variance weight_noise state_variance state_noise leak huber covariance rehearsal
        );
        let refuse = |name: &str, of: &str| {
            Err(SettingError::Option(format!(
                "{} is an option of {of}: this is a model of kind '{}'",
                key(name),
                model.kind()
            )))
        };
        if model.committee().is_some() {
            let any = first!(self, learner forgetting).or(least_squares).or(kalman);
            if let Some(name) = any {
                return Err(SettingError::Option(format!(
                    "{}: a committee has no options of adaptation: its members continue the regression of the training rows, with the weights that cross-validation chose. Leave it out",
                    key(name)
                )));
            }
        } else if direct || equations && self.learner != Some(Method::Kalman) {
            if direct && self.learner == Some(Method::Kalman) {
                return Err(SettingError::Option(format!(
                    "direct predictors adapt by least squares: leave {} out",
                    key("learner").is("kalman")
                )));
            }
            if let Some(name) = kalman {
                let of = format!(
                    "the extended Kalman filter, for a recurrent network, a vessel, or equations with {}",
                    key("learner").is("kalman")
                );
                return refuse(name, &of);
            }
            if let Some(name) = first!(self, window all_terms no_gate).filter(|_| direct) {
                return refuse(name, "equations");
            }
            let settings = &mut options.least_squares;
            settings.forgetting_s = self.forgetting.unwrap_or(settings.forgetting_s);
            settings.window_s = self.window;
            settings.prior_s = self.prior.unwrap_or(settings.prior_s);
            settings.leak = !self.no_leak;
            settings.all_terms = self.all_terms;
            if self.no_gate {
                settings.gate = InnovationGate::OPEN;
            }
        } else {
            if !equations && self.learner == Some(Method::LeastSquares) {
                return Err(SettingError::Option(format!(
                    "{} needs equations or a direct predictor: this is a model of kind '{}', which adapts by the extended Kalman filter",
                    key("learner").is("least-squares"),
                    model.kind()
                )));
            }
            if let Some(name) = least_squares {
                let of = "recursive least squares, for equations or a direct predictor";
                return refuse(name, of);
            }
            if model.recurrent().is_none() {
                options.method = Method::Kalman;
            }
            let settings = &mut options.kalman;
            for (value, into) in [
                (self.forgetting, &mut settings.forgetting_s),
                (self.noise_factor, &mut settings.noise_factor),
                (self.weight_variance, &mut settings.weight_variance),
                (self.weight_noise, &mut settings.weight_noise_per_s),
                (self.state_variance, &mut settings.state_variance),
                (self.state_noise, &mut settings.state_noise_per_s),
                (self.leak, &mut settings.leak_s),
                (self.huber, &mut settings.huber),
            ] {
                *into = value.unwrap_or(*into);
            }
            settings.covariance = self.covariance.unwrap_or(settings.covariance);
            settings.rehearsal = self.rehearsal;
            settings.noise = self.noise(model)?;
        }
        Ok(if self.no_guard { options } else { options.guarded(model) })
    }

    /// The stated noise of all outputs.
    fn noise(&self, model: &Model) -> Result<Option<Vec<f64>>, SettingError> {
        if self.noise.is_empty() {
            return Ok(None);
        }
        let outputs = || model.description.outputs.iter().map(|port| port.channel.name.as_str());
        let wrong = |what: String| SettingError::Option(format!("{}: {what}", key("noise")));
        if let Some((name, _)) = self.noise.iter().find(|(name, _)| !outputs().any(|output| output == name)) {
            let all = outputs().collect::<Vec<_>>().join(", ");
            return Err(wrong(format!("the model has no output '{name}'; its outputs are {all}")));
        }
        let of = |name: &str| {
            let entry = self.noise.iter().find(|(named, _)| named == name);
            entry
                .map(|(_, std)| *std)
                .ok_or_else(|| wrong(format!("the output '{name}' is missing; name all outputs")))
        };
        outputs().map(of).collect::<Result<_, _>>().map(Some)
    }
}
