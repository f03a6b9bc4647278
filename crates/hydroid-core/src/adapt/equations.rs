//! Sparse equations with recursive least squares on their coefficients.

mod adapter;
mod constants;

use alloc::vec;
use alloc::vec::Vec;

use super::increments::Increments;
use super::innovation_gate::Noise;
use super::least_squares::RecursiveLeastSquares;
use super::options::{RecursiveOptions, RecursiveOptionsError};
use super::parametric_session::ParametricSession;
use super::prediction_variance::PredictionVariance;
use super::scale::{rms_over_range, unit_columns};
use super::{Innovation, Outcome, Rejection};
use crate::model::sparse::{Equations, EquationsError, Program, Term};
use crate::predict::{Predictor, delegate, plain};

pub use constants::{EquationsConstants, GroupConstants};

/// Equations with the same terms, which share a regressor and a covariance.
#[derive(Clone, Debug)]
struct Group {
    terms: Vec<usize>,
    outputs: Vec<usize>,
    /// Index of the first weight of each output.
    firsts: Vec<usize>,
    kernel: RecursiveLeastSquares,
    phi: Vec<f64>,
    z: Vec<f64>,
}

/// An [`Adapter`](super::Adapter) of sparse equations (recursive `SINDy`).
///
/// `dy/dt = Xi theta(y, c, s)` is linear in the coefficients `Xi`. A regression row is the increment over a window of
/// samples with the library averaged over it (the `Midpoint` rows of `hydroid::sindy::RegressionForm`); one row is
/// completed every quarter of a window. Each row is one step of [`RecursiveLeastSquares`], weighted by the part of its
/// window that no earlier row covered. A missing value restarts the window. Signals (lag states, past values) are
/// averaged like the outputs; rows start after their warm-up.
///
/// Columns are scaled by the root mean square of their term over the design ranges ([`rms_over_range`]).
#[derive(Clone, Debug)]
pub struct RecursiveEquations {
    session: ParametricSession,
    library: Library,
    groups: Vec<Group>,
    rows: Increments,
    noise: Noise,
    /// `None` for experts of a mixture, which need no bands.
    prediction_variance: Option<PredictionVariance>,
    expected: Vec<f64>,
    lambda: f64,
    /// Weight of a row: part of its window that no earlier row covered.
    weight: f64,
    frozen: bool,
    /// Factor of the noise variance of the next row.
    inflation: f64,
    outcome: Outcome,
    innovations: Vec<Innovation>,
    weights: Vec<f64>,
}

#[derive(Clone, Debug)]
struct Library {
    /// Indices of its terms in the equations.
    used: Vec<usize>,
    program: Program,
    inverse: Vec<f64>,
    slots: Vec<f64>,
    /// Outputs, inputs and signals at the start of the interval.
    start: Vec<f64>,
    /// Whether each of them is constant over the interval.
    holds: Vec<bool>,
    known: bool,
    /// Whether the last sample was complete, and whether a command was given after it.
    held: bool,
    seen: usize,
    phi: Vec<f64>,
    z: Vec<f64>,
}

impl RecursiveEquations {
    /// From identified equations, and the design range `(low, high)` of each output, then each input.
    ///
    /// # Errors
    /// If the options are invalid, or there is no coefficient to adapt.
    pub fn new(
        equations: &Equations,
        ranges: &[(f64, f64)],
        options: &RecursiveOptions,
    ) -> Result<Self, RecursiveOptionsError> {
        Self::with_r_factor(equations, ranges, options, None)
    }

