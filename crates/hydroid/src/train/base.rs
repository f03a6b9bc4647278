//! Base of a recurrent network: one step forward and backward for windows in parallel lanes.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::{BaseModel, Scaling};
use hydroid_core::model::sparse::Equations;

/// Step of the central differences, in scaled units.
const DIFFERENCE: f64 = 1e-5;

/// Base of a mini-batch.
///
/// ```text
/// z+ = b(z, c) + ratio . g,     ratio = correction_scale / output_scale
/// ```
///
/// in scaled outputs `z`; matrices are `outputs x lanes`. Equations are integrated in double precision and physical
/// units.
///
/// The backward pass replaces `a` by `(db/dz)' a`. The Jacobian of equations is computed by central differences over a
/// sample and includes gates and substeps. It neglects the dependence of later samples on past outputs among the
/// signals, so that the gradient of such equations is approximate; the loss is exact.
#[derive(Clone, Debug)]
pub(super) struct BaseStep {
    kind: Kind,
    pub(super) ratio: Vec<f64>,
}

#[derive(Clone, Debug)]
enum Kind {
    Nothing,
    Hold,
    Equations(Box<EquationsStep>),
}

#[derive(Clone, Debug)]
struct EquationsStep {
    equations: Equations,
    mean: Vec<f64>,
    scale: Vec<f64>,
    lanes: usize,
    /// State of the equations in each lane; only the signal memory persists from step to step.
    states: Vec<f64>,
    scratch: Vec<f64>,
    trial: Vec<f64>,
    /// `(db/dz)' a` of a lane.
    sums: Vec<f64>,
    /// `d z+_i / d z_j` of each step, `steps x outputs x outputs x lanes`; empty without a backward pass.
    derivatives: Vec<f64>,
}

impl BaseStep {
    /// Base for `lanes` windows; `steps` is the number of recorded steps.
    pub(super) fn new(base: &BaseModel, scaling: &Scaling, lanes: usize, steps: usize) -> Self {
        let ratio = scaling.correction_scale.iter().zip(&scaling.output_scale).map(|(c, s)| c / s).collect();
        let kind = match base {
            BaseModel::Nothing => Kind::Nothing,
            BaseModel::Hold => Kind::Hold,
            BaseModel::Equations(equations) => {
                let n = equations.outputs();
                Kind::Equations(Box::new(EquationsStep {
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
    pub(super) fn is_recursive(&self) -> bool {
        !matches!(self.kind, Kind::Nothing)
    }

    pub(super) fn reset(&mut self) {
        if let Kind::Equations(grey) = &mut self.kind {
            grey.states.fill(f64::NAN);
        }
    }

    /// Step `k`: `next <- b(z, c)`; `c` is the command of a lane, none for an unused lane.
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

    /// Backward step `k`: `a <- (db/dz)' a`.
    pub(super) fn back<T: Scalar>(&mut self, k: usize, a: &mut [T]) {
        match &mut self.kind {
            Kind::Nothing => a.fill(T::zero()),
            Kind::Hold => {}
            Kind::Equations(grey) => grey.back(k, a),
        }
    }
}

impl EquationsStep {
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
                // Outputs are held while the signal memory is incomplete.
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
