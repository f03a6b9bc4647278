//! Parts of the structure search: simplex minimization, substitution in terms, stability check.

use hydroid::evaluate::DesignRange;
use hydroid::sindy::{
    NelderMeadOptions, StabilityCheck, StabilityOptions, gated, nelder_mead, stability_check,
    substitute_variable,
};
use hydroid_core::model::sparse::{Equations, Gate, Real, Shape, Term};

const STOP: NelderMeadOptions = NelderMeadOptions { spread: 1e-14, evaluations: 2_000 };

#[test]
fn nelder_mead_minimizes_the_rosenbrock_function() {
    let rosenbrock = |x: &[f64]| (1.0 - x[0]).powi(2) + 100.0 * (x[1] - x[0] * x[0]).powi(2);
    let (x, y) = nelder_mead(rosenbrock, &[-1.2, 1.0], &[0.3, 0.3], STOP);
    assert!(y < 1e-10 && (x[0] - 1.0).abs() < 1e-4 && (x[1] - 1.0).abs() < 1e-4, "{x:?} {y}");
}

#[test]
fn nelder_mead_takes_one_variable_or_none() {
    let (x, _) = nelder_mead(|x| (x[0] - 3.0).powi(2), &[0.0], &[1.0], STOP);
    assert!((x[0] - 3.0).abs() < 1e-6);
    assert_eq!(nelder_mead(|_| 7.0, &[], &[], STOP), (vec![], 7.0));
}

#[test]
fn nelder_mead_avoids_values_that_are_not_finite_and_keeps_its_budget() {
    let mut calls = 0;
    let wall = |x: &[f64]| {
        calls += 1;
        if x[0] < 1.0 { f64::NAN } else { x[0] + x[1] * x[1] }
    };
    let (x, y) =
        nelder_mead(wall, &[4.0, 2.0], &[1.0, 1.0], NelderMeadOptions { spread: 0.0, evaluations: 200 });
    assert!(x[0] >= 1.0 && y < 1.01, "{x:?} {y}");
    assert!(calls <= 205);
}

#[test]
fn a_substituted_variable_joins_the_factors_of_the_term() {
    let thrust = Term::signed_square(1, 1).times(&Term::monomial(&[0]));
    assert_eq!(substitute_variable(&thrust, 1, 3), Term::signed_square(3, 3).times(&Term::monomial(&[0])));
    assert_eq!(substitute_variable(&Term::monomial(&[0, 1]), 1, 0), Term::monomial(&[0, 0]));
    assert_eq!(substitute_variable(&thrust, 2, 5), thrust);
}

#[test]
fn the_modes_of_a_term_add_up_to_it() {
    let gate = Gate { centre: Real(2.5), slope: Real(12.0) };
    let terms = [Term::constant(), Term::of(1, Shape::Sin)];
    let modes = gated(&terms, 0, gate);
    assert_eq!(modes.len(), 4);
    for (pair, term) in modes.chunks(2).zip(&terms) {
        let at = [2.6, 0.3];
        let sum: f64 = pair.iter().map(|t| t.value(&at)).sum();
        assert!((sum - term.value(&at)).abs() < 1e-15);
    }
}

const RANGE: [DesignRange; 1] = [DesignRange { low: -1.0, high: 1.0 }];

fn check(coefficients: [f64; 3]) -> StabilityCheck {
    // y' = a y + b y^2 + c command.
    let terms = vec![Term::monomial(&[0]), Term::monomial(&[0, 0]), Term::monomial(&[1])];
    let equations = Equations::new(terms, coefficients.to_vec(), 1, 1, 0.1, 1).unwrap();
    stability_check(&equations, &RANGE, &RANGE, StabilityOptions { rollouts: 64, steps: 500, seed: 7 })
}

#[test]
fn a_damped_vessel_is_bounded_and_an_unstable_one_is_not() {
    assert!(check([-1.0, 0.0, 1.0]).is_bounded());
    // y' = -y + 2 y^2 runs away from every state above one half.
    let some = check([-1.0, 2.0, 0.0]);
    assert!((8..=24).contains(&some.unbounded), "a quarter of the states: {some:?}");
    // exp(5) over the rollout: all but states near rest.
    assert!(check([0.1, 0.0, 0.0]).unbounded > 50);
}

#[test]
fn the_stability_check_follows_from_its_seed() {
    assert_eq!(check([-1.0, 2.0, 0.3]), check([-1.0, 2.0, 0.3]));
}
