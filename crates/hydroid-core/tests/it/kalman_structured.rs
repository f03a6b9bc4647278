//! Filters with a block-diagonal covariance of the weights: against the full filter, against a dense implementation of
//! the same equations, and properties that hold for all inputs.

use std::sync::Arc;

use hydroid_core::adapt::kalman::{
    Correction, CovarianceForm, Filter, FilterOptions, FilterOptionsError, KalmanNetwork, Learnable,
    LearnableNetwork,
};
use hydroid_core::adapt::{Learning, SaveState};
use hydroid_core::model::recurrent::{BaseModel, Linearization, Network, Packed, Recurrent, Scaling};
use hydroid_core::predict::{Predictor, Workspace};
use proptest::prelude::*;

use crate::dense::{Matrix, cells, inverse, options, product, sample, transposed, weights};
use crate::jacobians::Dense as _;

const ALL: [CovarianceForm; 3] = [
    CovarianceForm::Blocks { group: 1 },
    CovarianceForm::Blocks { group: 3 },
    CovarianceForm::Blocks { group: usize::MAX },
];

fn near(ours: &[f64], theirs: &[f64], what: &str) {
    assert_eq!(ours.len(), theirs.len());
    for (a, b) in ours.iter().zip(theirs) {
        assert!((a - b).abs() < 1e-8 * (1.0 + b.abs()), "{what}: {a} {b}");
    }
}

fn filter(network: Network, options: FilterOptions) -> Filter<LearnableNetwork> {
    Filter::new(LearnableNetwork::new(Packed::new(network, &weights(network, 0.6))), options).unwrap()
}

/// Equal state, weights and variances with missing measurements, samples without learning, and a restart.
fn go_on_alike(network: Network, options: &FilterOptions, forms: [CovarianceForm; 2]) {
    let mut filters =
        forms.map(|covariance| filter(network, FilterOptions { covariance, ..options.clone() }));
    for k in 0..60 {
        let (x, z) = sample(k, network.outputs);
        for filter in &mut filters {
            filter.learn(!(20..30).contains(&k));
            filter.advance(&x);
            if k == 45 {
                filter.restart();
            }
            if k % 4 != 1 {
                filter.observe(&z);
            }
            if k == 50 {
                filter.reset();
            }
        }
        let [ours, theirs] = &filters;
        near(ours.state(), theirs.state(), "state");
        near(ours.weights(), theirs.weights(), "weights");
        let [(our_hh, our_tt), (hh, tt)] = [ours.variances(), theirs.variances()];
        near(&our_hh, &hh, "variances of the state");
        near(&our_tt, &tt, "variances of the weights");
    }
}

#[test]
fn one_block_of_weights_without_noise_is_the_full_filter() {
    for network in cells() {
        let options = options(network);
        let options = FilterOptions { weight_noise: vec![0.0; network.weights()], ..options };
        let all = CovarianceForm::Blocks { group: usize::MAX };
        // With leak and forgetting, with either, with none.
        for (leak, forgetting) in [(1e-3, 0.998), (1e-3, 1.0), (0.0, 0.998), (0.0, 1.0)] {
            go_on_alike(
                network,
                &FilterOptions { leak, forgetting, ..options.clone() },
                [all, CovarianceForm::Full],
            );
        }
    }
}

fn sum(a: &Matrix, b: &Matrix, factor: f64) -> Matrix {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a + factor * b).collect()).collect()
}

fn diagonal(values: &[f64]) -> Matrix {
    (0..values.len())
        .map(|i| (0..values.len()).map(|j| if i == j { values[i] } else { 0.0 }).collect())
        .collect()
}

/// The definition on dense matrices: `h~ = Psi theta~ + xi`, with the blocks of `P_tt` after each measurement.
struct Naive {
    packed: Packed,
    linear: Linearization,
    given: Vec<f64>,
    state: Vec<f64>,
    psi: Matrix,
    pi: Matrix,
    p: Matrix,
    groups: Vec<usize>,
    options: FilterOptions,
}

