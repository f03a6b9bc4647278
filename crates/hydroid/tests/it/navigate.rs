//! The smoother against a Rauch-Tung-Striebel smoother with dense matrices, on a simulated boat, and on the field logs.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "times are positive, and few")]

use hydroid::navigate::{Event, Kind, Run, Runs, Sensor, Smoothed, Statistics, fit, smooth};
use hydroid::progress::silent;
use hydroid_core::navigation::{Filter, Measurement, Mounting, Noise, Prior, STATES, State};

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// First guesses for a small ship.
fn guess(sensors: &[Sensor]) -> Statistics {
    let noise = Noise {
        surge_rate: 0.1,
        surge_acceleration: 0.05,
        sway_rate: 0.1,
        sway: 0.3,
        pivot_rate: 0.3,
        yaw_rate: 0.2,
        yaw: 0.05,
        wave_frequency: 1.0,
        wave_damping: 0.1,
        wave_forward: 0.1,
        wave_starboard: 0.1,
        gnss_rate: 1.0 / 60.0,
        gnss: 1.0,
        compass_rate: 0.1,
        compass: 0.3 * DEGREE,
        gyro_walk: 1e-5,
        accelerometer_walk: 1e-4,
        current_walk: 1e-4,
    };
    Statistics { noise, deviations: sensors.iter().map(|sensor| sensor.deviation).collect() }
}

fn sensor(kind: Kind, mounting: Mounting, deviation: f64) -> Sensor {
    Sensor { kind, mounting, deviation: [deviation; 2] }
}

fn dot(a: &[f64; STATES], b: &[f64; STATES]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

type Matrix = Vec<[f64; STATES]>;

/// Solves `A X = B` by Gaussian elimination with scaled rows and columns.
fn solve(a: &Matrix, b: &Matrix) -> Matrix {
    let scale: Vec<f64> = (0..STATES).map(|i| a[i][i].sqrt()).collect();
    let mut a: Matrix =
        (0..STATES).map(|i| std::array::from_fn(|j| a[i][j] / (scale[i] * scale[j]))).collect();
    let mut b: Matrix = (0..STATES).map(|i| b[i].map(|x| x / scale[i])).collect();
    for k in 0..STATES {
        let pivot = (k..STATES).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).unwrap();
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..STATES {
            let factor = a[i][k] / a[k][k];
            for j in 0..STATES {
                a[i][j] -= factor * a[k][j];
                b[i][j] -= factor * b[k][j];
            }
        }
    }
    for k in (0..STATES).rev() {
        for j in 0..STATES {
            let known: f64 = (k + 1..STATES).map(|i| a[k][i] * b[i][j]).sum();
            b[k][j] = (b[k][j] - known) / a[k][k];
        }
    }
    (0..STATES).map(|i| b[i].map(|x| x / scale[i])).collect()
}

