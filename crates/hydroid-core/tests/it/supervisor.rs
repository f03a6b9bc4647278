//! The supervisor of a steered vessel: all its transitions, by enumeration.

use std::collections::{BTreeSet, HashSet, VecDeque};

use hydroid_core::control::{Mode, Place, Stop, Supervisor, SupervisorLimits};
use hydroid_core::memory::Memory;

const STEP_S: f64 = 0.5;
const PATIENCE_S: f64 = 1.0;
const PROGRESS_M: f64 = 2.0;
const LIMITS: SupervisorLimits =
    SupervisorLimits { patience_s: PATIENCE_S, progress_m: PROGRESS_M, stall_s: 2.0 };
/// Length and time of the first way; later ones are as long, or shorter by the progress.
const WAY_M: f64 = 4.0;
const WAY_S: f64 = 1.0;

/// What happens in a sample.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "every combination is visited")]
struct Sample {
    alive: bool,
    within: bool,
    joined: bool,
    done: bool,
    /// Whether the reference moves on, and a new way is shorter.
    nearer: bool,
    lost: bool,
    outside: bool,
}

fn samples() -> impl Iterator<Item = Sample> {
    (0..128_u32).map(|bits| {
        let [alive, within, joined, done, nearer, lost, outside] =
            std::array::from_fn(|place| bits >> place & 1 == 1);
        Sample { alive, within, joined, done, nearer, lost, outside }
    })
}

/// A supervisor, with the length of the next way.
#[derive(Clone, Debug)]
struct State {
    supervisor: Supervisor,
    left_m: f64,
    along_m: f64,
}

impl State {
    fn new() -> Self {
        Self { supervisor: Supervisor::new(LIMITS), left_m: WAY_M, along_m: 0.0 }
    }

    /// All numbers on which the next samples depend.
    fn key(&self) -> Vec<u64> {
        let mut supervisor = self.supervisor.clone();
        let mut key: Vec<u64> =
            Memory::saved(|memory| supervisor.visit_state(memory)).into_iter().map(f64::to_bits).collect();
        key.extend([self.left_m, self.along_m].map(f64::to_bits));
        key
    }

    fn sample(&mut self, sample: Sample) {
        let supervisor = &mut self.supervisor;
        if sample.lost {
            supervisor.lose();
        }
        if sample.outside {
            supervisor.stop(Stop::Outside);
        }
        if supervisor.begin(sample.alive, STEP_S) {
            if sample.nearer && self.left_m > 0.0 {
                self.left_m -= PROGRESS_M;
            }
            supervisor.planned(self.left_m, WAY_S);
        }
        if sample.nearer {
            self.along_m = PROGRESS_M;
        }
        let Sample { within, joined, done, .. } = sample;
        supervisor.judge(&Place { within, joined, done, along_m: self.along_m });
    }
}

/// Every state that any sequence of samples reaches.
#[test]
fn all_transitions_keep_the_promises() {
    let mut seen = HashSet::new();
    let mut open = VecDeque::from([State::new()]);
    let mut edges = BTreeSet::new();
    while let Some(state) = open.pop_front() {
        assert!(seen.len() < 200_000, "the states have no end");
        for sample in samples() {
            let mut next = state.clone();
            let from = state.supervisor.mode();
            next.sample(sample);
            let to = next.supervisor.mode();
            edges.insert((from as usize, to as usize));
            // Commands without measurements are neutral at once.
            assert!(sample.alive || !to.steers(), "{state:?} {sample:?}");
            // And so are those outside the fence.
            assert!(!sample.outside || to.is_final(), "{state:?} {sample:?}");
            assert_eq!(to == Mode::Stopped, next.supervisor.cause().is_some());
            // A task that has ended stays so.
            assert!(!from.is_final() || from == to, "{state:?} {sample:?}");
            // Only a vessel on its way, which has reached the task, is on the task.
            let is_new = from != Mode::OnTask || sample.lost;
            assert!(to != Mode::OnTask || !is_new || sample.within && sample.joined, "{state:?} {sample:?}");
            assert!(to != Mode::Arrived || from == to || sample.done, "{state:?} {sample:?}");
            if seen.insert(next.key()) {
                open.push_back(next);
            }
        }
    }
    assert!(seen.len() > 100, "{}", seen.len());
    // Each mode is reached and, unless it is final, left.
    for mode in Mode::ALL {
        assert!(mode == Mode::Blind || edges.iter().any(|(from, to)| *to == mode as usize && from != to));
        assert!(mode.is_final() || edges.iter().any(|(from, to)| *from == mode as usize && from != to));
    }
    // On the task by the approach alone.
    assert!(!edges.contains(&(Mode::Stopped as usize, Mode::OnTask as usize)));
}

