//! The saved state of an adapter is complete.

use std::sync::Arc;

use hydroid_core::adapt::{
    Adapter, CommitteeSession, ExpertMixture, ExpertMixtureOptions, InnovationGate, Outcome,
    RecursiveEquations, RecursiveOptions, SaveState,
};
use hydroid_core::model::committee::{self, Committee, DifferenceEquations, Member, Prior};
use hydroid_core::model::sparse::{Equations, Real, Signal, Term};
use hydroid_core::predict::Workspace;
use hydroid_core::rate_limit::{RateLimited, RateLimiter};
use proptest::prelude::*;

const RANGES: [(f64, f64); 4] = [(0.0, 2.0), (-0.5, 0.5), (0.0, 2.0), (-0.5, 0.5)];

/// Surge and yaw rate with a propeller lag and a past rudder angle.
pub(crate) fn equations() -> Equations {
    let signals = vec![
        Signal::Lag { input: 2, time_constant_s: Real(0.5) },
        Signal::Past { variable: 3, samples: 2 },
        Signal::Past { variable: 1, samples: 3 },
    ];
    let terms = vec![
        Term::signed_square(0, 0),
        Term::monomial(&[1]),
        Term::monomial(&[4]),
        Term::monomial(&[5]),
        Term::monomial(&[6]),
    ];
    #[rustfmt::skip]
    let coefficients = vec![
        -0.3, 0.0,  0.5, 0.0, 0.0,
        0.0,  -1.0, 0.0, 0.8, 0.1,
    ];
    Equations::with_signals(terms, coefficients, 2, 2, signals, 0.1, 2).unwrap()
}

pub(crate) fn recursive() -> RecursiveEquations {
    let options = RecursiveOptions {
        forgetting_s: 20.0,
        window: 8,
        prior_s: 1.0,
        leak: true,
        all_terms: false,
        gate: InnovationGate::default(),
    };
    RecursiveEquations::new(&equations(), &RANGES, &options).unwrap()
}

pub(crate) fn mixture() -> ExpertMixture {
    let options = ExpertMixtureOptions {
        priors_s: vec![100.0, 1.0],
        forgetting_s: 20.0,
        window: 4,
        horizon: 20,
        gate: InnovationGate::default(),
    };
    ExpertMixture::new(&equations(), &RANGES, &options, None).unwrap()
}

fn rate_limited() -> RateLimited<dyn Adapter> {
    RateLimited::new(Box::new(recursive()), RateLimiter::new([None, Some(0.2)], 0.1).unwrap())
}

/// Two members that learn with different clock steps, and a constant one.
pub(crate) fn committee() -> CommitteeSession {
    let terms = [Term::constant(), Term::signed_square(0, 0), Term::monomial(&[1]), Term::monomial(&[6])];
    let member = |clock, averaging: Option<usize>| {
        let shape = committee::Shape { outputs: 2, inputs: 2, lags: 1, clock, dt: 0.1 };
        let coefficients = vec![0.1, -0.3, 0.0, 0.2, 0.0, 0.1, -1.0, 0.3];
        let equations = DifferenceEquations::new(terms.to_vec(), coefficients, shape).unwrap();
        let r_factor =
            (0..16).map(|at| [2.0, 0.1, 0.2, 0.1, 0.0][at % 5] * f64::from(u8::from(at % 4 >= at / 4)));
        let r_factor: Vec<f64> = r_factor.collect();
        let prior = averaging.map(|averaging| Prior { averaging, information: 2.0, r_factor });
        Member { equations, votes: 1, prior }
    };
    let members = vec![member(3, Some(2)), member(4, None), member(2, Some(1))];
    CommitteeSession::new(Arc::new(Committee::new(members).unwrap())).unwrap()
}

