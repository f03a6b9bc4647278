//! A vessel that learns its parameters on the way.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::filter::{Correction, Filter};
use super::learnable::Learnable;
use super::plant::{LANES, LearnablePlant, STATE};
use super::plant_weights::PlantWeights;
use super::tuning::{Tuning, TuningError};
use crate::adapt::memory::{Reader, Writer};
use crate::adapt::{Adapter, Health, Innovation, Outcome, Rejection};
use crate::model::{PlantModel, PlantSession};
use crate::predict::{Predictor, Workspace};

/// Length of the output.
const OUTPUTS: usize = PlantModel::OUTPUTS;

/// A session of a vessel whose weights are its own, with these in its snapshots: `[u, v, r, P_f]`, then the weights as
/// [`LearnablePlant`] has them.
#[derive(Clone, Debug)]
struct Weighted {
    session: PlantSession,
    map: PlantWeights,
    weights: Vec<f64>,
}

impl Weighted {
    fn set_weights(&mut self, weights: &[f64]) {
        self.weights.copy_from_slice(weights);
        self.session.set_numbers(self.map.form(), &self.map.numbers(weights));
    }
}

impl Predictor for Weighted {
    fn outputs(&self) -> usize {
        self.session.outputs()
    }

    fn inputs(&self) -> usize {
        self.session.inputs()
    }

    fn reset(&mut self) {
        self.session.reset();
    }

    fn observe(&mut self, y: &[f64]) {
        self.session.observe(y);
    }

    fn advance(&mut self, c: &[f64]) {
        self.session.advance(c);
    }

    fn output(&self, y: &mut [f64]) {
        self.session.output(y);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.session.rollout(commands, work, y);
    }

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

/// A session of a vessel whose motion, hidden propeller force, and parameters are estimated by a [`Filter`], in the units
/// of [`LearnablePlant`]: the tuning is in those.
///
/// A run begins where `u`, `v` and `r` have been measured once; they are as uncertain as `R` says, and the propeller force,
/// which begins as what holds the speed, as [`Tuning::initial_state`] says. It begins anew after a step or a measurement
/// that leaves all bounds; what was learned stays.
///
/// [`weights`](Adapter::weights) are the learned parameters in their own units, in the order of
/// [`LearnablePlant::places`].
#[derive(Clone, Debug)]
pub struct KalmanPlant {
    session: Weighted,
    filter: Filter<f64, LearnablePlant>,
    /// The learned parameters in their units.
    parameters: Vec<f64>,
    outcome: Outcome,
    nis: f64,
    innovations: Vec<Innovation>,
}

impl KalmanPlant {
    /// A session at the start of a run, with the parameters that the vessel has.
    ///
    /// # Errors
    /// If the tuning makes no sense, or does not fit the vessel.
    pub fn new(model: &PlantModel, tuning: Tuning) -> Result<Self, TuningError> {
        let plant = LearnablePlant::new(model);
        let weights = plant.weights().to_vec();
        let mut own = Self {
            session: Weighted { session: PlantSession::new(model), map: plant.map().clone(), weights },
            parameters: vec![0.0; plant.places().len()],
            outcome: Outcome::Waiting,
            nis: f64::NAN,
            innovations: Vec::with_capacity(OUTPUTS),
            filter: Filter::new(plant, tuning)?,
        };
        own.tell_parameters();
        Ok(own)
    }

    /// The filter.
    pub fn filter(&self) -> &Filter<f64, LearnablePlant> {
        &self.filter
    }

    /// Normalised innovation squared of the last sample; NaN where nothing was learned from.
    pub fn nis(&self) -> f64 {
        self.nis
    }

    fn tell_parameters(&mut self) {
        let Weighted { map, weights, .. } = &self.session;
        for (index, (into, &w)) in self.parameters.iter_mut().zip(weights).enumerate() {
            *into = map.value(index, w).0;
        }
    }

