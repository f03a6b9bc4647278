//! The session of a vessel.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::super::filter::Filter;
use super::super::learnable::plant::{LANES, STATE};
use super::super::learnable::plant_parameters::PlantParameters;
use super::super::learnable::{Learnable, LearnablePlant};
use super::super::options::{FilterOptions, FilterOptionsError};
use super::{KalmanSession, ModelKind};
use crate::memory::Memory;
use crate::model::{PlantModel, PlantSession};
use crate::predict::{Predictor, Workspace, delegate, plain};

const OUTPUTS: usize = PlantModel::OUTPUTS;

/// A [`KalmanSession`] of a vessel: motion, hidden propeller force and parameters are estimated, in the units of
/// [`LearnablePlant`].
///
/// A run starts when `u`, `v` and `r` have been measured once, with the variance `R`. The initial propeller force holds
/// the speed and has the variance [`FilterOptions::initial_state`]. A divergent step or measurement starts the run
/// again; the parameters stay.
///
/// [`weights`](crate::adapt::Learning::weights) are the learned parameters in their own units, in the order of
/// [`LearnablePlant::places`].
pub type KalmanPlant = KalmanSession<PlantKind>;

/// The part of a [`KalmanPlant`] outside filter and measurement.
#[derive(Clone, Debug)]
pub struct PlantKind {
    session: ParametricPlant,
    parameters: Vec<f64>,
    /// Integration steps in each sample of the derivatives of a prediction.
    substeps: Vec<usize>,
}

/// A session of a vessel with its own weights. Snapshot: `[u, v, r, P_f]`, then the weights of [`LearnablePlant`].
#[derive(Clone, Debug)]
pub struct ParametricPlant {
    session: PlantSession,
    map: PlantParameters,
    weights: Vec<f64>,
}

impl ParametricPlant {
    fn set_weights(&mut self, weights: &[f64]) {
        self.weights.copy_from_slice(weights);
        self.session.set_numbers(self.map.form(), &self.map.numbers(weights));
    }
}

impl Predictor for ParametricPlant {
    plain!(advance_observe rollout_snapshots);
    delegate!(session: outputs inputs warm_up reset observe_heading current output_through_water observe advance);
    delegate!(session: output rollout rollout_batch);

    fn snapshot_len(&self) -> usize {
        STATE + self.weights.len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        let (motion, weights) = into.split_at_mut(STATE);
        motion.copy_from_slice(self.session.motion());
        weights.copy_from_slice(&self.weights);
    }

    fn restore(&mut self, from: &[f64]) {
        let (motion, weights) = from.split_at(STATE);
        self.session.restore(motion);
        self.set_weights(weights);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(self.clone())
    }
}

impl KalmanPlant {
    /// A session at the start of a run, with the parameters of the vessel.
    ///
    /// # Errors
    /// If the options are out of range or do not fit the vessel.
    pub fn new(model: &PlantModel, options: FilterOptions) -> Result<Self, FilterOptionsError> {
        let plant = LearnablePlant::new(model);
        let weights = plant.weights().to_vec();
        let mut kind = PlantKind {
            session: ParametricPlant { session: PlantSession::new(model), map: plant.map().clone(), weights },
            parameters: vec![0.0; plant.places().len()],
            substeps: Vec::new(),
        };
        kind.update_parameters();
        Ok(Self::of(kind, Filter::new(plant, options)?))
    }
}

impl PlantKind {
    fn is_waiting(&self) -> bool {
        self.session.session.is_waiting()
    }

    fn update_parameters(&mut self) {
        let ParametricPlant { map, weights, .. } = &self.session;
        for (index, (into, &w)) in self.parameters.iter_mut().zip(weights).enumerate() {
            *into = map.value(index, w).0;
        }
    }

    fn scaled_motion(&self, model: &LearnablePlant) -> [f64; STATE] {
        let motion = self.session.session.motion();
        core::array::from_fn(|i| model.scaled(i, motion[i]))
    }
}

impl ModelKind for PlantKind {
    type Model = LearnablePlant;
    type Session = ParametricPlant;

    fn session(&self) -> &ParametricPlant {
        &self.session
    }

    fn session_mut(&mut self) -> &mut ParametricPlant {
        &mut self.session
    }

    fn weights(&self) -> &[f64] {
        &self.parameters
    }

    fn output_scale<'a>(&'a self, model: &'a LearnablePlant) -> &'a [f64] {
        model.scale()
    }

    fn take_measurement(&mut self, filter: &mut Filter<LearnablePlant>, y: &[f64], z: &mut [f64]) -> bool {
        if self.is_waiting() {
            self.session.observe(y);
            if !self.is_waiting() {
                filter.begin(self.scaled_motion(filter.model()));
            }
            return false;
        }
        for (i, z) in z.iter_mut().enumerate() {
            *z = if y[i].is_finite() { filter.model().scaled(i, y[i]) } else { f64::NAN };
        }
        true
    }

