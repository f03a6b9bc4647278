//! Equations of the navigation filter against finite differences, a dense filter and statistics of the processes.

use hydroid_core::navigation::{Filter, Measurement, Mounting, Noise, Prior, STATES, State, Transition};

fn noise() -> Noise {
    Noise {
        surge_rate: 0.05,
        surge_acceleration: 0.04,
        sway_rate: 0.08,
        sway: 0.3,
        pivot_rate: 0.05,
        yaw_rate: 0.1,
        yaw: 0.03,
        wave_frequency: 0.9,
        wave_damping: 0.05,
        wave_forward: 0.1,
        wave_starboard: 0.2,
        gnss_rate: 0.02,
        gnss: 0.8,
        compass_rate: 0.3,
        compass: 0.005,
        gyro_walk: 1e-5,
        accelerometer_walk: 1e-4,
        current_walk: 1e-3,
    }
}

/// A turning vessel: no state is zero.
fn turning() -> [f64; STATES] {
    let mut mean = [0.0; STATES];
    for (i, x) in mean.iter_mut().enumerate() {
        *x = 0.02 * (i as f64 + 1.0) * if i % 3 == 0 { -1.0 } else { 1.0 };
    }
    for (state, value) in [
        (State::North, 120.0),
        (State::East, -40.0),
        (State::Heading, 0.7),
        (State::Surge, 4.0),
        (State::Sway, -0.4),
        (State::YawRate, 0.05),
        (State::YawAcceleration, 0.01),
        (State::Pivot, 12.0),
        (State::PivotShift, -30.0),
        (State::PivotSlope, 4.0),
        (State::LaggedYawRate, 0.03),
        (State::Heel, -1.3),
        (State::Delay, 0.4),
    ] {
        mean[state as usize] = value;
    }
    mean
}

fn measurements() -> Vec<Measurement> {
    let mounting = Mounting { forward: -16.0, starboard: 3.0 };
    let value = [3.0, -1.5];
    vec![
        Measurement::Position { value, deviation: 0.5, mounting },
        Measurement::Velocity { value, deviation: 0.05, mounting },
        Measurement::Heading { value: 0.9, deviation: 0.01 },
        Measurement::YawRate { value: 0.06, deviation: 0.001 },
        Measurement::SpecificForce { value, deviation: [0.02, 0.03], mounting },
        Measurement::OverGround { value, deviation: 0.05, mounting },
        Measurement::ThroughWater { value, deviation: 0.05, mounting },
    ]
}

fn prior(mean: [f64; STATES]) -> Prior {
    Prior { mean, deviation: [0.5; STATES], ..Prior::default() }
}

/// Residual and derivatives of each scalar of a measurement.
fn scalars(measurement: &Measurement, mean: [f64; STATES]) -> Vec<(f64, [f64; STATES])> {
    // Without uncertainty nothing is learned from the first scalar before the second.
    let mut filter =
        Filter::new(noise(), &Prior { mean, deviation: [0.0; STATES], ..Prior::default() }, f64::INFINITY);
    let mut found = Vec::new();
    // The stationary states keep their variances, so only the first scalar is compared with the given mean.
    filter.update(measurement, |update| found.push((update.innovation.value, update.gradient)));
    found
}

#[test]
fn derivatives_of_measurements_are_those_of_finite_differences() {
    let mean = turning();
    for measurement in measurements() {
        let (residual, gradient) = scalars(&measurement, mean)[0];
        for i in 0..STATES {
            let step = 1e-6 * (1.0 + mean[i].abs());
            let shifted = |sign: f64| {
                let mut mean = mean;
                mean[i] += sign * step;
                scalars(&measurement, mean)[0].0
            };
            let slope = -(shifted(1.0) - shifted(-1.0)) / (2.0 * step);
            let error = (slope - gradient[i]).abs();
            assert!(
                error < 1e-5 * (1.0 + slope.abs()),
                "{measurement:?}, state {i}: {slope} and {}",
                gradient[i]
            );
        }
        assert!(residual.is_finite());
    }
}

