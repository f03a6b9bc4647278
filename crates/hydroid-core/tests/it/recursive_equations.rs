//! Recursive sparse regression along runs whose equations are known.

use hydroid_core::adapt::{
    ExpertMixture, ExpertMixtureOptions, InnovationGate, Learning, Outcome, RecursiveEquations,
    RecursiveOptions, RecursiveOptionsError, Rejection,
};
use hydroid_core::model::sparse::{Equations, EquationsSession, Signal, Term};
use hydroid_core::predict::{Predictor, Workspace};
use std::sync::Arc;

const DT: f64 = 0.1;

/// Surge under quadratic drag and a propeller, yaw rate under a rudder:
/// `du/dt = -d u|u| + 0.5 n`, `dr/dt = -r + 0.8 delta`.
fn vessel(drag: f64) -> Equations {
    let terms = vec![
        Term::signed_square(0, 0),
        Term::monomial(&[1]),
        Term::monomial(&[2]),
        Term::monomial(&[3]),
        Term::constant(),
    ];
    #[rustfmt::skip]
    let coefficients = vec![
        -drag, 0.0,  0.5, 0.0, 0.0,
        0.0,   -1.0, 0.0, 0.8, 0.0,
    ];
    Equations::new(terms, coefficients, 2, 2, DT, 4).unwrap()
}

const RANGES: [(f64, f64); 4] = [(0.0, 2.0), (-0.5, 0.5), (0.0, 2.0), (-0.5, 0.5)];

fn options() -> RecursiveOptions {
    RecursiveOptions {
        forgetting_s: 30.0,
        window: 8,
        prior_s: 0.5,
        leak: true,
        all_terms: false,
        gate: InnovationGate::default(),
    }
}

fn command(k: usize) -> [f64; 2] {
    // Transients: in steady state, more drag is equivalent to less thrust.
    ([0.2, 1.8, 1.0, 0.0][(k / 12) % 4], 0.4 * (0.11 * k as f64).sin()).into()
}

/// White noise, the same on every machine.
fn noise(k: usize, channel: usize, size: f64) -> f64 {
    let x = (k as f64 * 12.9898 + channel as f64 * 78.233).sin() * 43_758.545_3;
    size * 2.0 * (x - x.floor() - 0.5)
}

/// Simulates a vessel and calls `each` with its measurements and commands.
fn simulate(plant: &Equations, samples: usize, mut each: impl FnMut(usize, [f64; 2], [f64; 2])) {
    let mut state = [0.5, 0.0];
    let mut scratch = vec![0.0; plant.scratch()];
    for k in 0..samples {
        each(k, state, command(k));
        plant.step(&mut state, &command(k), &mut scratch);
    }
}

#[test]
fn only_the_changed_drag_is_adapted() {
    let mut adapter = RecursiveEquations::new(&vessel(0.3), &RANGES, &options()).unwrap();
    simulate(&vessel(0.6), 3000, |k, y, c| {
        adapter.observe(&[y[0] + noise(k, 0, 0.01), y[1] + noise(k, 1, 0.01)]);
        adapter.advance(&c);
    });
    let [drag, thrust, damping, rudder] = *adapter.weights() else { panic!() };
    // The prior has a small effect.
    assert!((-0.6..-0.5).contains(&drag), "{drag}");
    assert!((thrust - 0.5).abs() < 0.05 && (damping + 1.0).abs() < 0.1 && (rudder - 0.8).abs() < 0.08);
    assert_eq!(adapter.equations().coefficient(0, 0), drag);
    assert_eq!(adapter.equations().active_terms(), 4);
}

#[test]
fn all_terms_adapt_with_all_terms() {
    let options = RecursiveOptions { all_terms: true, prior_s: 1.0, ..options() };
    let mut adapter = RecursiveEquations::new(&vessel(0.3), &RANGES, &options).unwrap();
    // A current that the equations do not contain.
    let current = Equations::new(
        vessel(0.3).terms().to_vec(),
        vec![-0.3, 0.0, 0.5, 0.0, -0.1, 0.0, -1.0, 0.0, 0.8, 0.0],
        2,
        2,
        DT,
        4,
    )
    .unwrap();
    simulate(&current, 3000, |_, y, c| {
        adapter.observe(&y);
        adapter.advance(&c);
    });
    let found = adapter.equations().coefficient(0, 4);
    assert!((found + 0.1).abs() < 0.02, "{found}");
    assert_eq!(adapter.weights().len(), 10);
}

