//! Sessions in an evaluation: reset before each run, number of threads, adaptive sessions.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::judged::{DT, judge, options, run, wave};
use hydroid::evaluate::{DesignRange, evaluate};
use hydroid::log::{Channel, Table, Trajectory};
use hydroid_core::model::sparse::{Equations, EquationsSession, Term};
use hydroid_core::predict::{Predictor, Workspace, plain};

/// A coupled nonlinear model, sensitive to the last bit.
fn equations() -> EquationsSession {
    let terms = vec![Term::monomial(&[0]), Term::monomial(&[1]), Term::monomial(&[0, 1]), Term::constant()];
    let coefficients = vec![-0.1, 0.7, 0.3, 0.2, 0.05, -0.2, 0.1, -0.1];
    EquationsSession::new(Arc::new(Equations::new(terms, coefficients, 2, 1, DT, 2).unwrap()))
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    // More origins than one batch, in runs of different lengths.
    let (long, short) = (run("long", &wave(5_000)), run("short", &wave(333)));
    let text = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let result = pool.install(|| judge(&equations(), &[&long, &short], &options(11)));
        serde_json::to_string(&result.unwrap()).unwrap()
    };
    let one = text(1);
    assert_eq!(text(2), one);
    assert_eq!(text(3), one);
}

#[test]
fn a_session_sees_each_run_from_its_start() {
    // Neither the end of a run nor an earlier evaluation leaves a state.
    let (a, b) = (run("a", &wave(50)), run("b", &wave(60)));
    let mut used = equations();
    used.observe(&[9.0, 9.0]);
    used.advance(&[3.0]);
    let fresh = judge(&equations(), &[&a, &b], &options(5)).unwrap();
    assert_eq!(judge(&used, &[&a, &b], &options(5)).unwrap(), fresh);
    let mut y = [0.0; 2];
    used.output(&mut y);
    assert!(y.iter().all(|y| y.is_finite()), "the caller's session is where it was");
}

/// Counts observations and advances since the reset, and predicts both numbers.
#[derive(Clone)]
struct Memory {
    observed: f64,
    advanced: f64,
}

impl Predictor for Memory {
    plain!(warm_up over_ground advance_observe rollout_batch rollout_snapshots);

    fn outputs(&self) -> usize {
        2
    }
    fn inputs(&self) -> usize {
        1
    }
    fn reset(&mut self) {
        (self.observed, self.advanced) = (0.0, 0.0);
    }
    fn observe(&mut self, _y: &[f64]) {
        self.observed += 1.0;
    }
    fn advance(&mut self, c: &[f64]) {
        assert_eq!(c[0], self.advanced, "each command once, in order");
        self.advanced += 1.0;
    }
    fn output(&self, y: &mut [f64]) {
        y.copy_from_slice(&[self.observed, self.advanced]);
    }
    fn rollout(&self, _commands: &[f64], _work: &mut Workspace, y: &mut [f64]) {
        for row in y.chunks_exact_mut(2) {
            self.output(row);
        }
    }
    fn snapshot_len(&self) -> usize {
        2
    }
    fn snapshot(&self, into: &mut [f64]) {
        self.output(into);
    }
    fn restore(&mut self, from: &[f64]) {
        (self.observed, self.advanced) = (from[0], from[1]);
    }
    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(self.clone())
    }
}

#[test]
fn at_origin_k_a_session_has_observed_k_and_was_commanded_up_to_k_less_one() {
    // At origin k: k + 1 observations and k commands. The outputs of the run are these numbers, one sample later.
    let outputs: Vec<Vec<f64>> = (0..3_000).map(|k| vec![f64::from(k), f64::from(k - 1)]).collect();
    let range = [DesignRange { low: 0.0, high: 3_000.0 }; 2];
    let mut used = Memory { observed: 7.0, advanced: 3.0 };
    let (a, b) = (run("a", &outputs), run("b", &outputs[..2_000]));
    let silent = &mut |_| ControlFlow::Continue(());
    let result = evaluate("memory", &mut used, &range, &[&a, &b], &options(2), silent).unwrap();
    assert_eq!((result.windows, result.diverged), (2_998 + 1_998, 0));
    assert_eq!(result.max, [[0.0, 0.0], [1.0, 1.0]]);
}

/// Learns the slope of a ramp along the run; forks keep the slope and do not learn.
#[derive(Clone)]
struct Learner {
    last: f64,
    slope: f64,
    learns: bool,
}

impl Predictor for Learner {
    plain!(warm_up over_ground advance_observe rollout_batch rollout_snapshots);

    fn outputs(&self) -> usize {
        1
    }
    fn inputs(&self) -> usize {
        1
    }
    fn reset(&mut self) {
        self.last = f64::NAN;
    }
    fn observe(&mut self, y: &[f64]) {
        if self.learns && !self.last.is_nan() {
            self.slope = y[0] - self.last;
        }
        self.last = y[0];
    }
    fn advance(&mut self, _c: &[f64]) {}
    fn output(&self, y: &mut [f64]) {
        y[0] = self.last;
    }
    fn rollout(&self, _commands: &[f64], _work: &mut Workspace, y: &mut [f64]) {
        for (step, y) in (1u32..).zip(y.iter_mut()) {
            *y = self.last + self.slope * f64::from(step);
        }
    }
    fn snapshot_len(&self) -> usize {
        2
    }
    fn snapshot(&self, into: &mut [f64]) {
        into.copy_from_slice(&[self.last, self.slope]);
    }
    fn restore(&mut self, from: &[f64]) {
        (self.last, self.slope) = (from[0], from[1]);
    }
    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(Self { learns: false, ..self.clone() })
    }
}

/// Regression test: the session is evaluated, not a fork, which need not adapt.
#[test]
fn an_adapting_session_keeps_its_coefficients_for_the_next_run() {
    let ramp = |name, len: u32| {
        let channel = |c: &str| vec![Channel::new(c, "")];
        Trajectory {
            name: String::from(name),
            t0: 0.0,
            dt: 1.0,
            outputs: Table::new(channel("y"), (0..len).map(f64::from).collect()),
            inputs: Table::new(channel("c"), vec![0.0; len as usize]),
            truth: None,
            heading: None,
            position: None,
        }
    };
    // The first run is too short for a window, but the session learns from it.
    let (short, long) = (ramp("short", 5), ramp("long", 60));
    let range = [DesignRange { low: 0.0, high: 100.0 }];
    let judge = |runs: &[&Trajectory], learns| {
        let mut session = Learner { last: f64::NAN, slope: 0.0, learns };
        let silent = &mut |_| ControlFlow::Continue(());
        evaluate("learner", &mut session, &range, runs, &options(10), silent).unwrap()
    };
    assert_eq!(judge(&[&short, &long], false).mae[9], [10.0]);
    let learned = judge(&[&short, &long], true);
    assert_eq!(learned.max[9], [0.0]);
    assert_eq!((learned.runs.used, learned.runs.unused, learned.runs.unused_samples), (1, 1, 5));
    // Without a run before it, the first origin has no slope.
    assert_eq!(judge(&[&long], true).max[9], [10.0]);
}
