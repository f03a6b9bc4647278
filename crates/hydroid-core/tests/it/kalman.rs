//! The extended Kalman filter over state and weights, compared with a naive filter on full matrices, and its
//! invariants.

use std::sync::Arc;

use hydroid_core::adapt::kalman::{
    Correction, Filter, FilterOptions, FilterOptionsError, KalmanNetwork, Learnable, LearnableNetwork,
};
use hydroid_core::adapt::{Learning, Outcome, Rejection, SaveState};
use hydroid_core::model::recurrent::{BaseModel, Linearization, Network, Packed, Recurrent, Scaling};
use hydroid_core::model::sparse::{Equations, Term};
use hydroid_core::predict::{Predictor, Workspace};
use proptest::prelude::*;

use crate::dense::{Matrix, cells, inverse, options, product, sample, transposed, weights};
use crate::jacobians::Dense as _;

fn close(ours: &[f64], theirs: &[f64], what: &str) {
    assert_eq!(ours.len(), theirs.len());
    for (a, b) in ours.iter().zip(theirs) {
        assert!((a - b).abs() < 1e-10 * (1.0 + b.abs()), "{what}: {a} {b}");
    }
}

/// The textbook filter, dense: `P <- F P F' + Q`, `K = P H' S^-1`, `P <- (I - K H) P`.
struct Naive {
    packed: Packed,
    linear: Linearization,
    given: Vec<f64>,
    state: Vec<f64>,
    p: Matrix,
    options: FilterOptions,
}

impl Naive {
    fn new(network: Network, weights: &[f64], options: &FilterOptions) -> Self {
        let packed = Packed::new(network, weights);
        let n = network.state_len();
        let variance = |i: usize| if i < n { options.initial_state } else { options.initial_weights[i - n] };
        let size = n + weights.len();
        let diagonal = |i: usize| (0..size).map(|j| if i == j { variance(i) } else { 0.0 }).collect();
        Self {
            linear: Linearization::new(&packed),
            packed,
            given: weights.to_vec(),
            state: vec![0.0; n],
            p: (0..size).map(diagonal).collect(),
            options: options.clone(),
        }
    }

    fn advance(&mut self, x: &[f64]) {
        let (n, m) = (self.state.len(), self.given.len());
        self.linear.step(&self.packed, &mut self.state, x);
        let (a, b) = (self.linear.dense_state(&self.packed), self.linear.dense_weights(&self.packed));
        let keeps = 1.0 - self.options.leak;
        let grows = keeps / self.options.forgetting.sqrt();
        let mut f = vec![vec![0.0; n + m]; n + m];
        for i in 0..n {
            f[i][..n].copy_from_slice(&a[i * n..(i + 1) * n]);
            f[i][n..].copy_from_slice(&b[i * m..(i + 1) * m]);
        }
        (n..n + m).for_each(|i| f[i][i] = grows);
        self.p = product(&product(&f, &self.p), &transposed(&f));
        for i in 0..n + m {
            self.p[i][i] += if i < n { self.options.state_noise } else { self.options.weight_noise[i - n] };
        }
        let moved: Vec<f64> =
            self.packed.weights().iter().zip(&self.given).map(|(w, g)| g + keeps * (w - g)).collect();
        self.packed.set_weights(&moved);
    }

    fn observe(&mut self, z: &[f64]) {
        let (n, m) = (self.state.len(), self.given.len());
        let mut y = vec![0.0; z.len()];
        self.packed.output(&self.state, &mut y);
        let (c, d) =
            (self.linear.dense_output_state(&self.packed), self.linear.dense_output_weights(&self.packed));
        let measured: Vec<usize> = (0..z.len()).filter(|&i| !z[i].is_nan()).collect();
        let row = |&i: &usize| [&c[i * n..(i + 1) * n], &d[i * m..(i + 1) * m]].concat();
        let h: Matrix = measured.iter().map(row).collect();
        let gain = product(&self.p, &transposed(&h));
        let mut s = product(&h, &gain);
        for (k, &i) in measured.iter().enumerate() {
            s[k][k] += self.options.noise[i];
        }
        let k = product(&gain, &inverse(&s));
        let taken = product(&k, &transposed(&gain));
        self.p.iter_mut().zip(&taken).for_each(|(p, t)| p.iter_mut().zip(t).for_each(|(p, t)| *p -= t));
        let change = |i: usize| -> f64 { measured.iter().zip(&k[i]).map(|(&o, k)| k * (z[o] - y[o])).sum() };
        (0..n).for_each(|i| self.state[i] += change(i));
        let weights: Vec<f64> =
            self.packed.weights().iter().enumerate().map(|(i, w)| w + change(n + i)).collect();
        self.packed.set_weights(&weights);
    }
}

