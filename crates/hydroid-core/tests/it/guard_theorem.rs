//! The unguarded learner of a guard, the bound of the answers relative to it and the bound of the held samples, against an
//! adapter without guard that runs beside.

use hydroid_core::adapt::guard::{Guard, GuardOptions};
use hydroid_core::adapt::{Adapter, SaveState};
use hydroid_core::predict::{Predictor, Workspace};
use proptest::prelude::*;

use crate::adapter_memory::{committee, mixture, recursive};
use crate::guard::network;

/// Half the design range of each output, and the noise of its sensor.
const SCALE: f64 = 1.0;
const NOISE: f64 = 0.01;

/// Kinds of adapters: equations, a mixture of them, a committee, and networks with a filter that learns at the usual rate and
/// far too fast.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Equations,
    Mixture,
    Committee,
    Filter,
    Wild,
}

const QUICK: [Kind; 3] = [Kind::Equations, Kind::Mixture, Kind::Committee];

fn adapter(kind: Kind) -> Box<dyn Adapter> {
    match kind {
        Kind::Equations => Box::new(recursive()),
        Kind::Mixture => Box::new(mixture()),
        Kind::Committee => Box::new(committee()),
        Kind::Filter => network(0.02, 3.0),
        Kind::Wild => network(30.0, 1e-3),
    }
}

fn guard(kind: Kind) -> Guard {
    let mut reference = match kind {
        Kind::Filter | Kind::Wild => network(0.0, 1.0),
        Kind::Equations | Kind::Mixture | Kind::Committee => adapter(kind),
    };
    reference.freeze(true);
    let n = reference.outputs();
    let (ranges, noise) = (vec![(-SCALE, SCALE); n], vec![NOISE; n]);
    Guard::new(adapter(kind), adapter(kind), reference, &ranges, &noise, GuardOptions::new(0.1)).unwrap()
}

/// What is wrong with an output for some samples.
#[derive(Clone, Copy, Debug)]
struct Fault {
    begin: usize,
    len: usize,
    output: usize,
    change: Change,
}

#[derive(Clone, Copy, Debug)]
enum Change {
    Add(f64),
    Multiply(f64),
    Replace(f64),
}

fn command(k: usize) -> [f64; 2] {
    let x = k as f64;
    [1.0 + (0.05 * x).sin(), 0.4 * (0.13 * x).sin()]
}

/// Noisy motion with faults.
fn measured(k: usize, outputs: usize, seed: f64, faults: &[Fault]) -> Vec<f64> {
    let x = k as f64;
    let value = |i: usize| {
        let noise = NOISE * (2.0 * (((x + seed) * (12.9 + i as f64)).sin() * 43_758.5).fract());
        let motion = if i == 0 { 1.0 + 0.4 * (0.07 * x).sin() } else { 0.2 * (0.11 * x + i as f64).cos() };
        let of_output = faults.iter().filter(|fault| fault.output == i);
        let present = of_output.filter(|fault| (fault.begin..fault.begin + fault.len).contains(&k));
        present.fold(motion + noise, |y, fault| match fault.change {
            Change::Add(offset) => y + offset,
            Change::Multiply(factor) => y * factor,
            Change::Replace(value) => value,
        })
    };
    (0..outputs).map(value).collect()
}

fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|x| x.to_bits()).collect()
}

fn output(session: &dyn Predictor) -> Vec<f64> {
    let mut y = vec![0.0; session.outputs()];
    session.output(&mut y);
    y
}

fn rollout(session: &dyn Predictor, k: usize, steps: usize) -> Vec<f64> {
    let commands: Vec<f64> = (k..k + steps).flat_map(command).collect();
    let mut y = vec![0.0; steps * session.outputs()];
    session.rollout(&commands, &mut Workspace::new(), &mut y);
    y
}

fn are_apart(guard: &Guard) -> bool {
    !std::ptr::addr_eq(guard.learner(), guard.unguarded())
}