/// Without forgetting and with a negligible prior, the coefficients equal batch least squares on the same rows.
#[test]
fn a_row_is_the_increment_over_a_window_against_the_averaged_library() {
    let terms = vec![Term::monomial(&[0]), Term::monomial(&[1])];
    let equations = Equations::new(terms, vec![-1.0, 1.0], 1, 1, DT, 1).unwrap();
    let options = RecursiveOptions {
        forgetting_s: f64::INFINITY,
        window: 4,
        prior_s: 1e-12,
        gate: InnovationGate::OPEN,
        ..options()
    };
    let mut adapter = RecursiveEquations::new(&equations, &[(-1.0, 1.0); 2], &options).unwrap();
    let y: Vec<f64> = (0..200).map(|k| (0.3 * k as f64).sin() + noise(k, 0, 0.1)).collect();
    let c: Vec<f64> = (0..200).map(|k| noise(k, 1, 1.0)).collect();
    let (mut a, mut b) = ([[0.0; 2]; 2], [0.0; 2]);
    for k in 0..200 {
        adapter.observe(&[y[k]]);
        adapter.advance(&[c[k]]);
        if k < 4 {
            assert_eq!(adapter.outcome(), Outcome::Waiting);
            continue;
        }
        assert_eq!(adapter.outcome(), Outcome::Accepted);
        let phi = [
            (k - 4..k).map(|i| 0.125 * (y[i] + y[i + 1])).sum::<f64>(),
            (k - 4..k).map(|i| 0.25 * c[i]).sum::<f64>(),
        ];
        let z = (y[k] - y[k - 4]) / (4.0 * DT);
        for i in 0..2 {
            b[i] += phi[i] * z;
            for j in 0..2 {
                a[i][j] += phi[i] * phi[j];
            }
        }
    }
    let determinant = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    let batch =
        [(a[1][1] * b[0] - a[0][1] * b[1]) / determinant, (a[0][0] * b[1] - a[1][0] * b[0]) / determinant];
    for (found, batch) in adapter.weights().iter().zip(batch) {
        assert!((found - batch).abs() < 1e-8, "{found} against {batch}");
    }
}

#[test]
fn a_missing_value_removes_only_its_window() {
    let mut adapter = RecursiveEquations::new(&vessel(0.3), &RANGES, &options()).unwrap();
    let mut learned = Vec::new();
    simulate(&vessel(0.3), 60, |k, mut y, c| {
        if k == 30 {
            y[1] = f64::NAN;
        }
        adapter.observe(&y);
        adapter.advance(&c);
        if adapter.outcome() != Outcome::Waiting {
            learned.push(k);
        }
        assert!(adapter.weights().iter().all(|w| w.is_finite()));
    });
    // A window of 8 and a row every 2 samples; after the gap a whole window again.
    let expected: Vec<usize> = (8..30).step_by(2).chain((39..60).step_by(2)).collect();
    assert_eq!(learned, expected);
    let mut now = [0.0; 2];
    adapter.output(&mut now);
    assert!(now.iter().all(|y| y.is_finite()));
}

/// A spike in steady state hardly changes the coefficients of the gated session.
#[test]
fn a_spike_is_rejected_and_a_lasting_change_is_accepted() {
    let spiked = |gate| {
        let options = RecursiveOptions { gate, ..options() };
        let mut adapter = RecursiveEquations::new(&vessel(0.3), &RANGES, &options).unwrap();
        let mut rejected = 0;
        simulate(&vessel(0.3), 1500, |k, y, c| {
            let spike = if k % 200 == 150 { 3.0 } else { 0.0 };
            adapter.observe(&[y[0] + spike + noise(k, 0, 0.01), y[1] + noise(k, 1, 0.01)]);
            adapter.advance(&c);
            rejected += usize::from(matches!(
                adapter.outcome(),
                Outcome::Rejected(Rejection::Outlier { deviations }) if deviations > 10.0
            ));
        });
        (rejected, (adapter.weights()[0] + 0.3).abs())
    };
    let (rejected, gated) = spiked(InnovationGate::default());
    let (none, open) = spiked(InnovationGate::OPEN);
    assert_eq!(none, 0);
    assert!(rejected >= 7, "{rejected}");
    assert!(gated < 0.02 && gated < 0.2 * open, "{gated} against {open}");

    // Without noise, a change of the vessel exceeds every gate; it is accepted nevertheless.
    let mut adapter = RecursiveEquations::new(&vessel(0.3), &RANGES, &options()).unwrap();
    for drag in [0.3, 0.6] {
        adapter.reset();
        simulate(&vessel(drag), 3000, |_, y, c| {
            adapter.observe(&y);
            adapter.advance(&c);
        });
    }
    assert!(adapter.weights()[0] < -0.5, "{}", adapter.weights()[0]);
}

