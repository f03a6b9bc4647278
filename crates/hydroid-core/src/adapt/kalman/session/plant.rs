//! The session of a vessel.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::super::filter::Filter;
use super::super::learnable::plant::{LANES, Moving};
use super::super::learnable::plant_parameters::PlantParameters;
use super::super::learnable::{Learnable, LearnablePlant};
use super::super::options::{FilterOptions, FilterOptionsError};
use super::{KalmanSession, ModelKind};
use crate::craft::{Craft, MAX_SERVOS};
use crate::memory::Memory;
use crate::model::{CraftModel, CraftSession};
use crate::predict::{Predictor, Workspace, delegate, plain};

const OUTPUTS: usize = CraftModel::OUTPUTS;

/// A [`KalmanSession`] of a vessel: motion, positions of its actuators and numbers are estimated, in the units of
/// [`LearnablePlant`].
///
/// A run starts when `u`, `v` and `r` have been measured once, with the variance `R`. The initial positions are those of
/// the first command, held for a long time, with the variance [`FilterOptions::initial_state`]. A divergent step or
/// measurement starts the run again; the numbers stay.
///
/// [`weights`](crate::adapt::Learning::weights) are the learned numbers in their own units, in the order of
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

/// A session of a vessel with its own weights. Snapshot: that of the session, then the weights of [`LearnablePlant`].
#[derive(Clone, Debug)]
pub struct ParametricPlant {
    session: CraftSession,
    map: PlantParameters,
    craft: Craft,
    numbers: Vec<f64>,
    weights: Vec<f64>,
}

impl ParametricPlant {
    fn set_weights(&mut self, weights: &[f64]) {
        self.weights.copy_from_slice(weights);
        self.numbers.iter_mut().zip(self.map.numbers(weights)).for_each(|(into, number)| *into = number);
        self.craft.set_numbers(&self.numbers);
        self.session.set_craft(&self.craft);
    }
}

impl Predictor for ParametricPlant {
    plain!(advance_observe rollout_snapshots);
    delegate!(session: outputs inputs warm_up reset observe_heading current output_through_water observe advance);
    delegate!(session: output rollout rollout_batch);

    fn snapshot_len(&self) -> usize {
        self.session.snapshot_len() + self.weights.len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        let (motion, weights) = into.split_at_mut(self.session.snapshot_len());
        self.session.snapshot(motion);
        weights.copy_from_slice(&self.weights);
    }

    fn restore(&mut self, from: &[f64]) {
        let (motion, weights) = from.split_at(self.session.snapshot_len());
        self.session.restore(motion);
        self.set_weights(weights);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(self.clone())
    }
}