#[test]
fn the_fused_filter_equals_the_naive_one() {
    for network in cells() {
        let (weights, options) = (weights(network, 0.6), options(network));
        let model = LearnableNetwork::new(Packed::new(network, &weights));
        let mut ours = Filter::new(model, options.clone()).unwrap();
        let mut naive = Naive::new(network, &weights, &options);
        for k in 0..60 {
            let (x, z) = sample(k, network.outputs);
            ours.advance(&x);
            naive.advance(&x);
            // Some samples without measurement.
            if k % 4 != 1 {
                ours.observe(&z);
                naive.observe(&z);
            }
            close(ours.state(), &naive.state, "state");
            close(ours.weights(), naive.packed.weights(), "weights");
            let (hh, tt) = ours.variances();
            let diagonal: Vec<f64> = (0..naive.p.len()).map(|i| naive.p[i][i]).collect();
            close(&[hh, tt].concat(), &diagonal, "variances");
        }
    }
}

#[test]
fn weights_without_variance_stay() {
    let network = cells()[2];
    let given = weights(network, 0.6);
    let mut options = options(network);
    let model = LearnableNetwork::new(Packed::new(network, &given));
    let read_out: Vec<usize> =
        model.blocks()[model.structure().transition()..].iter().flatten().copied().collect();
    for i in (0..given.len()).filter(|i| !read_out.contains(i)) {
        (options.initial_weights[i], options.weight_noise[i]) = (0.0, 0.0);
    }
    let mut naive = Naive::new(network, &given, &options);
    let mut ours = Filter::new(model, options).unwrap();
    for k in 0..40 {
        let (x, z) = sample(k, network.outputs);
        ours.advance(&x);
        naive.advance(&x);
        ours.observe(&z);
        naive.observe(&z);
    }
    close(ours.weights(), naive.packed.weights(), "weights");
    close(ours.state(), &naive.state, "state");
    for (i, (ours, given)) in ours.weights().iter().zip(&given).enumerate() {
        assert_eq!(ours.to_bits() != given.to_bits(), read_out.contains(&i), "{i}");
    }
}

fn session(network: Network, base: BaseModel, feedback: bool) -> KalmanNetwork {
    let (n, m) = (network.outputs, 2);
    let network = Network { inputs: if feedback { m + n } else { m }, ..network };
    let scaling = Scaling {
        output_mean: vec![0.3; n],
        output_scale: vec![2.0; n],
        input_mean: vec![0.1; m],
        input_scale: vec![1.5; m],
        correction_scale: vec![if matches!(base, BaseModel::Hold) { 0.2 } else { 2.0 }; n],
    };
    let weights = weights(network, 0.6);
    let model = Recurrent { network, weights, scaling, base, feedback, wash_out: 5 };
    KalmanNetwork::new(Arc::new(model), options(network)).unwrap()
}

fn formulations() -> [KalmanNetwork; 3] {
    [
        session(cells()[2], BaseModel::Nothing, false),
        session(cells()[0], BaseModel::Nothing, true),
        session(cells()[3], BaseModel::Hold, true),
    ]
}

#[test]
fn nothing_is_learned_before_all_outputs_were_measured() {
    let terms = (0..4).map(|v| Term::monomial(&[v])).collect();
    let coefficients = vec![-0.8, 0.1, 0.2, 0.1, -0.2, -1.1, 0.5, 0.1];
    let equations = Equations::with_signals(terms, coefficients, 2, 2, Vec::new(), 0.1, 1).unwrap();
    let network = cells().into_iter().find(|network| network.outputs == 2).unwrap();
    for base in [BaseModel::Hold, BaseModel::Equations(Arc::new(equations))] {
        for feedback in [false, true] {
            let mut session = session(network, base.clone(), feedback);
            let given = session.weights().to_vec();
            for k in 0..40 {
                let (command, _) = sample(k, 2);
                let second = if k < 20 { f64::NAN } else { 0.2 };
                session.observe(&[0.3, second]);
                assert_eq!(session.outcome() == Outcome::Waiting, k <= 20, "{base:?} {feedback} {k}");
                assert_eq!(session.weights() == given, k <= 20, "{base:?} {feedback} {k}");
                session.advance(&command);
            }
        }
    }
}