#[test]
fn infinite_measurements_are_rejected_and_leave_no_trace() {
    let mut adapter = RecursiveEquations::new(&vessel(0.3), &RANGES, &options()).unwrap();
    let mut not_finite = 0;
    simulate(&vessel(0.3), 400, |k, mut y, c| {
        if k == 200 {
            y[0] = f64::INFINITY;
        }
        adapter.observe(&y);
        adapter.advance(&c);
        not_finite += usize::from(adapter.outcome() == Outcome::Rejected(Rejection::NotFinite));
    });
    assert!(not_finite > 0);
    assert!((adapter.weights()[0] + 0.3).abs() < 0.01, "{}", adapter.weights()[0]);
}

#[test]
fn snapshots_contain_the_current_weights_and_frozen_sessions_do_not_adapt() {
    let mut adapter = RecursiveEquations::new(&vessel(0.3), &RANGES, &options()).unwrap();
    let mut early = vec![0.0; adapter.snapshot_len()];
    let commands: Vec<f64> = (0..50).flat_map(command).collect();
    let (mut work, mut before) = (Workspace::new(), vec![0.0; 100]);
    simulate(&vessel(0.6), 1000, |k, y, c| {
        adapter.observe(&y);
        if k == 200 {
            adapter.snapshot(&mut early);
            adapter.rollout(&commands, &mut work, &mut before);
        }
        adapter.advance(&c);
    });
    let mut fork = adapter.fork();
    let mut y = vec![0.0; 100];
    fork.restore(&early);
    fork.rollout(&commands, &mut work, &mut y);
    assert_eq!(y, before);
    let weights = adapter.weights().to_vec();
    assert_ne!(adapter.equations().coefficient(0, 0), early[2]);
    assert_eq!(adapter.equations().coefficient(0, 0), weights[0]);
    adapter.restore(&early);
    assert_eq!(adapter.weights(), &early[2..]);
    adapter.rollout(&commands, &mut work, &mut y);
    assert_eq!(y, before);

    adapter.freeze(true);
    simulate(&vessel(0.6), 200, |_, y, c| {
        adapter.observe(&y);
        adapter.advance(&c);
        assert_eq!(adapter.outcome(), Outcome::Waiting);
    });
    assert_eq!(adapter.weights(), &early[2..]);
}

/// An adapter without accepted rows predicts bit for bit as the frozen session.
#[test]
fn without_adaptation_the_session_equals_the_frozen_session() {
    let equations = vessel(0.3);
    let mut adapter = RecursiveEquations::new(&equations, &RANGES, &options()).unwrap();
    adapter.freeze(true);
    let mut frozen = EquationsSession::new(Arc::new(equations));
    simulate(&vessel(0.6), 100, |_, y, c| {
        adapter.observe(&y);
        frozen.observe(&y);
        adapter.advance(&c);
        frozen.advance(&c);
        let (mut a, mut b) = ([0.0; 2], [0.0; 2]);
        adapter.output(&mut a);
        frozen.output(&mut b);
        assert_eq!(a, b);
    });
}

