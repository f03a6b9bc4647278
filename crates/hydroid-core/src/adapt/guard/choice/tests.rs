//! What is chosen keeps the guarantee, and gives what is lost back.

use proptest::prelude::*;

use super::*;

const FLOOR: f64 = 0.01;

proptest! {
    /// Whatever the models predict, no window exceeds the guarantee: an answer is never farther from the model from shore
    /// than it may be.
    #[test]
    fn no_window_exceeds_the_guarantee(
        errors in prop::collection::vec((0.0..0.2_f64, 0.0..3.0_f64, 0.0..3.0_f64), 300..600),
        calm in 1_usize..80,
    ) {
        let settings = GuardOptions::new(0.1);
        let mut choice = Choice::new(&settings, FLOOR);
        let delay = settings.horizon / settings.stride;
        let count = settings.window.div_ceil(settings.stride);
        let allowance = MARGIN * FLOOR * count as f64;
        let mut answered = vec![(Expert::Learner, choice.allowed.most); delay];
        let mut excess = Vec::new();
        for (i, &(shore, learner, kept)) in errors.iter().enumerate() {
            // Good for a while, then bad for a while.
            let good = i / calm % 2 == 0;
            let of = |share: f64| if good { 0.3 * share * shore } else { shore + share };
            let far = [of(learner), of(kept), shore];
            let (used, most) = answered[i];
            let error = far[used.index()].min(shore + most);
            excess.push(error - 1.2 * shore);
            choice.take(&Tested { far, near: far, now: far[0], revised: [0.0; 3], excess: error - 1.2 * shore, beyond: 0.0, right: None, whole: false });
            answered.push((choice.active, choice.allowed.most));
        }
        for window in excess.windows(count) {
            let sum: f64 = window.iter().sum();
            prop_assert!(sum <= allowance + 1e-12, "{} of {}", sum, allowance);
        }
    }
}

proptest! {
    /// A prediction that stands far from the frozen one costs no more than is allowed, if its error is what it is taken to
    /// be at most.
    #[test]
    fn what_stands_far_off_costs_no_more(
        errors in prop::collection::vec((0.0..0.2_f64, 0.0..1.0_f64, 0.0..0.2_f64), 20..60),
        share in 0.0..1.0_f64,
        more in 0.0..1.0_f64,
    ) {
        let mut choice = Choice::new(&GuardOptions::new(0.1), FLOOR);
        for (learner, shore, changed) in errors {
            let far = [learner, learner, shore];
            let excess = learner - 1.2 * shore;
            let revised = [changed; 3];
            choice.take(&Tested { far, near: far, now: learner, revised, excess, beyond: excess.max(0.0), right: None, whole: true });
            let Allowed { most, free, .. } = choice.allowed;
            if choice.active == Expert::Learner {
                let feared = choice.feared(Expert::Learner);
                if !feared.is_finite() {
                    continue;
                }
                prop_assert!(feared >= REVISED * changed);
                let error = share * feared;
                // The two are that far apart, and what was measured is as near to the frozen one as it can be then.
                let shore = (free.max(0.0) + more - error).max(0.0);
                prop_assert!(error - 1.2 * shore <= most + 1e-12);
            }
        }
    }
}

#[test]
fn who_has_changed_its_mind_is_not_believed_far_off_for_a_horizon() {
    let mut choice = Choice::new(&GuardOptions::new(0.1), FLOOR);
    let mut free_after = |changed: f64| {
        let far = [0.005, 0.005, 0.1];
        let revised = [changed, 0.0, 0.0];
        choice.take(&Tested {
            far,
            near: far,
            now: 0.005,
            revised,
            excess: 0.0,
            beyond: 0.0,
            right: None,
            whole: true,
        });
        choice.allowed.free
    };
    let calm = (0..10).map(|_| free_after(0.0)).last().unwrap();
    assert!(free_after(0.1) > calm + 0.1);
    for _ in 0..4 {
        assert!(free_after(0.0) > calm + 0.1);
    }
    assert!(free_after(0.0) < calm + 0.05);
}