/// Adaptation reduces the prediction errors for an unknown vessel.
#[test]
fn errors_decrease_during_adaptation() {
    for mut session in formulations() {
        let n = session.outputs();
        let truth = |k: usize, y: &[f64]| -> Vec<f64> {
            let (x, _) = sample(k, 1);
            (0..n).map(|i| 0.8 * y[i] + 0.3 * x[i % 2] + 0.05).collect()
        };
        let (mut y, mut predicted) = (vec![0.0; n], vec![0.0; n]);
        let mut errors = Vec::new();
        for k in 0..1500 {
            session.observe(&y);
            session.advance(&sample(k, 1).0);
            session.output(&mut predicted);
            y = truth(k, &y);
            errors.push(predicted.iter().zip(&y).map(|(a, b)| (a - b).abs()).sum::<f64>());
        }
        let mean =
            |range: std::ops::Range<usize>| errors[range.clone()].iter().sum::<f64>() / range.len() as f64;
        assert!(mean(1300..1500) < 0.25 * mean(0..100), "{} {}", mean(0..100), mean(1300..1500));
    }
}

#[test]
fn a_saved_state_resumes_bit_for_bit_and_forks_predict_the_same() {
    for mut session in formulations() {
        let n = session.outputs();
        for k in 0..30 {
            session.observe(&sample(k, n).1);
            session.advance(&sample(k, n).0);
        }
        let mut other = session.clone();
        other.reset();
        for k in 0..10 {
            other.advance(&sample(k, n).0);
            other.observe(&sample(k + 3, n).1);
        }
        let mut memory = vec![0.0; session.memory_len()];
        session.save(&mut memory);
        other.load(&memory);
        let mut snapshot = vec![0.0; session.snapshot_len()];
        session.snapshot(&mut snapshot);
        let mut fork = other.fork();
        fork.restore(&snapshot);
        let (mut work, mut a, mut b) = (Workspace::new(), vec![0.0; 8 * n], vec![0.0; 8 * n]);
        let commands: Vec<f64> = (0..8).flat_map(|k| sample(k, n).0).collect();
        session.rollout(&commands, &mut work, &mut a);
        fork.rollout(&commands, &mut work, &mut b);
        assert_eq!(a, b);
        for k in 30..60 {
            for session in [&mut session, &mut other] {
                session.observe(&sample(k, n).1);
                session.advance(&sample(k, n).0);
            }
            let bits = |session: &KalmanNetwork| -> Vec<u64> {
                session.weights().iter().map(|w| w.to_bits()).collect()
            };
            assert_eq!(bits(&session), bits(&other), "{k}");
        }
    }
}

#[test]
fn frozen_it_filters_the_state_and_keeps_its_weights() {
    let mut session = session(cells()[2], BaseModel::Nothing, false);
    session.freeze(true);
    let given = session.weights().to_vec();
    let mut open = session.clone();
    let mut differs = false;
    for k in 0..40 {
        session.observe(&sample(k, 3).1);
        open.observe(&[f64::NAN; 3]);
        session.advance(&sample(k, 3).0);
        open.advance(&sample(k, 3).0);
        let (mut a, mut b) = ([0.0; 3], [0.0; 3]);
        session.output(&mut a);
        open.output(&mut b);
        differs |= a != b;
    }
    assert!(differs);
    close(session.weights(), &given, "weights");
    // Earlier changes stay as well: no leak.
    session.freeze(false);
    for k in 0..20 {
        session.observe(&sample(k, 3).1);
        session.advance(&sample(k, 3).0);
    }
    session.freeze(true);
    let learned = session.weights().to_vec();
    assert_ne!(learned, given);
    for k in 0..20 {
        session.advance(&sample(k, 3).0);
        session.observe(&sample(k, 3).1);
    }
    assert_eq!(session.weights(), learned);
}

