//! What the network corrects, over one sample and back, for a chunk of windows side by side.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::{Base, Scaling};
use hydroid_core::model::sparse::Equations;

/// Step of the differences that stand for the equations' derivative, in scaled units: the error of a central
/// difference is of the order of its square, and rounding of 1e-16 over it.
const DIFFERENCE: f64 = 1e-5;

/// The base of a chunk.
///
/// ```text
/// z+ = b(z, c) + ratio . g,     ratio = correction_scale / output_scale
/// ```
///
/// in scaled outputs `z`; matrices are `outputs x lanes`. Equations are stepped in double precision and in their own
/// units.
///
/// On the way back `a` becomes `(db/dz)' a`. That of equations is by central differences of a whole sample, which is
/// exact to 1e-9 and knows of gates and substeps; what a *past* output among the equations' signals passes on to later
/// samples is left out of it, so that the gradient of such equations is approximate: it lacks what the network's correction of one
/// sample does through the past of a later one, of the size of that term's coefficient times the sample time. (Of lags
/// of commands nothing is left out.) The loss is exact in any case, and so is the choice of weights.
#[derive(Clone, Debug)]
pub(super) struct BaseStep {
    kind: Kind,
    /// Size of what the network gives, in scaled outputs.
    pub(super) ratio: Vec<f64>,
}

#[derive(Clone, Debug)]
enum Kind {
    Nothing,
    Hold,
    Equations(Box<Grey>),
}

#[derive(Clone, Debug)]
struct Grey {
    equations: Equations,
    mean: Vec<f64>,
    scale: Vec<f64>,
    lanes: usize,
    /// State of the equations of each lane, one after the other; only its memory lasts from step to step.
    states: Vec<f64>,
    scratch: Vec<f64>,
    trial: Vec<f64>,
    /// `(db/dz)' a` of a lane.
    sums: Vec<f64>,
    /// `d z+_i / d z_j` of each step, `steps x outputs x outputs x lanes`; empty where nobody goes back.
    derivatives: Vec<f64>,
}

impl BaseStep {
    /// For `lanes` windows, and as many steps as will be gone back.
    pub(super) fn new(base: &Base, scaling: &Scaling, lanes: usize, steps: usize) -> Self {
        let ratio = scaling.correction_scale.iter().zip(&scaling.output_scale).map(|(c, s)| c / s).collect();
        let kind = match base {
            Base::Nothing => Kind::Nothing,
            Base::Hold => Kind::Hold,
            Base::Equations(equations) => {
                let n = equations.outputs();
                Kind::Equations(Box::new(Grey {
                    mean: scaling.output_mean.clone(),
                    scale: scaling.output_scale.clone(),
                    lanes,
                    states: vec![f64::NAN; lanes * equations.state_len()],
                    scratch: vec![0.0; equations.scratch()],
                    sums: vec![0.0; n],
                    trial: vec![0.0; 2 * equations.state_len()],
                    derivatives: vec![0.0; steps * n * n * lanes],
                    equations: Equations::clone(equations),
                }))
            }
        };
        Self { kind, ratio }
    }

    /// Whether a prediction depends on the outputs before it.
    pub(super) fn recurs(&self) -> bool {
        !matches!(self.kind, Kind::Nothing)
    }

    /// The start of windows: nothing is known of the past.
    pub(super) fn reset(&mut self) {
        if let Kind::Equations(grey) = &mut self.kind {
            grey.states.fill(f64::NAN);
        }
    }

    /// Step `k`: `next <- b(z, c)`; `c` gives the command of a lane, none for a lane that is not in use.
    pub(super) fn step<'a, T: Scalar>(
        &mut self,
        k: usize,
        z: &[T],
        command: impl Fn(usize) -> Option<&'a [f64]>,
        next: &mut [T],
    ) {
        match &mut self.kind {
            Kind::Nothing => next.fill(T::zero()),
            Kind::Hold => next.copy_from_slice(z),
            Kind::Equations(grey) => grey.step(k, z, command, next),
        }
    }

    /// Step `k` back: `a <- (db/dz)' a`.
    pub(super) fn back<T: Scalar>(&mut self, k: usize, a: &mut [T]) {
        match &mut self.kind {
            Kind::Nothing => a.fill(T::zero()),
            Kind::Hold => {}
            Kind::Equations(grey) => grey.back(k, a),
        }
    }
}

impl Grey {
    fn step<'a, T: Scalar>(
        &mut self,
        k: usize,
        z: &[T],
        command: impl Fn(usize) -> Option<&'a [f64]>,
        next: &mut [T],
    ) {
        let (n, lanes, len) = (self.equations.outputs(), self.lanes, self.equations.state_len());
        let slopes = n * n * lanes;
        let back = (k + 1) * slopes <= self.derivatives.len();
        let (plus, minus) = self.trial.split_at_mut(len);
        for lane in 0..lanes {
            let Some(c) = command(lane) else {
                (0..n).for_each(|i| next[i * lanes + lane] = T::zero());
                continue;
            };
            let state = &mut self.states[lane * len..(lane + 1) * len];
            for i in 0..n {
                state[i] = self.mean[i] + self.scale[i] * z[i * lanes + lane].wide();
            }
            for j in 0..if back { n } else { 0 } {
                for (trial, step) in [(&mut *plus, DIFFERENCE), (&mut *minus, -DIFFERENCE)] {
                    trial.copy_from_slice(state);
                    trial[j] += step * self.scale[j];
                    self.equations.step(trial, c, &mut self.scratch);
                }
                for i in 0..n {
                    let slope = (plus[i] - minus[i]) / (2.0 * DIFFERENCE * self.scale[i]);
                    self.derivatives[k * slopes + (i * n + j) * lanes + lane] =
                        if slope.is_finite() { slope } else { 0.0 };
                }
            }
            self.equations.step(state, c, &mut self.scratch);
            for i in 0..n {
                let value = (state[i] - self.mean[i]) / self.scale[i];
                // Not known while the past of the signals is not: then the outputs stay as they are.
                let known = !value.is_nan();
                next[i * lanes + lane] = if known { T::of(value) } else { z[i * lanes + lane] };
            }
        }
    }

    fn back<T: Scalar>(&mut self, k: usize, a: &mut [T]) {
        let (n, lanes) = (self.equations.outputs(), self.lanes);
        let slopes = &self.derivatives[k * n * n * lanes..(k + 1) * n * n * lanes];
        for lane in 0..lanes {
            for (j, sum) in self.sums.iter_mut().enumerate() {
                *sum = (0..n).map(|i| slopes[(i * n + j) * lanes + lane] * a[i * lanes + lane].wide()).sum();
            }
            for (j, sum) in self.sums.iter().enumerate() {
                a[j * lanes + lane] = T::of(*sum);
            }
        }
    }
}