/// Heading and yaw rate are linear in the states: both smoothers are exact.
#[test]
fn the_smoother_equals_that_of_rauch_tung_and_striebel() {
    let none = Mounting::default();
    let sensors = vec![sensor(Kind::Heading, none, 0.01), sensor(Kind::YawRate, none, 0.002)];
    let statistics = guess(&sensors);
    let mut prior = Prior { mean: [0.0; STATES], deviation: [0.3; STATES], ..Prior::default() };
    prior.deviation[State::Delay as usize] = 0.1;
    let events: Vec<Event> = (0..60)
        .map(|k| {
            let t = 0.1 * f64::from(k);
            let value = if k % 2 == 0 { 0.3 * t + 0.01 * (7.0 * t).sin() } else { 0.3 + 0.1 * t.cos() };
            Event { t, sensor: k as usize % 2, value: [value, 0.0] }
        })
        .collect();
    let times: Vec<f64> = events.iter().map(|event| event.t).collect();
    let runs = Runs { sensors, runs: vec![Run { events: events.clone(), prior: prior.clone() }] };
    let smoothed = &smooth(&runs, &statistics, std::slice::from_ref(&times), &mut silent()).unwrap()[0];

    let mut filter = Filter::new(statistics.noise, &prior, Filter::OUTLIER);
    let mut predicted = Vec::new();
    let mut filtered = Vec::new();
    let mut transitions: Vec<Matrix> = Vec::new();
    for (k, event) in events.iter().enumerate() {
        let mut f: Matrix = (0..STATES).map(|i| std::array::from_fn(|j| f64::from(i == j))).collect();
        if k > 0 {
            let transition = filter.predict(event.t - events[k - 1].t);
            // The rows of F are F' e_i.
            for row in &mut f {
                transition.transpose(row);
            }
        }
        transitions.push(f);
        predicted.push(filter.estimate().clone());
        let measurement = match event.sensor {
            0 => Measurement::Heading { value: event.value[0], deviation: 0.01 },
            _ => Measurement::YawRate { value: event.value[0], deviation: 0.002 },
        };
        filter.update(&measurement, |_| {});
        filtered.push(filter.estimate().clone());
    }
    let last = events.len() - 1;
    let (mut mean, mut covariance) = (filtered[last].mean, filtered[last].covariance.to_vec());
    for k in (0..last).rev() {
        // G' = P(k+1|k)^-1 F P(k|k).
        let product: Matrix = (0..STATES)
            .map(|i| {
                std::array::from_fn(|j| {
                    (0..STATES).map(|l| transitions[k + 1][i][l] * filtered[k].covariance[l][j]).sum()
                })
            })
            .collect();
        let gain = solve(&predicted[k + 1].covariance.to_vec(), &product);
        let shift: [f64; STATES] = std::array::from_fn(|i| mean[i] - predicted[k + 1].mean[i]);
        let column = |j: usize| -> [f64; STATES] { std::array::from_fn(|i| gain[i][j]) };
        let difference: Matrix = (0..STATES)
            .map(|i| std::array::from_fn(|j| covariance[i][j] - predicted[k + 1].covariance[i][j]))
            .collect();
        mean = std::array::from_fn(|i| filtered[k].mean[i] + dot(&column(i), &shift));
        covariance = (0..STATES)
            .map(|i| {
                std::array::from_fn(|j| {
                    let right: [f64; STATES] = std::array::from_fn(|l| dot(&difference[l], &column(j)));
                    filtered[k].covariance[i][j] + dot(&column(i), &right)
                })
            })
            .collect();
        // An output at the time of a measurement is computed before or after it; smoothed, both are the same.
        let row = smoothed.rows[k];
        let yaw = State::YawRate as usize;
        assert!((row.ground[2] - mean[yaw]).abs() < 1e-8, "{k}: {} and {}", row.ground[2], mean[yaw]);
        let deviation = covariance[yaw][yaw].sqrt();
        assert!((row.ground_deviation[2] - deviation).abs() < 1e-6 * deviation.max(1e-3), "{k}: {deviation}");
        let heading = mean[State::Heading as usize];
        assert!((row.pose[2] - heading).abs() < 1e-8, "{k}: {} and {heading}", row.pose[2]);
    }
}

/// A deterministic normal number.
struct Normal(u64);

impl Normal {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    fn draw(&mut self, deviation: f64) -> f64 {
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        deviation * radius * (2.0 * std::f64::consts::PI * self.uniform()).cos()
    }
}

const LATE: f64 = 0.3;
const TURNED: f64 = 2.0 * DEGREE;

/// Pose and body velocities of a boat in zigzags, at 0.02 s, integrated here.
fn zigzags(seconds: f64) -> Vec<[f64; 6]> {
    let dt = 0.02;
    let mut state: [f64; 6] = [0.0, 0.0, 0.4, 3.0, 0.0, 0.0];
    let mut rows = Vec::new();
    for k in 0..(seconds / dt) as usize {
        rows.push(state);
        let t = k as f64 * dt;
        let rudder = if ((t / 14.0) as usize).is_multiple_of(2) { 0.06 } else { -0.06 };
        let throttle = if ((t / 45.0) as usize).is_multiple_of(2) { 3.4 } else { 2.4 };
        let [_, _, psi, u, v, r] = state;
        let (sine, cosine) = psi.sin_cos();
        let rates = [
            u * cosine - v * sine,
            u * sine + v * cosine,
            r,
            (throttle - u) / 12.0 - 3.0 * r * r,
            (-4.0 * r - v) / 3.0,
            (rudder - r) / 2.5,
        ];
        state.iter_mut().zip(rates).for_each(|(x, rate)| *x += dt * rate);
    }
    rows
}

