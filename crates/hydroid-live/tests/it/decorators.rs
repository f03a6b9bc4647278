//! Every session around another one answers with the whole session inside, and so do its forks.

use hydroid::adapt::{GuardOptions, MeteredAdapter};
use hydroid_core::adapt::guard::Guard;
use hydroid_core::adapt::kalman::RehearsalOptions;
use hydroid_core::adapt::{Adapter, Health, Innovation, Learning, Outcome, Rehearsing, SaveState};
use hydroid_core::current::{CurrentOptions, ThroughWater};
use hydroid_core::memory::Memory;
use hydroid_core::predict::{Current, Fork, Predictor, Workspace, plain, restore_and_roll_out, rollout_each};
use hydroid_core::rate_limit::{RateLimited, RateLimiter};
use hydroid_live::black_box::RecordingAdapter;

/// A session whose methods have answers of their own, so that none can stand in for another one.
#[derive(Clone)]
struct Inner {
    heading: f64,
    /// Outputs: surge, sway, yaw rate.
    state: [f64; 3],
    current: Current,
    /// Calls that change how it learns.
    weights: [f64; 4],
    innovations: Vec<Innovation>,
    rehearsal: RehearsalOptions,
    sound: bool,
}

/// Marks of the rollouts side by side.
const OF_BATCH: f64 = 1e-3;
const OF_SNAPSHOTS: f64 = 2e-3;

impl Inner {
    fn new() -> Self {
        Self {
            heading: 0.0,
            state: [f64::NAN; 3],
            current: Current { velocity: [0.3, -0.2], covariance: [1.0, 0.5, 2.0] },
            weights: [0.0; 4],
            innovations: vec![Innovation { value: 0.5, deviation: 2.0 }; 3],
            rehearsal: RehearsalOptions {
                windows: 3,
                samples: 4,
                every: 5,
                initial_state: 1.0,
                noise_factor: 1.0,
            },
            sound: true,
        }
    }
}

impl Predictor for Inner {
    plain!(advance_observe);

    fn outputs(&self) -> usize {
        3
    }

    fn inputs(&self) -> usize {
        1
    }

    fn warm_up(&self) -> usize {
        7
    }

    fn reset(&mut self) {
        self.state = [f64::NAN; 3];
    }

    fn observe_heading(&mut self, heading: f64) {
        self.heading = heading;
    }

    fn current(&self) -> Option<&Current> {
        Some(&self.current)
    }

    fn output_through_water(&self, y: &mut [f64]) {
        y.fill(self.state[0] - 1.0);
    }

    fn observe(&mut self, y: &[f64]) {
        for (own, y) in self.state.iter_mut().zip(y).filter(|(_, y)| !y.is_nan()) {
            *own = *y;
        }
    }

    fn advance(&mut self, c: &[f64]) {
        self.state[0] += 0.01 * c[0];
    }

    fn output(&self, y: &mut [f64]) {
        y.copy_from_slice(&self.state);
    }

    fn rollout(&self, commands: &[f64], _: &mut Workspace, y: &mut [f64]) {
        for (row, c) in y.chunks_exact_mut(3).zip(commands) {
            row.copy_from_slice(&self.state);
            row[0] += 0.01 * c + 0.02 * self.heading;
        }
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        rollout_each(self, count, commands, work, y);
        for y in y {
            *y += OF_BATCH;
        }
    }

    fn snapshot_len(&self) -> usize {
        4
    }

    fn snapshot(&self, into: &mut [f64]) {
        into[0] = self.heading;
        into[1..].copy_from_slice(&self.state);
    }

    fn restore(&mut self, from: &[f64]) {
        self.heading = from[0];
        self.state.copy_from_slice(&from[1..]);
    }

    fn rollout_snapshots(
        &mut self,
        count: usize,
        snapshots: &[f64],
        commands: &[f64],
        work: &mut Workspace,
        y: &mut [f64],
    ) {
        restore_and_roll_out(self, count, snapshots, commands, work, y);
        for y in y {
            *y += OF_SNAPSHOTS;
        }
    }

    fn fork(&self) -> Fork {
        Box::new(self.clone())
    }
}

impl Learning for Inner {
    plain!(no_guard);

    fn outcome(&self) -> Outcome {
        Outcome::Accepted
    }

    fn innovations(&self) -> &[Innovation] {
        &self.innovations
    }

    fn weights(&self) -> &[f64] {
        &self.weights
    }

    fn freeze(&mut self, frozen: bool) {
        self.weights[0] = if frozen { 1.0 } else { -1.0 };
    }

    fn scale_noise(&mut self, factor: f64) {
        self.weights[1] = factor;
    }

