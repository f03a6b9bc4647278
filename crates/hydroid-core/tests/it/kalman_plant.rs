//! The Kalman filter over the parameters of a vessel: derivatives compared with finite differences, the filter compared
//! with a dense filter, and invariants.

use hydroid_core::adapt::kalman::{
    Correction, Filter, FilterOptions, KalmanPlant, Learnable, LearnablePlant,
};
use hydroid_core::adapt::{Learning, Outcome, Rejection, SaveState};
use hydroid_core::craft::{Coriolis, Craft, Dynamics};
use hydroid_core::model::{CraftModel, CraftModelError, CraftSession};
use hydroid_core::predict::{Predictor, Workspace};
use hydroid_core::vessel::{Command, State};

use crate::plant::Plant;

use crate::craft::craft as with_two_thrusters;
use crate::dense::{Matrix, inverse, product, transposed};

/// Near take-off in a turn, with the Munk moment: every number has an effect.
fn vessels() -> [Craft; 4] {
    let mut full = Craft::hydrofoil();
    full.hull.coriolis = Coriolis::Full;
    let mut coupled = full.clone();
    coupled.hull.y_rdot = -3.0;
    coupled.hull.linear[0][1] = 4.0;
    coupled.hull.quadratic[2][0] = -2.0;
    [Craft::simple(), Craft::hydrofoil(), full, coupled]
}

/// The force of the propeller is its order: its coefficients are not learned.
fn model(craft: &Craft) -> CraftModel {
    let model = CraftModel::new(craft.clone(), 0.1).unwrap();
    let parameters = craft.parameters();
    let is_thrust =
        |index: usize| ["forward", "reverse"].iter().any(|end| parameters[index].0.path.ends_with(end));
    let learned = model.learned().iter().filter(|group| !is_thrust(group[0])).cloned().collect();
    model.with_learned(learned)
}

fn number(craft: &Craft, path: &str) -> f64 {
    craft.parameters().iter().find(|(parameter, _)| parameter.path == path).unwrap().1
}

/// The weight of a number.
fn weight(craft: &Craft, plant: &LearnablePlant, path: &str) -> usize {
    let index = craft.parameters().iter().position(|(parameter, _)| parameter.path == path).unwrap();
    plant.places().iter().position(|group| group.contains(&index)).unwrap()
}

/// The vessel with other numbers.
fn changed(craft: &Craft, factors: &[(&str, f64)]) -> Craft {
    craft.map(&mut |parameter, value| {
        factors.iter().find(|(path, _)| *path == parameter.path).map_or(value, |(_, factor)| value * factor)
    })
}

/// Commands that cover the modes of a vessel.
fn command(craft: &Craft, k: usize) -> [f64; 2] {
    let t = k as f64;
    let [low, high] = craft.commands[0].limits;
    let rudder = craft.commands[1].limits[1];
    [0.5 * (low + high) + 0.5 * (high - low) * (0.02 * t).sin(), 0.8 * rudder * (0.083 * t).sin()]
}

/// Measurements of a vessel from rest, with deterministic noise of the given size.
fn measured(craft: &Craft, count: usize, noise: f64) -> Vec<[f64; 3]> {
    let dynamics = Dynamics::new(craft);
    let (mut nu, mut positions) = ([0.0; 3], [0.0; 2]);
    (0..count)
        .map(|k| {
            let e = |a: f64| noise * (a * (k * k % 1009) as f64 + a).sin();
            let y = [nu[0] + e(1.3), nu[1] + e(2.9), nu[2] + e(4.1)];
            dynamics.advance(&mut nu, &mut positions, &command(craft, k), 0.01, 10);
            y
        })
        .collect()
}

/// Standard deviations of 1 cm/s and 1 deg/s.
fn options(plant: &LearnablePlant) -> FilterOptions {
    let noise: Vec<f64> = plant
        .scale()
        .iter()
        .zip([0.01, 0.01, 0.017])
        .map(|(scale, std): (_, f64)| (std / scale).powi(2))
        .collect();
    FilterOptions::uniform(plant.places().len(), 0.01, 1e-7, (1.0, 1e-6), &noise)
}