#[test]
fn signals_equal_those_of_the_identification() {
    // du/dt = -a u + b lag(n) + e u(-3 samples)
    let terms = vec![Term::monomial(&[0]), Term::monomial(&[2]), Term::monomial(&[3])];
    let signals = vec![
        Signal::Lag { input: 1, time_constant_s: hydroid_core::model::sparse::Real(1.0) },
        Signal::Past { variable: 0, samples: 3 },
    ];
    let with = |coefficients: Vec<f64>| {
        Equations::with_signals(terms.clone(), coefficients, 1, 1, signals.clone(), DT, 2).unwrap()
    };
    let options = RecursiveOptions { window: 4, forgetting_s: f64::INFINITY, prior_s: 1e-6, ..options() };
    let shore = with(vec![-0.7, 1.0, 0.3]);
    let mut adapter = RecursiveEquations::new(&shore, &[(-1.0, 1.0); 2], &options).unwrap();
    let truth = with(vec![-1.0, 1.5, 0.2]);
    let mut plant = EquationsSession::new(Arc::new(truth));
    let mut y = [0.0];
    for k in 0..6000usize {
        if k < 4 {
            plant.observe(&[0.2]);
        }
        plant.output(&mut y);
        adapter.observe(&y);
        assert!(k >= plant.warm_up() || adapter.outcome() == Outcome::Waiting);
        let c = [if (k / 17) % 3 == 0 { 0.8 } else { -0.3 + 0.2 * (0.1 * k as f64).sin() }];
        adapter.advance(&c);
        plant.advance(&c);
    }
    for (found, truth) in adapter.weights().iter().zip([-1.0, 1.5, 0.2]) {
        // The mean of the ends of a lag is not its mean: an error of second order in the sample time.
        assert!((found - truth).abs() < 0.06, "{:?}", adapter.weights());
    }
}

#[test]
fn invalid_options_are_refused_with_a_reason() {
    let new =
        |options: RecursiveOptions| RecursiveEquations::new(&vessel(0.3), &RANGES, &options).map(|_| ());
    let bad = [
        RecursiveOptions { forgetting_s: 0.0, ..options() },
        RecursiveOptions { forgetting_s: f64::NAN, ..options() },
        RecursiveOptions { prior_s: f64::INFINITY, ..options() },
        RecursiveOptions { prior_s: -1.0, ..options() },
    ];
    assert!(bad.into_iter().all(|s| matches!(new(s), Err(RecursiveOptionsError::Time(_)))));
    assert_eq!(new(RecursiveOptions { window: 0, ..options() }), Err(RecursiveOptionsError::Window));
    let ranges = RecursiveEquations::new(&vessel(0.3), &RANGES[..3], &options()).map(|_| ());
    assert_eq!(ranges, Err(RecursiveOptionsError::Ranges));
    let empty = Equations::new(vec![Term::constant()], vec![0.0], 1, 0, DT, 1).unwrap();
    let nothing = RecursiveEquations::new(&empty, &[(0.0, 1.0)], &options()).map(|_| ());
    assert_eq!(nothing, Err(RecursiveOptionsError::Nothing));
}

fn mixture(window: usize) -> ExpertMixtureOptions {
    ExpertMixtureOptions {
        priors_s: vec![300.0, 0.5],
        forgetting_s: 60.0,
        window,
        horizon: 40,
        gate: InnovationGate::default(),
    }
}

/// Weights of the experts with a strong and a weak prior, the reference coefficients and zero coefficients after 300 s.
fn weights_of_experts(drag: f64) -> Vec<f64> {
    let mut session = ExpertMixture::new(&vessel(0.3), &RANGES, &mixture(8), None).unwrap();
    simulate(&vessel(drag), 3000, |k, y, c| {
        session.observe(&[y[0] + noise(k, 0, 0.01), y[1] + noise(k, 1, 0.01)]);
        session.advance(&c);
    });
    session.expert_weights().to_vec()
}

#[test]
fn a_mixture_follows_the_best_forgetting_factor() {
    let [cautious, quick, given, none] = weights_of_experts(0.9)[..] else { panic!() };
    assert!(quick > 0.8 && quick > cautious && cautious > given, "{cautious} {quick} {given} {none}");
    let [cautious, quick, given, none] = weights_of_experts(0.3)[..] else { panic!() };
    assert!(given + cautious > quick && none < 0.01, "{cautious} {quick} {given} {none}");
}

#[test]
fn a_mixture_predicts_by_one_expert_and_snapshots_contain_it() {
    let mut session = ExpertMixture::new(&vessel(0.3), &RANGES, &mixture(8), None).unwrap();
    let commands: Vec<f64> = (0..40).flat_map(command).collect();
    let (mut work, mut early, mut again) = (Workspace::new(), [0.0; 80], [0.0; 80]);
    let mut snapshot = vec![0.0; session.snapshot_len()];
    simulate(&vessel(0.6), 2000, |k, y, c| {
        session.observe(&if k % 700 == 650 { [f64::NAN, y[1]] } else { y });
        if k == 1000 {
            session.snapshot(&mut snapshot);
            session.rollout(&commands, &mut work, &mut early);
        }
        session.advance(&c);
    });
    assert_eq!(session.equations().coefficients(), session.weights());
    assert!((session.expert_weights().iter().sum::<f64>() - 1.0).abs() < 1e-12);
    let mut fork = session.fork();
    fork.restore(&snapshot);
    fork.rollout(&commands, &mut work, &mut again);
    assert_eq!(early, again);
    session.restore(&snapshot);
    session.rollout(&commands, &mut work, &mut again);
    assert_eq!(early, again);
}

