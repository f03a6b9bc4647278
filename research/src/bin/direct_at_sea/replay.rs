//! Online adaptation of all weights of a direct predictor by Adam on completed windows.

use std::sync::Arc;

use hydroid_core::adapt::{Health, Innovation, Learning, Outcome, Rehearsing, SaveState};
use hydroid_core::memory::Memory;
use hydroid_core::model::direct::{Batch, Direct, DirectError, DirectSession};
use hydroid_core::model::recurrent::BaseModel;
use hydroid_core::predict::{Predictor, Workspace, delegate, plain};

pub(crate) struct ReplaySettings {
    pub(crate) rate: f64,
    pub(crate) batch: usize,
    pub(crate) steps: usize,
    pub(crate) last: usize,
}

/// A session whose model is replaced during the run. It allocates, so it is not for use on board.
pub(crate) struct Replay {
    session: DirectSession,
    model: Direct,
    settings: ReplaySettings,
    batch: Batch<f32>,
    weights: Vec<f32>,
    gradient: Vec<f32>,
    moments: [Vec<f32>; 2],
    step: i32,
    /// Scaled outputs and commands since the start of the run. A window is complete when its horizon has passed.
    outputs: Vec<f32>,
    commands: Vec<f32>,
    random: u64,
    frozen: bool,
}

impl Replay {
    pub(crate) fn new(model: &Arc<Direct>, settings: ReplaySettings) -> Result<Self, DirectError> {
        #[expect(clippy::cast_possible_truncation, reason = "single precision is enough for steps")]
        let weights: Vec<f32> = model.weights.iter().map(|&w| w as f32).collect();
        Ok(Self {
            session: DirectSession::new(Arc::clone(model))?,
            model: Direct::clone(model),
            batch: Batch::new(&model.network, settings.batch.max(1)),
            settings,
            gradient: vec![0.0; weights.len()],
            moments: [vec![0.0; weights.len()], vec![0.0; weights.len()]],
            weights,
            step: 0,
            outputs: Vec::new(),
            commands: Vec::new(),
            random: 0x9e37_79b9_7f4a_7c15,
            frozen: false,
        })
    }

    fn samples(&self) -> usize {
        self.outputs.len() / self.model.outputs()
    }

    fn any_below(&mut self, count: usize) -> usize {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        usize::try_from(self.random % count as u64).unwrap_or(0)
    }

    /// An Adam step on windows that end at samples from `first` to `last`, including the newest.
    fn adam(&mut self, first: usize, last: usize) {
        let Direct { history: p, horizon: h, .. } = self.model;
        let (n, m) = (self.model.outputs(), self.model.inputs());
        let (count, lanes) = (self.settings.batch.max(1), self.batch.lanes());
        let ends: Vec<usize> = (0..count)
            .map(|w| if w == 0 { last } else { first + self.any_below(last + 1 - first) })
            .collect();
        for (w, &k) in ends.iter().enumerate() {
            let outputs = &self.outputs[(k + 1 - p) * n..(k + 1) * n];
            let commands = &self.commands[(k + 1 - p) * m..(k + h) * m];
            for (i, x) in outputs.iter().chain(commands).enumerate() {
                self.batch.input_mut()[i * lanes + w] = *x;
            }
        }
        self.batch.forward(&self.weights);
        let s = &self.model.scaling;
        let scale = 2.0 / (count * h * n) as f32;
        for (w, &k) in ends.iter().enumerate() {
            for i in 0..h * n {
                let c = i % n;
                let base = if self.model.base == BaseModel::Hold { self.outputs[k * n + c] } else { 0.0 };
                #[expect(clippy::cast_possible_truncation, reason = "single precision is enough for steps")]
                let unit = (s.output_scale[c] / s.correction_scale[c]) as f32;
                let target = unit * (self.outputs[(k + 1) * n + i] - base);
                let error = self.batch.output()[i * lanes + w] - target;
                self.batch.output_adjoint_mut()[i * lanes + w] = scale * error;
            }
        }
        self.batch.backward(&self.weights, &mut self.gradient);
        self.step += 1;
        let (first, second) = (1.0 - 0.9_f32.powi(self.step), 1.0 - 0.999_f32.powi(self.step));
        #[expect(clippy::cast_possible_truncation, reason = "single precision is enough for steps")]
        let rate = self.settings.rate as f32;
        let [means, squares] = &mut self.moments;
        let moments = means.iter_mut().zip(squares);
        for ((w, g), (mean, square)) in self.weights.iter_mut().zip(&self.gradient).zip(moments) {
            *mean += 0.1 * (g - *mean);
            *square += 0.001 * (g * g - *square);
            *w -= rate * (*mean / first) / ((*square / second).sqrt() + 1e-8);
        }
    }
}