    fn restart(&mut self) {
        self.weights[2] += 1.0;
    }

    fn health(&self) -> Health {
        Health { least_variance: 0.25, min_s_over_r: 1.5 }
    }

    fn deviations(
        &mut self,
        commands: &[f64],
        horizons: &[usize],
        _: &mut Workspace,
        deviations: &mut [f64],
    ) {
        deviations.fill(commands[0] + horizons[0] as f64);
    }
}

impl SaveState for Inner {
    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.session(self);
    }

    fn is_sound(&self) -> bool {
        self.sound
    }
}

impl Rehearsing for Inner {
    fn rehearsal(&self) -> Option<&RehearsalOptions> {
        Some(&self.rehearsal)
    }

    fn store_window(&mut self, _: &[f64], _: &[f64]) {
        self.weights[3] += 1.0;
    }
}

fn limited(inner: Box<dyn Adapter>) -> Box<dyn Adapter> {
    Box::new(RateLimited::new(inner, RateLimiter::new([Some(1e9)], 0.1).expect("a limit")))
}

fn guarded(inner: [Box<dyn Adapter>; 3]) -> Box<dyn Adapter> {
    let [learner, unguarded, reference] = inner;
    let guard =
        Guard::new(learner, unguarded, reference, &[(-5.0, 5.0); 3], &[0.1; 3], GuardOptions::new(0.1));
    Box::new(guard.expect("a guard"))
}

fn through_water(inner: Box<dyn Adapter>) -> Box<dyn Adapter> {
    let options = CurrentOptions {
        motion: [0, 1, 2],
        dt: 0.1,
        window: 1000,
        deviations: [0.1; 3],
        noise: [0.0; 3],
        initial: 1.0,
        walk: 0.0,
    };
    Box::new(ThroughWater::new(inner, options).expect("valid options"))
}

/// Sessions around `inner` that change none of its predictions, and whether they take its rollouts from snapshots.
fn neutral(inner: &Inner) -> Vec<(&'static str, Box<dyn Adapter>, bool)> {
    let inner = || -> Box<dyn Adapter> { Box::new(inner.clone()) };
    vec![
        ("rate limit", limited(inner()), true),
        ("recording", Box::new(RecordingAdapter::new(inner(), None)), true),
        // Rollouts from snapshots are limited one by one.
        ("guard", guarded([inner(), inner(), inner()]), false),
        ("guard around a rate limit", guarded([limited(inner()), limited(inner()), limited(inner())]), false),
    ]
}

/// Some samples of a run with a turn.
fn run(session: &mut dyn Predictor) {
    session.reset();
    for k in 0..20_u32 {
        let x = f64::from(k);
        let (c, y) = ([x], [1.0 + 0.01 * x, 0.02, 0.03]);
        session.observe_heading(0.1 * x);
        if k % 2 == 0 {
            session.advance_observe(&c, &y);
        } else {
            session.observe(&y);
            session.advance(&c);
        }
    }
}

fn outputs(session: &dyn Predictor) -> [[f64; 3]; 2] {
    let mut y = [[0.0; 3]; 2];
    session.output(&mut y[0]);
    session.output_through_water(&mut y[1]);
    y
}

/// Rollouts of two sequences of two commands: the first alone, both side by side, both from the present state.
fn rollouts(session: &mut dyn Predictor) -> [Vec<f64>; 3] {
    let (commands, mut work) = ([19.0, 18.0, 17.0, 16.0], Workspace::new());
    let (mut one, mut batch, mut from_snapshots) = (vec![0.0; 6], vec![0.0; 12], vec![0.0; 12]);
    let mut snapshot = vec![0.0; session.snapshot_len()];
    session.snapshot(&mut snapshot);
    session.rollout(&commands[..2], &mut work, &mut one);
    session.rollout_batch(2, &commands, &mut work, &mut batch);
    session.rollout_snapshots(2, &snapshot.repeat(2), &commands, &mut work, &mut from_snapshots);
    [one, batch, from_snapshots]
}

/// Compares a session around `Inner` with one of `Inner`, after the same calls.
fn compare(name: &str, session: &mut dyn Predictor, inner: &mut Inner, takes_snapshots: bool) {
    assert_eq!((session.outputs(), session.inputs(), session.warm_up()), (3, 1, 7), "{name}");
    assert_eq!(session.current(), inner.current(), "{name}");
    assert_eq!(outputs(session), outputs(inner), "{name}");
    let mut expected = rollouts(inner);
    if !takes_snapshots {
        let plain: Vec<f64> = expected[1].iter().map(|y| y - OF_BATCH).collect();
        expected[2] = plain;
    }
    for (found, expected) in rollouts(session).iter().flatten().zip(expected.iter().flatten()) {
        assert!((found - expected).abs() < 1e-12, "{name}: {found}, and {expected} inside");
    }
}

