//! Extended Kalman filter over state and weights: options, and the adapter of recurrent networks.

use std::sync::Arc;

use hydroid_core::adapt::Adapter;
use hydroid_core::adapt::kalman::{CovarianceForm, FilterOptions, KalmanNetwork, RehearsalOptions};
use hydroid_core::model::recurrent::{BaseModel, Layout, Recurrent};
use hydroid_core::predict::Predictor;
use serde::{Deserialize, Serialize};

use super::AdaptError;
use crate::log::{Trajectory, noise_level};
use crate::model::{Body, Model, Port};

/// Options of the extended Kalman filter, with defaults for networks; [`of_equations`](Self::of_equations) and
/// [`of_plants`](Self::of_plants) have those for equations and vessels. Variances are in scaled units: of the scaled
/// network, or of [`LearnableEquations`](hydroid_core::adapt::kalman::LearnableEquations), whose state is their
/// outputs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KalmanOptions {
    /// Initial variance of each weight: difference of the vessel from the model.
    pub weight_variance: f64,
    /// Process noise of each weight \[variance/s\]: rate of change of the vessel.
    pub weight_noise_per_s: f64,
    /// Initial variance of each hidden state. The state of equations has the variance of its measurement.
    pub state_variance: f64,
    /// Process noise of each hidden state \[variance/s\].
    pub state_noise_per_s: f64,
    /// Noise standard deviation of each output, in its unit; default from the training runs or the log to adapt on.
    pub noise: Option<Vec<f64>>,
    /// Factor of the measurement noise variance. A factor above 1 accounts for model error over one sample.
    pub noise_factor: f64,
    /// Time constant \[s\] with which weights return to the reference model; infinite for none.
    pub leak_s: f64,
    /// Rehearsal of windows of the training data, for networks.
    #[serde(default)]
    pub rehearsal: Option<Rehearse>,
    /// Time constant of the forgetting \[s\]: a sample of this age counts `1/e`; infinite for none.
    pub forgetting_s: f64,
    /// Innovations above this number of standard deviations are down-weighted (Huber); infinite for none.
    pub huber: f64,
    /// Form of the covariance of the weights.
    #[serde(with = "as_text")]
    pub covariance: CovarianceForm,
}

/// Rehearsal of windows of the training data ([`store_rehearsal_windows`](super::store_rehearsal_windows)).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rehearse {
    /// Number of windows, evenly distributed over the training data.
    pub windows: usize,
    /// Length of a window \[s\].
    pub window_s: f64,
    /// Number of observed samples for each rehearsed one.
    pub every: usize,
    /// Variance of each hidden state at the start of a window.
    pub state_variance: f64,
    /// Noise variance of a rehearsed sample relative to a measurement.
    pub noise_factor: f64,
}

impl Default for Rehearse {
    fn default() -> Self {
        Self { windows: 32, window_s: 10.0, every: 2, state_variance: 0.1, noise_factor: 1.0 }
    }
}

impl Rehearse {
    fn of(&self, dt: f64) -> RehearsalOptions {
        // Casts saturate.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let samples = (self.window_s / dt).round() as usize;
        RehearsalOptions {
            windows: self.windows,
            samples,
            every: self.every,
            initial_state: self.state_variance,
            noise_factor: self.noise_factor,
        }
    }
}

mod as_text {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    use super::CovarianceForm;