impl Predictor for Replay {
    plain!(advance_observe rollout_batch rollout_snapshots);
    delegate!(session: outputs inputs warm_up observe_heading current output output_through_water rollout);
    delegate!(session: snapshot_len snapshot fork);

    fn reset(&mut self) {
        self.session.reset();
        self.outputs.clear();
        self.commands.clear();
    }

    fn observe(&mut self, y: &[f64]) {
        self.session.observe(y);
        let s = &self.model.scaling;
        #[expect(clippy::cast_possible_truncation, reason = "single precision is enough for steps")]
        let scaled = |(i, y): (usize, &f64)| ((y - s.output_mean[i]) / s.output_scale[i]) as f32;
        self.outputs.extend(y.iter().enumerate().map(scaled));
        let first = self.model.history - 1;
        let Some(last) = self.samples().checked_sub(1 + self.model.horizon).filter(|last| *last >= first)
        else {
            return;
        };
        if self.frozen {
            return;
        }
        for _ in 0..self.settings.steps {
            self.adam(first.max(last.saturating_sub(self.settings.last)), last);
        }
        self.model.weights.iter_mut().zip(&self.weights).for_each(|(into, w)| *into = f64::from(*w));
        let mut past = vec![0.0; self.session.snapshot_len()];
        self.session.snapshot(&mut past);
        if let Ok(mut session) = DirectSession::new(Arc::new(self.model.clone())) {
            session.restore(&past);
            self.session = session;
        }
    }

    fn advance(&mut self, c: &[f64]) {
        self.session.advance(c);
        let s = &self.model.scaling;
        #[expect(clippy::cast_possible_truncation, reason = "single precision is enough for steps")]
        let scaled = |(i, c): (usize, &f64)| ((c - s.input_mean[i]) / s.input_scale[i]) as f32;
        self.commands.extend(c.iter().enumerate().map(scaled));
    }

    fn restore(&mut self, from: &[f64]) {
        self.session.restore(from);
    }
}

/// The part of the interface that this comparison uses: sessions and freezing.
impl Learning for Replay {
    plain!(no_guard);

    fn outcome(&self) -> Outcome {
        Outcome::Waiting
    }

    fn innovations(&self) -> &[Innovation] {
        &[]
    }

    fn weights(&self) -> &[f64] {
        &self.model.weights
    }

    fn freeze(&mut self, frozen: bool) {
        self.frozen = frozen;
    }

    fn scale_noise(&mut self, _: f64) {}

    fn restart(&mut self) {}

    fn health(&self) -> Health {
        Health::UNKNOWN
    }

    fn deviations(&mut self, _: &[f64], _: &[usize], _: &mut Workspace, deviations: &mut [f64]) {
        deviations.fill(f64::NAN);
    }
}

impl SaveState for Replay {
    fn visit_state(&mut self, _: &mut Memory<'_>) {}

    fn is_sound(&self) -> bool {
        true
    }
}

impl Rehearsing for Replay {
    plain!(no_rehearsal);
}