#[test]
fn who_owes_is_near_for_nothing_until_it_is_paid() {
    let mut choice = Choice::new(&GuardOptions::new(0.1), FLOOR);
    let mut owes_after = |learner: f64, shore: f64| {
        let far = [learner, learner, shore];
        let (near, now, excess) = (far, learner, learner - 1.2 * shore);
        choice.take(&Tested {
            far,
            near,
            now,
            revised: [0.0; 3],
            excess,
            beyond: 0.0,
            right: None,
            whole: true,
        });
        choice.allowed.owes
    };
    assert!(!(0..10).any(|_| owes_after(0.03, 0.04)));
    assert!(owes_after(0.07, 0.05));
    assert!(owes_after(0.03, 0.03));
    assert!((0..5).any(|_| !owes_after(0.03, 0.04)));
}

#[test]
fn who_would_have_been_right_may_be_farther_off_until_it_would_not() {
    let mut choice = Choice::new(&GuardOptions::new(0.1), FLOOR);
    let mut stride = 0.001;
    let mut far_after = |right: Option<bool>| {
        // What it goes wrong by in a stride grows, as where it begins what the model has never seen.
        stride *= 1.05;
        let (far, near, revised) = ([0.005, 0.005, 0.1], [0.0, 0.0, stride], [0.0; 3]);
        let (now, excess, beyond) = (0.005, 0.0, 0.0);
        choice.take(&Tested { far, near, now, revised, excess, beyond, right, whole: true });
        choice.allowed.far - choice.allowed.most
    };
    let usual = (0..10).map(|_| far_after(None)).last().unwrap();
    for (right, times) in [(Some(true), PROVEN), (None, PROVEN), (Some(false), 1.0), (None, 1.0)] {
        assert!((far_after(right) - times * usual).abs() < 1e-9, "{right:?}");
    }
}

/// A vessel that comes down from what the model from shore does not know: a test of the horizon finds that model wrong for as long as one
/// of a stride has found it right.
#[test]
fn a_model_from_shore_that_is_right_again_is_not_taken_to_be_far_off() {
    let mut choice = Choice::new(&GuardOptions::new(0.1), FLOOR);
    let mut far_after = |stride: f64| {
        let (far, near, revised) = ([0.005, 0.005, 0.2], [0.0, 0.0, stride], [0.0; 3]);
        let (now, excess, beyond) = (0.005, 0.0, 0.0);
        choice.take(&Tested { far, near, now, revised, excess, beyond, right: None, whole: true });
        choice.allowed.far - choice.allowed.most
    };
    let steady = (0..10).map(|_| far_after(0.1)).last().unwrap();
    assert!((steady - FALLS * 0.2).abs() < 1e-9, "{steady}");
    assert!((far_after(0.05) - 0.5 * steady).abs() < 1e-9);
    assert!(far_after(0.13) > 2.0 * steady);
}

#[test]
fn who_says_that_a_model_that_is_right_will_be_wrong_has_to_earn_it() {
    let mut choice = Choice::new(&GuardOptions::new(0.1), FLOOR);
    let mut far_after = |right: Option<bool>| {
        let (far, near, revised) = ([0.005, 0.005, 0.05], [0.0, 0.0, 0.02], [0.0; 3]);
        let (now, excess, beyond) = (0.005, 0.0, 0.0);
        choice.take(&Tested { far, near, now, revised, excess, beyond, right, whole: true });
        choice.allowed.far - choice.allowed.most
    };
    let little = (0..10).map(|_| far_after(None)).last().unwrap();
    assert!((little - FALLS * 0.05).abs() < 1e-9, "{little}");
    let earned = (1..20).find(|_| far_after(Some(true)) > little);
    assert_eq!(earned, Some(7));
    assert!((1..20).any(|_| far_after(Some(false)) <= little));
}

#[test]
fn a_learner_that_is_lost_is_rescued_and_one_that_is_late_is_not() {
    let mut choice = Choice::new(&GuardOptions::new(0.1), FLOOR);
    let mut rescued_after = |learner: f64, tests: usize| {
        (0..tests).position(|_| {
            let far = [learner, 0.05, 0.04];
            choice.take(&Tested {
                far,
                near: far,
                now: learner,
                revised: [0.0; 3],
                excess: 0.0,
                beyond: 0.0,
                right: None,
                whole: true,
            });
            choice.rescue().is_some()
        })
    };
    assert_eq!(rescued_after(0.08, 200), None);
    assert!(rescued_after(2.0, 30).is_some());
}