    pub(super) fn serialize<S: Serializer>(form: &CovarianceForm, into: S) -> Result<S::Ok, S::Error> {
        into.collect_str(form)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<CovarianceForm, D::Error> {
        String::deserialize(from)?.parse().map_err(D::Error::custom)
    }
}

impl Default for KalmanOptions {
    fn default() -> Self {
        Self {
            weight_variance: 0.02,
            weight_noise_per_s: 6e-7,
            state_variance: 1.0,
            state_noise_per_s: 1e-4,
            noise: None,
            noise_factor: 3.0,
            leak_s: 33_000.0,
            rehearsal: None,
            forgetting_s: f64::INFINITY,
            huber: f64::INFINITY,
            covariance: CovarianceForm::Full,
        }
    }
}

/// Resolved options; infinite times are `null`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[expect(missing_docs, reason = "documented in KalmanOptions")]
pub struct ResolvedKalman {
    pub weight_variance: f64,
    pub weight_noise_per_s: f64,
    pub state_variance: f64,
    pub state_noise_per_s: f64,
    pub noise: Vec<f64>,
    pub noise_factor: f64,
    pub leak_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rehearsal: Option<Rehearse>,
    pub forgetting_s: f64,
    pub huber: f64,
    pub covariance: String,
}

/// Least standard deviation of an estimated noise, relative to the range of the output. The estimate is too small for
/// filtered channels, and recurrent networks can diverge with it.
pub(super) const LEAST_NOISE: f64 = 0.0015;

/// Factor of initial variance and process noise for the weights of gates (LSTM, GRU), which set the time constants.
const GATE_FACTOR: f64 = 5.0;

/// Process noise of the filter on the state alone, per sample.
const STATE_FILTER_PROCESS: f64 = 1e-4;

impl KalmanOptions {
    /// The options of a filter on the state alone.
    pub(super) fn with_constant_weights(&self) -> Self {
        Self {
            weight_variance: 0.0,
            weight_noise_per_s: 0.0,
            leak_s: f64::INFINITY,
            rehearsal: None,
            forgetting_s: f64::INFINITY,
            covariance: CovarianceForm::Full,
            ..self.clone()
        }
    }

    /// Standard deviation of the measurement noise of each output.
    ///
    /// # Errors
    /// If a given value is not positive and finite, or the noise is unknown and there are no runs.
    pub fn noise_of(&self, model: &Model, runs: &[&Trajectory]) -> Result<Vec<f64>, AdaptError> {
        let outputs = &model.description.outputs;
        let noise: Vec<f64> = if let Some(noise) = &self.noise {
            noise.clone()
        } else if let Some(known) = outputs.iter().map(|port| port.noise).collect() {
            known
        } else if runs.is_empty() {
            return Err(AdaptError::NoNoise);
        } else {
            noise_level(runs)
        };
        let wrong = |std: &f64| !(*std > 0.0 && std.is_finite());
        if noise.len() != outputs.len() {
            return Err(AdaptError::Noise { channel: "outputs".to_owned(), std: f64::NAN });
        }
        if let Some(i) = noise.iter().position(wrong).filter(|_| self.noise.is_some()) {
            return Err(AdaptError::Noise { channel: outputs[i].channel.name.clone(), std: noise[i] });
        }
        if self.noise.is_some() {
            return Ok(noise);
        }
        // A smoothed channel shows no noise, but is not exact.
        let least = |port: &Port| LEAST_NOISE * (port.range.high - port.range.low);
        Ok(noise.iter().zip(outputs).map(|(std, port)| std.max(least(port))).collect())
    }

    /// Filter options with equal variances for all weights, from noise and scale of the outputs and sample time \[s\].
    pub(super) fn uniform(&self, weights: usize, noise: &[f64], scale: &[f64], dt: f64) -> FilterOptions {
        let per_sample = |time_s: f64| 1.0 - (-dt / time_s).exp();
        let scaled = |(std, scale): (&f64, &f64)| self.noise_factor * (std / scale).powi(2);
        let noise: Vec<f64> = noise.iter().zip(scale).map(scaled).collect();
        let state = (self.state_variance, self.state_noise_per_s * dt);
        FilterOptions {
            leak: per_sample(self.leak_s),
            forgetting: 1.0 - per_sample(self.forgetting_s),
            huber: self.huber,
            covariance: self.covariance,
            ..FilterOptions::uniform(
                weights,
                self.weight_variance,
                self.weight_noise_per_s * dt,
                state,
                &noise,
            )
        }
    }

    pub(super) fn resolved(&self, noise: Vec<f64>) -> ResolvedKalman {
        ResolvedKalman {
            weight_variance: self.weight_variance,
            weight_noise_per_s: self.weight_noise_per_s,
            state_variance: self.state_variance,
            state_noise_per_s: self.state_noise_per_s,
            noise,
            noise_factor: self.noise_factor,
            leak_s: self.leak_s,
            rehearsal: self.rehearsal,
            forgetting_s: self.forgetting_s,
            huber: self.huber,
            covariance: self.covariance.to_string(),
        }
    }

