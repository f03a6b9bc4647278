//! Faults of sensors that begin and end: what a guard makes of them, beside the same learner without one.
//!
//! A vessel and a model of it whose coefficients are wrong by 10 to 20 %. The learner has 100 s, then a sensor fails for some time.
//! Errors are those of predictions 2 s ahead against the truth, as means over the outputs in half design ranges.

use std::sync::Arc;

use hydroid_core::adapt::guard::{Action, Cause, Guard, GuardOptions};
use hydroid_core::adapt::{Adapter, InnovationGate, RecursiveEquations, RecursiveOptions};
use hydroid_core::model::sparse::{Equations, EquationsSession, Term};
use hydroid_core::predict::{Predictor, Workspace};

const DT: f64 = 0.1;
const HORIZON: usize = 20;
const RANGES: [(f64, f64); 5] = [(0.0, 3.0), (-0.6, 0.6), (-0.6, 0.6), (0.0, 2.0), (-0.5, 0.5)];
const NOISE: [f64; 3] = [0.01, 0.01, 0.017_453];

/// Samples before the fault.
const BEFORE: usize = 1000;
/// Samples after it.
const AFTER: usize = 400;

#[derive(Clone, Copy, Debug)]
enum Vessel {
    Quick,
    /// With eight times the inertia.
    Slow,
}

/// Surge, sway, yaw; variables `u, v, r`, propeller, rudder.
fn equations(vessel: Vessel, wrong: bool) -> Equations {
    let terms = vec![
        Term::monomial(&[0]),
        Term::monomial(&[1]),
        Term::monomial(&[2]),
        Term::monomial(&[3]),
        Term::monomial(&[0, 2]),
        Term::monomial(&[0, 4]),
    ];
    let coefficients =
        [[-0.7, 0.0, 0.0, 1.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0, -0.3, 0.1], [0.0, 0.2, -1.2, 0.0, 0.0, 0.6]]
            .concat();
    let inertia = match vessel {
        Vessel::Quick => 1.0,
        Vessel::Slow => 8.0,
    };
    let errors = [0.85, 1.17, 1.12, 0.88, 1.2, 0.83, 1.14];
    let error = |i: usize| if wrong { errors[i % errors.len()] } else { 1.0 };
    let coefficients = coefficients.iter().enumerate().map(|(i, c)| c / inertia * error(i)).collect();
    Equations::new(terms, coefficients, 3, 2, DT, 1).unwrap()
}

fn learner(vessel: Vessel) -> Box<dyn Adapter> {
    let options = RecursiveOptions {
        forgetting_s: 300.0,
        window: 10,
        prior_s: 10.0,
        leak: false,
        all_terms: false,
        gate: InnovationGate::default(),
    };
    Box::new(RecursiveEquations::new(&equations(vessel, true), &RANGES, &options).unwrap())
}

fn guard(vessel: Vessel) -> Guard {
    let mut reference = learner(vessel);
    reference.freeze(true);
    let options = GuardOptions::new(DT);
    Guard::new(learner(vessel), learner(vessel), reference, &RANGES[..3], &NOISE, options).unwrap()
}

/// Uniform numbers between 0 and 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() - 6.0
    }
}

/// Commands, truth and measurements without a fault.
struct Log {
    commands: Vec<[f64; 2]>,
    truth: Vec<[f64; 3]>,
    measured: Vec<[f64; 3]>,
}

fn log(vessel: Vessel, len: usize, seed: u64) -> Log {
    let mut random = Random(seed.wrapping_mul(7919) + 1);
    for _ in 0..10 {
        let _ = random.next();
    }
    let mut commands = Vec::new();
    while commands.len() < len {
        let (shortest, longest) = match vessel {
            Vessel::Quick => (50.0, 180.0),
            Vessel::Slow => (200.0, 500.0),
        };
        let steps = shortest + random.next() * (longest - shortest);
        let command = [0.4 + 1.4 * random.next(), random.next() - 0.5];
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 50 and 500
        let steps = steps as usize;
        commands.extend(std::iter::repeat_n(command, steps));
    }
    let mut session = EquationsSession::new(Arc::new(equations(vessel, false)));
    session.observe(&[1.0, 0.0, 0.0]);
    let (mut truth, mut measured) = (Vec::new(), Vec::new());
    for command in &commands[..len] {
        let mut y = [0.0; 3];
        session.output(&mut y);
        truth.push(y);
        measured.push(std::array::from_fn(|i| y[i] + NOISE[i] * random.normal()));
        session.advance(command);
    }
    Log { commands, truth, measured }
}

type Fault = fn(k: usize, before: &[[f64; 3]], y: &mut [f64; 3]);

/// Mean errors of the guard and of the learner without one.
#[derive(Clone, Copy, Debug)]
struct Errors {
    guarded: f64,
    unguarded: f64,
}

