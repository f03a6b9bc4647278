//! Equations of motion as a parametric model.

use hydroid_core::model::sparse::{Equations, Sensitivity};
use hydroid_core::predict::Workspace;

use super::parameters::Parameters;
use super::shooting::{Parametric, ShootingModel};

/// Relative step of central finite differences; the derivatives have about eight digits.
const DIFFERENCE: f64 = 1e-4;

/// Equations with the sensitivities to their coefficients by the variational equation, and to lags and gates by central
/// differences.
pub(super) struct ShootingEquations {
    equations: Equations,
    short: Sensitivity,
    full: Sensitivity,
    /// Equations with each parameter except coefficients decreased and increased, and the inverse of the difference.
    perturbations: Vec<(Equations, Equations, f64)>,
}

impl Parametric for Parameters {
    type Model = ShootingEquations;

    fn model(&self, values: &[f64]) -> Option<ShootingEquations> {
        let equations = self.equations(values).ok()?;
        Some(ShootingEquations {
            short: Sensitivity::new(&equations, &[]).ok()?,
            full: Sensitivity::new(&equations, self.places()).ok()?,
            perturbations: perturbations(self, values)?,
            equations,
        })
    }
}

fn perturbations(parameters: &Parameters, values: &[f64]) -> Option<Vec<(Equations, Equations, f64)>> {
    let first = parameters.places().len();
    let perturbed = |at: usize, by: f64| {
        let mut moved = values.to_vec();
        moved[at] += by;
        parameters.equations(&moved).ok()
    };
    let one = |(i, size): (usize, f64)| {
        let by = DIFFERENCE * size;
        Some((perturbed(first + i, -by)?, perturbed(first + i, by)?, 0.5 / by))
    };
    parameters.sizes().into_iter().enumerate().map(one).collect()
}

impl ShootingEquations {
    /// The equations, then the perturbed ones, whose states differ for the same past.
    fn all(&self) -> impl Iterator<Item = &Equations> {
        let perturbed = self.perturbations.iter().flat_map(|(low, high, _)| [low, high]);
        std::iter::once(&self.equations).chain(perturbed)
    }

    fn started(&self, state: &[f64], start: &[f64]) -> Vec<f64> {
        let mut state = state.to_vec();
        state[..self.equations.outputs()].copy_from_slice(start);
        state
    }
}

impl ShootingModel for ShootingEquations {
    type Past = Vec<Vec<f64>>;

    fn outputs(&self) -> usize {
        self.equations.outputs()
    }

    fn inputs(&self) -> usize {
        self.equations.inputs()
    }

    fn parameters(&self) -> usize {
        self.full.parameters() - self.equations.outputs() + self.perturbations.len()
    }

    fn warm_up(&self) -> usize {
        self.equations.warm_up()
    }

    fn past(&self) -> Self::Past {
        self.all().map(|equations| vec![f64::NAN; equations.state_len()]).collect()
    }

    fn observe(&self, past: &mut Self::Past, y: &[f64]) {
        for state in past {
            state[..self.equations.outputs()].copy_from_slice(y);
        }
    }

    fn is_known(&self, past: &Self::Past) -> bool {
        past.iter().flatten().all(|x| x.is_finite())
    }

    fn wait(&self, past: &mut Self::Past, c: &[f64]) {
        let mut scratch = vec![0.0; self.equations.outputs()];
        for (equations, state) in self.all().zip(past) {
            equations.wait(state, c, &mut scratch);
        }
    }

    fn roll_start(
        &self,
        past: &Self::Past,
        start: &[f64],
        commands: &[f64],
        work: &mut Workspace,
        y: &mut [f64],
        by_start: &mut [f64],
    ) {
        let scratch = work.take(self.short.scratch());
        self.short.rollout(&self.started(&past[0], start), commands, scratch, y, by_start);
    }

    fn roll(
        &self,
        past: &Self::Past,
        start: &[f64],
        commands: &[f64],
        work: &mut Workspace,
        y: &mut [f64],
        jacobian: &mut [f64],
    ) {
        let (n, m, p) = (self.outputs(), self.inputs(), self.full.parameters());
        let columns = p + self.perturbations.len();
        let length = self.full.scratch().max(self.equations.scratch());
        let buffer = work.take(y.len() * p + length);
        let (s, scratch) = buffer.split_at_mut(y.len() * p);
        self.full.rollout(&self.started(&past[0], start), commands, scratch, y, s);
        for (to, from) in jacobian.chunks_exact_mut(columns).zip(s.chunks_exact(p)) {
            to[..p].copy_from_slice(from);
            to[p..].fill(0.0);
        }
        for (v, (low, high, inverse)) in self.perturbations.iter().enumerate() {
            for (equations, sign, state) in
                [(low, -*inverse, &past[1 + 2 * v]), (high, *inverse, &past[2 + 2 * v])]
            {
                let mut own = self.started(state, start);
                for j in 0..y.len() / n - 1 {
                    equations.step(&mut own, &commands[j * m..(j + 1) * m], scratch);
                    for i in 0..n {
                        jacobian[((j + 1) * n + i) * columns + p + v] += sign * own[i];
                    }
                }
            }
        }
    }
}