/// What the instruments of the boat write.
fn instruments(truth: &[[f64; 6]], seed: u64) -> (Vec<Sensor>, Vec<Event>) {
    let antenna = Mounting { forward: -2.0, starboard: 0.5 };
    let unit = Mounting { forward: 1.0, starboard: 0.0 };
    let sensors = vec![
        sensor(Kind::Position, antenna, 0.5),
        sensor(Kind::Velocity, antenna, 0.1),
        sensor(Kind::Heading, Mounting::default(), DEGREE),
        sensor(Kind::YawRate, Mounting::default(), 0.005),
        sensor(Kind::SpecificForce, unit, 0.05),
    ];
    let mut normal = Normal(seed);
    let mut events = Vec::new();
    let late = (LATE / 0.02).round() as usize;
    for k in late..truth.len() - 1 {
        let t = k as f64 * 0.02;
        let [_, _, psi, u, v, r] = truth[k];
        let rate = |i: usize| (truth[k + 1][i] - truth[k - 1][i]) / 0.04;
        if k % 5 == 0 {
            events.push(Event { t, sensor: 3, value: [r + 0.004 + normal.draw(0.002), 0.0] });
            let forward = rate(3) - r * v - r * r * unit.forward;
            let lateral = rate(4) + r * u;
            let starboard = lateral + rate(5) * unit.forward - 1.4 * lateral;
            let value = [forward + 0.05 + normal.draw(0.03), starboard - 0.1 + normal.draw(0.03)];
            events.push(Event { t, sensor: 4, value });
        }
        if k % 10 == 0 {
            events.push(Event { t, sensor: 2, value: [psi + TURNED + normal.draw(0.5 * DEGREE), 0.0] });
        }
        if k % 50 == 0 {
            let [x, y, psi, u, v, r] = truth[k - late];
            let (sine, cosine) = psi.sin_cos();
            let (a, b) = (antenna.forward, antenna.starboard);
            let place = [x + cosine * a - sine * b, y + sine * a + cosine * b];
            let (u, v) = (u - r * b, v + r * a);
            let speed = [u * cosine - v * sine, u * sine + v * cosine];
            // A fix among the rocks.
            let wild = if k % 5000 == 0 { 40.0 } else { 0.0 };
            events.push(Event { t, sensor: 0, value: place.map(|x| x + wild + normal.draw(0.3)) });
            events.push(Event { t, sensor: 1, value: speed.map(|x| x + normal.draw(0.05)) });
        }
    }
    (sensors, events)
}

/// Two runs of the boat.
fn voyages(truth: &[[f64; 6]]) -> Runs {
    let mut runs = Runs { sensors: Vec::new(), runs: Vec::new() };
    for seed in [1, 2] {
        let (sensors, events) = instruments(truth, seed);
        runs.sensors = sensors;
        let prior = Prior::default().with(State::Heading, 0.4, 0.2).with(State::Surge, 3.0, 1.0);
        runs.runs.push(Run { events, prior });
    }
    runs
}

/// Times of the outputs \[s\], after the first fix.
fn times() -> Vec<f64> {
    (10..2000).map(|k| 0.1 * f64::from(k)).collect()
}