    /// Takes state, and weights if they have changed, of the filter into use.
    fn take_over(&mut self, weights: bool) {
        let model = self.filter.model();
        let motion = self.session.session.motion_mut();
        for (i, (into, h)) in motion.iter_mut().zip(self.filter.state()).enumerate() {
            *into = model.unscaled(i, *h);
        }
        if weights {
            self.session.set_weights(self.filter.weights());
            self.tell_parameters();
        }
    }

    /// The motion of the session as the filter has it.
    fn scaled_motion(&self) -> [f64; STATE] {
        let motion = self.session.session.motion();
        core::array::from_fn(|i| self.filter.model().scaled(i, motion[i]))
    }

    /// What the filter made of a measurement, in units of the outputs.
    fn note(&mut self, correction: Correction) {
        self.innovations.clear();
        self.nis = f64::NAN;
        self.outcome = match correction {
            Correction::None => Outcome::Waiting,
            Correction::Lost => Outcome::Rejected(Rejection::NotFinite),
            Correction::Made { nis, deviations, weight } => {
                self.nis = nis;
                let (e, s) = self.filter.innovation();
                let scale = self.filter.model().scale();
                let innovation = |((e, s), scale): ((&f64, &f64), &f64)| Innovation {
                    value: e * scale,
                    deviation: Float::sqrt(*s) * scale,
                };
                self.innovations.extend(e.iter().zip(s).zip(scale).map(innovation));
                if weight < 1.0 { Outcome::Inflated { deviations, weight } } else { Outcome::Accepted }
            }
        };
    }
}

impl Predictor for KalmanPlant {
    fn outputs(&self) -> usize {
        OUTPUTS
    }

    fn inputs(&self) -> usize {
        PlantModel::INPUTS
    }

    fn reset(&mut self) {
        self.session.reset();
        self.filter.reset();
        self.note(Correction::None);
    }

    /// A second measurement of the same sample is not used, once a run has begun.
    fn observe(&mut self, y: &[f64]) {
        let correction = if self.session.session.is_waiting() {
            self.session.observe(y);
            if !self.session.session.is_waiting() {
                self.filter.begin(self.scaled_motion());
            }
            Correction::None
        } else {
            let model = self.filter.model();
            // What is infinite was not measured.
            let z: [f64; OUTPUTS] =
                core::array::from_fn(|i| if y[i].is_finite() { model.scaled(i, y[i]) } else { f64::NAN });
            self.filter.observe(&z)
        };
        match correction {
            Correction::None => {}
            Correction::Made { .. } => self.take_over(self.filter.learns),
            Correction::Lost => self.session.reset(),
        }
        self.note(correction);
        if y.iter().any(|y| y.is_infinite()) {
            self.outcome = Outcome::Rejected(Rejection::NotFinite);
        }
    }

    fn advance(&mut self, c: &[f64]) {
        if self.session.session.is_waiting() {
            return;
        }
        self.filter.advance(c);
        self.take_over(self.filter.leaks());
        if !self.session.session.motion().iter().all(|x| x.is_finite()) {
            // A step that has left all bounds, or a command that is no number.
            self.session.reset();
        }
    }

    fn output(&self, y: &mut [f64]) {
        self.session.output(y);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.session.rollout(commands, work, y);
    }

    fn snapshot_len(&self) -> usize {
        self.session.snapshot_len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        self.session.snapshot(into);
    }

    /// The filter goes on from the motion and the parameters of the snapshot; how uncertain they are stays as it is now.
    fn restore(&mut self, from: &[f64]) {
        self.session.restore(from);
        self.filter.set(self.scaled_motion(), self.session.weights.iter().copied());
        self.tell_parameters();
    }

    fn fork(&self) -> Box<dyn Predictor> {
        self.session.fork()
    }
}

impl Adapter for KalmanPlant {
    fn outcome(&self) -> Outcome {
        self.outcome
    }

    fn innovations(&self) -> &[Innovation] {
        &self.innovations
    }

    fn weights(&self) -> &[f64] {
        &self.parameters
    }

    fn freeze(&mut self, frozen: bool) {
        self.filter.learn(!frozen);
    }

