//! Steps, rollouts and evaluation of identified equations: `cargo bench -p hydroid --bench rollout`.

use std::sync::Arc;

use divan::{Bencher, counter::ItemsCount};
use hydroid::evaluate::{DesignRange, Options, evaluate};
use hydroid::log::{Channel, Table, Trajectory};
use hydroid::progress;
use hydroid::sindy::{Library, Variables};
use hydroid_core::model::sparse::{Equations, EquationsSession, Gate, Program, Real, Shape, Signal, Term};
use hydroid_core::predict::{Predictor, Workspace};

fn main() {
    divan::main();
}

const OUTPUTS: usize = 3;
const INPUTS: usize = 5;
const STEPS: usize = 1000;

/// Stable equations in three outputs and five inputs with this many non-zero coefficients, spread over
/// terms of degree up to 3 as an identification would leave them.
fn equations(active: usize) -> Equations {
    let terms = Library::polynomial(3).terms(&Variables::plain(8, 0));
    let count = terms.len();
    let mut coefficients = vec![0.0; OUTPUTS * count];
    for i in 0..OUTPUTS {
        coefficients[i * count + 1 + i] = -1.0;
    }
    for k in 0..active - OUTPUTS {
        // A stride that has no factor in common with 495: every place is met once.
        let place = 37 + k * 202 % (OUTPUTS * count);
        let free =
            (0..OUTPUTS * count).map(|d| (place + d) % (OUTPUTS * count)).find(|&p| coefficients[p] == 0.0);
        coefficients[free.unwrap()] = 1e-3 * (1.0 + (k % 7) as f64);
    }
    let equations = Equations::new(terms, coefficients, OUTPUTS, INPUTS, 0.1, 1).unwrap();
    assert_eq!(equations.active_terms(), active);
    equations
}

fn command(k: usize) -> [f64; INPUTS] {
    std::array::from_fn(|j| (0.07 * (j + 1) as f64 * k as f64).sin())
}

#[divan::bench(args = [18, 53, 165])]
fn step_3_outputs_5_inputs(bencher: Bencher, active: usize) {
    let equations = equations(active);
    let commands: Vec<[f64; INPUTS]> = (0..STEPS).map(command).collect();
    let mut scratch = vec![0.0; equations.scratch()];
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        let mut y = [0.5, -0.1, 0.2];
        for c in &commands {
            equations.step(&mut y, divan::black_box(c), &mut scratch);
        }
        y
    });
}

/// What identification finds on the hydrofoil: two modes, a lagged propeller, 40 coefficients. `inputs` are the
/// propeller's and the rudder's commands.
fn gated_equations() -> Equations {
    let gate = Gate { centre: Real(2.5), slope: Real(12.0) };
    let lag = Signal::Lag { input: 3, time_constant_s: Real(1.0) };
    let m = |variables: &[u16]| Term::monomial(variables);
    let lift = m(&[0]).times(&Term::of(4, Shape::Sin));
    let [u, v, r] = [0, 1, 2].map(|x| Term::signed_square(x, x));
    let rows: [Vec<Term>; 3] = [
        vec![m(&[0]), u, m(&[1, 2]), m(&[2, 2]), m(&[5]), m(&[0, 0])],
        vec![m(&[1]), m(&[2]), v.clone(), r.clone(), m(&[0, 2]), lift.clone(), m(&[0, 1])],
        vec![m(&[1]), m(&[2]), v, r, m(&[0, 2]), lift, m(&[0, 1])],
    ];
    let mut terms: Vec<Term> = rows.iter().flatten().flat_map(|term| term.gated(0, gate)).collect();
    terms.sort();
    terms.dedup();
    let has = |row: &[Term], term: &Term| row.iter().any(|own| own.gated(0, gate).contains(term));
    let coefficients: Vec<f64> = rows
        .iter()
        .flat_map(|row| terms.iter().map(|term| if has(row, term) { -0.1 } else { 0.0 }).collect::<Vec<_>>())
        .collect();
    let equations = Equations::with_signals(terms, coefficients, 3, 2, vec![lag], 0.1, 1).unwrap();
    assert_eq!(equations.active_terms(), 40);
    equations
}

#[divan::bench]
fn step_of_two_modes_and_a_lag_40_terms(bencher: Bencher) {
    let equations = gated_equations();
    let commands: Vec<[f64; INPUTS]> = (0..STEPS).map(command).collect();
    let mut scratch = vec![0.0; equations.scratch()];
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        let mut state = vec![0.5; equations.state_len()];
        for c in &commands {
            equations.step(&mut state, divan::black_box(&c[..2]), &mut scratch);
        }
        state
    });
}

#[divan::bench]
fn evaluate_full_library_of_165_terms_at_one_point(bencher: Bencher) {
    let program = Program::new(&Library::polynomial(3).terms(&Variables::plain(8, 0)), 8).unwrap();
    let mut slots = vec![0.5; program.slots()];
    bencher
        .counter(ItemsCount::new(program.len()))
        .bench_local(|| program.evaluate(divan::black_box(&mut slots)));
}

#[divan::bench(args = [18, 53])]
fn rollout_of_100_steps(bencher: Bencher, active: usize) {
    let mut session = EquationsSession::new(Arc::new(equations(active)));
    session.observe(&[0.5, -0.1, 0.2]);
    let commands: Vec<f64> = (0..100).flat_map(command).collect();
    let (mut work, mut y) = (Workspace::new(), vec![0.0; 100 * OUTPUTS]);
    bencher.counter(ItemsCount::new(100usize)).bench_local(|| {
        session.rollout(divan::black_box(&commands), &mut work, &mut y);
        y[299]
    });
}

/// A run as long as those of the CyberShip, judged from every origin.
#[divan::bench(args = [18, 53])]
fn evaluate_7300_samples_at_horizon_100(bencher: Bencher, active: usize) {
    let session = EquationsSession::new(Arc::new(equations(active)));
    let channels = |prefix: &str, n: usize| -> Vec<Channel> {
        (0..n).map(|j| Channel::new(format!("{prefix}{j}"), "")).collect()
    };
    let outputs =
        (0..7_300usize).flat_map(|k| (0..OUTPUTS).map(move |j| 0.5 * (0.01 * k as f64 + j as f64).sin()));
    let run = Trajectory {
        name: String::from("bench"),
        t0: 0.0,
        dt: 0.1,
        outputs: Table::new(channels("y", OUTPUTS), outputs.collect()),
        inputs: Table::new(channels("c", INPUTS), (0..7_300).flat_map(command).collect()),
        truth: None,
        heading: None,
        position: None,
    };
    let ranges = [DesignRange { low: -2.0, high: 2.0 }; OUTPUTS];
    bencher.counter(ItemsCount::new(7_200usize * 100)).bench_local(|| {
        let result = evaluate(
            "bench",
            &mut session.clone(),
            &ranges,
            &[&run],
            &Options::default(),
            &mut progress::silent(),
        )
        .unwrap();
        assert_eq!((result.windows, result.diverged), (7_200, 0));
        result
    });
}