fn session(craft: &Craft) -> KalmanPlant {
    let model = model(craft);
    KalmanPlant::new(&model, options(&LearnablePlant::new(&model))).unwrap()
}

fn step(plant: &LearnablePlant, h: &[f64], weights: &[f64], x: &[f64]) -> Vec<f64> {
    let (mut plant, mut h) = (plant.clone(), h.to_vec());
    plant.set_weights(weights);
    plant.step(&mut h, x);
    h
}

/// `[A B]` of the last step, row by row.
fn partials(plant: &LearnablePlant) -> Matrix {
    let (states, count) = (plant.state_len(), plant.places().len());
    let size = states + count;
    let (mut state, mut local) = (vec![0.0; states * size], vec![0.0; states * size]);
    for i in 0..states {
        state[i * size + i] = 1.0;
        plant.local_jacobian(0, i, &mut local[i * size + states..(i + 1) * size]);
    }
    let mut out = vec![0.0; states * size];
    plant.apply_state_jacobian(&state, &local, size, &mut out, &mut []);
    out.chunks(size).map(<[f64]>::to_vec).collect()
}

fn close(a: &[f64], b: &[f64], tolerance: f64, what: &str) {
    assert_eq!(a.len(), b.len());
    let size = b.iter().fold(1e-12, |size: f64, b| size.max(b.abs()));
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        assert!((a - b).abs() <= tolerance * size, "{what} {i}: {a} {b}");
    }
}

#[test]
fn partials_are_those_of_central_differences() {
    // On either side of the change of mode, without zeros; the last vessel has six states, of which five are positions that
    // lag or turn at a limited rate.
    let [simple, hydrofoil, full, coupled] = vessels();
    let foils: [&[f64]; 3] = [&[2.4, -0.2, 0.15, 120.0], &[0.7, 0.1, -0.3, -20.0], &[3.6, 0.3, 0.2, 200.0]];
    let two: [&[f64]; 2] =
        [&[1.2, -0.2, 0.15, 12.0, 0.3, 9.0, 0.1], &[0.7, 0.1, -0.3, -8.0, -0.3, 11.0, -0.2]];
    let cases = [simple, hydrofoil, full, coupled]
        .map(|craft| (model(&craft), foils.as_slice(), vec![150.0, 0.3]))
        .into_iter()
        .chain([(
            CraftModel::new(with_two_thrusters(), 0.1).unwrap(),
            two.as_slice(),
            vec![14.0, 9.5, 0.4, -0.1],
        )]);
    for (model, motions, x) in cases {
        let mut plant = LearnablePlant::new(&model);
        let (states, count) = (plant.state_len(), plant.places().len());
        let weights: Vec<f64> = (0..count).map(|k| 0.05 * (k as f64 * 1.7).sin()).collect();
        plant.set_weights(&weights);
        for motion in motions {
            let h: Vec<f64> = (0..states).map(|i| plant.scaled(i, motion[i])).collect();
            let mut moved = h.clone();
            plant.step(&mut moved, &x);
            assert_eq!(moved, step(&plant, &h, &weights, &x));
            let ours = partials(&plant);
            let mut differences = vec![vec![0.0; states + count]; states];
            for j in 0..states + count {
                let by = 1e-5;
                let at = |by: f64| {
                    let (mut h, mut weights) = (h.clone(), weights.clone());
                    if j < states {
                        h[j] += by;
                    } else {
                        weights[j - states] += by;
                    }
                    step(&plant, &h, &weights, &x)
                };
                let (up, down) = (at(by), at(-by));
                (0..states).for_each(|i| differences[i][j] = (up[i] - down[i]) / (2.0 * by));
            }
            for i in 0..states {
                close(
                    &ours[i],
                    &differences[i],
                    1e-6,
                    &format!("{} {}: row {i}", model.craft().name, motion[0]),
                );
            }
        }
    }
}

