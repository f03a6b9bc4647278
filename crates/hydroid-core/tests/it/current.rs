//! The estimate of the current, on vessels that are simulated in the water.

use std::f64::consts::TAU;
use std::sync::Arc;

use hydroid_core::adapt::{
    Adapter, InnovationGate, Learning, RecursiveEquations, RecursiveOptions, SaveState,
};
use hydroid_core::current::{CurrentOptions, ThroughWater, in_body};
use hydroid_core::model::sparse::{Equations, EquationsSession, Term};
use hydroid_core::predict::{Predictor, Workspace};
use proptest::prelude::*;

const DT: f64 = 0.1;

/// Standard deviation of the measurements \[m/s, rad/s\].
const NOISE: f64 = 0.01;

/// Surge and sway through the water and the yaw rate, under a propeller and a rudder.
fn equations(propeller: f64, rudder: f64) -> Equations {
    // Variables: u, v, r, propeller, rudder.
    let terms = vec![
        Term::monomial(&[0]),
        Term::monomial(&[1]),
        Term::monomial(&[2]),
        Term::monomial(&[3]),
        Term::monomial(&[0, 2]),
        Term::monomial(&[0, 4]),
    ];
    let coefficients = [
        [-0.3, 0.0, 0.0, propeller, 0.0, 0.0],
        [0.0, -0.5, 0.0, 0.0, -0.2, 0.05],
        [0.0, 0.1, -0.6, 0.0, 0.0, rudder],
    ];
    Equations::new(terms, coefficients.concat(), 3, 2, DT, 1).unwrap()
}

fn vessel() -> Box<dyn Predictor> {
    Box::new(EquationsSession::new(Arc::new(equations(0.6, 0.3))))
}

/// Recursive least squares on a model with a propeller and a rudder that are too weak.
fn learner() -> Box<dyn Adapter> {
    let options = RecursiveOptions {
        forgetting_s: f64::INFINITY,
        window: 10,
        prior_s: 5.0,
        leak: false,
        all_terms: false,
        gate: InnovationGate::default(),
    };
    let ranges = [(-0.5, 2.5), (-0.5, 0.5), (-0.5, 0.5), (0.0, 1.5), (-0.6, 0.6)];
    Box::new(RecursiveEquations::new(&equations(0.45, 0.2), &ranges, &options).unwrap())
}

fn options(initial: f64, deviation: f64) -> CurrentOptions {
    CurrentOptions {
        motion: [0, 1, 2],
        dt: DT,
        window: 30,
        deviations: [deviation; 3],
        noise: [NOISE; 3],
        initial,
        walk: 0.0,
    }
}

/// Random numbers (Steele, Lea and Flood, *Fast splittable pseudorandom number generators*, OOPSLA 2014).
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Nearly normal: the sum of twelve uniform numbers has unit variance.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// Measured outputs over ground, true outputs over ground, headings and commands.
struct Run {
    measured: Vec<[f64; 3]>,
    truth: Vec<[f64; 3]>,
    heading: Vec<f64>,
    commands: Vec<[f64; 2]>,
}

/// A run in a current that turns at half of it.
fn run(currents: [[f64; 2]; 2], samples: usize, seed: u64) -> Run {
    let mut random = Random(seed);
    let mut plant = vessel();
    plant.observe(&[0.5, 0.0, 0.0]);
    let (mut measured, mut truth, mut headings, mut commands) = (vec![], vec![], vec![], vec![]);
    let (mut heading, mut command) = (1.0, [0.8, 0.2]);
    let mut water = [0.0; 3];
    plant.output(&mut water);
    for k in 0..samples {
        if k % 50 == 0 {
            command = [0.2 + random.uniform(), 1.2 * (random.uniform() - 0.5)];
        }
        let [surge, sway] = in_body(currents[2 * k / samples], heading);
        let over_ground = [water[0] + surge, water[1] + sway, water[2]];
        truth.push(over_ground);
        measured.push(over_ground.map(|y| y + NOISE * random.normal()));
        headings.push(heading);
        commands.push(command);
        let before = water[2];
        plant.advance(&command);
        plant.output(&mut water);
        heading += 0.5 * DT * (before + water[2]);
    }
    Run { measured, truth, heading: headings, commands }
}