    fn filter_options(&self, network: &Recurrent, noise: &[f64], dt: f64) -> FilterOptions {
        let scale = &network.scaling.correction_scale;
        let mut filter = self.uniform(network.weights.len(), noise, scale, dt);
        for place in Layout::new(&network.network).gates(network.network.cell) {
            filter.initial_weights[place] *= GATE_FACTOR;
            filter.weight_noise[place] *= GATE_FACTOR;
        }
        filter
    }
}

/// Options of the filter of a network whose measurement noise the options or the model state.
///
/// # Errors
/// If the noise is unknown or not valid.
#[doc(hidden)]
pub fn network_filter_options(
    model: &Model,
    network: &Recurrent,
    options: &KalmanOptions,
) -> Result<FilterOptions, AdaptError> {
    let noise = options.noise_of(model, &[])?;
    Ok(options.filter_options(network, &noise, model.description.dt))
}

/// Adapter of a network and its resolved options. `runs` give the noise if options and model do not.
pub(super) fn adapter(
    model: &Model,
    network: &Arc<Recurrent>,
    options: &KalmanOptions,
    runs: &[&Trajectory],
) -> Result<(Box<dyn Adapter>, ResolvedKalman), AdaptError> {
    let noise = options.noise_of(model, runs)?;
    let filter = options.filter_options(network, &noise, model.description.dt);
    let rehearsal = options.rehearsal.map(|rehearse| rehearse.of(model.description.dt));
    let adapter = KalmanNetwork::with_rehearsal(Arc::clone(network), filter, rehearsal)?;
    Ok((Box::new(adapter), options.resolved(noise)))
}

/// A session that filters the state alone; `None` for networks with output feedback or a base.
pub(super) fn filtered(model: &Model, noise: &[f64]) -> Result<Option<Box<dyn Predictor>>, AdaptError> {
    let Body::Recurrent(network) = &model.body else { return Ok(None) };
    if network.feedback || network.base != BaseModel::Nothing {
        return Ok(None);
    }
    let variance = |(std, scale): (&f64, &f64)| (std / scale).powi(2);
    let noise: Vec<f64> = noise.iter().zip(&network.scaling.correction_scale).map(variance).collect();
    let session = KalmanNetwork::state_filter(Arc::clone(network), STATE_FILTER_PROCESS, 1.0, &noise)?;
    Ok(Some(model.whole_session(Box::new(session))))
}

pub(super) fn learned(model: &Model, network: &Recurrent, weights: &[f64]) -> Result<Model, AdaptError> {
    if weights.len() != network.weights.len() || weights.iter().any(|w| !w.is_finite()) {
        return Err(AdaptError::Weights);
    }
    let network = Recurrent { weights: weights.to_vec(), ..network.clone() };
    Ok(Model { body: Body::Recurrent(Arc::new(network)), ..model.clone() })
}

#[cfg(test)]
mod tests {
    use hydroid_core::model::recurrent::{Cell, Network, Scaling};

    use super::*;

    #[test]
    fn the_gates_of_a_network_have_their_own_variance() {
        let network = Network { cell: Cell::Gru { hidden: 2 }, inputs: 1, outputs: 1, read_out: true };
        let scaling = Scaling {
            output_mean: vec![0.0],
            output_scale: vec![1.0],
            input_mean: vec![0.0],
            input_scale: vec![1.0],
            correction_scale: vec![1.0],
        };
        let weights = vec![0.1; network.weights()];
        let (base, wash_out) = (BaseModel::Nothing, 0);
        let model = Recurrent { network, weights, scaling, base, feedback: false, wash_out };
        let options = KalmanOptions::default();
        let filter = options.filter_options(&model, &[0.01], 0.1);
        let gates = Layout::new(&network).gates(network.cell);
        for (place, (variance, noise)) in filter.initial_weights.iter().zip(&filter.weight_noise).enumerate()
        {
            let factor = if gates.contains(&place) { 5.0 } else { 1.0 };
            assert_eq!((*variance, *noise), (0.02 * factor, options.weight_noise_per_s * 0.1 * factor));
        }
    }
}
