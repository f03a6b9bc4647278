//! The Kalman filter over outputs and coefficients of equations, compared with a dense filter with finite differences.

use hydroid_core::adapt::kalman::{
    Correction, Filter, FilterOptions, KalmanEquations, Learnable, LearnableEquations,
};
use hydroid_core::adapt::{Learning, Outcome};
use hydroid_core::predict::Predictor;

use crate::damped::{close, command, equations, learnable, measured, options, session};
use crate::dense::{Matrix, inverse, product, transposed};

/// The textbook filter, dense, with Jacobians by central differences of [`Equations::step`].
struct Naive {
    model: LearnableEquations,
    given: Vec<f64>,
    /// Outputs and weights, scaled.
    state: Vec<f64>,
    p: Matrix,
    options: FilterOptions,
}

impl Naive {
    fn new() -> Self {
        let (model, options) = (learnable(), options());
        let given = model.weights().to_vec();
        let variance = |i: usize| if i < 2 { options.initial_state } else { options.initial_weights[i - 2] };
        let size = 2 + given.len();
        let diagonal = |i: usize| (0..size).map(|j| if i == j { variance(i) } else { 0.0 }).collect();
        let state = [&[0.0; 2], &given[..]].concat();
        Self { p: (0..size).map(diagonal).collect(), model, state, given, options }
    }

    fn step(&self, at: &[f64], x: &[f64]) -> [f64; 2] {
        let mut own = equations(1.0);
        let mut coefficients = own.coefficients().to_vec();
        for ((&place, unit), w) in self.model.places().iter().zip(self.model.units()).zip(&at[2..]) {
            coefficients[place] = w * unit;
        }
        own.set_coefficients(&coefficients);
        let mut state = vec![self.model.unscaled(0, at[0]), self.model.unscaled(1, at[1])];
        state.extend(&x[1..]);
        own.step(&mut state, &x[..1], &mut vec![0.0; own.scratch()]);
        [self.model.scaled(0, state[0]), self.model.scaled(1, state[1])]
    }

    fn advance(&mut self, x: &[f64]) {
        let size = self.state.len();
        let keeps = 1.0 - self.options.leak;
        let mut f = vec![vec![0.0; size]; size];
        for j in 0..size {
            let h = 1e-5;
            let moved = |by: f64| {
                let mut at = self.state.clone();
                at[j] += by;
                self.step(&at, x)
            };
            let (up, down) = (moved(h), moved(-h));
            (0..2).for_each(|i| f[i][j] = (up[i] - down[i]) / (2.0 * h));
        }
        (2..size).for_each(|i| f[i][i] = keeps / self.options.forgetting.sqrt());
        let next = self.step(&self.state, x);
        self.p = product(&product(&f, &self.p), &transposed(&f));
        for i in 0..size {
            self.p[i][i] += if i < 2 { self.options.state_noise } else { self.options.weight_noise[i - 2] };
        }
        self.state[..2].copy_from_slice(&next);
        for (w, given) in self.state[2..].iter_mut().zip(&self.given) {
            *w = given + keeps * (*w - given);
        }
    }

    fn observe(&mut self, z: &[f64]) {
        let measured: Vec<usize> = (0..2).filter(|&i| !z[i].is_nan()).collect();
        if measured.is_empty() {
            return;
        }
        let gain: Matrix = self.p.iter().map(|row| measured.iter().map(|&i| row[i]).collect()).collect();
        let mut s: Matrix = measured.iter().map(|&i| gain[i].clone()).collect();
        for (k, &i) in measured.iter().enumerate() {
            s[k][k] += self.options.noise[i];
        }
        let k = product(&gain, &inverse(&s));
        let taken = product(&k, &transposed(&gain));
        self.p.iter_mut().zip(&taken).for_each(|(p, t)| p.iter_mut().zip(t).for_each(|(p, t)| *p -= t));
        let before = self.state.clone();
        for (state, k) in self.state.iter_mut().zip(&k) {
            *state += measured.iter().zip(k).map(|(&o, k)| k * (z[o] - before[o])).sum::<f64>();
        }
    }
}