#[test]
fn a_session_equals_the_simulation() {
    for params in [Craft::simple(), Craft::hydrofoil()] {
        let model = CraftModel::new(params.clone(), 0.1).unwrap();
        let plant = Plant::new(&params);
        let mut session = CraftSession::new(&model);
        let settled = command(&params, 0);
        // The propeller holds the first measured speed, and follows its order from then on.
        let held = model.dynamics().holding_force(1.9);
        let p_f = settled[0] + (held - settled[0]) * (-0.1 / params.thrusters[0].servo.lag).exp();
        let mut state = State { u: 1.9, v: 0.1, r: -0.1, p_f, ..State::REST };
        session.observe(&[state.u, state.v, f64::NAN]);
        close(&session.motion().1[..1], &[held], 1e-12, &params.name);
        session.advance(&settled);
        assert!(session.is_waiting());
        session.observe(&[f64::NAN, f64::INFINITY, state.r]);
        let commands: Vec<f64> = (0..40).flat_map(|k| command(&params, k)).collect();
        let mut ahead = vec![0.0; 3 * 40];
        session.rollout(&commands, &mut Workspace::new(), &mut ahead);
        for k in 0..40 {
            let [pp, rd] = command(&params, k);
            for _ in 0..model.steps() {
                state = plant.advance(&state, &Command { pp, rd }, 0.1 / model.steps() as f64);
            }
            session.advance(&[pp, rd]);
            let (nu, positions) = session.motion();
            close(&nu, &state.nu(), 1e-12, &params.name);
            close(positions, &[state.p_f, rd], 1e-12, &params.name);
            assert_eq!(ahead[3 * k..3 * k + 3], nu);
        }
        session.advance(&[f64::NAN, 0.0]);
        assert!(session.is_waiting());
    }
    for dt in [0.0, -1.0, f64::NAN, 1e9] {
        assert!(matches!(CraftModel::new(Craft::simple(), dt), Err(CraftModelError::Step(_))), "{dt}");
    }
}

/// A propeller that only pushes ahead holds no speed astern: its first order counts.
#[test]
fn a_propeller_without_thrust_astern_starts_at_its_order() {
    let mut craft = Craft::simple();
    craft.thrusters[0].reverse = 0.0;
    let mut session = CraftSession::new(&CraftModel::new(craft, 0.1).unwrap());
    session.observe(&[-0.5, 0.0, 0.0]);
    assert!(session.motion().1[0].is_nan());
    session.advance(&[40.0, 0.0]);
    close(&session.motion().1[..1], &[40.0], 1e-12, "order");
}

/// The textbook filter, dense, with Jacobians by central differences.
struct Naive {
    model: LearnablePlant,
    state: Vec<f64>,
    p: Matrix,
    options: FilterOptions,
}

impl Naive {
    fn advance(&mut self, x: &[f64]) {
        let (size, keeps) = (self.state.len(), 1.0 - self.options.leak);
        let mut f = vec![vec![0.0; size]; size];
        for j in 0..size {
            let at = |by: f64| {
                let mut at = self.state.clone();
                at[j] += by;
                step(&self.model, &at[..4], &at[4..], x)
            };
            let (up, down) = (at(1e-5), at(-1e-5));
            (0..4).for_each(|i| f[i][j] = (up[i] - down[i]) / 2e-5);
        }
        (4..size).for_each(|i| f[i][i] = keeps / self.options.forgetting.sqrt());
        let next = step(&self.model, &self.state[..4], &self.state[4..], x);
        self.p = product(&product(&f, &self.p), &transposed(&f));
        for i in 0..size {
            self.p[i][i] += if i < 4 { self.options.state_noise } else { self.options.weight_noise[i - 4] };
        }
        self.state[..4].copy_from_slice(&next);
        self.state[4..].iter_mut().for_each(|w| *w *= keeps);
    }

