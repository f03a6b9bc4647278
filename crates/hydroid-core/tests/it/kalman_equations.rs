//! Invariants of the Kalman filter over outputs and coefficients of equations.

use hydroid_core::adapt::kalman::{FilterOptions, FilterOptionsError, KalmanEquations, LearnableEquations};
use hydroid_core::adapt::{Learning, Outcome, RecursiveOptionsError, Rejection, SaveState};
use hydroid_core::model::sparse::{Equations, Term};
use hydroid_core::predict::{Predictor, Workspace};

use crate::damped::{RANGES, close, command, equations, learnable, measured, options, session};

#[test]
fn a_change_of_drag_is_estimated() {
    let deviations = [0.01, 0.002];
    let change = 1000;
    let y = measured(4000, deviations, |k| if k < change { 1.0 } else { 1.6 });
    let model = learnable();
    let noise: Vec<f64> = (0..2).map(|i| (deviations[i] / model.scale()[i]).powi(2)).collect();
    let options = FilterOptions::uniform(model.places().len(), 0.01, 1e-5, (1.0, 1e-8), &noise);
    let mut learning = KalmanEquations::new(model, options).unwrap();
    let mut frozen = learning.clone();
    frozen.freeze(true);
    let given = frozen.weights().to_vec();
    let (mut work, mut ahead) = (Workspace::new(), vec![0.0; 2 * 50]);
    let mut errors = [[0.0; 2]; 2];
    for k in 0..3900 {
        let commands: Vec<f64> = (k..k + 50).map(command).collect();
        for (session, errors) in [&mut learning, &mut frozen].into_iter().zip(&mut errors) {
            session.observe(&y[k]);
            if k >= 2500 {
                session.rollout(&commands, &mut work, &mut ahead);
                (0..2).for_each(|i| errors[i] += (ahead[98 + i] - y[k + 50][i]).powi(2));
            }
            session.advance(&[command(k)]);
        }
    }
    for i in 0..2 {
        assert!(errors[0][i] < 0.3 * errors[1][i], "{errors:?}");
    }
    close(frozen.weights(), &given, 1e-15, "frozen");
}

/// Under the assumptions of the filter.
#[test]
fn deviations_have_their_stated_coverage() {
    let deviations = [0.02, 0.004];
    let y = measured(3000, deviations, |_| 1.02);
    let model = learnable();
    let noise: Vec<f64> = (0..2).map(|i| (deviations[i] / model.scale()[i]).powi(2)).collect();
    let options = FilterOptions::uniform(model.places().len(), 1e-4, 0.0, (1.0, 0.0), &noise);
    let mut session = KalmanEquations::new(model, options).unwrap();
    let (mut work, mut ahead, mut band) = (Workspace::new(), vec![0.0; 2 * 40], [0.0; 6]);
    assert!({
        session.deviations(&[7.0; 40], &[1, 10, 40], &mut work, &mut band);
        band.iter().all(|band| band.is_nan())
    });
    let (mut inside, mut all) = ([0; 3], 0);
    for k in 0..2900 {
        session.observe(&y[k]);
        let commands: Vec<f64> = (k..k + 40).map(command).collect();
        if k > 100 {
            session.rollout(&commands, &mut work, &mut ahead);
            session.deviations(&commands, &[1, 10, 40], &mut work, &mut band);
            for (at, horizon) in [1, 10, 40].into_iter().enumerate() {
                for i in 0..2 {
                    let error = ahead[2 * (horizon - 1) + i] - y[k + horizon][i];
                    // 90 % of the uniform noise are within 1.56 deviations.
                    inside[at] += usize::from(error.abs() < 1.56 * band[2 * at + i]);
                }
            }
            all += 2;
        }
        session.advance(&[command(k)]);
    }
    for inside in inside {
        let share = inside as f64 / f64::from(all);
        assert!((0.86..0.96).contains(&share), "{share}");
    }
}

