//! The theorem on the balance.

use alloc::vec::Vec;

use proptest::prelude::*;

use super::*;

const FLOOR: f64 = 0.01;

fn account(options: &GuardOptions) -> Account {
    Account::new(options, Balance::new(options, FLOOR))
}

/// Runs tests whose costs are this share of the limit of their answers; answers without a share are exempt. Returns the
/// largest discounted sum of the costs, relative to the constant of the guarantee.
fn largest(options: &GuardOptions, shares: &[Option<f64>]) -> f64 {
    let mut account = account(options);
    let n = options.horizon / options.stride;
    let past = (-(options.stride as f64) / options.window as f64).exp();
    let constant = options.floors * FLOOR / (1.0 - past);
    let (mut sum, mut most) = (0.0, f64::NEG_INFINITY);
    for (j, share) in shares.iter().enumerate() {
        if j >= n {
            // A gain can be large without a limit.
            let cost = match shares[j - n] {
                Some(share) if share > 0.0 => share * account.oldest(),
                Some(gain) => gain,
                None => 0.0,
            };
            assert!(shares[j - n].is_some() || account.oldest() == 0.0);
            account.settle(cost);
            sum = past * sum + cost;
            most = f64::max(most, sum);
            assert!((constant - sum - account.balance()).abs() < 1e-9 * (1.0 + sum.abs()), "{sum}");
        }
        account.open(share.is_none());
        assert!(account.limit() >= 0.0);
    }
    most / constant
}

proptest! {
    /// Whatever the costs are, up to the limits of their answers, the guarantee holds.
    #[test]
    fn the_guarantee_holds_for_any_costs(
        shares in prop::collection::vec(
            prop_oneof![4 => Just(Some(1.0)), 4 => (-0.5_f64..1.0).prop_map(Some), 1 => Just(None)],
            0..600,
        ),
        stride in 1_usize..5,
        tests in 1_usize..8,
        windows in 1_usize..200,
    ) {
        let horizon = stride * tests;
        let options = GuardOptions { horizon, stride, window: horizon + windows, ..GuardOptions::new(0.1) };
        prop_assert!(largest(&options, &shares) <= 1.0 + 1e-9);
    }
}

/// The worst learner spends the constant, and no more.
#[test]
fn the_worst_learner_uses_most_of_the_constant() {
    let most = largest(&GuardOptions::new(0.1), &vec![Some(1.0); 2000]);
    assert!((0.8..=1.0).contains(&most), "{most}");
}

#[test]
fn gains_permit_larger_deviations() {
    let options = GuardOptions::new(0.1);
    let mut account = account(&options);
    let before = account.limit();
    for _ in 0..50 {
        account.settle(-0.2);
        account.open(false);
    }
    assert!(account.limit() > 3.0 * before, "{} {before}", account.limit());
    let losses: Vec<f64> = (0..20)
        .map(|_| {
            account.settle(account.oldest());
            account.open(false);
            account.limit()
        })
        .collect();
    assert!(losses.last().unwrap() < &before, "{losses:?}");
}