    fn observe(&mut self, z: &[f64]) {
        let measured: Vec<usize> = (0..3).filter(|&i| !z[i].is_nan()).collect();
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
    for params in [Craft::hydrofoil(), Craft::simple()] {
        let plant = LearnablePlant::new(&model(&params));
        let mut options = FilterOptions { leak: 1e-3, forgetting: 0.999, ..options(&plant) };
        for (i, q) in options.weight_noise.iter_mut().enumerate() {
            *q *= 1.0 + (i % 5) as f64;
        }
        let size = 4 + plant.places().len();
        let variance = |i: usize| if i < 4 { options.initial_state } else { options.initial_weights[i - 4] };
        let row = |i: usize| (0..size).map(|j| if i == j { variance(i) } else { 0.0 }).collect();
        let mut naive = Naive {
            state: vec![0.0; size],
            p: (0..size).map(row).collect(),
            model: plant.clone(),
            options: options.clone(),
        };
        let mut ours = Filter::new(plant, options).unwrap();
        let changed = changed(&params, &[("drag.linear[0][0]", 1.2), ("rudder.rudder.gain", 0.9)]);
        let y = measured(&changed, 61, 0.005);
        for k in 0..60 {
            let x = command(&params, k);
            ours.advance(&x);
            naive.advance(&x);
            if k % 4 != 1 {
                let mut z = [0, 1, 2].map(|i| ours.model().scaled(i, y[k + 1][i]));
                if k % 7 == 3 {
                    z[0] = f64::NAN;
                }
                assert!(matches!(ours.observe(&z), Correction::Applied { .. }));
                naive.observe(&z);
            }
            close(ours.state(), &naive.state[..4], 1e-6, "state");
            close(ours.weights(), &naive.state[4..], 1e-6, "weights");
            let (hh, tt) = ours.variances();
            let diagonal: Vec<f64> = (0..size).map(|i| naive.p[i][i]).collect();
            close(&[hh, tt].concat(), &diagonal, 1e-6, "variances");
        }
    }
}

#[test]
fn changed_parameters_are_found() {
    let given = Craft::hydrofoil();
    let factors = [("drag.linear[0][0]", 1.3), ("drag.quadratic[0][0]", 1.3), ("rudder.rudder.gain", 0.8)];
    let changed = changed(&given, &factors);
    let y = measured(&changed, 6001, 0.01);
    let mut session = session(&given);
    for k in 0..6000 {
        session.observe(&y[k]);
        session.advance(&command(&given, k));
    }
    let plant = LearnablePlant::new(&model(&given));
    let learned = |path: &str| session.weights()[weight(&given, &plant, path)] / number(&changed, path);
    for path in
        ["drag.quadratic[0][0]", "rudder.rudder.gain", "flying.transition_speed", "thruster.propeller.lag"]
    {
        assert!((learned(path) - 1.0).abs() < 0.05, "{path}: {} of the truth", learned(path));
    }
    let mut snapshot = vec![0.0; session.snapshot_len()];
    session.snapshot(&mut snapshot);
    let mut truth = CraftSession::new(&CraftModel::new(changed, 0.1).unwrap());
    truth.observe(&[0.0; 3]);
    (0..6000).for_each(|k| truth.advance(&command(&given, k)));
    let (_, force) = truth.motion();
    assert!((snapshot[3] - force[0]).abs() < 3.0, "{} {}", snapshot[3], force[0]);
}

#[test]
fn parameters_stay_those_of_a_vessel() {
    for params in vessels() {
        let plant = LearnablePlant::new(&model(&params));
        let uniform = options(&plant);
        // Low measurement noise and high parameter variance, so that the filter follows nonsense.
        let options = FilterOptions { initial_weights: vec![4.0; plant.places().len()], ..uniform };
        let mut session = KalmanPlant::new(&model(&params), options).unwrap();
        let mut least = f64::INFINITY;
        for k in 0..600 {
            let t = k as f64;
            session.observe(&[3.0 * (0.9 * t).sin(), 2.0 * (1.3 * t).cos(), 1.5 * (2.1 * t).sin()]);
            session.advance(&command(&params, k));
            let learned: Craft = params.with_numbers(&session.filter().model().numbers());
            assert_eq!(learned.validate(), Ok(()), "{} {k}", params.name);
            let (_, variances) = session.filter().variances();
            assert!(variances.iter().all(|p| *p > -1e-9), "{variances:?}");
            least = session.filter().weights().iter().fold(least, |least, w| least.min(-w.abs()));
        }
        assert!(least < -0.5, "it did believe nonsense: {least}");
    }
    // A step that the mass matrix forbids is shortened.
    let coupled = &vessels()[3];
    let mut plant = LearnablePlant::new(&model(coupled));
    let place = |path: &str| weight(coupled, &plant, path);
    let (inertia, added, coupling) =
        (place("rigid_body.i_z"), place("added_mass.n_rdot"), place("rigid_body.x_g"));
    let mut weights = plant.weights().to_vec();
    (weights[inertia], weights[added], weights[coupling]) = (-2.2, -2.2, 2.2);
    plant.project(&mut weights);
    assert!(weights[inertia] > -2.2 && weights[inertia] < 0.0, "{}", weights[inertia]);
    plant.set_weights(&weights);
    let learned: Craft = coupled.with_numbers(&plant.numbers());
    assert_eq!(learned.validate(), Ok(()));
    let mut nonsense = vec![f64::NAN; weights.len()];
    nonsense[0] = f64::INFINITY;
    plant.project(&mut nonsense);
    assert!(nonsense.iter().all(|w| w.is_finite()));
}

#[test]
fn bands_have_their_stated_coverage() {
    let params = Craft::hydrofoil();
    // Sines of large arguments: their deviation is the amplitude over sqrt(2).
    let y = measured(&params, 2100, 0.014);
    let model = model(&params);
    let plant = LearnablePlant::new(&model);
    let noise: Vec<f64> = plant.scale()[..3].iter().map(|scale| (0.0099 / scale).powi(2)).collect();
    let options = FilterOptions::uniform(plant.places().len(), 1e-4, 0.0, (1.0, 0.0), &noise);
    let mut session = KalmanPlant::new(&model, options).unwrap();
    let (mut work, mut ahead, mut band) = (Workspace::new(), vec![0.0; 3 * 40], [0.0; 9]);
    session.deviations(&[7.0; 80], &[1, 10, 40], &mut work, &mut band);
    assert!(band.iter().all(|band| band.is_nan()));
    let (mut inside, mut all) = ([0; 3], 0);
    for k in 0..2000 {
        session.observe(&y[k]);
        let commands: Vec<f64> = (k..k + 40).flat_map(|k| command(&params, k)).collect();
        if k > 100 && k % 5 == 0 {
            session.rollout(&commands, &mut work, &mut ahead);
            session.deviations(&commands, &[1, 10, 40], &mut work, &mut band);
            for (at, horizon) in [1, 10, 40].into_iter().enumerate() {
                for i in 0..3 {
                    let error = ahead[3 * (horizon - 1) + i] - y[k + horizon][i];
                    // 82 % of a sine of random phase are within 1.36 deviations, and all within 1.42.
                    inside[at] += usize::from(error.abs() < 1.36 * band[3 * at + i]);
                }
            }
            all += 3;
        }
        session.advance(&command(&params, k));
    }
    for inside in inside {
        let share = f64::from(u32::try_from(inside).unwrap()) / f64::from(all);
        assert!((0.70..0.94).contains(&share), "{share}");
    }
}

#[test]
fn a_saved_state_resumes_bit_for_bit_and_forks_predict_the_same() {
    let params = Craft::hydrofoil();
    let changed = changed(&params, &[("rudder.rudder.gain", 0.8)]);
    let y = measured(&changed, 120, 0.01);
    for at in [0, 1, 2, 40] {
        let mut session = session(&params);
        for k in 0..at {
            session.observe(&y[k]);
            session.advance(&command(&params, k));
        }
        let mut other = session.clone();
        other.reset();
        for k in 0..10 {
            other.observe(&y[k + 50]);
            other.advance(&command(&params, k));
        }
        let mut memory = vec![0.0; session.memory_len()];
        session.save(&mut memory);
        other.load(&memory);
        let mut snapshot = vec![0.0; session.snapshot_len()];
        session.snapshot(&mut snapshot);
        let mut fork = other.fork();
        fork.restore(&snapshot);
        let commands: Vec<f64> = (at..at + 8).flat_map(|k| command(&params, k)).collect();
        let (mut work, mut a, mut b) = (Workspace::new(), [0.0; 24], [0.0; 24]);
        session.rollout(&commands, &mut work, &mut a);
        fork.rollout(&commands, &mut work, &mut b);
        assert_eq!(a.map(f64::to_bits), b.map(f64::to_bits));
        for k in at..at + 40 {
            for session in [&mut session, &mut other] {
                session.observe(&if k % 9 == 4 { [f64::NAN, y[k][1], y[k][2]] } else { y[k] });
                session.advance(&command(&params, k));
            }
            let bits = |session: &KalmanPlant| -> Vec<u64> {
                let mut snapshot = vec![0.0; session.snapshot_len()];
                session.snapshot(&mut snapshot);
                snapshot.iter().chain(session.weights()).map(|w| w.to_bits()).collect()
            };
            assert_eq!(bits(&session), bits(&other), "{at} {k}");
        }
        session.restore(&snapshot);
        let mut again = vec![0.0; snapshot.len()];
        session.snapshot(&mut again);
        assert!(snapshot.iter().zip(&again).all(|(a, b)| a.to_bits() == b.to_bits()));
    }
}

#[test]
fn invalid_values_never_panic() {
    let params = Craft::hydrofoil();
    let y = measured(&params, 200, 0.01);
    for nonsense in [f64::INFINITY, f64::NAN, 1e200, -1e300] {
        let mut session = session(&params);
        for k in 0..20 {
            session.observe(&y[k]);
            session.advance(&command(&params, k));
        }
        let before = session.weights().to_vec();
        session.observe(&[f64::INFINITY; 3]);
        assert_eq!(session.outcome(), Outcome::Rejected(Rejection::NotFinite));
        assert_eq!(before, session.weights());
        session.advance(&[nonsense; 2]);
        session.observe(&[nonsense; 3]);
        session.advance(&[nonsense; 2]);
        let mut deviation = [0.0; 3];
        session.deviations(&[7.0; 10], &[5], &mut Workspace::new(), &mut deviation);
        session.reset();
        let (mut now, mut frozen) = ([0.0; 3], session.clone());
        let kept = frozen.weights().to_vec();
        frozen.freeze(true);
        for k in 20..150 {
            session.observe(&y[k]);
            session.advance(&command(&params, k));
            frozen.observe(&y[k]);
            frozen.advance(&command(&params, k));
        }
        assert!(session.weights().iter().all(|w| w.is_finite()), "{nonsense}");
        session.output(&mut now);
        assert!((0..3).all(|i| (now[i] - y[150][i]).abs() < 1.0), "{nonsense}: {now:?} {:?}", y[150]);
        assert_eq!(frozen.weights(), kept);
    }
}

/// Derivatives of predictions have longer integration steps than predictions. The variance of a band is compared with
/// that of central differences of rollouts, for the covariance at the start of a run: `R` of the outputs, the initial
/// variances of propeller force and parameters.
#[test]
fn bands_agree_with_differences_of_rollouts() {
    for params in vessels() {
        let model = model(&params);
        let plant = LearnablePlant::new(&model);
        let options = FilterOptions { state_noise: 0.0, ..options(&plant) };
        let mut session = KalmanPlant::new(&model, options.clone()).unwrap();
        session.observe(&measured(&params, 40, 0.0)[39]);
        let horizons = [1, 10, 50];
        let commands: Vec<f64> = (0..50).flat_map(|k| command(&params, k)).collect();
        let mut work = Workspace::new();
        let mut snapshot = vec![0.0; session.snapshot_len()];
        session.snapshot(&mut snapshot);
        // The propeller holds the speed, and the rudder is at the first command of a run.
        assert!(snapshot[3].is_finite() && snapshot[4].is_nan());
        snapshot[4] = commands[1];
        let mut variances = vec![0.0; 3 * horizons.len()];
        let mut fork = session.fork();
        let mut add = |fork: &mut dyn Predictor, place: usize, unit: f64, variance: f64| {
            let [low, high] = [-1e-5, 1e-5].map(|change| {
                let (mut from, mut y) = (snapshot.clone(), vec![0.0; 150]);
                from[place] += change * unit;
                fork.restore(&from);
                fork.rollout(&commands, &mut Workspace::new(), &mut y);
                y
            });
            for (h, horizon) in horizons.iter().enumerate() {
                for i in 0..3 {
                    let at = 3 * (horizon - 1) + i;
                    variances[3 * h + i] += variance * ((high[at] - low[at]) / 2e-5).powi(2);
                }
            }
        };
        for i in 0..4 {
            let variance = if i < 3 { options.noise[i] } else { options.initial_state };
            add(fork.as_mut(), i, plant.scale()[i], variance);
        }
        for i in 0..plant.places().len() {
            add(fork.as_mut(), 5 + i, 1.0, options.initial_weights[i]);
        }
        let mut bands = vec![0.0; 9];
        session.deviations(&commands, &horizons, &mut work, &mut bands);
        for (i, (band, variance)) in bands.iter().zip(&variances).enumerate() {
            let noise = options.noise[i % 3] * plant.scale()[i % 3].powi(2);
            let expected = (variance + noise).sqrt();
            println!("{} {i}: {:.1e}", params.name, band / expected - 1.0);
            assert!((band / expected - 1.0).abs() < 2e-3, "{} {i}: {band} {expected}", params.name);
        }
    }
}

/// Vessels of the thesis, and one with every part that a batch computes side by side.
#[test]
fn a_batch_of_rollouts_equals_single_rollouts() {
    let mut steered = with_two_thrusters();
    steered.hull.cross_flow = 0.0;
    steered.rudders.clear();
    steered.commands.truncate(3);
    for params in [Craft::simple(), Craft::hydrofoil(), steered, with_two_thrusters()] {
        let mut session = CraftSession::new(&CraftModel::new(params.clone(), 0.1).unwrap());
        let inputs = params.commands.len();
        let commands = |from: usize, to: usize| -> Vec<f64> {
            let command = |k: usize, i: usize| {
                let [low, high] = params.commands[i].limits;
                0.5 * (low + high) + 0.5 * (high - low) * (0.3 * k as f64 + i as f64).sin()
            };
            (from..to).flat_map(|k| (0..inputs).map(move |i| command(k, i))).collect()
        };
        let (count, steps) = (37, 12);
        let (mut work, mut batch) = (Workspace::new(), vec![0.0; count * steps * 3]);
        session.observe(&[1.2, 0.1, -0.2]);
        // Positions that are unknown, and known ones.
        for _ in 0..2 {
            let all = commands(0, count * steps);
            session.rollout_batch(count, &all, &mut work, &mut batch);
            for (commands, batch) in all.chunks(inputs * steps).zip(batch.chunks(3 * steps)) {
                let mut single = vec![0.0; 3 * steps];
                session.rollout(commands, &mut work, &mut single);
                close(batch, &single, 1e-12, &params.name);
            }
            session.advance(&commands(5, 6));
        }
        session.rollout_batch(0, &[], &mut work, &mut []);
    }
}
