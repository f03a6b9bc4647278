//! The age of measurements.

use hydroid_core::control::{Liveness, longest_age_s};
use hydroid_core::memory::Memory;
use proptest::prelude::*;

#[test]
fn each_quantity_has_an_age_and_the_oldest_counts() {
    let mut liveness = Liveness::<2>::new(1.0);
    assert!(!liveness.is_alive() && liveness.remaining_s() == 0.0, "nothing was measured");
    liveness.take(f64::INFINITY, [true, false]);
    assert_eq!(liveness.ages_s(), [0.0, f64::INFINITY]);
    liveness.take(0.25, [false, true]);
    liveness.pass(0.5);
    assert_eq!(liveness.ages_s(), [0.75, 0.5]);
    assert!(liveness.is_alive() && liveness.remaining_s() == 0.25);
    liveness.pass(0.25);
    assert!(liveness.is_alive(), "the limit itself is not beyond it");
    // The stamps say less than the time that passed.
    liveness.take(0.125, [false, true]);
    assert_eq!(liveness.ages_s(), [1.0, 0.0]);
    liveness.pass(0.001);
    assert!(!liveness.is_alive());
    for unknown in [f64::NAN, -1.0, f64::INFINITY] {
        let mut liveness = Liveness::<1>::new(1.0);
        liveness.take(0.0, [true]);
        liveness.pass(unknown);
        assert!(!liveness.is_alive(), "{unknown}");
    }
    assert_eq!([0.01, 0.1, 0.2, 1.0].map(longest_age_s), [1.0, 1.0, 1.0, 5.0]);
}

proptest! {
    /// Against the times at which each quantity was measured, and the true time at any pace of the stamps.
    #[test]
    fn no_age_is_less_than_the_time_since_the_measurement(
        steps in prop::collection::vec((0.0..0.6f64, 0.0..0.6f64, any::<[bool; 3]>(), any::<bool>()), 1..60),
    ) {
        let mut liveness = Liveness::<3>::new(1.0);
        let (mut now, mut measured) = (0.0, [f64::NEG_INFINITY; 3]);
        for (passed, stated, which, is_used) in steps {
            now += passed;
            liveness.pass(passed);
            if is_used {
                liveness.take(stated, which);
                for (at, _) in measured.iter_mut().zip(which).filter(|(_, which)| *which) {
                    *at = now;
                }
            }
            let numbers = Memory::saved(|memory| liveness.visit_state(memory));
            let mut loaded = Liveness::<3>::new(1.0);
            loaded.visit_state(&mut Memory::Loading(&numbers));
            prop_assert_eq!(&loaded, &liveness);
            for (age, at) in liveness.ages_s().into_iter().zip(measured) {
                prop_assert!(age >= (now - at) * (1.0 - 1e-9), "{} {}", age, now - at);
            }
            prop_assert_eq!(liveness.is_alive(), liveness.ages_s().iter().all(|age| *age <= 1.0 + 5e-7));
        }
    }
}
