//! The selector keeps the guarantee and rolls a lost learner back.

use proptest::prelude::*;

use super::*;

const FLOOR: f64 = 0.01;

/// A complete test with equal errors over horizon and stride.
fn test(errors: [f64; 3]) -> TestErrors {
    TestErrors {
        horizon: errors,
        stride: errors,
        current_weights: errors[0],
        revisions: [0.0; 3],
        excess: 0.0,
        overdraft: 0.0,
        rejection_right: None,
        complete: true,
    }
}

fn selector() -> ModelSelector {
    ModelSelector::new(&GuardOptions::new(0.1), FLOOR)
}

proptest! {
    #[test]
    fn no_window_exceeds_the_guarantee(
        errors in prop::collection::vec((0.0..0.2_f64, 0.0..3.0_f64, 0.0..3.0_f64), 300..600),
        calm in 1_usize..80,
    ) {
        let options = GuardOptions::new(0.1);
        let mut selector = selector();
        let delay = options.horizon / options.stride;
        let count = options.window.div_ceil(options.stride);
        let allowance = MARGIN * FLOOR * count as f64;
        let mut answered = vec![(Expert::Adapted, selector.budget.limit); delay];
        let mut excesses = Vec::new();
        for (i, &(reference, learner, snapshot)) in errors.iter().enumerate() {
            // Good models and bad models alternate.
            let good = i / calm % 2 == 0;
            let of = |share: f64| if good { 0.3 * share * reference } else { reference + share };
            let horizon = [of(learner), of(snapshot), reference];
            let (used, limit) = answered[i];
            let excess = horizon[used.index()].min(reference + limit) - 1.2 * reference;
            excesses.push(excess);
            selector.update(&TestErrors { excess, complete: false, ..test(horizon) });
            answered.push((selector.active, selector.budget.limit));
        }
        for window in excesses.windows(count) {
            let sum: f64 = window.iter().sum();
            prop_assert!(sum <= allowance + 1e-12, "{} of {}", sum, allowance);
        }
    }
}

proptest! {
    #[test]
    fn a_supported_deviation_costs_no_more_than_the_limit(
        errors in prop::collection::vec((0.0..0.2_f64, 0.0..1.0_f64, 0.0..0.2_f64), 20..60),
        share in 0.0..1.0_f64,
        more in 0.0..1.0_f64,
    ) {
        let mut selector = selector();
        for (learner, reference, changed) in errors {
            let excess = learner - 1.2 * reference;
            let overdraft = excess.max(0.0);
            let errors = test([learner, learner, reference]);
            selector.update(&TestErrors { revisions: [changed; 3], excess, overdraft, ..errors });
            let Budget { limit, supported_from, .. } = selector.budget;
            if selector.active == Expert::Adapted {
                let bound = selector.error_bound(Expert::Adapted);
                if !bound.is_finite() {
                    continue;
                }
                prop_assert!(bound >= REVISION_RATIO * changed);
                let error = share * bound;
                // The smallest error of the reference model at this deviation.
                let reference = (supported_from.max(0.0) + more - error).max(0.0);
                prop_assert!(error - 1.2 * reference <= limit + 1e-12);
            }
        }
    }
}

#[test]
fn a_revision_withdraws_support_for_a_horizon() {
    let mut selector = selector();
    let mut supported_from = |changed: f64| {
        selector.update(&TestErrors { revisions: [changed, 0.0, 0.0], ..test([0.005, 0.005, 0.1]) });
        selector.budget.supported_from
    };
    let calm = (0..10).map(|_| supported_from(0.0)).last().unwrap();
    assert!(supported_from(0.1) > calm + 0.1);
    for _ in 0..4 {
        assert!(supported_from(0.0) > calm + 0.1);
    }
    assert!(supported_from(0.0) < calm + 0.05);
}

#[test]
fn a_deficit_lasts_until_it_is_paid() {
    let mut selector = selector();
    let mut in_deficit = |learner: f64, reference: f64| {
        let excess = learner - 1.2 * reference;
        selector.update(&TestErrors { excess, ..test([learner, learner, reference]) });
        selector.budget.in_deficit
    };
    assert!(!(0..10).any(|_| in_deficit(0.03, 0.04)));
    assert!(in_deficit(0.07, 0.05));
    assert!(in_deficit(0.03, 0.03));
    assert!((0..5).any(|_| !in_deficit(0.03, 0.04)));
}

/// The bound on the error of the reference model after a test with these errors over horizon and stride.
fn reference_bound(selector: &mut ModelSelector, [horizon, stride]: [f64; 2], right: Option<bool>) -> f64 {
    let errors = test([0.005, 0.005, horizon]);
    selector.update(&TestErrors { stride: [0.0, 0.0, stride], rejection_right: right, ..errors });
    selector.budget.supported_to - selector.budget.limit
}

#[test]
fn a_confirmed_rejection_widens_the_bound_until_it_is_refuted() {
    let mut selector = selector();
    let mut stride = 0.001;
    let mut bound = |right: Option<bool>| {
        // The error over a stride grows, as at the start of a new mode.
        stride *= 1.05;
        reference_bound(&mut selector, [0.1, stride], right)
    };
    let usual = (0..10).map(|_| bound(None)).last().unwrap();
    for (right, times) in [(Some(true), CONFIRMED), (None, CONFIRMED), (Some(false), 1.0), (None, 1.0)] {
        assert!((bound(right) - times * usual).abs() < 1e-9, "{right:?}");
    }
}

/// After a return to known motion the error over a stride falls before the error over the horizon.
#[test]
fn the_bound_falls_when_the_reference_model_recovers() {
    let mut selector = selector();
    let mut bound = |stride: f64| reference_bound(&mut selector, [0.2, stride], None);
    let steady = (0..10).map(|_| bound(0.1)).last().unwrap();
    assert!((steady - DECAY * 0.2).abs() < 1e-9, "{steady}");
    assert!((bound(0.05) - 0.5 * steady).abs() < 1e-9);
    assert!(bound(0.13) > 2.0 * steady);
}

#[test]
fn trust_in_rejected_predictions_is_earned() {
    let mut selector = selector();
    let mut bound = |right: Option<bool>| reference_bound(&mut selector, [0.05, 0.02], right);
    let little = (0..10).map(|_| bound(None)).last().unwrap();
    assert!((little - DECAY * 0.05).abs() < 1e-9, "{little}");
    let earned = (1..20).find(|_| bound(Some(true)) > little);
    assert_eq!(earned, Some(7));
    assert!((1..20).any(|_| bound(Some(false)) <= little));
}

#[test]
fn a_lost_learner_is_rolled_back_and_a_slow_one_is_not() {
    let mut selector = selector();
    let mut rolled_back_after = |learner: f64, tests: usize| {
        (0..tests).position(|_| {
            selector.update(&test([learner, 0.05, 0.04]));
            selector.rollback_target().is_some()
        })
    };
    assert_eq!(rolled_back_after(0.08, 200), None);
    assert!(rolled_back_after(2.0, 30).is_some());
}