impl Naive {
    fn new(network: Network, options: FilterOptions) -> Self {
        let given = weights(network, 0.6);
        let packed = Packed::new(network, &given);
        let (n, m) = (network.state_len(), given.len());
        let mut groups: Vec<usize> = (0..m).collect();
        if let CovarianceForm::Blocks { group } = options.covariance {
            for (b, block) in LearnableNetwork::new(packed.clone()).blocks().iter().enumerate() {
                for &place in block {
                    groups[place] = b / group;
                }
            }
        }
        Self {
            linear: Linearization::new(&packed),
            packed,
            state: vec![0.0; n],
            psi: vec![vec![0.0; m]; n],
            pi: diagonal(&vec![options.initial_state; n]),
            p: diagonal(&options.initial_weights),
            groups,
            given,
            options,
        }
    }

    fn advance(&mut self, x: &[f64]) {
        let (n, m) = (self.state.len(), self.given.len());
        self.linear.step(&self.packed, &mut self.state, x);
        let matrix =
            |flat: Vec<f64>, columns: usize| flat.chunks(columns).map(<[f64]>::to_vec).collect::<Matrix>();
        let a = matrix(self.linear.dense_state(&self.packed), n);
        let b = matrix(self.linear.dense_weights(&self.packed), m);
        let keeps = 1.0 - self.options.leak;
        let grows = keeps / self.options.forgetting.sqrt();
        self.psi = sum(&product(&a, &self.psi), &b, 1.0);
        self.psi.iter_mut().flatten().for_each(|psi| *psi /= grows);
        self.pi = product(&product(&a, &self.pi), &transposed(&a));
        (0..n).for_each(|i| self.pi[i][i] += self.options.state_noise);
        self.p.iter_mut().flatten().for_each(|p| *p *= grows * grows);
        for (i, q) in self.options.weight_noise.iter().enumerate() {
            self.p[i][i] += q;
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
        let rows = |flat: &[f64], columns: usize| -> Matrix {
            measured.iter().map(|&i| flat[i * columns..(i + 1) * columns].to_vec()).collect()
        };
        let (h_h, h_t) = (rows(&c, n), rows(&d, m));
        let seen = sum(&product(&h_h, &self.psi), &h_t, 1.0);
        let of_xi = product(&self.pi, &transposed(&h_h));
        let noise: Vec<f64> = measured.iter().map(|&i| self.options.noise[i]).collect();
        let r = sum(&product(&h_h, &of_xi), &diagonal(&noise), 1.0);
        let gain = product(&self.p, &transposed(&seen));
        let s = inverse(&sum(&product(&seen, &gain), &r, 1.0));
        let e: Matrix = measured.iter().map(|&i| vec![z[i] - y[i]]).collect();
        let pull = product(&s, &e);
        let moved = product(&sum(&product(&self.psi, &gain), &of_xi, 1.0), &pull);
        self.state.iter_mut().zip(&moved).for_each(|(h, by)| *h += by[0]);
        let moved = product(&gain, &pull);
        let weights: Vec<f64> = self.packed.weights().iter().zip(&moved).map(|(w, by)| w + by[0]).collect();
        self.packed.set_weights(&weights);
        let r = inverse(&r);
        let lost = product(&of_xi, &r);
        self.psi = sum(&self.psi, &product(&lost, &seen), -1.0);
        self.pi = sum(&self.pi, &product(&lost, &transposed(&of_xi)), -1.0);
        self.p = sum(&self.p, &product(&product(&gain, &s), &transposed(&gain)), -1.0);
        for i in 0..m {
            for j in (0..m).filter(|&j| self.groups[i] != self.groups[j]) {
                self.p[i][j] = 0.0;
            }
        }
    }

    fn variances(&self) -> (Vec<f64>, Vec<f64>) {
        let hh = sum(&product(&product(&self.psi, &self.p), &transposed(&self.psi)), &self.pi, 1.0);
        let diagonal = |matrix: &Matrix| (0..matrix.len()).map(|i| matrix[i][i]).collect();
        (diagonal(&hh), diagonal(&self.p))
    }
}

#[test]
fn each_structure_equals_the_naive_filter_of_its_definition() {
    for covariance in ALL {
        for network in cells() {
            let options = FilterOptions { covariance, ..options(network) };
            let mut ours = filter(network, options.clone());
            let mut naive = Naive::new(network, options);
            for k in 0..50 {
                let (x, z) = sample(k, network.outputs);
                ours.advance(&x);
                naive.advance(&x);
                if k % 4 != 1 {
                    ours.observe(&z);
                    naive.observe(&z);
                }
                let what = format!("{covariance:?}, sample {k}");
                near(ours.state(), &naive.state, &what);
                near(ours.weights(), naive.packed.weights(), &what);
                let [(our_hh, our_tt), (hh, tt)] = [ours.variances(), naive.variances()];
                near(&our_hh, &hh, &what);
                near(&our_tt, &tt, &what);
            }
        }
    }
}

#[test]
fn stored_numbers() {
    let network = cells()[0];
    let (n, m) = (network.state_len(), network.weights());
    let of_state = n * n + n * m;
    let kept = |covariance| {
        filter(network, FilterOptions { covariance, ..options(network) }).covariance_len() - of_state
    };
    assert_eq!(kept(CovarianceForm::Blocks { group: usize::MAX }), m * (m + 1) / 2);
    let blocks = LearnableNetwork::new(Packed::new(network, &weights(network, 0.6))).blocks().to_vec();
    let triangles = blocks.iter().map(|b| b.len() * (b.len() + 1) / 2).sum::<usize>();
    assert_eq!(kept(CovarianceForm::Blocks { group: 1 }), triangles);
}

/// Weights without variance and noise stay to the last bit; those with noise alone are learned.
#[test]
fn known_weights_stay() {
    let network = cells()[2];
    for covariance in ALL {
        let mut options = FilterOptions { covariance, leak: 0.0, ..options(network) };
        for i in 0..network.weights() {
            match i % 3 {
                0 => (options.initial_weights[i], options.weight_noise[i]) = (0.0, 0.0),
                1 => options.initial_weights[i] = 0.0,
                _ => {}
            }
        }
        let mut filter = filter(network, options);
        let given = filter.weights().to_vec();
        for k in 0..40 {
            let (x, z) = sample(k, network.outputs);
            filter.advance(&x);
            assert_ne!(filter.observe(&z), Correction::Diverged);
        }
        for (i, (ours, given)) in filter.weights().iter().zip(&given).enumerate() {
            assert_eq!(ours.to_bits() != given.to_bits(), i % 3 != 0, "{covariance:?}: {i}");
        }
    }
}

fn session(
    covariance: CovarianceForm,
    which: usize,
    base: BaseModel,
    feedback: bool,
    noisy: bool,
) -> KalmanNetwork {
    let network = cells()[which];
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
    let mut options = FilterOptions { covariance, ..options(network) };
    if !noisy {
        options.weight_noise.fill(0.0);
    }
    let model = Recurrent { network, weights, scaling, base, feedback, wash_out: 5 };
    KalmanNetwork::new(Arc::new(model), options).unwrap()
}

fn errors_fall(mut session: KalmanNetwork, what: &str) {
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
    let mean = |range: std::ops::Range<usize>| errors[range.clone()].iter().sum::<f64>() / range.len() as f64;
    assert!(mean(1300..1500) < 0.5 * mean(0..100), "{what}: {} {}", mean(0..100), mean(1300..1500));
}

#[test]
fn errors_fall_while_it_learns() {
    for covariance in ALL {
        errors_fall(session(covariance, 2, BaseModel::Nothing, false, true), &format!("{covariance:?}"));
        errors_fall(
            session(covariance, 0, BaseModel::Nothing, true, true),
            &format!("{covariance:?}, feedback"),
        );
        errors_fall(session(covariance, 3, BaseModel::Hold, true, true), &format!("{covariance:?}, hold"));
    }
}

#[test]
fn memory_goes_on_to_the_last_bit() {
    for covariance in ALL {
        let mut session = session(covariance, 0, BaseModel::Nothing, false, true);
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
        let mut saved = vec![0.0; session.memory_len()];
        session.save(&mut saved);
        other.load(&saved);
        for k in 30..60 {
            for session in [&mut session, &mut other] {
                session.observe(&sample(k, n).1);
                session.advance(&sample(k, n).0);
            }
            let bits = |session: &KalmanNetwork| -> Vec<u64> {
                let (hh, tt) = session.filter().variances();
                session.weights().iter().chain(&hh).chain(&tt).map(|w| w.to_bits()).collect()
            };
            assert_eq!(bits(&session), bits(&other), "{covariance:?}: {k}");
        }
    }
}

#[test]
fn deviations_ahead_are_those_of_the_full_filter() {
    let forms = [CovarianceForm::Full, CovarianceForm::Blocks { group: usize::MAX }];
    let mut deviations = forms.map(|covariance| {
        let mut session = session(covariance, 2, BaseModel::Nothing, false, false);
        let n = session.outputs();
        for k in 0..30 {
            session.observe(&sample(k, n).1);
            session.advance(&sample(k, n).0);
        }
        session.observe(&sample(30, n).1);
        let commands: Vec<f64> = (30..50).flat_map(|k| sample(k, n).0).collect();
        let mut deviations = vec![0.0; 3 * n];
        session.deviations(&commands, &[1, 5, 20], &mut Workspace::new(), &mut deviations);
        deviations
    });
    let (full, ours) = deviations.split_at_mut(1);
    assert!(full[0].iter().all(|d| *d > 0.0));
    near(&ours[0], &full[0], "deviations");
}

#[test]
fn invalid_values_are_refused_or_handled() {
    let network = cells()[2];
    let model = LearnableNetwork::new(Packed::new(network, &weights(network, 0.6)));
    let covariance = CovarianceForm::Blocks { group: 0 };
    let refused = Filter::new(model, FilterOptions { covariance, ..options(network) }).err();
    assert!(matches!(refused, Some(FilterOptionsError::Number(_))));
    for covariance in ALL {
        let mut session = session(covariance, 2, BaseModel::Nothing, false, true);
        session.advance(&[0.1, 0.2]);
        session.observe(&[1e300; 3]);
        session.advance(&[f64::NAN, 1e300]);
        session.observe(&[f64::INFINITY, 1e300, 0.0]);
        for k in 0..30 {
            session.advance(&sample(k, 3).0);
            session.observe(&sample(k, 3).1);
        }
        assert!(session.weights().iter().all(|w| w.is_finite()));
        let mut y = vec![0.0; 3];
        session.output(&mut y);
        assert!(y.iter().all(|y| y.is_finite()), "{covariance:?}: {y:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// For any measurements, variances stay positive, and `S` is at least `R`.
    #[test]
    fn variances_stay_positive(
        which in 0_usize..5,
        covariance in 0_usize..3,
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
            covariance: ALL[covariance],
            ..FilterOptions::uniform(network.weights(), 10_f64.powf(initial), 1e-6, (1.0, 1e-5), &r)
        };
        let mut filter = Filter::new(model, options).unwrap();
        for k in 0..300 {
            let t = seed + f64::from(k);
            let x: Vec<f64> = (0..2).map(|i| (0.37 * t + f64::from(i)).sin() * 2.0).collect();
            let z: Vec<f64> = (0..network.outputs).map(|i| (0.9 * t * (1 + i) as f64).sin()).collect();
            filter.learn(k % 50 < 40);
            filter.advance(&x);
            let made = matches!(filter.observe(&z), Correction::Applied { .. });
            prop_assert!(made, "lost at {k}");
            let (hh, tt) = filter.variances();
            prop_assert!(hh.iter().chain(&tt).all(|&p| p > 0.0 && p.is_finite()), "{k}: {hh:?} {tt:?}");
            let (_, s) = filter.innovation();
            // The smallest eigenvalue of S is a difference of products.
            prop_assert!(s.iter().zip(&r).all(|(s, r)| *s >= r * (1.0 - 1e-9)), "{k}: {s:?} {r:?}");
        }
    }
}