    fn inflate(&mut self, factor: f64) {
        self.filter.inflate(factor);
    }

    fn restart(&mut self) {
        self.filter.restart();
    }

    fn health(&self) -> Health {
        self.filter.health()
    }

    fn memory_len(&self) -> usize {
        self.session.snapshot_len() + self.filter.memory_len()
    }

    fn save(&self, into: &mut [f64]) {
        assert_eq!(into.len(), self.memory_len(), "room for the memory");
        let mut writer = Writer::new(into);
        self.session.snapshot(writer.part(self.session.snapshot_len()));
        self.filter.save(writer.part(self.filter.memory_len()));
    }

    fn load(&mut self, from: &[f64]) {
        assert_eq!(from.len(), self.memory_len(), "a memory of this adapter");
        let mut reader = Reader::new(from);
        self.session.restore(reader.part(self.session.snapshot_len()));
        self.filter.load(reader.part(self.filter.memory_len()));
        self.tell_parameters();
        self.note(Correction::None);
    }

    /// Of motion and parameters as the filter knows them, of `Q_h` in each step, and of the measurement:
    ///
    /// ```text
    /// S_n P S_n' + sum_{j<n} Phi_j Q_h Phi_j' + R        S_n = [Phi_n dy_n/dw],  Phi_n = dy_n/dh
    /// ```
    ///
    /// NaN before a run has begun.
    fn deviations(
        &mut self,
        commands: &[f64],
        horizons: &[usize],
        work: &mut Workspace,
        deviations: &mut [f64],
    ) {
        assert_eq!(deviations.len(), horizons.len() * OUTPUTS, "a row for each horizon");
        let steps = horizons.iter().copied().max().unwrap_or(0);
        let commands = &commands[..steps * PlantModel::INPUTS];
        if self.session.session.is_waiting() || commands.iter().any(|c| c.is_nan()) {
            return deviations.fill(f64::NAN);
        }
        let model = self.filter.model();
        // Gradients of the outputs at each horizon, as columns; with room for the last pass to overhang.
        let rows = model.passes() * LANES;
        let gradients = work.take(horizons.len() * rows * OUTPUTS);
        let q = self.filter.state_noise();
        for pass in 0..model.passes() {
            let mut motion = model.start(self.session.session.motion(), pass);
            let (mut drifted, mut done) = ([0.0; OUTPUTS], 0);
            for ((&horizon, of_horizon), into) in horizons
                .iter()
                .zip(gradients.chunks_exact_mut(rows * OUTPUTS))
                .zip(deviations.chunks_exact_mut(OUTPUTS))
            {
                for c in commands[done * PlantModel::INPUTS..horizon * PlantModel::INPUTS]
                    .chunks_exact(PlantModel::INPUTS)
                {
                    for (drifted, y) in drifted.iter_mut().zip(&motion) {
                        *drifted += q * y.partials[..STATE].iter().map(|s| s * s).sum::<f64>();
                    }
                    motion = model.sample(pass, &motion, c);
                }
                done = horizon;
                for (i, y) in motion[..OUTPUTS].iter().enumerate() {
                    for (lane, partial) in y.partials.iter().enumerate() {
                        of_horizon[(pass * LANES + lane) * OUTPUTS + i] = *partial;
                    }
                    if pass == 0 {
                        // The derivatives to the state are in the first pass.
                        into[i] = drifted[i] + self.filter.noise()[i] * Float::powi(model.scale()[i], 2);
                    }
                }
            }
        }
        for (gradients, into) in
            gradients.chunks_exact(rows * OUTPUTS).zip(deviations.chunks_exact_mut(OUTPUTS))
        {
            let (by_state, by_weights) = gradients.split_at(STATE * OUTPUTS);
            self.filter.add_variances(by_state, by_weights, into);
            for variance in into.iter_mut() {
                // Rounding; what is no number stays so.
                *variance = Float::sqrt(variance.clamp(0.0, f64::INFINITY));
            }
        }
    }
}