#[test]
fn invalid_values_are_refused_or_handled() {
    let network = cells()[2];
    let model = || LearnableNetwork::new(Packed::new(network, &weights(network, 0.6)));
    let with = |change: &dyn Fn(&mut FilterOptions)| {
        let mut options = options(network);
        change(&mut options);
        Filter::new(model(), options).err()
    };
    assert_eq!(with(&|t| t.noise[1] = 0.0), Some(FilterOptionsError::Noise));
    assert!(matches!(with(&|t| t.leak = 1.5), Some(FilterOptionsError::Number(_))));
    assert!(matches!(with(&|t| t.forgetting = 0.0), Some(FilterOptionsError::Number(_))));
    assert!(matches!(with(&|t| t.huber = f64::NAN), Some(FilterOptionsError::Number(_))));
    assert!(matches!(with(&|t| t.initial_weights[3] = -1.0), Some(FilterOptionsError::Number(_))));
    assert!(matches!(
        with(&|t| {
            t.weight_noise.pop();
        }),
        Some(FilterOptionsError::Length(_))
    ));
    for mut session in formulations() {
        let n = session.outputs();
        for k in 0..20 {
            session.observe(&sample(k, n).1);
            session.advance(&sample(k, n).0);
        }
        let before = session.weights().to_vec();
        session.observe(&vec![f64::INFINITY; n]);
        assert_eq!(session.outcome(), Outcome::Rejected(Rejection::NotFinite));
        assert_eq!(before, session.weights());
        session.advance(&[f64::NAN, 1e300]);
        session.observe(&vec![1e300; n]);
        for k in 0..30 {
            session.advance(&sample(k, n).0);
            session.observe(&sample(k, n).1);
        }
        assert!(session.weights().iter().all(|w| w.is_finite()));
        let mut y = vec![0.0; n];
        session.output(&mut y);
        assert!(y.iter().all(|y| y.is_finite()), "{y:?}");
    }
}

/// An outlier has the effect of a measurement at the threshold.
#[test]
fn outliers_have_less_weight() {
    let pull = |huber: f64, by: f64| {
        let network = cells()[2];
        let given = weights(network, 0.6);
        let model = LearnableNetwork::new(Packed::new(network, &given));
        let mut filter = Filter::new(model, FilterOptions { huber, ..options(network) }).unwrap();
        filter.advance(&[0.3, 0.1]);
        let mut y = [0.0; 3];
        filter.model().output(filter.state(), &mut y);
        let z = [y[0] + by, f64::NAN, f64::NAN];
        let Correction::Applied { weight, deviations, .. } = filter.observe(&z) else { panic!() };
        let moved: f64 = filter.state().iter().map(|h| h.powi(2)).sum::<f64>();
        let _ = moved;
        let pull: f64 = filter.weights().iter().zip(&given).map(|(a, b)| (a - b).powi(2)).sum();
        (pull.sqrt(), weight, deviations)
    };
    let (_, _, at_100) = pull(f64::INFINITY, 100.0);
    let limit = 100.0 / at_100 * 3.0;
    let (at_limit, ..) = pull(f64::INFINITY, limit);
    let (softened, weight, deviations) = pull(3.0, 100.0);
    assert!((softened / at_limit - 1.0).abs() < 0.05, "{softened} {at_limit}");
    assert!((weight - 3.0 / deviations).abs() < 1e-9);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// For any measurements, variances stay positive, and `S` is at least `R`.
    #[test]
    fn variances_stay_positive(
        which in 0_usize..5,
        seed in 0.0_f64..10.0,
        size in 0.1_f64..3.0,
        initial in -4.0_f64..2.0,
        noise in -5.0_f64..0.0,
    ) {
        let network = cells()[which];
        let model = LearnableNetwork::new(Packed::new(network, &weights(network, size)));
        let r = vec![10_f64.powf(noise); network.outputs];
        let options = FilterOptions {
            leak: 1e-4,
            ..FilterOptions::uniform(network.weights(), 10_f64.powf(initial), 1e-6, (1.0, 1e-5), &r)
        };
        let mut filter = Filter::new(model, options).unwrap();
        for k in 0..300 {
            let t = seed + f64::from(k);
            let x: Vec<f64> = (0..2).map(|i| (0.37 * t + f64::from(i)).sin() * 2.0).collect();
            let z: Vec<f64> = (0..network.outputs).map(|i| (0.9 * t * (1 + i) as f64).sin()).collect();
            filter.advance(&x);
            let made = matches!(filter.observe(&z), Correction::Applied { .. });
            prop_assert!(made);
            let (hh, tt) = filter.variances();
            prop_assert!(hh.iter().chain(&tt).all(|&p| p > 0.0 && p.is_finite()));
            let (_, s) = filter.innovation();
            prop_assert!(s.iter().zip(&r).all(|(s, r)| s >= r));
        }
    }
}