/// Observes the samples of a run up to `to`, without its command.
fn follow(session: &mut dyn Predictor, run: &Run, from: usize, to: usize) {
    for k in from..=to {
        session.observe_heading(run.heading[k]);
        if k == 0 {
            session.observe(&run.measured[k]);
        } else {
            session.advance_observe(&run.commands[k - 1], &run.measured[k]);
        }
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[test]
fn the_current_is_found_and_predictions_over_ground_follow_the_truth() {
    let current = [0.3, -0.2];
    let run = run([current; 2], 1_000, 1);
    let mut session = ThroughWater::new(vessel(), options(0.5, 0.02)).unwrap();
    let mut still = vessel();
    let (mut work, mut worst, mut worst_still) = (Workspace::new(), 0.0_f64, 0.0_f64);
    for k in 0..900 {
        follow(&mut session, &run, k, k);
        follow(still.as_mut(), &run, k, k);
        if k > 400 && k % 20 == 0 {
            let commands = run.commands[k..k + 100].concat();
            let (mut y, mut over_ground) = ([0.0; 300], [0.0; 300]);
            session.rollout(&commands, &mut work, &mut y);
            still.rollout(&commands, &mut work, &mut over_ground);
            let error = |y: &[f64; 300]| {
                (0..3).map(|c| (y[297 + c] - run.truth[k + 100][c]).abs()).fold(0.0, f64::max)
            };
            worst = worst.max(error(&y));
            worst_still = worst_still.max(error(&over_ground));
        }
    }
    assert!(
        distance(session.current().unwrap().velocity, current) < 0.01,
        "{:?}",
        session.current().unwrap()
    );
    assert!(worst < 0.03, "{worst}");
    // Without the current, the turning body axes are taken for forces.
    assert!(worst_still > 0.3, "{worst_still}");
}

/// Mean squared error of the current over its variance, and the number of runs of sixty inside the intervals of 90 %.
fn calibration(options: CurrentOptions) -> (f64, usize) {
    let (mut squares, runs) = (0.0, 60);
    let mut inside = 0;
    for seed in 0..runs {
        let angle = TAU * seed as f64 / runs as f64;
        let current = [0.4 * angle.cos(), 0.4 * angle.sin()];
        let run = run([current; 2], 400, seed);
        let mut session = ThroughWater::new(vessel(), options).unwrap();
        follow(&mut session, &run, 0, 399);
        let estimate = session.current().unwrap();
        let [p, q, r] = estimate.covariance;
        let [x, y] = [estimate.velocity[0] - current[0], estimate.velocity[1] - current[1]];
        let square = (r * x * x - 2.0 * q * x * y + p * y * y) / (p * r - q * q);
        squares += square / 2.0 / runs as f64;
        // 90 % of a chi-square distribution with two degrees of freedom.
        inside += usize::from(square < 4.605);
    }
    (squares, inside)
}

#[test]
fn intervals_hold_the_current_in_nine_of_ten_runs() {
    // Errors of windows under the right current are measurement noise: at the end, and at the start after its decay. Those
    // of windows that do not overlap are independent.
    let (squares, inside) = calibration(options(0.4, 0.0105));
    assert!((0.5..1.6).contains(&squares), "{squares}");
    assert!((48..=60).contains(&inside), "{inside}");
}

#[test]
fn a_model_from_logs_without_noise_is_not_overconfident_on_a_noisy_run() {
    let smoothed = CurrentOptions { noise: [0.0; 3], ..options(0.4, 1e-4) };
    let (squares, inside) = calibration(smoothed);
    // Both ends of a window count, although the noise at its start decays.
    assert!((0.25..1.6).contains(&squares), "{squares}");
    assert!((48..=60).contains(&inside), "{inside}");
    // Without the noise, the errors of the options would be ten times too small.
    let (squares, _) = calibration(CurrentOptions { noise: [NOISE; 3], ..smoothed });
    assert!(squares > 5.0, "{squares}");
}

#[test]
fn a_current_that_turns_is_followed_at_the_rate_of_its_random_walk() {
    let (before, after) = ([0.3, 0.1], [-0.2, 0.3]);
    let run = run([before, after], 2_400, 3);
    let walking = CurrentOptions { walk: 0.05, ..options(0.3, 0.02) };
    let mut session = ThroughWater::new(vessel(), walking).unwrap();
    follow(&mut session, &run, 0, 1_199);
    assert!(distance(session.current().unwrap().velocity, before) < 0.03, "{:?}", session.current().unwrap());
    follow(&mut session, &run, 1_200, 1_700);
    assert!(distance(session.current().unwrap().velocity, after) < 0.03, "{:?}", session.current().unwrap());
    // The next run may have another one.
    session.reset();
    assert_eq!(session.current().unwrap().velocity, [0.0; 2]);
    assert!(session.heading().is_nan());
}

#[test]
fn without_a_heading_the_water_is_still() {
    let run = run([[0.3, 0.3]; 2], 200, 4);
    let (mut session, mut model) = (ThroughWater::new(vessel(), options(0.5, 0.02)).unwrap(), vessel());
    let (mut work, mut a, mut b) = (Workspace::new(), [0.0; 30], [0.0; 30]);
    for k in 0..200 {
        if k > 0 {
            session.advance(&run.commands[k - 1]);
            model.advance(&run.commands[k - 1]);
        }
        session.observe(&run.measured[k]);
        model.observe(&run.measured[k]);
        let commands = [0.5; 20];
        session.rollout(&commands, &mut work, &mut a);
        model.rollout(&commands, &mut work, &mut b);
        assert_eq!(a, b);
    }
}

#[test]
fn a_heading_may_wrap_or_be_missing_for_a_while() {
    let run = run([[0.2, -0.3]; 2], 1_000, 5);
    let observed = |heading: &dyn Fn(usize) -> f64| {
        let mut session = ThroughWater::new(vessel(), options(0.5, 0.02)).unwrap();
        for k in 0..1_000 {
            session.observe_heading(heading(k));
            if k == 0 {
                session.observe(&run.measured[k]);
            } else {
                session.advance_observe(&run.commands[k - 1], &run.measured[k]);
            }
        }
        session
    };
    let whole = observed(&|k| run.heading[k]);
    let wrapped = observed(&|k| (run.heading[k] + 3.0).rem_euclid(TAU) - 3.0);
    assert!(distance(whole.current().unwrap().velocity, wrapped.current().unwrap().velocity) < 1e-9);
    let gap = 700..720;
    let missing = observed(&|k| if gap.contains(&k) { f64::NAN } else { run.heading[k] });
    assert!(distance(missing.current().unwrap().velocity, [0.2, -0.3]) < 0.01, "{:?}", missing.current());
    // A compass that is switched on late, or fails for long, shows the current afterwards.
    for gap in [0..300, 300..600] {
        let late = observed(&|k| if gap.contains(&k) { f64::NAN } else { run.heading[k] });
        assert!(distance(late.current().unwrap().velocity, [0.2, -0.3]) < 0.01, "{:?}", late.current());
    }
    // Across a gap, the heading is predicted from the yaw rate.
    let mut session = ThroughWater::new(vessel(), options(0.5, 0.02)).unwrap();
    follow(&mut session, &run, 0, 700);
    for k in 701..720 {
        session.advance_observe(&run.commands[k - 1], &run.measured[k]);
    }
    assert!((session.heading() - run.heading[719]).abs() < 0.02);
}

#[test]
fn outputs_at_several_rates_show_the_current() {
    let mut run = run([[0.2, -0.3]; 2], 1_000, 8);
    for (k, y) in run.measured.iter_mut().enumerate() {
        // Surge and sway at a third of the rate of the yaw rate.
        if k % 3 != 1 {
            (y[0], y[1]) = (f64::NAN, f64::NAN);
        }
    }
    let mut session = ThroughWater::new(vessel(), options(0.5, 0.02)).unwrap();
    follow(&mut session, &run, 0, 999);
    assert!(distance(session.current().unwrap().velocity, [0.2, -0.3]) < 0.02, "{:?}", session.current());
}

/// Distance of the coefficients from those of the vessel, relative to that at the start.
fn weight_error(adapter: &dyn Adapter) -> f64 {
    let of = |propeller, rudder| {
        let equations = equations(propeller, rudder);
        let numbers = equations.coefficients().iter().copied().filter(|xi| *xi != 0.0);
        numbers.collect::<Vec<f64>>()
    };
    let truth = of(0.6, 0.3);
    let far = |weights: &[f64]| {
        weights.iter().zip(&truth).map(|(weight, truth)| (weight - truth).powi(2)).sum::<f64>().sqrt()
    };
    far(adapter.weights()) / far(&of(0.45, 0.2))
}

#[test]
fn a_model_that_learns_takes_the_vessel_and_not_the_current() {
    let current = [0.4, -0.2];
    let run = run([current; 2], 9_000, 9);
    let options = CurrentOptions { walk: 0.01, ..options(0.5, 0.05) };
    let mut session = ThroughWater::new(learner(), options).unwrap();
    let mut over_ground = learner();
    let start = session.weights().to_vec();
    // Until the current is known, the model does not learn.
    follow(&mut session, &run, 0, 30);
    assert_eq!(session.weights(), start);
    follow(&mut session, &run, 31, 8_999);
    follow(over_ground.as_mut(), &run, 0, 8_999);
    assert!(distance(session.current().unwrap().velocity, current) < 0.06, "{:?}", session.current());
    let (own, other) = (weight_error(&session), weight_error(over_ground.as_ref()));
    assert!(own < 0.6 && other > 2.5, "{own} {other}");
    // A frozen session predicts on, and does not learn.
    session.freeze(true);
    let before = session.weights().to_vec();
    follow(&mut session, &run, 8_000, 8_999);
    assert_eq!(session.weights(), before);
}

#[test]
fn a_saved_session_continues_to_the_last_bit() {
    let mut run = run([[0.4, -0.2], [-0.3, 0.3]], 2_000, 10);
    run.heading[700] = f64::NAN;
    run.measured[720][1] = f64::NAN;
    let new = || ThroughWater::new(learner(), CurrentOptions { walk: 0.02, ..options(0.5, 0.05) }).unwrap();
    let bits = |session: &mut dyn Adapter| {
        let mut memory = vec![0.0; session.memory_len()];
        session.save(&mut memory);
        memory.into_iter().map(f64::to_bits).collect::<Vec<_>>()
    };
    // While a heading is missing, and while the turn of the current is found.
    for to in [722, 1_014, 1_024, 1_034, 1_044] {
        let mut session = new();
        follow(&mut session, &run, 0, to);
        let mut memory = vec![0.0; session.memory_len()];
        session.save(&mut memory);
        let mut other = new();
        other.load(&memory);
        assert_eq!(bits(&mut session), bits(&mut other), "{to}");
        for k in to + 1..to + 400 {
            follow(&mut session, &run, k, k);
            follow(&mut other, &run, k, k);
        }
        assert_eq!(bits(&mut session), bits(&mut other), "{to}");
        let mut snapshot = vec![0.0; session.snapshot_len()];
        session.snapshot(&mut snapshot);
        assert!(snapshot.ends_with(session.weights()));
    }
}

#[test]
fn a_jump_of_the_current_is_found_within_three_windows_and_not_learned() {
    let (before, after) = ([0.0, 0.1], [0.4, -0.2]);
    let run = run([before, after], 4_000, 12);
    let options = CurrentOptions { walk: 0.005, ..options(0.3, 0.05) };
    let mut session = ThroughWater::new(vessel(), options).unwrap();
    follow(&mut session, &run, 0, 1_999);
    assert!(distance(session.current().unwrap().velocity, before) < 0.05, "{:?}", session.current());
    follow(&mut session, &run, 2_000, 2_089);
    assert!(distance(session.current().unwrap().velocity, after) < 0.08, "{:?}", session.current());
    // Without jumps, the random walk takes much longer.
    let mut slow = ThroughWater::new(vessel(), CurrentOptions { initial: 1e6, ..options }).unwrap();
    follow(&mut slow, &run, 0, 2_089);
    assert!(distance(slow.current().unwrap().velocity, after) > 0.25, "{:?}", slow.current());
    // What was learned while the old current was taken for the present one is forgotten.
    let mut learning = ThroughWater::new(learner(), options).unwrap();
    follow(&mut learning, &run, 0, 1_999);
    let known = weight_error(&learning);
    let mut worst = known;
    for k in 2_000..4_000 {
        follow(&mut learning, &run, k, k);
        if k >= 2_089 {
            worst = worst.max(weight_error(&learning));
        }
    }
    assert!(worst < known + 0.03, "{known} {worst}");
}

/// A model error that lasts for a second is not a jump of the current.
#[test]
fn an_outlier_is_no_jump() {
    let current = [0.2, -0.3];
    let mut run = run([current; 2], 2_000, 13);
    for k in (600..2_000).step_by(200) {
        for row in &mut run.measured[k..k + 10] {
            row[0] += 0.4;
        }
    }
    let options = CurrentOptions { walk: 0.005, ..options(0.3, 0.03) };
    let mut session = ThroughWater::new(vessel(), options).unwrap();
    for k in 0..2_000 {
        follow(&mut session, &run, k, k);
        let off = distance(session.current().unwrap().velocity, current);
        assert!(k < 400 || off < 0.06, "sample {k}: {off}");
    }
}

#[test]
fn bands_contain_the_uncertainty_of_the_current() {
    let run = run([[0.4, -0.2]; 2], 1_000, 11);
    let options = CurrentOptions { walk: 0.02, ..options(0.5, 0.05) };
    let mut session = ThroughWater::new(learner(), options).unwrap();
    let (mut work, commands) = (Workspace::new(), [0.5; 120]);
    let mut deviations = |session: &mut ThroughWater<dyn Adapter>| {
        let mut y = [0.0; 9];
        session.deviations(&commands, &[1, 30, 60], &mut work, &mut y);
        y
    };
    follow(&mut session, &run, 0, 900);
    let before = deviations(&mut session);
    let mut snapshot = vec![0.0; session.snapshot_len()];
    session.snapshot(&mut snapshot);
    snapshot[2..5].copy_from_slice(&[0.04, 0.0, 0.04]);
    session.restore(&snapshot);
    let after = deviations(&mut session);
    let added = |i: usize| (after[i].powi(2) - before[i].powi(2)).sqrt();
    assert!((0.05..=0.2).contains(&added(3)) && (0.05..=0.2).contains(&added(4)), "{before:?} {after:?}");
    assert!(added(0) < 0.1 * added(3) && (added(6) - added(3)).abs() < 0.01, "{before:?} {after:?}");
}

#[test]
fn rollouts_of_batches_and_snapshots_are_those_of_single_ones() {
    let run = run([[0.2, -0.3]; 2], 400, 6);
    let mut session = ThroughWater::new(vessel(), options(0.5, 0.02)).unwrap();
    let size = session.snapshot_len();
    let (mut work, mut snapshots, mut single, mut commands) = (Workspace::new(), vec![], vec![], vec![]);
    for k in 0..350 {
        follow(&mut session, &run, k, k);
        if k % 50 == 30 {
            let mut own = vec![0.0; size];
            session.snapshot(&mut own);
            snapshots.extend(own);
            let ahead = run.commands[k..k + 20].concat();
            let mut y = vec![0.0; 60];
            session.rollout(&ahead, &mut work, &mut y);
            let mut batch = vec![0.0; 120];
            session.rollout_batch(2, &ahead.repeat(2), &mut work, &mut batch);
            assert!(batch.iter().zip(y.iter().cycle()).all(|(a, b)| (a - b).abs() < 1e-12));
            single.extend(y);
            commands.extend(ahead);
        }
    }
    let count = snapshots.len() / size;
    let mut y = vec![0.0; single.len()];
    let mut fork = session.fork();
    fork.rollout_snapshots(count, &snapshots, &commands, &mut work, &mut y);
    assert!(y.iter().zip(&single).all(|(a, b)| (a - b).abs() < 1e-12));
    for (i, snapshot) in snapshots.chunks_exact(size).enumerate() {
        session.restore(snapshot);
        let mut again = [0.0; 60];
        session.rollout(&commands[i * 40..(i + 1) * 40], &mut work, &mut again);
        assert_eq!(again, single[i * 60..(i + 1) * 60]);
    }
}

#[test]
fn options_that_make_no_sense_are_refused() {
    let good = options(0.5, 0.02);
    for bad in [
        CurrentOptions { motion: [0, 1, 1], ..good },
        CurrentOptions { motion: [0, 1, 3], ..good },
        CurrentOptions { window: 0, ..good },
        CurrentOptions { window: usize::MAX, ..good },
        CurrentOptions { deviations: [0.1, 0.0, 0.1], ..good },
        CurrentOptions { noise: [0.0, -0.1, 0.0], ..good },
        CurrentOptions { dt: f64::NAN, ..good },
        CurrentOptions { initial: -0.1, ..good },
        CurrentOptions { walk: f64::INFINITY, ..good },
    ] {
        assert!(ThroughWater::new(vessel(), bad).is_none(), "{bad:?}");
    }
}

proptest! {
    #[test]
    fn bad_samples_cause_no_panic_and_no_lasting_harm(
        bad in prop::collection::vec((100..300_usize, 0..4_usize, prop::sample::select(vec![f64::NAN, f64::INFINITY, -1e300, 1e300])), 0..12),
    ) {
        let mut run = run([[0.2, -0.3]; 2], 800, 7);
        for (k, place, value) in bad {
            if place == 3 { run.heading[k] = value } else { run.measured[k][place] = value }
        }
        let mut session = ThroughWater::new(vessel(), CurrentOptions { walk: 0.01, ..options(0.5, 0.02) }).unwrap();
        follow(&mut session, &run, 0, 799);
        prop_assert!(distance(session.current().unwrap().velocity, [0.2, -0.3]) < 0.05, "{:?}", session.current().unwrap());
    }
}
