//! Expert mixture (prediction with expert advice): recursive equations with different priors, weighted by their errors.
//!
//! Each expert `i` is a [`RecursiveEquations`] with its own weight of the prior. Two more experts do not adapt: the
//! reference coefficients, and zero coefficients (persistence). At each check every expert is rolled out from its
//! state one horizon ago and compared with the measurement:
//!
//! ```text
//! L_i <- L_i + 1/n sum_c min(((yhat_{i,c} - y_c) / s_c)^2, 25)        L_i = 1 at the start
//! w_i  = (L_i / min_j L_j)^-3,  normalized to the sum 1
//! theta = sum_i w_i theta_i
//! ```
//!
//! for `n` outputs of the scale `s_c`, a fifth of the design range. The method is the polynomially weighted average
//! forecaster (Cesa-Bianchi, Lugosi, *Prediction, Learning, and Games*, 2006, section 2.1).

use alloc::vec;
use alloc::vec::Vec;

use super::equations::RecursiveEquations;
use super::innovation_gate::InnovationGate;
use super::options::{MOST_EXPERTS, MOST_SAMPLES, RecursiveOptions, RecursiveOptionsError};
use super::parametric_session::ParametricSession;
use super::{Health, Innovation, Learning, Outcome, Rehearsing, SaveState, are_variances};
use crate::memory::{MOST_COUNTED, Memory};
use crate::model::sparse::Equations;
use crate::predict::{Predictor, Workspace, delegate, plain};

/// Options of an [`ExpertMixture`].
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ExpertMixtureOptions {
    /// Weight of the reference coefficients for each expert \[s\]; see [`RecursiveOptions::prior_s`].
    pub priors_s: Vec<f64>,
    /// See [`RecursiveOptions::forgetting_s`].
    pub forgetting_s: f64,
    /// See [`RecursiveOptions::window`].
    pub window: usize,
    /// Horizon of the compared predictions \[samples\].
    pub horizon: usize,
    /// Innovation gate of the rows.
    pub gate: InnovationGate,
}

/// Maximum length of the stored snapshots and commands.
const MOST_NUMBERS: usize = 1 << 26;

const CHECKS: usize = 10;

/// Exponent of the loss in the weights: a 26 % larger loss halves the weight.
const POWER: i32 = -3;

/// Bound on a squared error, which limits the effect of a faulty sample or a diverged rollout.
const WORST: f64 = 25.0;

/// An [`Adapter`](super::Adapter) that predicts with the weighted mean of the coefficients of several
/// [`RecursiveEquations`].
///
/// The appropriate prior depends on the change of the vessel: experts with a strong prior predict best on an unchanged
/// vessel, experts with a weak prior on a changed one.
///
/// Snapshot: the snapshot of the mean equations.
#[derive(Clone, Debug)]
pub struct ExpertMixture {
    experts: Vec<RecursiveEquations>,
    mixture: ParametricSession,
    losses: Vec<f64>,
    expert_weights: Vec<f64>,
    inverse: Vec<f64>,
    given: Vec<f64>,
    weights: Vec<f64>,
    past: Past,
    frozen: bool,
}

#[derive(Clone, Debug)]
struct Past {
    horizon: usize,
    stride: usize,
    trial: ParametricSession,
    /// Ring of snapshots, `checks x experts x snapshot`.
    snapshots: Vec<f64>,
    commands: Vec<f64>,
    /// Samples since the last missing measurement.
    seen: usize,
    /// Commands, oldest first.
    unrolled: Vec<f64>,
    predicted: Vec<f64>,
    work: Workspace,
}