impl KalmanPlant {
    /// A session at the start of a run, with the numbers of the vessel.
    ///
    /// # Errors
    /// If the options are out of range or do not fit the vessel.
    pub fn new(model: &CraftModel, options: FilterOptions) -> Result<Self, FilterOptionsError> {
        let plant = LearnablePlant::new(model);
        let weights = plant.weights().to_vec();
        let mut kind = PlantKind {
            session: ParametricPlant {
                session: CraftSession::new(model),
                craft: plant.map().craft().clone(),
                numbers: plant.numbers(),
                map: plant.map().clone(),
                weights,
            },
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
        for ((into, group), &w) in self.parameters.iter_mut().zip(map.groups()).zip(weights) {
            *into = map.value(group[0], w).0;
        }
    }

    fn moving(&self) -> Moving<f64> {
        let (nu, own) = self.session.session.motion();
        let mut positions = [0.0; MAX_SERVOS];
        positions[..own.len()].copy_from_slice(own);
        Moving { nu, positions }
    }

    /// The state of the filter.
    fn scaled_motion(&self, model: &LearnablePlant) -> [f64; 3 + MAX_SERVOS] {
        let Moving { nu, positions } = self.moving();
        let hidden = model.moving().iter().map(|&servo| positions[servo]);
        let mut scaled = [0.0; 3 + MAX_SERVOS];
        for (place, (into, x)) in scaled.iter_mut().zip(nu.into_iter().chain(hidden)).enumerate() {
            // Unknown positions are those in the middle of their ranges.
            *into = if x.is_nan() { 0.0 } else { model.scaled(place, x) };
        }
        scaled
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
                let start = self.scaled_motion(filter.model());
                filter.begin(start);
            }
            return false;
        }
        for (i, z) in z.iter_mut().enumerate() {
            *z = if y[i].is_finite() { filter.model().scaled(i, y[i]) } else { f64::NAN };
        }
        true
    }

    fn sync_session(&mut self, filter: &Filter<LearnablePlant>, weights: bool) {
        let model = filter.model();
        let (nu, positions) = self.session.session.motion_mut();
        for (place, h) in filter.state().iter().enumerate() {
            let into = match place.checked_sub(3) {
                None => &mut nu[place],
                Some(hidden) => &mut positions[model.moving()[hidden]],
            };
            *into = model.unscaled(place, *h);
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
        let is_known = c.iter().all(|c| c.is_finite());
        if self.is_waiting() || !is_known {
            // The actuators move before the start of a run; a command that is unknown ends it.
            return self.session.advance(c);
        }
        if self.session.session.settle(c) {
            let start = self.scaled_motion(filter.model());
            filter.begin(start);
        }
        filter.advance(c);
        self.sync_session(filter, filter.leaks());
        self.session.session.follow(c);
        let (nu, positions) = self.session.session.motion();
        if !nu.iter().chain(positions).all(|x| x.is_finite()) {
            // The step has diverged.
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
        let inputs = self.session.inputs();
        let commands = &commands[..steps * inputs];
        if self.is_waiting() || commands.iter().any(|c| c.is_nan()) {
            return deviations.fill(f64::NAN);
        }
        let mut from = self.moving();
        if let Some(first) = commands.get(..inputs) {
            self.session.session.start(&mut from.positions, first);
        }
        let model = filter.model();
        let states = model.scale().len();
        // Gradients of the outputs at each horizon, as columns. The last pass can have unused lanes.
        let rows = model.passes() * LANES;
        let gradients = work.take(horizons.len() * rows * OUTPUTS);
        self.substeps.resize(steps.max(self.substeps.len()), 0);
        let substeps = &mut self.substeps;
        let q = filter.state_noise();
        for into in deviations.chunks_exact_mut(OUTPUTS) {
            for ((into, noise), scale) in into.iter_mut().zip(filter.noise()).zip(model.scale()) {
                *into = noise * Float::powi(*scale, 2);
            }
        }
        for pass in 0..model.passes() {
            let mut at = model.start(&from, pass);
            let by_state = model.state_lanes(pass);
            let (mut process, mut done) = ([0.0; OUTPUTS], 0);
            for ((&horizon, of_horizon), into) in horizons
                .iter()
                .zip(gradients.chunks_exact_mut(rows * OUTPUTS))
                .zip(deviations.chunks_exact_mut(OUTPUTS))
            {
                for (c, steps) in commands[done * inputs..horizon * inputs]
                    .chunks_exact(inputs)
                    .zip(&mut substeps[done..horizon])
                {
                    if pass == 0 {
                        let values =
                            Moving { nu: at.nu.map(|x| x.value), positions: at.positions.map(|x| x.value) };
                        *steps = model.derivative_steps(&values);
                    }
                    for (process, y) in process.iter_mut().zip(&at.nu) {
                        *process += q * y.partials[..by_state].iter().map(|s| s * s).sum::<f64>();
                    }
                    model.sample(pass, &mut at, c, *steps);
                }
                done = horizon;
                for (i, y) in at.nu.iter().enumerate() {
                    for (lane, partial) in y.partials.iter().enumerate() {
                        of_horizon[(pass * LANES + lane) * OUTPUTS + i] = *partial;
                    }
                    into[i] += process[i];
                }
            }
        }
        for (h, gradients) in gradients.chunks_exact(rows * OUTPUTS).enumerate() {
            let (by_state, by_weights) = gradients.split_at(states * OUTPUTS);
            filter.set_gradients(h * OUTPUTS, OUTPUTS, by_state, by_weights);
        }
        filter.add_variances(deviations);
        for variance in deviations.iter_mut() {
            *variance = Float::sqrt(variance.clamp(0.0, f64::INFINITY));
        }
    }
}