impl Errors {
    fn ratio(self) -> f64 {
        self.guarded / self.unguarded
    }
}

#[derive(Debug)]
struct Story {
    /// During the fault; from 2 to 5 s after its end, and from 20 to 35 s.
    during: Errors,
    soon: Errors,
    later: Errors,
    before: Errors,
    trusted: Vec<(usize, Cause)>,
    held: Vec<bool>,
}

/// Runs a story: the `fault` gets the sample since its begin, and the sound measurements up to it.
fn story(vessel: Vessel, samples: usize, seed: u64, fault: Fault) -> Story {
    let len = BEFORE + samples + AFTER + HORIZON;
    let mut log = log(vessel, len, seed);
    let sound = log.measured.clone();
    for k in 0..samples {
        fault(k, &sound[..=BEFORE + k], &mut log.measured[BEFORE + k]);
    }
    let (mut guard, mut plain) = (guard(vessel), learner(vessel));
    let mut work = Workspace::new();
    let (mut errors, mut held, mut trusted) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..len - HORIZON {
        guard.observe(&log.measured[k]);
        plain.observe(&log.measured[k]);
        held.push(guard.is_held());
        trusted.extend(guard.events().iter().filter_map(|event| match event.action {
            Action::Trusted { cause, .. } => Some((k, cause)),
            _ => None,
        }));
        let commands = log.commands[k..k + HORIZON].as_flattened();
        let error = |session: &dyn Predictor, work: &mut Workspace| {
            let mut y = [0.0; 3 * HORIZON];
            session.rollout(commands, work, &mut y);
            let off = |i: usize| {
                let error = (y[3 * (HORIZON - 1) + i] - log.truth[k + HORIZON][i]).abs();
                let error = error / (0.5 * (RANGES[i].1 - RANGES[i].0));
                if error < 20.0 { error } else { 20.0 }
            };
            (off(0) + off(1) + off(2)) / 3.0
        };
        errors.push([error(&guard, &mut work), error(plain.as_ref(), &mut work)]);
        guard.advance(&log.commands[k]);
        plain.advance(&log.commands[k]);
    }
    let mean = |from: usize, to: usize| {
        let [guarded, unguarded] =
            [0, 1].map(|i| errors[from..to].iter().map(|pair| pair[i]).sum::<f64>() / (to - from) as f64);
        Errors { guarded, unguarded }
    };
    let end = BEFORE + samples;
    Story {
        during: mean(BEFORE, end),
        soon: mean(end + 20, end + 50),
        later: mean(end + 200, end + 350),
        before: mean(BEFORE / 2, BEFORE),
        trusted,
        held,
    }
}

fn exchange(_: usize, _: &[[f64; 3]], y: &mut [f64; 3]) {
    y.swap(0, 1);
}

fn sign_of_u(_: usize, _: &[[f64; 3]], y: &mut [f64; 3]) {
    y[0] = -y[0];
}

fn sign_of_r(_: usize, _: &[[f64; 3]], y: &mut [f64; 3]) {
    y[2] = -y[2];
}

fn degrees(_: usize, _: &[[f64; 3]], y: &mut [f64; 3]) {
    y[2] = y[2].to_degrees();
}

fn double(_: usize, _: &[[f64; 3]], y: &mut [f64; 3]) {
    y[0] *= 2.0;
}

fn rounding(_: usize, _: &[[f64; 3]], y: &mut [f64; 3]) {
    y[0] = (2.0 * y[0]).round() / 2.0;
    y[2] = (5.0 * y[2]).round() / 5.0;
}

fn jump(_: usize, _: &[[f64; 3]], y: &mut [f64; 3]) {
    y[0] += 0.5;
}

fn drift(k: usize, _: &[[f64; 3]], y: &mut [f64; 3]) {
    y[0] += 0.02 * DT * k as f64;
}

fn spikes(k: usize, _: &[[f64; 3]], y: &mut [f64; 3]) {
    if k.is_multiple_of(9) {
        y[k % 3] += 1.0;
    }
}

fn stuck(k: usize, before: &[[f64; 3]], y: &mut [f64; 3]) {
    y[0] = before[before.len() - 1 - k][0];
}

fn dropout(_: usize, _: &[[f64; 3]], y: &mut [f64; 3]) {
    y[0] = f64::NAN;
}

fn delay(_: usize, before: &[[f64; 3]], y: &mut [f64; 3]) {
    *y = before[before.len() - 8];
}

const KINDS: [(&str, Fault); 12] = [
    ("exchange", exchange),
    ("sign of u", sign_of_u),
    ("sign of r", sign_of_r),
    ("degrees", degrees),
    ("double", double),
    ("rounding", rounding),
    ("jump", jump),
    ("drift", drift),
    ("spikes", spikes),
    ("stuck", stuck),
    ("dropout", dropout),
    ("delay", delay),
];

