//! Actuators with limited rates in front of models.

use std::sync::Arc;

use hydroid_core::adapt::{Adapter, Learning as _};
use hydroid_core::model::sparse::EquationsSession;
use hydroid_core::predict::{Predictor, Workspace};
use hydroid_core::rate_limit::{RateLimited, RateLimiter};
use proptest::prelude::*;

use crate::adapter_memory::{equations, recursive};

const RATES: [Option<f64>; 2] = [None, Some(0.7)];
const DT: f64 = 0.1;

fn limiter() -> RateLimiter {
    RateLimiter::new(RATES, DT).unwrap()
}

fn positions(commands: &[f64]) -> Vec<f64> {
    let mut limiter = limiter();
    let mut rows = commands.to_vec();
    rows.chunks_exact_mut(2).for_each(|row| limiter.advance(row));
    rows
}

fn session() -> Box<dyn Predictor> {
    Box::new(EquationsSession::new(Arc::new(equations())))
}

#[test]
fn a_reversal_takes_the_time_of_the_steering_gear() {
    let mut limiter = limiter();
    let mut at = |command: [f64; 2]| {
        let mut row = command;
        limiter.advance(&mut row);
        row
    };
    // The first command is the position at the start.
    assert_eq!(at([5.0, 0.35]), [5.0, 0.35]);
    let rudder: Vec<f64> = (0..12).map(|_| at([-5.0, -0.35])[1]).collect();
    for (k, position) in rudder.iter().enumerate() {
        let exact = (0.35 - 0.07 * (k + 1) as f64).max(-0.35);
        assert!((position - exact).abs() < 1e-12, "{k}: {position} instead of {exact}");
    }
    // A missing command moves nothing, and one that is absurd at the rate of the gear.
    assert!(at([0.0, f64::NAN])[1].is_nan());
    assert!((at([0.0, 1e200])[1] + 0.28).abs() < 1e-12);
    assert!((at([0.0, f64::NEG_INFINITY])[1] + 0.35).abs() < 1e-12);
}

#[test]
fn rates_must_be_positive_and_one_must_be_finite() {
    for rates in [[None, None], [Some(f64::INFINITY), None], [Some(0.0), Some(1.0)], [Some(f64::NAN), None]] {
        assert_eq!(RateLimiter::new(rates, DT), None, "{rates:?}");
    }
}

proptest! {
    #[test]
    fn positions_are_their_own_positions(commands in prop::collection::vec(-2.0..2.0_f64, 2..80)) {
        let commands = &commands[..commands.len() / 2 * 2];
        let once = positions(commands);
        prop_assert_eq!(positions(&once), once);
    }

    /// A session behind a limiter is the session of the model under the positions, in all its methods.
    #[test]
    fn a_session_behind_a_limiter_takes_positions(
        commands in prop::collection::vec(-2.0..2.0_f64, 60..=60),
        split in 4..20_usize,
    ) {
        let moved = positions(&commands);
        let (mut limited, mut plain) = (RateLimited::new(session(), limiter()), session());
        limited.observe(&[1.0, 0.1]);
        plain.observe(&[1.0, 0.1]);
        for k in 0..split {
            let y = [1.0 + 0.01 * k as f64, 0.1];
            if k % 3 == 0 {
                limited.advance_observe(&commands[2 * k..2 * k + 2], &y);
                plain.advance_observe(&moved[2 * k..2 * k + 2], &y);
            } else {
                limited.advance(&commands[2 * k..2 * k + 2]);
                plain.advance(&moved[2 * k..2 * k + 2]);
                limited.observe(&y);
                plain.observe(&y);
            }
        }
        let (after, moved_after) = (&commands[2 * split..], &moved[2 * split..]);
        let mut work = Workspace::new();
        let [mut a, mut b] = [vec![0.0; after.len()], vec![0.0; after.len()]];
        limited.rollout(after, &mut work, &mut a);
        plain.rollout(moved_after, &mut work, &mut b);
        prop_assert_eq!(&a, &b);
        // Two sequences side by side, the second of which is of constant commands.
        let held: Vec<f64> = after.iter().map(|_| 1.0).collect();
        let both = [after, &held].concat();
        let mut side_by_side = vec![0.0; both.len()];
        limited.rollout_batch(2, &both, &mut work, &mut side_by_side);
        let mut each = vec![0.0; both.len()];
        limited.rollout(after, &mut work, &mut each[..after.len()]);
        limited.rollout(&held, &mut work, &mut each[after.len()..]);
        let near = |a: &[f64], b: &[f64]| {
            let same = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9 * (1.0 + b.abs());
            a.iter().zip(b).all(same)
        };
        prop_assert!(near(&side_by_side, &each));
        // A snapshot has the positions; a fork goes on from them.
        let mut snapshot = vec![0.0; limited.snapshot_len()];
        limited.snapshot(&mut snapshot);
        let fork = limited.fork();
        limited.reset();
        limited.advance(&[2.0, 2.0]);
        let twice = [&snapshot[..], &snapshot].concat();
        limited.rollout_snapshots(2, &twice, &both, &mut work, &mut side_by_side);
        prop_assert!(near(&side_by_side, &each));
        limited.rollout(after, &mut work, &mut a);
        fork.rollout(after, &mut work, &mut b);
        prop_assert_eq!(&a, &b);
        prop_assert_eq!(&a[..], &each[..after.len()]);
    }
}

#[test]
fn an_adapter_behind_a_limiter_learns_from_positions() {
    let mut limited: RateLimited<dyn Adapter> = RateLimited::new(Box::new(recursive()), limiter());
    let mut plain = recursive();
    let commands: Vec<f64> = (0..400).map(|k| if (k / 37) % 2 == 0 { 1.0 } else { -0.6 }).collect();
    let moved = positions(&commands);
    for k in 0..200 {
        let y = [1.0 + 0.3 * (0.1 * k as f64).sin(), 0.2 * (0.07 * k as f64).cos()];
        limited.observe(&y);
        plain.observe(&y);
        limited.advance(&commands[2 * k..2 * k + 2]);
        plain.advance(&moved[2 * k..2 * k + 2]);
    }
    assert_eq!(limited.weights(), plain.weights());
    let mut deviations = [vec![0.0; 4], vec![0.0; 4]];
    let mut work = Workspace::new();
    // From the present position, which is on its way.
    let ahead = [1.0; 20];
    let mut last = limiter();
    moved.chunks_exact(2).for_each(|row| last.advance(&mut [row[0], row[1]]));
    let mut moved_ahead = ahead;
    moved_ahead.chunks_exact_mut(2).for_each(|row| last.advance(row));
    limited.deviations(&ahead, &[1, 10], &mut work, &mut deviations[0]);
    plain.deviations(&moved_ahead, &[1, 10], &mut work, &mut deviations[1]);
    assert_eq!(deviations[0], deviations[1]);
    assert!(deviations[0].iter().all(|deviation| deviation.is_finite()));
}