#[test]
fn a_mixture_without_experts_or_with_a_singular_prior_is_refused() {
    let none = ExpertMixtureOptions { priors_s: Vec::new(), ..mixture(8) };
    let made = |options: &ExpertMixtureOptions, r_factor: Option<&[f64]>| {
        ExpertMixture::new(&vessel(0.3), &RANGES, options, r_factor).map(|_| ()).unwrap_err()
    };
    assert_eq!(made(&none, None), RecursiveOptionsError::Experts);
    assert_eq!(made(&mixture(8), Some(&[0.0; 25])), RecursiveOptionsError::RFactor);
    assert_eq!(made(&mixture(8), Some(&[1.0; 24])), RecursiveOptionsError::RFactor);
}

#[test]
fn options_whose_numbers_overflow_are_refused() {
    let made = |change: &dyn Fn(&mut RecursiveOptions)| {
        let mut options = options();
        change(&mut options);
        RecursiveEquations::new(&vessel(0.3), &RANGES, &options).map(|_| ())
    };
    let prior = RecursiveOptionsError::Extreme("the weight of the prior");
    // Values that overflow.
    assert_eq!(made(&|s| s.prior_s = 1e308), Err(prior.clone()));
    assert_eq!(made(&|s| s.prior_s = 1e-310), Err(prior));
    assert_eq!(made(&|s| s.forgetting_s = 1e-4), Err(RecursiveOptionsError::Extreme("the forgetting time")));
    assert_eq!(made(&|s| s.window = usize::MAX), Err(RecursiveOptionsError::Window));
    for (inflate, reject) in [(0.0, 1.0), (3.0, 2.0), (f64::NAN, 3.0), (3.0, f64::NAN), (-1.0, 1.0)] {
        assert_eq!(made(&|s| s.gate = InnovationGate { inflate, reject }), Err(RecursiveOptionsError::Gate));
    }
    assert_eq!(made(&|s| (s.gate, s.forgetting_s) = (InnovationGate::OPEN, f64::INFINITY)), Ok(()));
}

#[test]
fn a_row_with_weight_zero_changes_nothing() {
    // An exact model has innovations of zero: a spike has infinite normalized size.
    let options = RecursiveOptions {
        gate: InnovationGate { inflate: 3.0, reject: f64::INFINITY },
        window: 1,
        ..options()
    };
    let still = Equations::new(vec![Term::monomial(&[0])], vec![-1.0], 1, 0, DT, 1).unwrap();
    let mut session = RecursiveEquations::new(&still, &[(-1.0, 1.0)], &options).unwrap();
    let mut weightless = 0;
    for k in 0..60 {
        session.observe(&[if k == 50 { 1.0 } else { 0.0 }]);
        session.advance(&[]);
        weightless += usize::from(matches!(session.outcome(), Outcome::Inflated { weight: 0.0, .. }));
        assert!(session.weights()[0].is_finite(), "sample {k}");
    }
    assert!(weightless > 0);
}

#[test]
fn a_mixture_from_a_damaged_file_is_refused() {
    let made = |change: &dyn Fn(&mut ExpertMixtureOptions), r_factor: Option<&[f64]>| {
        let mut options = mixture(8);
        change(&mut options);
        ExpertMixture::new(&vessel(0.3), &RANGES, &options, r_factor).map(|_| ()).unwrap_err()
    };
    for horizon in [0, 1 << 40, usize::MAX] {
        assert_eq!(made(&|s| s.horizon = horizon, None), RecursiveOptionsError::Experts);
    }
    assert_eq!(made(&|s| s.priors_s = vec![1.0; 1000], None), RecursiveOptionsError::Experts);
    assert_eq!(made(&|s| s.window = usize::MAX / 2, None), RecursiveOptionsError::Window);
    assert!(matches!(made(&|s| s.priors_s[1] = 1e308, None), RecursiveOptionsError::Extreme(_)));
    assert_eq!(made(&|s| s.gate.inflate = f64::NAN, None), RecursiveOptionsError::Gate);
    for (at, value) in [(0, f64::NAN), (0, 1e200), (0, 1e-200), (7, f64::INFINITY), (5, 1.0)] {
        let mut r_factor: Vec<f64> = (0..25).map(|k| f64::from(u8::from(k % 6 == 0))).collect();
        r_factor[at] = value;
        assert_eq!(made(&|_| (), Some(&r_factor)), RecursiveOptionsError::RFactor, "{value} at {at}");
    }
}