/// 20 s after the end of a fault of at most 30 s, the guarded error is less than 1.2 times that of the learner without guard;
/// during the fault it is less than `most_during` times it.
fn leaves_nothing_behind(fault: Fault, most_during: f64) {
    for samples in [5, 80, 300] {
        for seed in 1..=2 {
            let story = story(Vessel::Quick, samples, seed, fault);
            assert!(story.later.ratio() < 1.2, "{samples} samples, seed {seed}: {:?}", story.later);
            assert!(story.during.ratio() < most_during, "{samples} samples, seed {seed}: {:?}", story.during);
        }
    }
}

#[test]
fn an_exchange_of_u_and_v_leaves_nothing_behind() {
    leaves_nothing_behind(exchange, 0.2);
}

#[test]
fn a_wrong_sign_of_u_leaves_nothing_behind() {
    leaves_nothing_behind(sign_of_u, 0.2);
}

#[test]
fn a_yaw_rate_in_degrees_leaves_nothing_behind() {
    leaves_nothing_behind(degrees, 0.2);
}

/// Rounding to a value that is nearly right cannot be seen.
#[test]
fn coarse_rounding_leaves_nothing_behind() {
    leaves_nothing_behind(rounding, 1.2);
}

#[test]
fn half_a_second_of_any_fault_is_forgotten() {
    for vessel in [Vessel::Quick, Vessel::Slow] {
        for (name, fault) in KINDS {
            let story = story(vessel, 5, 1, fault);
            let error = story.before.unguarded.max(story.soon.unguarded);
            assert!(story.soon.guarded < 1.2 * error, "{vessel:?}, {name}: {:?}", story.soon);
            let held = story.held[BEFORE + 5..].iter().take_while(|held| **held).count();
            assert!(held <= 8, "{vessel:?}, {name}: held for {held} samples more");
        }
    }
}

/// A drift is learned. Its end is a jump, which the learner without guard confirms.
#[test]
fn a_wrong_hold_ends_within_two_seconds() {
    for vessel in [Vessel::Quick, Vessel::Slow] {
        for samples in [80, 300] {
            let story = story(vessel, samples, 1, drift);
            let held = story.held[BEFORE + samples..].iter().take_while(|held| **held).count();
            assert!((1..=20).contains(&held), "{vessel:?}, {samples} samples: held for {held}");
            assert!(
                story.soon.ratio() < 1.2 && story.later.ratio() < 1.2,
                "{vessel:?}, {samples}: {story:?}"
            );
        }
    }
}

/// A constant is consistent with a steady motion, so that only the budget ends the hold of a stuck sensor.
#[test]
fn the_budget_ends_a_hold() {
    let story = story(Vessel::Quick, 1700, 1, stuck);
    let longest = story.held.split(|held| !held).map(<[bool]>::len).max();
    assert!(longest.is_some_and(|longest| (1150..=1200).contains(&longest)), "{longest:?}");
    let [(first, Cause::Budget), (second, Cause::Budget), ..] = story.trusted[..] else {
        panic!("{:?}", story.trusted)
    };
    // 20 samples of budget have come back.
    assert!((200..=230).contains(&(second - first)), "{:?}", story.trusted);
}

#[test]
fn without_faults_the_guard_costs_nothing() {
    let (mut held, mut samples) = (0, 0);
    for (vessel, seed) in [(Vessel::Quick, 1), (Vessel::Quick, 2), (Vessel::Slow, 1), (Vessel::Slow, 2)] {
        let story = story(vessel, 2000, seed, |_, _, _| {});
        assert!(story.during.ratio() < 1.03, "{vessel:?}, seed {seed}: {:?}", story.during);
        held += story.held.iter().filter(|held| **held).count();
        samples += story.held.len();
    }
    assert!(2000 * held <= samples, "{held} of {samples} samples are held");
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn no_fault_is_left_behind_or_made_worse() {
    for (vessel, seed) in [(Vessel::Quick, 1), (Vessel::Quick, 3), (Vessel::Slow, 1), (Vessel::Slow, 3)] {
        for (name, fault) in KINDS {
            for samples in [5, 20, 80, 200, 600] {
                let story = story(vessel, samples, seed, fault);
                let story_of = format!("{vessel:?}, {name} for {samples} samples, seed {seed}: {story:?}");
                assert!(story.later.ratio() < 1.5, "{}", &story_of[..400]);
                // An error far below that without a fault does not count.
                let least = 1.2 * story.before.unguarded;
                assert!(
                    story.during.guarded < (1.2 * story.during.unguarded).max(least),
                    "{}",
                    &story_of[..400]
                );
            }
        }
    }
}
