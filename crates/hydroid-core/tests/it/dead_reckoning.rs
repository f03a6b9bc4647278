//! Poses beside velocities.

use hydroid_core::control::DeadReckoning;
use hydroid_core::memory::Memory;

const DT: f64 = 0.1;

/// A vessel on a circle, with a pose that sensors change; the time until position and heading are contradicted \[s\].
fn found([u, v, r]: [f64; 3], sensors: impl Fn(f64, &mut [f64; 3], &mut [f64; 3])) -> [Option<f64>; 2] {
    let mut reckoning = DeadReckoning::new(1.0, 10.0);
    let (mut eta, mut found) = ([5.0, -3.0, 3.0], [None; 2]);
    for k in 0..600 {
        let t = f64::from(k) * DT;
        let (mut pose, mut nu) = (eta, [u, v, r]);
        sensors(t, &mut pose, &mut nu);
        let (elapsed, measured) = (if k == 0 { f64::INFINITY } else { DT }, pose);
        reckoning.take(elapsed, nu, &mut pose);
        for (part, at) in [0, 2].into_iter().enumerate() {
            let off = reckoning.off()[part] > 0.0;
            assert_eq!(off, pose[at].is_nan() && !measured[at].is_nan(), "{t}: {reckoning:?}");
            if off {
                found[part].get_or_insert(t);
            }
        }
        let (sin, cos) = (eta[2] + 0.5 * DT * r).sin_cos();
        eta = [eta[0] + DT * (u * cos - v * sin), eta[1] + DT * (u * sin + v * cos), eta[2] + DT * r];
    }
    found
}

#[test]
fn a_pose_that_does_not_move_as_the_velocities_say_is_contradicted() {
    let turn = [1.0, 0.1, 0.2];
    let never = [None; 2];
    // Whatever the turns of the heading, and where it is not measured.
    assert_eq!(found(turn, |_, _, _| ()), never);
    assert_eq!(
        found(turn, |t, pose, _| pose[2] =
            pose[2].sin().atan2(pose[2].cos()) + (t % 3.0).floor() * std::f64::consts::TAU),
        never
    );
    assert_eq!(
        found(turn, |t, pose, _| if (t * 10.0).round() % 5.0 > 0.0 {
            pose.fill(f64::NAN);
        }),
        never
    );
    // A velocity that is wrong by less than a quarter of the speed.
    assert_eq!(found(turn, |t, pose, _| pose[0] += 0.2 * t), never);
    assert_eq!(found(turn, |_, _, nu| nu[2] += 0.02), never);
    let within = |of: Option<f64>, low: f64, high: f64| of.is_some_and(|at| (low..=high).contains(&at));
    assert!(within(found(turn, |t, pose, _| pose[0] += 0.4 * t)[0], 5.0, 15.0));
    assert!(within(found([1.0, 0.0, 0.0], |_, pose, _| pose[..2].fill(0.0))[0], 2.5, 3.5));
    assert!(within(found(turn, |_, pose, _| pose[2] = 3.0)[1], 1.0, 2.0));
    assert!(within(
        found(turn, |t, pose, _| if t > 3.0 {
            pose[2] += 1.0;
        })[1],
        3.0,
        3.2
    ));
    assert!(within(found(turn, |_, _, nu| nu[2] = -nu[2])[1], 0.5, 1.0));
    assert!(within(found([1.0, 0.0, 0.0], |_, _, nu| nu[0] *= 1.944)[0], 2.5, 4.0));
    // Both are wrong together.
    assert_eq!(found(turn, |_, pose, nu| (pose[2], nu[2]) = (0.0, 0.0))[1], None);
}

#[test]
fn its_state_is_saved_and_a_new_run_believes_the_next_pose() {
    let mut one = DeadReckoning::new(1.0, 10.0);
    one.take(f64::INFINITY, [1.0, 0.0, 0.0], &mut [0.0; 3]);
    one.take(0.1, [1.0, 0.0, 0.0], &mut [9.0, 0.0, 0.0]);
    assert!((one.off()[0] - 8.9).abs() < 1e-12, "{one:?}");
    let numbers = Memory::saved(|memory| one.visit_state(memory));
    let mut other = DeadReckoning::new(1.0, 10.0);
    other.visit_state(&mut Memory::Loading(&numbers));
    assert_eq!(one, other);
    one.reset();
    let mut pose = [9.0, 0.0, 1.0];
    one.take(f64::INFINITY, [f64::NAN; 3], &mut pose);
    assert_eq!((pose, one.off()), ([9.0, 0.0, 1.0], [0.0; 2]));
}