impl ExpertMixture {
    /// From identified equations, the design range `(low, high)` of each output, then each input, and the R factor of
    /// the training rows ([`RecursiveEquations::with_r_factor`]).
    ///
    /// # Errors
    /// If the options are invalid, or there is no coefficient to adapt.
    pub fn new(
        equations: &Equations,
        ranges: &[(f64, f64)],
        options: &ExpertMixtureOptions,
        r_factor: Option<&[f64]>,
    ) -> Result<Self, RecursiveOptionsError> {
        let (experts_allowed, samples) = (1..=MOST_EXPERTS, 1..=MOST_SAMPLES);
        if !(experts_allowed.contains(&options.priors_s.len()) && samples.contains(&options.horizon)) {
            return Err(RecursiveOptionsError::Experts);
        }
        let expert = |&prior_s: &f64| {
            let options = RecursiveOptions {
                forgetting_s: options.forgetting_s,
                window: options.window,
                prior_s,
                leak: true,
                all_terms: true,
                gate: options.gate,
            };
            RecursiveEquations::with_r_factor(equations, ranges, &options, r_factor)
                .map(RecursiveEquations::without_deviations)
        };
        let experts = options.priors_s.iter().map(expert).collect::<Result<Vec<_>, _>>()?;
        let mixture = experts[0].parametric_session();
        let mut given = vec![0.0; mixture.places().len()];
        mixture.weights(&mut given);
        let count = experts.len() + 2;
        let n = equations.outputs();
        let stride = options.horizon.div_ceil(CHECKS);
        let checks = options.horizon.div_ceil(stride);
        let horizon = checks * stride;
        let kept = (checks * count).saturating_mul(mixture.snapshot_len());
        if kept.max(horizon.saturating_mul(n.max(equations.inputs()))) > MOST_NUMBERS {
            return Err(RecursiveOptionsError::Experts);
        }
        let mut work = Workspace::new();
        let _ = work.take(mixture.snapshot_len() + equations.scratch());
        Ok(Self {
            losses: vec![1.0; count],
            expert_weights: vec![1.0 / count as f64; count],
            inverse: ranges[..n].iter().map(|(low, high)| DEVIATIONS / (high - low)).collect(),
            weights: given.clone(),
            given,
            past: Past {
                horizon,
                stride,
                trial: mixture.clone(),
                snapshots: vec![0.0; checks * count * mixture.snapshot_len()],
                commands: vec![0.0; horizon * equations.inputs()],
                seen: 0,
                unrolled: vec![0.0; horizon * equations.inputs()],
                predicted: vec![0.0; horizon * n],
                work,
            },
            mixture,
            experts,
            frozen: false,
        })
    }

    /// The equations with the current weights.
    pub fn equations(&self) -> &Equations {
        self.mixture.equations()
    }

    /// Weights of the experts, the reference coefficients, and zero coefficients.
    pub fn expert_weights(&self) -> &[f64] {
        &self.expert_weights
    }

    /// Updates losses and weights with the predictions of one horizon ago, and stores the present snapshots.
    fn check(&mut self, y: &[f64]) {
        let Past { horizon, stride, trial, snapshots, commands, seen, unrolled, predicted, work } =
            &mut self.past;
        if !seen.is_multiple_of(*stride) {
            return;
        }
        let (len, count, n, m) = (trial.snapshot_len(), self.losses.len(), y.len(), self.mixture.inputs());
        let checks = *horizon / *stride;
        let slot = (*seen / *stride) % checks;
        let known = *seen >= *horizon + self.mixture.warm_up();
        if known {
            let start = (*seen % *horizon) * m;
            let (late, early) = commands.split_at(start);
            unrolled[..early.len()].copy_from_slice(early);
            unrolled[early.len()..].copy_from_slice(late);
        }
        for i in 0..count {
            let snapshot = &mut snapshots[(slot * count + i) * len..][..len];
            if known {
                trial.restore(snapshot);
                trial.rollout(unrolled, work, predicted);
                let last = &predicted[predicted.len() - n..];
                let error = |((p, y), inverse): ((&f64, &f64), &f64)| {
                    let e = (p - y) * inverse;
                    if e.is_finite() { (e * e).min(WORST) } else { WORST }
                };
                self.losses[i] += last.iter().zip(y).zip(&self.inverse).map(error).sum::<f64>() / n as f64;
            }
            if let Some(expert) = self.experts.get(i) {
                expert.snapshot(snapshot);
            } else {
                self.mixture.snapshot(snapshot);
                let weights = &mut snapshot[len - self.given.len()..];
                if i == self.experts.len() { weights.copy_from_slice(&self.given) } else { weights.fill(0.0) }
            }
        }
        if known {
            let best = self.losses.iter().copied().fold(f64::INFINITY, f64::min);
            let mut sum = 0.0;
            for (share, loss) in self.expert_weights.iter_mut().zip(&self.losses) {
                *share = num_traits::Float::powi(loss / best, POWER);
                sum += *share;
            }
            self.expert_weights.iter_mut().for_each(|share| *share /= sum);
        }
    }