/// Coverage of the 80 % band at horizons of 1, 5 and 20 samples, for a vessel with sensor and process noise.
fn coverage(sensor: f64, force: f64) -> [f64; 3] {
    const HORIZONS: [usize; 3] = [1, 5, 20];
    let mut adapter = RecursiveEquations::new(&vessel(0.4), &RANGES, &options()).unwrap();
    let plant = vessel(0.4);
    let (mut state, mut scratch) = ([0.5, 0.0], vec![0.0; plant.scratch()]);
    let mut work = Workspace::new();
    let mut predicted: Vec<([f64; 40], [f64; 6])> = Vec::new();
    let (mut inside, mut all) = ([0.0; 3], 0.0);
    for k in 0..4000 {
        let y = [state[0] + noise(k, 0, sensor), state[1] + noise(k, 1, sensor)];
        adapter.observe(&y);
        if k > 1000 {
            for (h, count) in HORIZONS.iter().zip(&mut inside) {
                let (ahead, deviations) = &predicted[k - h];
                let at = HORIZONS.iter().position(|x| x == h).unwrap();
                for i in 0..2 {
                    let miss = (y[i] - ahead[2 * (h - 1) + i]).abs();
                    *count += f64::from(u8::from(miss <= 1.2816 * deviations[2 * at + i]));
                }
            }
            all += 2.0;
        }
        let commands: Vec<f64> = (k..k + 20).flat_map(command).collect();
        let (mut ahead, mut deviations) = ([0.0; 40], [0.0; 6]);
        adapter.rollout(&commands, &mut work, &mut ahead);
        adapter.deviations(&commands, &HORIZONS, &mut work, &mut deviations);
        assert_eq!(k < 66, deviations[0].is_nan(), "{k}: {deviations:?}");
        predicted.push((ahead, deviations));
        adapter.advance(&command(k));
        plant.step(&mut state, &command(k), &mut scratch);
        state[0] += noise(k, 2, force);
        state[1] += noise(k, 3, force);
    }
    inside.map(|n| n / all)
}

#[test]
fn bands_cover_the_measurements_with_sensor_or_process_noise() {
    for (sensor, force) in [(0.01, 0.0), (0.0, 0.004), (0.01, 0.002)] {
        for share in coverage(sensor, force) {
            // The noise is uniform, with narrower tails than a normal distribution.
            assert!((0.70..0.90).contains(&share), "{sensor} {force}: {:?}", coverage(sensor, force));
        }
    }
}

#[test]
fn bands_widen_with_missing_measurements_and_with_the_horizon() {
    let mut adapter = RecursiveEquations::new(&vessel(0.4), &RANGES, &options()).unwrap();
    let (mut work, mut before, mut after) = (Workspace::new(), [0.0; 4], [0.0; 4]);
    let plant = vessel(0.4);
    let (mut state, mut scratch) = ([0.5, 0.0], vec![0.0; plant.scratch()]);
    for k in 0..500 {
        adapter.observe(&[state[0] + noise(k, 0, 0.002), state[1] + noise(k, 1, 0.002)]);
        adapter.advance(&command(k));
        plant.step(&mut state, &command(k), &mut scratch);
        state[0] += noise(k, 2, 0.01);
        state[1] += noise(k, 3, 0.01);
    }
    adapter.deviations(&[1.0; 20], &[1, 10], &mut work, &mut before);
    for k in 500..505 {
        adapter.observe(&[f64::NAN; 2]);
        adapter.advance(&command(k));
    }
    adapter.deviations(&[1.0; 20], &[1, 10], &mut work, &mut after);
    assert!(before.iter().all(|x| *x > 0.0 && *x < 0.1), "{before:?}");
    assert!(before[2] > 1.5 * before[0] && after[0] > 1.5 * before[0], "{before:?} {after:?}");
}