    /// As [`new`](Self::new), with a prior from the training rows: `r_factor` is the upper triangle `T` (`terms x
    /// terms`) of the second moments `T'T` of the library. It sets the scale of each term and the prior information in
    /// each direction, and requires that all terms are adapted.
    ///
    /// # Errors
    /// As [`new`](Self::new); if the triangle does not fit the terms or is singular.
    pub fn with_r_factor(
        equations: &Equations,
        ranges: &[(f64, f64)],
        options: &RecursiveOptions,
        r_factor: Option<&[f64]>,
    ) -> Result<Self, RecursiveOptionsError> {
        let (n, m, count) = (equations.outputs(), equations.inputs(), equations.terms().len());
        options.check(equations, ranges)?;
        let adapts = |i: usize, j: usize| options.all_terms || equations.coefficient(i, j) != 0.0;
        let used: Vec<usize> = (0..count).filter(|&j| (0..n).any(|i| adapts(i, j))).collect();
        let terms: Vec<Term> = used.iter().map(|&j| equations.terms()[j].clone()).collect();
        let places: Vec<usize> = (0..n * count).filter(|p| adapts(p / count, p % count)).collect();
        if places.is_empty() {
            return Err(RecursiveOptionsError::Nothing);
        }
        let program = Program::new(&terms, equations.variables())
            .map_err(|e| RecursiveOptionsError::Equations(EquationsError::Program(e)))?;
        let mut ranges = ranges.to_vec();
        let mut holds: Vec<bool> = (0..n + m).map(|v| v >= n).collect();
        for signal in equations.signals() {
            ranges.push(ranges[usize::from(signal.source())]);
            holds.push(signal.is_held(n));
        }
        let (scales, r_factor) = match r_factor {
            None => (terms.iter().map(|t| rms_over_range(t, &ranges)).collect(), None),
            Some(r_factor) => {
                let (scales, r_factor) =
                    unit_columns(r_factor, count).ok_or(RecursiveOptionsError::RFactor)?;
                if !options.all_terms {
                    return Err(RecursiveOptionsError::RFactor);
                }
                (scales, Some(r_factor))
            }
        };
        let rows = Increments::new(options.window, n, terms.len(), equations.dt());
        let (information, lambda) = options.prior_and_forgetting(&rows, equations.dt(), terms.len())?;
        let mut shared: Vec<(Vec<usize>, Vec<usize>)> = Vec::new();
        for i in 0..n {
            let own: Vec<usize> = (0..used.len()).filter(|&t| adapts(i, used[t])).collect();
            match shared.iter_mut().find(|(terms, _)| *terms == own) {
                _ if own.is_empty() => {}
                Some((_, outputs)) => outputs.push(i),
                None => shared.push((own, vec![i])),
            }
        }
        let group = |(terms, outputs): (Vec<usize>, Vec<usize>)| {
            let scaled = |i: usize| {
                let (terms, used, scales) = (&terms, &used, &scales);
                terms.iter().map(move |&t| equations.coefficient(i, used[t]) * scales[t])
            };
            let theta: Vec<f64> = outputs.iter().flat_map(|&i| scaled(i)).collect();
            // Places go output by output, and term by term within each.
            let firsts = outputs.iter().map(|&i| places.partition_point(|p| p / count < i)).collect();
            Group {
                kernel: match &r_factor {
                    Some(r_factor) => {
                        RecursiveLeastSquares::with_r_factor(&theta, information, r_factor, options.leak)
                    }
                    None => RecursiveLeastSquares::new(terms.len(), &theta, information, options.leak),
                },
                phi: vec![0.0; terms.len()],
                z: vec![0.0; outputs.len()],
                firsts,
                terms,
                outputs,
            }
        };
        let groups: Vec<Group> = shared.into_iter().map(group).collect();
        if !groups.iter().all(|group| group.kernel.is_sound()) {
            return Err(RecursiveOptionsError::RFactor);
        }
        let own = adaptable(equations, &places)?;
        Ok(Self {
            lambda,
            weight: rows.stride() as f64 / rows.samples() as f64,
            noise: Noise::new(n, options.gate, rows.overlap(), rows.stride() as f64 * equations.dt()),
            library: Library {
                used,
                slots: vec![0.0; program.slots()],
                program,
                inverse: scales.iter().map(|s| 1.0 / s).collect(),
                start: vec![f64::NAN; holds.len()],
                holds,
                known: false,
                held: false,
                seen: 0,
                phi: vec![0.0; terms.len()],
                z: vec![0.0; n],
            },
            groups,
            rows,
            frozen: false,
            inflation: 1.0,
            outcome: Outcome::Waiting,
            innovations: Vec::with_capacity(n),
            prediction_variance: Some(
                PredictionVariance::new(&own, &places).map_err(RecursiveOptionsError::Equations)?,
            ),
            expected: vec![f64::NAN; n],
            weights: places.iter().map(|&p| equations.coefficients()[p]).collect(),
            session: ParametricSession::new(own, places),
        })
    }

    /// The equations with the current coefficients.
    pub fn equations(&self) -> &Equations {
        self.session.equations()
    }

    pub(super) fn without_deviations(self) -> Self {
        Self { prediction_variance: None, ..self }
    }

    pub(super) fn parametric_session(&self) -> ParametricSession {
        self.session.clone()
    }

    /// Returns whether a row is complete.
    fn collect(&mut self, y: &[f64]) -> bool {
        let Library { program, inverse, slots, start, holds, known, held, seen, phi, z, .. } =
            &mut self.library;
        *seen = seen.saturating_add(1);
        let complete = y.iter().all(|y| !y.is_nan()) && *seen >= self.session.warm_up();
        let interval = *known && *held;
        let mut ready = false;
        if complete && interval {
            let n = y.len();
            self.session.load(&start[n..], slots);
            for ((slot, a), holds) in slots[1..].iter_mut().zip(&*start).zip(&*holds) {
                *slot = if *holds { *a } else { 0.5 * (a + *slot) };
            }
            program.evaluate(slots);
            let theta = |j: usize| slots[program.slot(j)] * inverse[j];
            ready = self.rows.push(theta, y, phi, z);
        } else if complete {
            self.rows.restart(y);
        }
        *known = complete;
        *held = false;
        ready
    }