/// The second value of a pair, seen alone: a value that is not finite does not count.
#[test]
fn derivatives_of_second_values_are_those_of_finite_differences() {
    let mounting = Mounting { forward: -16.0, starboard: 3.0 };
    let value = [f64::NAN, -1.5];
    let pairs = [
        Measurement::Position { value, deviation: 0.5, mounting },
        Measurement::Velocity { value, deviation: 0.05, mounting },
        Measurement::SpecificForce { value, deviation: [0.02, 0.03], mounting },
        Measurement::OverGround { value, deviation: 0.05, mounting },
        Measurement::ThroughWater { value, deviation: 0.05, mounting },
    ];
    let mean = turning();
    for measurement in pairs {
        let found = scalars(&measurement, mean);
        assert_eq!(found.len(), 1);
        for i in 0..STATES {
            let step = 1e-6 * (1.0 + mean[i].abs());
            let shifted = |sign: f64| {
                let mut mean = mean;
                mean[i] += sign * step;
                scalars(&measurement, mean)[0].0
            };
            let slope = -(shifted(1.0) - shifted(-1.0)) / (2.0 * step);
            let error = (slope - found[0].1[i]).abs();
            assert!(error < 1e-5 * (1.0 + slope.abs()), "{measurement:?}, state {i}: {slope}");
        }
    }
}

/// The columns of `F`, read from the propagation of a state with one uncertain entry.
fn dense(dt: f64) -> Vec<[f64; STATES]> {
    let mut columns = Vec::new();
    for j in 0..STATES {
        let mut mean = turning();
        let transition = Transition::new(&noise(), &mut mean, dt);
        // F' e_i has the entry F[i][j] in place j.
        let column = std::array::from_fn(|i| {
            let mut unit = [0.0; STATES];
            unit[i] = 1.0;
            transition.transpose(&mut unit);
            unit[j]
        });
        columns.push(column);
    }
    columns
}

#[test]
fn the_transition_is_the_derivative_of_the_motion() {
    let dt = 0.2;
    for (j, column) in dense(dt).iter().enumerate() {
        let start = turning();
        let step = 1e-6 * (1.0 + start[j].abs());
        let moved = |sign: f64| {
            let mut mean = start;
            mean[j] += sign * step;
            Transition::new(&noise(), &mut mean, dt);
            mean
        };
        let (up, down) = (moved(1.0), moved(-1.0));
        for i in 0..STATES {
            let slope = (up[i] - down[i]) / (2.0 * step);
            assert!(
                (slope - column[i]).abs() < 1e-6 * (1.0 + slope.abs()),
                "{i}, {j}: {slope} and {}",
                column[i]
            );
        }
    }
}

#[test]
fn the_covariance_is_propagated_as_with_dense_matrices() {
    let dt = 0.2;
    let f = dense(dt);
    let covariance: [[f64; STATES]; STATES] = std::array::from_fn(|i| {
        std::array::from_fn(|j| if i == j { 2.0 } else { 0.3 / (1.0 + i.abs_diff(j) as f64) })
    });
    let mut mean = turning();
    let transition = Transition::new(&noise(), &mut mean, dt);
    let mut propagated = covariance;
    transition.propagate(&mut propagated);
    // Without the noise of a transition from zero covariance.
    let mut added = [[0.0; STATES]; STATES];
    transition.propagate(&mut added);
    for i in 0..STATES {
        for j in 0..STATES {
            let mut expected = added[i][j];
            for k in 0..STATES {
                for l in 0..STATES {
                    expected += f[k][i] * covariance[k][l] * f[l][j];
                }
            }
            assert!((expected - propagated[i][j]).abs() < 1e-9, "{i}, {j}: {expected}");
        }
    }
    let mut information = covariance;
    transition.transpose_both(&mut information);
    for i in 0..STATES {
        for j in 0..STATES {
            let mut expected = 0.0;
            for k in 0..STATES {
                for l in 0..STATES {
                    expected += f[i][k] * covariance[k][l] * f[j][l];
                }
            }
            assert!((expected - information[i][j]).abs() < 1e-9, "{i}, {j}: {expected}");
        }
    }
}

/// The variances of stationary processes stay as they are, and two half steps are one step.
#[test]
fn stationary_states_stay_stationary() {
    let stationary = [
        State::Sway,
        State::SwayRate,
        State::YawRate,
        State::YawAcceleration,
        State::SurgeRate,
        State::WaveForward,
        State::WaveForwardIntegral,
        State::WaveStarboard,
        State::GnssNorth,
        State::CompassError,
    ];
    let mut filter = Filter::new(noise(), &Prior::default(), f64::INFINITY);
    let before: Vec<f64> = stationary.iter().map(|state| filter.estimate().variance(*state)).collect();
    for dt in [0.001, 0.05, 0.7, 30.0] {
        filter.predict(dt);
        for (state, variance) in stationary.iter().zip(&before) {
            let now = filter.estimate().variance(*state);
            assert!(
                (now - variance).abs() < 1e-9 * variance,
                "{state:?} after {dt} s: {variance}, then {now}"
            );
        }
    }
    let spread = |steps: usize| {
        let mut filter = Filter::new(noise(), &Prior::default(), f64::INFINITY);
        for _ in 0..steps {
            filter.predict(4.0 / steps as f64);
        }
        filter.estimate().variance(State::Surge)
    };
    assert!((spread(1) - spread(64)).abs() < 1e-6 * spread(1), "{} and {}", spread(1), spread(64));
}