/// From every state, a vessel that is never on its way and comes no nearer is stopped within a stated time, and so is one that
/// is on its way and never reaches the task, or stands still on it.
#[test]
fn steering_without_success_ends() {
    let base = Sample {
        alive: true,
        within: false,
        joined: false,
        done: false,
        nearer: false,
        lost: false,
        outside: false,
    };
    let approach_s = 2.0 * WAY_S + 10.0 * PATIENCE_S;
    for (sample, most_s) in [
        (base, 5.0 * (PATIENCE_S + 2.0 * STEP_S)),
        (Sample { within: true, ..base }, 2.0 * approach_s),
        (Sample { within: true, joined: true, ..base }, 5.0 * (LIMITS.stall_s + 2.0 * STEP_S)),
        (Sample { joined: true, ..base }, 5.0 * (PATIENCE_S + 2.0 * STEP_S)),
    ] {
        for first in samples() {
            for second in samples() {
                let mut state = State::new();
                (0..3).for_each(|_| state.sample(first));
                (0..3).for_each(|_| state.sample(second));
                let mut time_s = 0.0;
                while !state.supervisor.mode().is_final() {
                    state.sample(sample);
                    time_s += STEP_S;
                    assert!(time_s <= most_s, "{state:?} after {first:?}, {second:?} with {sample:?}");
                }
            }
        }
    }
}

/// Times and lengths that are no numbers stop a vessel.
#[test]
fn what_is_no_number_is_no_reason_to_steer() {
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        let mut supervisor = Supervisor::new(LIMITS);
        assert!(supervisor.begin(true, f64::INFINITY));
        supervisor.planned(WAY_M, WAY_S);
        assert!(!supervisor.begin(true, bad), "{bad}");
        assert_eq!(supervisor.mode(), Mode::Stopped, "{bad}");
    }
    for (left_m, duration_s) in [(f64::NAN, 1.0), (1.0, f64::NAN), (f64::INFINITY, 1.0), (1.0, f64::INFINITY)]
    {
        let mut supervisor = Supervisor::new(LIMITS);
        assert!(supervisor.begin(true, 0.1));
        supervisor.planned(left_m, duration_s);
        assert_eq!(supervisor.mode(), Mode::Stopped, "{left_m} {duration_s}");
    }
}

/// A station is regained however often the measurements are lost; a vessel that does not come back to it is stopped.
#[test]
fn a_station_is_regained_after_any_number_of_losses() {
    let mut supervisor = Supervisor::new(LIMITS);
    let place = |near: bool| Place { within: near, joined: near, done: false, along_m: f64::INFINITY };
    for _ in 0..20 {
        assert!(supervisor.begin(true, STEP_S));
        supervisor.planned(WAY_M, WAY_S);
        supervisor.judge(&place(true));
        assert_eq!(supervisor.mode(), Mode::OnTask);
        assert!(!supervisor.begin(false, STEP_S));
        assert_eq!(supervisor.mode(), Mode::Blind);
    }
    for _ in 0..20 {
        if supervisor.begin(true, STEP_S) {
            supervisor.planned(WAY_M, WAY_S);
        }
        supervisor.judge(&place(false));
    }
    assert_eq!(supervisor.mode(), Mode::Stopped);
}