    fn learn(&mut self) -> Outcome {
        let (phi, z) = (&self.library.phi, &self.library.z);
        if !phi.iter().chain(z).all(|x| x.is_finite()) {
            self.library.known = false;
            return Outcome::Rejected(Rejection::NotFinite);
        }
        self.innovations.resize(z.len(), Innovation::default());
        for group in &mut self.groups {
            for (own, &t) in group.phi.iter_mut().zip(&group.terms) {
                *own = phi[t];
            }
            for (own, &i) in group.z.iter_mut().zip(&group.outputs) {
                *own = z[i];
            }
            let leverage = group.kernel.predict(&group.phi, &group.z);
            for (&i, &value) in group.outputs.iter().zip(group.kernel.innovations()) {
                self.innovations[i] = Innovation { value, deviation: leverage };
            }
        }
        let outcome = self.noise.judge(&mut self.innovations);
        let share = match outcome {
            Outcome::Accepted => 1.0,
            Outcome::Inflated { weight, .. } => weight,
            _ => return outcome,
        };
        let share = share / self.inflation;
        // The weight is zero if the noise variance is zero.
        if !(1.0 / (share * self.weight)).is_finite() {
            return outcome;
        }
        for group in &mut self.groups {
            group.kernel.correct(share * self.weight);
            group.kernel.forget(self.lambda);
        }
        self.publish();
        outcome
    }

    fn publish(&mut self) {
        for group in &self.groups {
            let n = group.terms.len();
            for (theta, &first) in group.kernel.coefficients().chunks_exact(n).zip(&group.firsts) {
                for ((weight, theta), &t) in self.weights[first..].iter_mut().zip(theta).zip(&group.terms) {
                    *weight = theta * self.library.inverse[t];
                }
            }
        }
        self.session.set_weights(&self.weights);
        self.update_prediction_variance();
    }

    fn update_prediction_variance(&mut self) {
        if let Some(prediction_variance) = &mut self.prediction_variance {
            prediction_variance.set_coefficients(self.session.coefficients());
        }
    }

    fn adopt(&mut self) {
        self.session.weights(&mut self.weights);
        self.update_prediction_variance();
        for group in &mut self.groups {
            let n = group.terms.len();
            for (theta, &first) in group.kernel.coefficients_mut().chunks_exact_mut(n).zip(&group.firsts) {
                for ((theta, weight), &t) in theta.iter_mut().zip(&self.weights[first..]).zip(&group.terms) {
                    *theta = weight / self.library.inverse[t];
                }
            }
        }
    }
}

fn adaptable(equations: &Equations, places: &[usize]) -> Result<Equations, RecursiveOptionsError> {
    let mut ones = vec![0.0; equations.coefficients().len()];
    for &place in places {
        ones[place] = 1.0;
    }
    let mut own = Equations::with_signals(
        equations.terms().to_vec(),
        ones,
        equations.outputs(),
        equations.inputs(),
        equations.signals().to_vec(),
        equations.dt(),
        equations.substeps(),
    )
    .map_err(RecursiveOptionsError::Equations)?;
    own.set_coefficients(equations.coefficients());
    Ok(own)
}

impl Predictor for RecursiveEquations {
    plain!(over_ground advance_observe rollout_snapshots);
    delegate!(session: outputs inputs warm_up output rollout rollout_batch snapshot_len snapshot fork);

    fn reset(&mut self) {
        self.session.reset();
        self.library.known = false;
        self.library.held = false;
        self.library.seen = 0;
        self.expected.fill(f64::NAN);
        if let Some(prediction_variance) = &mut self.prediction_variance {
            prediction_variance.restart();
        }
    }

    fn observe(&mut self, y: &[f64]) {
        if let Some(prediction_variance) = &mut self.prediction_variance {
            prediction_variance.observe(y, &self.expected);
        }
        self.expected.fill(f64::NAN);
        self.session.observe(y);
        self.innovations.clear();
        let ready = self.collect(y);
        self.outcome = if ready && !self.frozen { self.learn() } else { Outcome::Waiting };
        self.inflation = 1.0;
    }

    fn advance(&mut self, c: &[f64]) {
        // An interval with two commands is not part of a row.
        let Library { slots, start, known, held, .. } = &mut self.library;
        *known &= !*held;
        *held = true;
        self.session.load(c, slots);
        for (start, slot) in start.iter_mut().zip(&slots[1..]) {
            *start = *slot;
        }
        self.session.advance(c);
        self.session.output(&mut self.expected);
    }

    /// Restores state and coefficients. The covariance stays, and the window restarts.
    fn restore(&mut self, from: &[f64]) {
        self.session.restore(from);
        self.expected.fill(f64::NAN);
        self.library.known = false;
        self.library.held = false;
        self.adopt();
    }
}