/// A run with noise, missing values and spikes.
fn walk(adapter: &mut dyn Adapter, from: usize, to: usize) -> Vec<u64> {
    let mut seen = Vec::new();
    let mut work = Workspace::new();
    for k in from..to {
        let x = k as f64;
        let noise = |a: f64| 0.01 * ((x * a).sin() * 43_758.5).fract();
        let mut y = [1.0 + 0.4 * (0.07 * x).sin() + noise(12.9), 0.2 * (0.11 * x).cos() + noise(78.2)];
        if k % 61 == 60 {
            y[k % 2] = f64::NAN;
        }
        if k % 97 == 96 {
            y[0] = 50.0;
        }
        adapter.observe(&y);
        adapter.advance(&[1.0 + (0.05 * x).sin(), 0.4 * (0.13 * x).sin()]);
        let mut ahead = [0.0; 10];
        adapter.rollout(&[0.5; 10], &mut work, &mut ahead);
        seen.extend(ahead.iter().chain(adapter.weights()).map(|x| x.to_bits()));
        seen.extend(adapter.innovations().iter().flat_map(|i| [i.value.to_bits(), i.deviation.to_bits()]));
        seen.push(u64::from(adapter.outcome() == Outcome::Waiting));
    }
    seen
}

fn goes_on_as_if_nothing_had_been(mut first: impl Adapter, mut second: impl Adapter, at: usize) {
    let saved = |adapter: &mut dyn Adapter| {
        let mut memory = vec![0.0; adapter.memory_len()];
        adapter.save(&mut memory);
        memory
    };
    let bits = |memory: &[f64]| memory.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    walk(&mut first, 0, at);
    // An unrelated run before, without later effect.
    walk(&mut second, 5, 300);
    second.reset();
    walk(&mut second, 7, 50);
    let memory = saved(&mut first);
    second.load(&memory);
    assert_eq!(bits(&saved(&mut second)), bits(&memory));
    assert_eq!(second.outcome(), Outcome::Waiting);
    assert!(second.innovations().is_empty() || at == 0);
    assert!(walk(&mut first, at, at + 400) == walk(&mut second, at, at + 400), "saved at {at}");
    assert_eq!(bits(&saved(&mut second)), bits(&saved(&mut first)));
}

#[test]
fn an_adapter_resumes_from_a_saved_state() {
    // In the warm-up, in an incomplete window, after a gap, and much later.
    for at in [0, 1, 3, 9, 10, 61, 62, 97, 500] {
        goes_on_as_if_nothing_had_been(recursive(), recursive(), at);
        goes_on_as_if_nothing_had_been(mixture(), mixture(), at);
        goes_on_as_if_nothing_had_been(committee(), committee(), at);
        goes_on_as_if_nothing_had_been(rate_limited(), rate_limited(), at);
    }
}

#[test]
fn a_frozen_adapter_stays_frozen() {
    stays_frozen(recursive(), recursive());
    stays_frozen(committee(), committee());
}

fn stays_frozen(mut frozen: impl Adapter, mut other: impl Adapter) {
    frozen.freeze(true);
    let mut memory = vec![0.0; frozen.memory_len()];
    frozen.save(&mut memory);
    other.load(&memory);
    let before = other.weights().to_vec();
    walk(&mut other, 0, 200);
    assert_eq!(other.weights(), before);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn an_arbitrary_saved_state_never_panics(seed in any::<u64>(), finite in any::<bool>()) {
        let mut x = seed | 1;
        let mut next = || {
            x ^= x << 13;
            x ^= x >> 7;
            x ^= x << 17;
            if finite { (x % 10_000) as f64 - 5000.0 } else { f64::from_bits(x) }
        };
        let mut adapter = recursive();
        let memory: Vec<f64> = (0..adapter.memory_len()).map(|_| next()).collect();
        adapter.load(&memory);
        walk(&mut adapter, 0, 100);
        let mut adapter = mixture();
        let memory: Vec<f64> = (0..adapter.memory_len()).map(|_| next()).collect();
        adapter.load(&memory);
        walk(&mut adapter, 0, 100);
        let mut adapter = committee();
        let mut memory: Vec<f64> = (0..adapter.memory_len()).map(|_| next()).collect();
        adapter.load(&memory);
        walk(&mut adapter, 0, 100);
        memory.fill(f64::MAX);
        adapter.load(&memory);
        walk(&mut adapter, 0, 100);
    }
}