#[test]
fn velocities_of_a_simulated_boat_with_guessed_statistics() {
    let truth = zigzags(210.0);
    let runs = voyages(&truth);
    let smoothed = smooth(&runs, &guess(&runs.sensors), &[times(), times()], &mut silent()).unwrap();
    for run in &smoothed {
        assert!(run.outliers[0] > 0.001 && run.outliers[0] < 0.05, "{:?}", run.outliers);
        for (i, bound) in [(0, 0.1), (1, 0.2), (2, 0.004)] {
            let (error, _) = errors(run, 20.0, i, |t| truth[(t / 0.02).round() as usize][3 + i]);
            assert!(error < bound, "velocity {i}: {error}");
        }
    }
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn velocities_and_misalignment_of_a_simulated_boat() {
    let truth = zigzags(210.0);
    let mut runs = voyages(&truth);
    let fitted = fit(&runs, &[guess(&runs.sensors)], &mut silent()).unwrap();
    runs.runs.iter_mut().for_each(|run| run.prior = fitted.prior(&run.prior));
    let deviation = |sensor: usize| fitted.statistics.deviations[sensor][0];
    for (sensor, expected) in [(1, 0.05), (2, 0.5 * DEGREE), (3, 0.002), (4, 0.03)] {
        let ratio = deviation(sensor) / expected;
        assert!((0.8..1.25).contains(&ratio), "sensor {sensor}: {} instead of {expected}", deviation(sensor));
    }
    for run in &smooth(&runs, &fitted.statistics, &[times(), times()], &mut silent()).unwrap() {
        let (mean, deviation) = run.end[State::Delay as usize];
        println!("delay {mean} +- {deviation}");
        assert!((mean - LATE).abs() < 0.1, "delay {mean} +- {deviation}");
        let (mean, deviation) = run.end[State::Misalignment as usize];
        assert!((mean - TURNED).abs() < 0.5 * DEGREE, "misalignment {mean} +- {deviation}");
        for (i, bound) in [(0, 0.03), (1, 0.015), (2, 0.002)] {
            let (error, held) = errors(run, 20.0, i, |t| truth[(t / 0.02).round() as usize][3 + i]);
            println!("velocity {i}: RMSE {error:.4}, {held:.2} within the band of 90 %");
            assert!(error < bound, "velocity {i}: {error}");
        }
    }
}

/// The statistics do not depend on the number of threads.
#[test]
fn the_same_runs_give_the_same_statistics() {
    let sensors = vec![
        sensor(Kind::Heading, Mounting::default(), 0.02),
        sensor(Kind::YawRate, Mounting::default(), 0.01),
    ];
    let mut normal = Normal(3);
    let events = (0..400).map(|k| {
        let t = 0.1 * f64::from(k);
        let value =
            if k % 2 == 0 { -0.2 * t.cos() + normal.draw(0.01) } else { 0.2 * t.sin() + normal.draw(0.002) };
        Event { t, sensor: k as usize % 2, value: [value, 0.0] }
    });
    let runs = Runs { runs: vec![Run { events: events.collect(), prior: Prior::default() }], sensors };
    let start = guess(&runs.sensors);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fit(&runs, std::slice::from_ref(&start), &mut silent()).unwrap())
    };
    let (one, two) = (on(1), on(2));
    assert_eq!(one.statistics, two.statistics);
    assert!((one.statistics.deviations[0][0] / 0.01 - 1.0).abs() < 0.2, "{:?}", one.statistics.deviations);
}

/// RMSE of a velocity over ground after a time, and the share within the band of 90 %.
fn errors(run: &Smoothed, from: f64, i: usize, truth: impl Fn(f64) -> f64) -> (f64, f64) {
    let (mut square, mut held, mut n) = (0.0, 0.0, 0.0);
    for row in run.rows.iter().filter(|row| row.t > from) {
        let error = row.ground[i] - truth(row.t);
        square += error * error;
        held += f64::from(error.abs() < 1.645 * row.ground_deviation[i]);
        n += 1.0;
    }
    ((square / n).sqrt(), held / n)
}

#[test]
fn a_run_without_measurements_is_as_wide_as_its_prior() {
    let sensors = vec![sensor(Kind::YawRate, Mounting::default(), 0.01)];
    let statistics = guess(&sensors);
    let prior = Prior::default();
    let runs = Runs { sensors, runs: vec![Run { events: Vec::new(), prior }] };
    let smoothed = smooth(&runs, &statistics, &[vec![0.0, 1.0]], &mut silent()).unwrap();
    let deviation = smoothed[0].rows[0].ground_deviation;
    assert!(
        (deviation[0] - 5.0).abs() < 1e-9 && (deviation[2] - statistics.noise.yaw).abs() < 1e-9,
        "{deviation:?}"
    );
    let none = Runs { sensors: Vec::new(), runs: Vec::new() };
    assert!(smooth(&none, &statistics, &[], &mut silent()).unwrap().is_empty());
}