#[test]
fn a_prior_variance_of_zero_fixes_a_state() {
    let fixed = Prior::default().with(State::Delay, 0.35, 0.0).with(State::Misalignment, 0.02, 0.0);
    let mut filter = Filter::new(noise(), &fixed, f64::INFINITY);
    for measurement in measurements() {
        filter.predict(0.1);
        filter.update(&measurement, |_| {});
    }
    assert_eq!(filter.estimate().get(State::Delay), 0.35);
    assert_eq!(filter.estimate().get(State::Misalignment), 0.02);
}

#[test]
fn a_constant_is_linearized_at_its_value() {
    let delay = State::Delay as usize;
    let start = prior(turning()).linearized_at(State::Delay, 0.35);
    let mut filter = Filter::new(noise(), &start, f64::INFINITY);
    let mounting = Mounting { forward: -16.0, starboard: 3.0 };
    for _ in 0..3 {
        filter.predict(0.1);
        let measurement = Measurement::Position { value: [125.0, -36.0], deviation: 0.5, mounting };
        // The derivative of a position by the current is the negative delay.
        let mut by_current = Vec::new();
        filter.update(&measurement, |update| by_current.push(update.gradient[State::CurrentNorth as usize]));
        assert_eq!(by_current[0], -0.35);
    }
    assert!((filter.estimate().mean[delay] - 0.35).abs() > 1e-3);
    // Without a measurement, the deviation from the value moves the position by the derivative of the motion.
    let shift = 0.01;
    let moved = |by: f64| {
        let mut start = prior(turning()).linearized_at(State::Pivot, 12.0);
        start.mean[State::Pivot as usize] += by;
        let mut filter = Filter::new(noise(), &start, f64::INFINITY);
        let transition = filter.predict(0.2);
        (filter.estimate().mean, transition)
    };
    let (start, transition) = moved(0.0);
    let (end, _) = moved(shift);
    let mut unit = [0.0; STATES];
    unit[State::North as usize] = 1.0;
    transition.transpose(&mut unit);
    let expected = unit[State::Pivot as usize] * shift;
    assert!((end[State::North as usize] - start[State::North as usize] - expected).abs() < 1e-12);
    assert!((end[State::Pivot as usize] - 12.0 - shift).abs() < 1e-12);
}

#[test]
fn the_influence_of_an_outlier_is_bounded() {
    let shift = |value: f64| {
        let mut filter = Filter::new(noise(), &prior(turning()), Filter::OUTLIER);
        let before = filter.estimate().get(State::YawRate);
        let mut weight = 0.0;
        let measurement = Measurement::YawRate { value, deviation: 0.001 };
        filter.update(&measurement, |update| weight = update.innovation.weight);
        (filter.estimate().get(State::YawRate) - before, weight)
    };
    let ((near, _), (far, wild), (farther, _)) = (shift(0.5), shift(50.0), shift(5e6));
    assert!(wild < 0.1, "{wild}");
    assert!(near > 0.0 && (far - farther).abs() < 1e-9, "{near} {far} {farther}");
}

#[test]
fn headings_are_compared_on_the_circle() {
    let mut filter = Filter::new(noise(), &Prior::default().with(State::Heading, 3.1, 0.1), f64::INFINITY);
    filter.update(&Measurement::Heading { value: -3.1, deviation: 1e-3 }, |_| {});
    let expected = 2.0 * std::f64::consts::PI - 3.1;
    // The misalignment takes its share of the difference of 0.083 rad.
    assert!((filter.estimate().get(State::Heading) - expected).abs() < 0.03);
}

#[test]
fn a_restart_keeps_what_the_sensors_share() {
    let mut filter = Filter::new(noise(), &prior(turning()), f64::INFINITY);
    for measurement in measurements() {
        filter.predict(0.1);
        filter.update(&measurement, |_| {});
    }
    let before = filter.estimate().clone();
    filter.restart(&Prior::default(), &[State::Delay, State::Heel]);
    let after = filter.estimate();
    assert_eq!(after.get(State::Delay), before.get(State::Delay));
    let pair =
        |e: &hydroid_core::navigation::Estimate| e.covariance[State::Delay as usize][State::Heel as usize];
    assert_eq!(pair(after), pair(&before));
    assert_eq!(after.get(State::Surge), 0.0);
    assert_eq!(after.covariance[State::Delay as usize][State::Surge as usize], 0.0);
}