    fn sync_session(&mut self, filter: &Filter<LearnablePlant>, weights: bool) {
        let motion = self.session.session.motion_mut();
        for (i, (into, h)) in motion.iter_mut().zip(filter.state()).enumerate() {
            *into = filter.model().unscaled(i, *h);
        }
        if weights {
            self.session.set_weights(filter.weights());
            self.update_parameters();
        }
    }

    fn recover(&mut self, _: &Filter<LearnablePlant>) {
        self.session.reset();
    }

    fn advance(&mut self, filter: &mut Filter<LearnablePlant>, c: &[f64]) {
        if self.is_waiting() {
            return;
        }
        filter.advance(c);
        self.sync_session(filter, filter.leaks());
        if !self.session.session.motion().iter().all(|x| x.is_finite()) {
            // The step has diverged, or the command is NaN.
            self.session.reset();
        }
    }

    fn sync_filter(&mut self, filter: &mut Filter<LearnablePlant>) {
        let motion = self.scaled_motion(filter.model());
        filter.set(motion, self.session.weights.iter().copied());
        self.update_parameters();
    }

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        if memory.is_loading() {
            self.update_parameters();
        }
    }

    /// From the covariance of state and parameters, `Q_h` in each step, and the noise of the measurement:
    ///
    /// ```text
    /// S_n P S_n' + sum_{j<n} Phi_j Q_h Phi_j' + R        S_n = [Phi_n dy_n/dw],  Phi_n = dy_n/dh
    /// ```
    ///
    /// The derivatives have as many integration steps as their accuracy needs
    /// ([`LearnablePlant::derivative_steps`]), fewer than a prediction. NaN before a run has started.
    fn deviations(
        &mut self,
        filter: &mut Filter<LearnablePlant>,
        commands: &[f64],
        horizons: &[usize],
        work: &mut Workspace,
        deviations: &mut [f64],
    ) {
        assert_eq!(deviations.len(), horizons.len() * OUTPUTS, "one row of deviations for each horizon");
        let steps = horizons.iter().copied().max().unwrap_or(0);
        let commands = &commands[..steps * PlantModel::INPUTS];
        if self.session.session.is_waiting() || commands.iter().any(|c| c.is_nan()) {
            return deviations.fill(f64::NAN);
        }
        let model = filter.model();
        // Gradients of the outputs at each horizon, as columns. The last pass can have unused lanes.
        let rows = model.passes() * LANES;
        let gradients = work.take(horizons.len() * rows * OUTPUTS);
        self.substeps.resize(steps.max(self.substeps.len()), 0);
        let substeps = &mut self.substeps;
        let q = filter.state_noise();
        for pass in 0..model.passes() {
            let mut motion = model.start(self.session.session.motion(), pass);
            let (mut process, mut done) = ([0.0; OUTPUTS], 0);
            for ((&horizon, of_horizon), into) in horizons
                .iter()
                .zip(gradients.chunks_exact_mut(rows * OUTPUTS))
                .zip(deviations.chunks_exact_mut(OUTPUTS))
            {
                for (c, steps) in commands[done * PlantModel::INPUTS..horizon * PlantModel::INPUTS]
                    .chunks_exact(PlantModel::INPUTS)
                    .zip(&mut substeps[done..horizon])
                {
                    if pass == 0 {
                        *steps = model.derivative_steps(&motion.map(|x| x.value), c);
                    }
                    for (process, y) in process.iter_mut().zip(&motion) {
                        *process += q * y.partials[..STATE].iter().map(|s| s * s).sum::<f64>();
                    }
                    motion = model.sample(pass, &motion, c, *steps);
                }
                done = horizon;
                for (i, y) in motion[..OUTPUTS].iter().enumerate() {
                    for (lane, partial) in y.partials.iter().enumerate() {
                        of_horizon[(pass * LANES + lane) * OUTPUTS + i] = *partial;
                    }
                    if pass == 0 {
                        // The derivatives with respect to the state are in the first pass.
                        into[i] = process[i] + filter.noise()[i] * Float::powi(model.scale()[i], 2);
                    }
                }
            }
        }
        for (h, gradients) in gradients.chunks_exact(rows * OUTPUTS).enumerate() {
            let (by_state, by_weights) = gradients.split_at(STATE * OUTPUTS);
            filter.set_gradients(h * OUTPUTS, OUTPUTS, by_state, by_weights);
        }
        filter.add_variances(deviations);
        for variance in deviations.iter_mut() {
            *variance = Float::sqrt(variance.clamp(0.0, f64::INFINITY));
        }
    }
}
