//! An extended Kalman filter over state and weights: for networks, and its options.

use std::sync::Arc;

use hydroid_core::adapt::Adapter;
use hydroid_core::adapt::kalman::{CovarianceForm, FilterOptions, KalmanNetwork, RehearsalOptions};
use hydroid_core::model::recurrent::{BaseModel, Layout, Recurrent, StateFilter};
use serde::{Deserialize, Serialize};

use super::AdaptError;
use crate::log::{Trajectory, noise_level};
use crate::model::{Body, Model, Port};

/// How networks are adapted, and equations by the filter. Variances are in the units of the scaled network, whose inputs and
/// outputs are about 1 in size, or of scaled equations
/// ([`LearnableEquations`](hydroid_core::adapt::kalman::LearnableEquations)), whose state is their outputs.
///
/// The default is for networks; for equations it is [`of_equations`](Self::of_equations).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KalmanOptions {
    /// Variance of each weight at the start: how far the vessel may be from the model.
    pub weight_variance: f64,
    /// Variance that each weight gains in a second: how fast the vessel may change.
    pub weight_noise_per_s: f64,
    /// Variance of each number of the hidden state at the start of a run. That of equations is as uncertain as its
    /// measurement.
    pub state_variance: f64,
    /// Variance that each number of the hidden state gains in a second.
    pub state_noise_per_s: f64,
    /// Standard deviation of the noise of each output, in its unit (default: as in the logs that the model was trained on,
    /// or as in the log that it is adapted on).
    pub noise: Option<Vec<f64>>,
    /// The filter takes the variance of the noise for so many times of what it is: what else the model misses from one sample to
    /// the next is in there.
    pub noise_factor: f64,
    /// Time constant \[s\] with which weights return to those from shore; infinite not to.
    pub leak_s: f64,
    /// Whether, and how, networks rehearse windows of the shore on the way.
    #[serde(default)]
    pub rehearsal: Option<Rehearse>,
    /// Time \[s\] after which a sample counts `1/e`; infinite to forget nothing.
    pub forgetting_s: f64,
    /// Innovations of more standard deviations than this weigh less (Huber); infinite to trust all of them.
    pub huber: f64,
    /// Form of the covariance of the weights.
    #[serde(with = "as_text")]
    pub covariance: CovarianceForm,
}

/// How windows of logs from shore are rehearsed ([`store_rehearsal_windows`](super::store_rehearsal_windows)).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rehearse {
    /// Windows that are kept, spread evenly.
    pub windows: usize,
    /// Length of each \[s\].
    pub window_s: f64,
    /// One sample is rehearsed after so many that are sailed.
    pub every: usize,
    /// Variance of each number of the hidden state at the start of a window.
    pub state_variance: f64,
    /// Variance of the noise of what is rehearsed, in that of what is measured.
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

/// The form of the covariance as on the command line.
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

/// The settings that were used, with what was chosen written out; infinite times are `null`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[expect(missing_docs, reason = "as in KalmanOptions, of which they are")]
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

/// Standard deviation of the noise of an output that is not given, at the least: in widths of its range. Of filtered channels
/// all that is found is too small (0.0002 m/s on the Esso Osaka model); of six networks' errors on its random run that
/// was left out, this was the floor at which an LSTM ran away no more, while simulated sensors are noisier by themselves.
pub(super) const LEAST_NOISE: f64 = 0.0015;

/// Factor of the initial variance and of the noise of the weights of gates (LSTM, GRU), which set the time constants of the
/// network.
const GATE_FACTOR: f64 = 5.0;

/// Process noise of the filter on the state alone, for one sample.
const STATE_FILTER_PROCESS: f64 = 1e-4;

impl KalmanOptions {
    /// Standard deviation of the noise of each output.
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
        // A channel that was smoothed shows no noise, and is not exact for that.
        let least = |port: &Port| LEAST_NOISE * (port.range.high - port.range.low);
        Ok(noise.iter().zip(outputs).map(|(std, port)| std.max(least(port))).collect())
    }

    /// The options of the core's filter where all weights are learned, for outputs of that noise, scaled by `scale`, and steps
    /// of `dt` seconds.
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

    /// These, with the noise that was taken.
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

    /// The options for a network.
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

/// The session that adapts a network, and the settings that it was made with. `runs` tell the noise where nothing else does.
pub(super) fn adapter(
    model: &Model,
    network: &Arc<Recurrent>,
    options: &KalmanOptions,
    runs: &[&Trajectory],
) -> Result<(Box<dyn Adapter>, ResolvedKalman), AdaptError> {
    let noise = options.noise_of(model, runs)?;
    let filter = options.filter_options(network, &noise, model.description.dt);
    let plain = Arc::new(Recurrent { state_filter: None, ..(**network).clone() });
    let rehearsal = options.rehearsal.map(|rehearse| rehearse.of(model.description.dt));
    let adapter = KalmanNetwork::with_rehearsal(plain, filter, rehearsal)?;
    Ok((Box::new(adapter), options.resolved(noise)))
}

/// The model with a filter on its state alone; none for those whose state a measurement enters otherwise.
pub(super) fn filtered(model: &Model, noise: &[f64]) -> Option<Model> {
    let Body::Recurrent(network) = &model.body else { return None };
    if network.feedback || network.base != BaseModel::Nothing {
        return None;
    }
    let variance = |(std, scale): (&f64, &f64)| (std / scale).powi(2);
    let noise = noise.iter().zip(&network.scaling.correction_scale).map(variance).collect();
    let filter = StateFilter { process: STATE_FILTER_PROCESS, initial: 1.0, noise };
    let body = Arc::new(Recurrent { state_filter: Some(filter), ..(**network).clone() });
    Some(Model { body: Body::Recurrent(body), ..model.clone() })
}

/// The model with the weights that an adapter of its network has.
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
        let model =
            Recurrent { network, weights, scaling, base, feedback: false, wash_out, state_filter: None };
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