#[test]
fn a_saved_state_resumes_bit_for_bit_and_forks_predict_the_same() {
    let y = measured(120, [0.02, 0.01], |_| 1.3);
    for at in [0, 1, 2, 40] {
        let mut session = session();
        for k in 0..at {
            session.observe(&y[k]);
            session.advance(&[command(k)]);
        }
        let mut other = session.clone();
        other.reset();
        for k in 0..10 {
            other.observe(&y[k + 50]);
            other.advance(&[command(k)]);
        }
        let mut memory = vec![0.0; session.memory_len()];
        session.save(&mut memory);
        other.load(&memory);
        let mut snapshot = vec![0.0; session.snapshot_len()];
        session.snapshot(&mut snapshot);
        let mut fork = other.fork();
        fork.restore(&snapshot);
        let commands: Vec<f64> = (at..at + 8).map(command).collect();
        let (mut work, mut a, mut b) = (Workspace::new(), [0.0; 16], [0.0; 16]);
        session.rollout(&commands, &mut work, &mut a);
        fork.rollout(&commands, &mut work, &mut b);
        assert_eq!(a.map(f64::to_bits), b.map(f64::to_bits));
        for k in at..at + 40 {
            for session in [&mut session, &mut other] {
                session.observe(&if k % 9 == 4 { [f64::NAN, y[k][1]] } else { y[k] });
                session.advance(&[command(k)]);
            }
            let bits = |session: &KalmanEquations| -> Vec<u64> {
                let mut snapshot = vec![0.0; session.snapshot_len()];
                session.snapshot(&mut snapshot);
                snapshot.iter().chain(session.weights()).map(|w| w.to_bits()).collect()
            };
            assert_eq!(bits(&session), bits(&other), "{at} {k}");
        }
        // A snapshot can be restored into the learning session.
        session.restore(&snapshot);
        let mut again = vec![0.0; snapshot.len()];
        session.snapshot(&mut again);
        assert!(snapshot.iter().zip(&again).all(|(a, b)| a.to_bits() == b.to_bits()));
    }
}

#[test]
fn invalid_values_are_refused_or_handled() {
    let error = LearnableEquations::new(&equations(1.0), &RANGES[..2]).unwrap_err();
    assert_eq!(error, RecursiveOptionsError::Ranges);
    let none = Equations::new(vec![Term::monomial(&[0])], vec![0.0], 1, 0, 0.1, 1).unwrap();
    assert_eq!(LearnableEquations::new(&none, &[(0.0, 1.0)]).unwrap_err(), RecursiveOptionsError::Nothing);
    let error =
        KalmanEquations::new(learnable(), FilterOptions { noise: vec![0.0; 2], ..options() }).unwrap_err();
    assert_eq!(error, FilterOptionsError::Noise);

    let y = measured(200, [0.02, 0.01], |_| 1.3);
    for nonsense in [f64::INFINITY, f64::NAN, 1e200, 1e300] {
        let mut session = session();
        for k in 0..20 {
            session.observe(&y[k]);
            session.advance(&[command(k)]);
        }
        let before = session.weights().to_vec();
        session.observe(&[f64::INFINITY; 2]);
        assert_eq!(session.outcome(), Outcome::Rejected(Rejection::NotFinite));
        assert_eq!(before, session.weights());
        session.advance(&[nonsense]);
        session.observe(&[nonsense; 2]);
        session.advance(&[nonsense]);
        let mut deviation = [0.0; 2];
        session.deviations(&[7.0; 5], &[5], &mut Workspace::new(), &mut deviation);
        if nonsense.abs() > 1.0 && nonsense.is_finite() {
            // The actuator lag has not settled.
            session.reset();
        }
        for k in 20..150 {
            session.observe(&y[k]);
            session.advance(&[command(k)]);
        }
        assert!(session.weights().iter().all(|w| w.is_finite()), "{nonsense}");
        let mut now = [0.0; 2];
        session.output(&mut now);
        assert!((0..2).all(|i| (now[i] - y[150][i]).abs() < 1.0), "{nonsense}: {now:?} {:?}", y[150]);
        session.reset();
        session.output(&mut now);
        assert!(now.iter().all(|y| y.is_nan()));
    }
}