    fn mix(&mut self) {
        let count = self.experts.len();
        for (weight, given) in self.weights.iter_mut().zip(&self.given) {
            *weight = self.expert_weights[count] * given;
        }
        for (expert, share) in self.experts.iter().zip(&self.expert_weights) {
            for (weight, own) in self.weights.iter_mut().zip(expert.weights()) {
                *weight += share * own;
            }
        }
        self.mixture.set_weights(&self.weights);
    }
}

/// Width of a design range in scales: between a uniform distribution (3.5 standard deviations) and a normal one (6).
const DEVIATIONS: f64 = 5.0;

impl Predictor for ExpertMixture {
    plain!(over_ground advance_observe rollout_snapshots);
    delegate!(mixture: outputs inputs warm_up output rollout rollout_batch snapshot_len snapshot fork);

    fn reset(&mut self) {
        self.experts.iter_mut().for_each(Predictor::reset);
        self.mixture.reset();
        self.past.seen = 0;
    }

    fn observe(&mut self, y: &[f64]) {
        self.experts.iter_mut().for_each(|expert| expert.observe(y));
        self.mixture.observe(y);
        if self.frozen {
            return;
        }
        if y.iter().all(|y| !y.is_nan()) {
            self.check(y);
            self.mix();
        } else {
            self.past.seen = 0;
        }
    }

    fn advance(&mut self, c: &[f64]) {
        self.experts.iter_mut().for_each(|expert| expert.advance(c));
        self.mixture.advance(c);
        let at = (self.past.seen % self.past.horizon) * c.len();
        self.past.commands[at..][..c.len()].copy_from_slice(c);
        self.past.seen = self.past.seen.saturating_add(1);
    }

    /// Restores state and coefficients, for all experts.
    fn restore(&mut self, from: &[f64]) {
        self.mixture.restore(from);
        self.experts.iter_mut().for_each(|expert| expert.restore(from));
        self.past.seen = 0;
    }
}

impl Learning for ExpertMixture {
    plain!(no_guard);

    /// Outcome of the first expert; the gates of the others can differ.
    fn outcome(&self) -> Outcome {
        self.experts[0].outcome()
    }

    fn innovations(&self) -> &[Innovation] {
        self.experts[0].innovations()
    }

    fn weights(&self) -> &[f64] {
        &self.weights
    }

    fn freeze(&mut self, frozen: bool) {
        self.frozen = frozen;
        self.experts.iter_mut().for_each(|expert| expert.freeze(frozen));
    }

    fn scale_noise(&mut self, factor: f64) {
        self.experts.iter_mut().for_each(|expert| expert.scale_noise(factor));
    }

    fn restart(&mut self) {
        self.experts.iter_mut().for_each(Learning::restart);
    }

    /// Unknown: the covariances of the experts are positive by construction.
    fn health(&self) -> Health {
        Health::UNKNOWN
    }

    /// NaN: a mixture has no variance of its own.
    fn deviations(&mut self, _: &[f64], horizons: &[usize], _: &mut Workspace, deviations: &mut [f64]) {
        assert_eq!(deviations.len(), horizons.len() * self.outputs(), "a row for each horizon");
        deviations.fill(f64::NAN);
    }
}

impl SaveState for ExpertMixture {
    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.experts.iter_mut().for_each(|expert| expert.visit_state(memory));
        memory.session(&mut self.mixture);
        memory.numbers(&mut self.losses);
        memory.numbers(&mut self.expert_weights);
        memory.numbers(&mut self.past.snapshots);
        memory.numbers(&mut self.past.commands);
        memory.count(&mut self.past.seen, MOST_COUNTED);
        memory.flag(&mut self.frozen);
        if memory.is_loading() {
            self.mixture.weights(&mut self.weights);
        }
    }

    fn is_sound(&self) -> bool {
        self.weights.iter().all(|weight| weight.is_finite())
            && are_variances(&self.losses)
            && are_variances(&self.expert_weights)
            && self.experts.iter().all(SaveState::is_sound)
    }
}

impl Rehearsing for ExpertMixture {
    plain!(no_rehearsal);
}