#[test]
fn the_filter_equals_a_naive_one_with_finite_differences() {
    let mut ours = Filter::new(learnable(), options()).unwrap();
    let mut naive = Naive::new();
    for k in 0..80 {
        let t = k as f64;
        // The memory: the lag of the command, u of one and two samples ago, r of one.
        let u = 2.0 + 0.5 * (0.1 * t).sin();
        let x = [command(k), command(k) - 0.3, u, u - 0.01, 0.1 * (0.2 * t).cos()];
        assert_eq!(ours.model().inputs(), x.len());
        let z = [if k % 7 == 3 { f64::NAN } else { 0.4 * (0.09 * t).sin() }, 0.3 * (0.05 * t).cos()];
        ours.advance(&x);
        naive.advance(&x);
        // Some samples without measurement.
        if k % 4 != 1 {
            assert!(matches!(ours.observe(&z), Correction::Applied { .. }));
            naive.observe(&z);
        }
        close(ours.state(), &naive.state[..2], 1e-7, "state");
        close(ours.weights(), &naive.state[2..], 1e-7, "weights");
        let (hh, tt) = ours.variances();
        let diagonal: Vec<f64> = (0..naive.p.len()).map(|i| naive.p[i][i]).collect();
        close(&[hh, tt].concat(), &diagonal, 1e-7, "variances");
    }
}

/// The session equals the filter with the memory of the signals as input, started from the measurement.
#[test]
fn the_session_uses_the_units_of_the_outputs() {
    let (mut session, mut naive) = (session(), Naive::new());
    let y = measured(60, [0.02, 0.01], |_| 1.2);
    let weights = |naive: &Naive| -> Vec<f64> {
        naive.state[2..].iter().zip(naive.model.units()).map(|(w, unit)| w * unit).collect()
    };
    let outputs = |session: &KalmanEquations| {
        let mut y = [0.0; 2];
        session.output(&mut y);
        y
    };
    // The memory: lag, u one and two samples ago, r one sample ago.
    let (mut lag, mut past) = (f64::NAN, [f64::NAN; 3]);
    let mut begun = false;
    for k in 0..60 {
        let y = if k == 30 { [f64::NAN, y[k][1]] } else { y[k] };
        session.observe(&y);
        if begun {
            let z = [naive.model.scaled(0, y[0]), naive.model.scaled(1, y[1])];
            let expected = [naive.model.unscaled(0, naive.state[0]), naive.model.unscaled(1, naive.state[1])];
            let spread: Vec<f64> = (0..2).map(|i| naive.p[i][i] + naive.options.noise[i]).collect();
            naive.observe(&z);
            assert_eq!(session.outcome(), Outcome::Accepted);
            for i in (0..2).filter(|&i| !y[i].is_nan()) {
                let Some(innovation) = session.innovations().get(i) else { panic!("an innovation") };
                let deviation = naive.model.scale()[i] * spread[i].sqrt();
                close(&[innovation.value, innovation.deviation], &[y[i] - expected[i], deviation], 1e-6, "e");
            }
        } else {
            assert_eq!(session.outcome(), Outcome::Waiting);
            for i in 0..2 {
                naive.state[i] = naive.model.scaled(i, y[i]);
                naive.p[i].fill(0.0);
                naive.p[i][i] = naive.options.noise[i];
            }
        }
        let expected = [naive.model.unscaled(0, naive.state[0]), naive.model.unscaled(1, naive.state[1])];
        close(&outputs(&session), &expected, 1e-6, "outputs");
        close(session.weights(), &weights(&naive), 1e-6, "weights");
        let c = command(k);
        let x = [c, if lag.is_nan() { c } else { lag }, past[0], past[1], past[2]];
        session.advance(&[c]);
        if past.iter().all(|past| past.is_finite()) {
            naive.advance(&x);
            begun = true;
        }
        past = [expected[0], past[0], expected[1]];
        lag = if lag.is_nan() { c } else { c + (lag - c) * (-0.2 / 0.8_f64).exp() };
    }
    assert!(begun);
}