#[test]
fn sessions_around_another_one_answer_with_all_of_it() {
    for (name, mut session, takes_snapshots) in neutral(&Inner::new()) {
        let inner = &mut Inner::new();
        let session = session.as_mut();
        run(session);
        run(inner);
        compare(name, session, inner, takes_snapshots);
        // A fork, and one of that, hear headings and measurements.
        let mut fork = session.fork();
        let mut inner_fork = inner.clone();
        for generation in ["fork", "fork of the fork"] {
            fork.observe_heading(-2.0);
            inner_fork.observe_heading(-2.0);
            fork.observe(&[1.2, 0.1, 0.2]);
            inner_fork.observe(&[1.2, 0.1, 0.2]);
            compare(&format!("{generation}, {name}"), fork.as_mut(), &mut inner_fork, takes_snapshots);
            fork = fork.fork();
        }
        let mut snapshot = vec![0.0; session.snapshot_len()];
        session.snapshot(&mut snapshot);
        fork.restore(&snapshot);
        compare(name, fork.as_mut(), inner, takes_snapshots);
        learning(name, session, inner);
    }
    let mut metered = Inner::new();
    let (session, inner) = (&mut MeteredAdapter::new(&mut metered), &mut Inner::new());
    run(session);
    run(inner);
    compare("metered", session, inner, true);
}

fn learning(name: &str, session: &mut dyn Adapter, inner: &mut Inner) {
    let around: [&mut dyn Adapter; 2] = [session, inner];
    let [session, inner] = around.map(|adapter| {
        adapter.freeze(true);
        adapter.scale_noise(4.0);
        adapter.restart();
        adapter.store_window(&[0.0; 12], &[0.0; 4]);
        let mut deviations = [0.0; 3];
        adapter.deviations(&[5.0; 4], &[4], &mut Workspace::new(), &mut deviations);
        let mut memory = vec![0.0; adapter.memory_len()];
        adapter.save(&mut memory);
        adapter.reset();
        adapter.load(&memory);
        (
            (adapter.weights().to_vec(), adapter.innovations().to_vec(), adapter.health(), deviations),
            (adapter.rehearsal().copied(), adapter.is_sound(), outputs(adapter)),
        )
    });
    assert_eq!(session, inner, "{name}");
}

#[test]
fn an_unsound_session_makes_all_around_it_unsound() {
    let unsound = Inner { sound: false, ..Inner::new() };
    let of_water = ("current", through_water(Box::new(unsound.clone())), false);
    for (name, session, _) in neutral(&unsound).into_iter().chain([of_water]) {
        assert!(!session.is_sound(), "{name}");
    }
}

#[test]
fn a_guard_is_found_behind_what_is_around_it() {
    let guard = || guarded([(); 3].map(|()| Box::new(Inner::new()) as Box<dyn Adapter>));
    let recording = Box::new(RecordingAdapter::new(guard(), None));
    for session in [limited(guard()), through_water(guard()), recording] {
        assert!(session.guard().is_some());
    }
}

/// In a current, the predictions over ground depend on the heading.
#[test]
fn a_fork_of_a_guard_hears_the_heading() {
    let inner = || through_water(Box::new(Inner::new()));
    let mut guard = guarded([inner(), inner(), inner()]);
    guard.observe(&[1.0, 0.0, 0.0]);
    let mut fork = guard.fork();
    // The sessions of the guard begin with the current, here a metre per second to the north.
    let mut snapshot = vec![0.0; fork.snapshot_len()];
    fork.snapshot(&mut snapshot);
    let len = (snapshot.len() - 3) / 3;
    snapshot[..3 * len].chunks_exact_mut(len).for_each(|of_session| of_session[0] = 1.0);
    for (heading, over_ground) in [(0.0, 2.0), (std::f64::consts::PI, 0.0)] {
        fork.restore(&snapshot);
        fork.observe_heading(heading);
        fork.observe(&[f64::NAN; 3]);
        assert_eq!(fork.current().map(|current| current.velocity), Some([1.0, 0.0]));
        let mut y = [0.0; 3];
        fork.rollout(&[0.0], &mut Workspace::new(), &mut y);
        let [present, through_water] = outputs(fork.as_ref());
        assert!((through_water[0] - 1.0).abs() < 1e-12, "{through_water:?}");
        for surge in [present[0], y[0]] {
            assert!((surge - over_ground).abs() < 1e-12, "{surge} at the heading {heading}");
        }
    }
}