#[test]
fn the_unguarded_learner_is_the_adapter_without_guard() {
    QUICK.into_iter().for_each(is_the_adapter_without_guard);
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn the_unguarded_filter_is_the_adapter_without_guard() {
    [Kind::Filter, Kind::Wild].into_iter().for_each(is_the_adapter_without_guard);
}

/// Along a run with faults, a reset, a state that is loaded by another guard, and calls that change how the learner learns.
fn is_the_adapter_without_guard(kind: Kind) {
    let faults = [
        Fault { begin: 300, len: 1, output: 0, change: Change::Add(5.0) },
        Fault { begin: 420, len: 30, output: 1, change: Change::Multiply(-40.0) },
        Fault { begin: 700, len: 20, output: 0, change: Change::Replace(f64::NAN) },
        Fault { begin: 1500, len: 3, output: 1, change: Change::Replace(f64::INFINITY) },
        Fault { begin: 1600, len: 50, output: 1, change: Change::Replace(0.123) },
    ];
    let (mut guard, mut plain) = (guard(kind), adapter(kind));
    let (mut together, mut apart) = (0, 0);
    for k in 0..1700 {
        for adapter in [&mut guard as &mut dyn Adapter, plain.as_mut()] {
            match k {
                0 | 1300 => adapter.reset(),
                250 | 431 => adapter.scale_noise(3.0),
                500 => adapter.freeze(true),
                540 => adapter.freeze(false),
                1650 => adapter.restart(),
                _ => {}
            }
        }
        let y = measured(k, plain.outputs(), 0.0, &faults);
        guard.observe(&y);
        plain.observe(&y);
        if !plain.is_sound() {
            break;
        }
        let unguarded = guard.unguarded();
        assert_eq!(bits(unguarded.weights()), bits(plain.weights()), "{kind:?} {k}");
        assert_eq!(bits(&output(unguarded)), bits(&output(plain.as_ref())), "{kind:?} {k}");
        if k % 7 == 0 {
            assert_eq!(
                bits(&rollout(unguarded, k, 20)),
                bits(&rollout(plain.as_ref(), k, 20)),
                "{kind:?} {k}"
            );
        }
        if !guard.is_held() {
            assert_eq!(bits(&output(&guard)), bits(&output(plain.as_ref())), "{kind:?} {k}");
        }
        *if are_apart(&guard) { &mut apart } else { &mut together } += 1;
        guard.advance(&command(k));
        plain.advance(&command(k));
        if k == 200 || k == 440 {
            let mut memory = vec![0.0; guard.memory_len()];
            guard.save(&mut memory);
            guard = self::guard(kind);
            guard.load(&memory);
        }
    }
    assert!(together > 0 && apart > 0, "{kind:?}: {together} samples together, {apart} apart");
}

/// Largest use of the constant of the bound against all measurements: at most 1.
fn used_constant(kind: Kind, len: usize, seed: f64, faults: &[Fault], resets: &[usize]) -> f64 {
    let (mut guard, mut plain) = (guard(kind), adapter(kind));
    let GuardOptions { horizon, stride, window, factor, floors, hold, share, .. } = GuardOptions::new(0.1);
    let n = plain.outputs();
    let past = (-(stride as f64) / window as f64).exp();
    let constant = floors * (NOISE / SCALE) / (1.0 - past);
    let stream: Vec<Vec<f64>> = (0..len).map(|k| measured(k, n, seed, faults)).collect();
    let error = |y: f64, p: f64| {
        let error = (p - y).abs() / SCALE;
        if y.is_nan() {
            0.0
        } else if error < 20.0 {
            error
        } else {
            20.0
        }
    };
    let (mut begin, mut sum, mut most) = (0, 0.0, f64::NEG_INFINITY);
    let mut budget = hold as f64;
    // Origin, predictions of guard and adapter over the last stride before the horizon.
    let mut pending: Vec<(usize, bool, [Vec<f64>; 2])> = Vec::new();
    for k in 0..len {
        if resets.contains(&k) {
            guard.reset();
            plain.reset();
            (begin, pending) = (k, Vec::new());
        }
        guard.observe(&stream[k]);
        plain.observe(&stream[k]);
        if !plain.is_sound() {
            break;
        }
        budget = if guard.is_held() { budget - 1.0 } else { (budget + share).min(hold as f64) };
        assert!(budget >= 0.0, "{kind:?} {k}: more held samples than the budget has");
        if (k - begin).is_multiple_of(stride) {
            if let Some(at) = pending.iter().position(|(origin, ..)| origin + horizon == k) {
                let (origin, held, [own, other]) = pending.remove(at);
                let first = origin + 1 + horizon - stride;
                let mean = |predicted: &[f64]| {
                    let measured = stream[first..=k].iter().flatten();
                    measured.zip(predicted).map(|(y, p)| error(*y, *p)).sum::<f64>() / (stride * n) as f64
                };
                let cost = if held { 0.0 } else { mean(&own) - factor * mean(&other) };
                sum = past * sum + cost;
                most = f64::max(most, sum / constant);
            }
            let ahead =
                |session: &dyn Predictor| rollout(session, k, horizon)[(horizon - stride) * n..].to_vec();
            pending.push((k, guard.is_held(), [ahead(&guard), ahead(plain.as_ref())]));
        }
        guard.advance(&command(k));
        plain.advance(&command(k));
    }
    most
}

fn faults() -> impl Strategy<Value = Vec<Fault>> {
    let change = prop_oneof![
        (-3.0_f64..3.0).prop_map(|x| Change::Add(x * x * x)),
        prop::sample::select(vec![-1.0, 2.0, 57.3, 0.0]).prop_map(Change::Multiply),
        prop::sample::select(vec![f64::NAN, f64::INFINITY, 0.5, -1e9, 1e200]).prop_map(Change::Replace),
    ];
    let len = prop_oneof![1_usize..8, 8_usize..80, 80_usize..400];
    let fault = (100_usize..1100, len, 0_usize..3, change);
    prop::collection::vec(
        fault.prop_map(|(begin, len, output, change)| Fault { begin, len, output, change }),
        0..6,
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever is measured: outside holds the answers are within the factor and the constant of the unguarded learner.
    #[test]
    fn the_answers_are_bounded_relative_to_the_unguarded_learner(
        kind in prop::sample::select(QUICK.to_vec()),
        seed in 0.0_f64..1e3,
        faults in faults(),
        resets in prop::collection::vec(0_usize..1200, 0..3),
    ) {
        let most = used_constant(kind, 1200, seed, &faults, &resets);
        prop_assert!(most <= 1.0 + 1e-9, "{most} of the constant");
    }
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn the_answers_of_filters_are_bounded_relative_to_the_unguarded_ones() {
    let changes = [Change::Add(1.0), Change::Multiply(-1.0), Change::Replace(f64::NAN)];
    for (change, kind) in
        changes.into_iter().flat_map(|change| [(change, Kind::Filter), (change, Kind::Wild)])
    {
        let faults = [Fault { begin: 300, len: 40, output: 0, change }];
        let most = used_constant(kind, 900, 3.0, &faults, &[]);
        assert!(most <= 1.0 + 1e-9, "{kind:?}: {most} of the constant");
    }
}
