//! Sparse equations, compared with explicit products and closed-form solutions.

use std::sync::Arc;

use hydroid_core::model::Persistence;
use hydroid_core::model::sparse::{
    Equations, EquationsError, EquationsSession, Factor, Gate, Jacobian, Program, ProgramError, Real, Shape,
    Term,
};
use hydroid_core::predict::{Predictor, Workspace};
use proptest::prelude::*;

const VARIABLES: u16 = 4;

fn shapes() -> impl Strategy<Value = Shape> {
    let gate = || (-2.0..2.0f64, 0.5..2.0f64).prop_map(|(c, k)| Gate { centre: Real(c), slope: Real(k) });
    prop_oneof![
        3 => (1u8..4).prop_map(Shape::Power),
        2 => Just(Shape::Abs),
        1 => Just(Shape::Sign),
        1 => Just(Shape::Sin),
        1 => Just(Shape::Cos),
        1 => Just(Shape::Reciprocal),
        1 => gate().prop_map(Shape::Above),
        1 => gate().prop_map(Shape::Below),
    ]
}

fn any_term() -> impl Strategy<Value = Term> {
    let factor = (0..VARIABLES, shapes()).prop_map(|(variable, shape)| Factor { variable, shape });
    prop::collection::vec(factor, 0..4).prop_map(Term::new)
}

fn library() -> impl Strategy<Value = Vec<Term>> {
    prop::collection::vec(any_term(), 0..12)
}

fn point() -> impl Strategy<Value = Vec<f64>> {
    // Away from 0, where signs and reciprocals are undefined.
    let away = (0.05..3.0f64, prop::bool::ANY).prop_map(|(x, minus)| if minus { -x } else { x });
    prop::collection::vec(away, usize::from(VARIABLES))
}

fn evaluated(terms: &[Term], point: &[f64]) -> Vec<f64> {
    let program = Program::new(terms, point.len()).unwrap();
    let mut slots = vec![f64::NAN; program.slots()];
    slots[1..=point.len()].copy_from_slice(point);
    program.evaluate(&mut slots);
    (0..terms.len()).map(|term| slots[program.slot(term)]).collect()
}

/// The product, factor by factor, without code of the crate.
fn by_hand(term: &Term, point: &[f64]) -> f64 {
    let mut product = 1.0;
    for factor in term.factors() {
        let x = point[usize::from(factor.variable)];
        product *= match factor.shape {
            Shape::Power(n) => x.powi(i32::from(n)),
            Shape::Abs => {
                if x < 0.0 {
                    -x
                } else {
                    x
                }
            }
            Shape::Sign => x.signum(),
            Shape::Sin => x.sin(),
            Shape::Cos => x.cos(),
            Shape::Reciprocal => x.recip(),
            Shape::Log => x.ln(),
            Shape::Above(g) => 0.5 * (1.0 + (0.5 * g.slope.0 * (x - g.centre.0)).tanh()),
            Shape::Below(g) => 0.5 * (1.0 - (0.5 * g.slope.0 * (x - g.centre.0)).tanh()),
        };
    }
    product
}

fn close(a: f64, b: f64, scale: f64) -> bool {
    (a - b).abs() <= 1e-12 * scale.abs().max(1.0)
}

proptest! {
    #[test]
    fn a_program_gives_the_products_written_out(terms in library(), point in point()) {
        for (term, value) in terms.iter().zip(evaluated(&terms, &point)) {
            let expected = by_hand(term, &point);
            prop_assert!(close(value, expected, expected), "{value} for {expected}");
            prop_assert!(close(term.value(&point), expected, expected));
        }
    }

    #[test]
    fn batched_values_equal_single_values(
        terms in library(),
        points in prop::collection::vec(point(), 1..40),
    ) {
        let (n, rows) = (usize::from(VARIABLES), points.len());
        let program = Program::new(&terms, n).unwrap();
        let mut slots = vec![f64::NAN; program.slots() * rows];
        for (i, point) in points.iter().enumerate() {
            for (v, x) in point.iter().enumerate() {
                slots[(1 + v) * rows + i] = *x;
            }
        }
        program.evaluate_block(&mut slots, rows);
        for (i, point) in points.iter().enumerate() {
            for (term, one) in evaluated(&terms, point).into_iter().enumerate() {
                // Same operations in the same order: bit-identical.
                prop_assert_eq!(slots[program.slot(term) * rows + i].to_bits(), one.to_bits());
            }
        }
    }

    #[test]
    fn order_and_repetition_of_terms_change_nothing(
        (terms, shuffled) in library().prop_flat_map(|t| {
            let order: Vec<usize> = (0..t.len()).chain(0..t.len()).collect();
            (Just(t), Just(order).prop_shuffle())
        }),
        point in point(),
    ) {
        let plain = evaluated(&terms, &point);
        let twice: Vec<Term> = shuffled.iter().map(|&i| terms[i].clone()).collect();
        for (&i, value) in shuffled.iter().zip(evaluated(&twice, &point)) {
            prop_assert_eq!(value.to_bits(), plain[i].to_bits());
        }
        let slots = |terms: &[Term]| Program::new(terms, point.len()).unwrap().slots();
        prop_assert_eq!(slots(&terms), slots(&twice), "what is there already is not made again");
    }

    #[test]
    fn an_unknown_variable_is_reported_with_its_term(terms in library(), at in 0usize..12, beyond in 0u16..5) {
        let at = at.min(terms.len());
        let variable = VARIABLES + beyond;
        let mut bad = terms;
        bad.insert(at, Term::signed_square(0, variable));
        prop_assert_eq!(
            Program::new(&bad, usize::from(VARIABLES)).unwrap_err(),
            ProgramError::UnknownVariable { term: at, variable, variables: usize::from(VARIABLES) }
        );
    }

    #[test]
    fn the_derivative_is_coefficients_times_terms(
        terms in library(),
        point in point(),
        seed in prop::collection::vec(-2.0..2.0f64, 24),
    ) {
        // Two outputs, two inputs; every third coefficient is zero.
        let coefficients: Vec<f64> =
            (0..2 * terms.len()).map(|k| if k % 3 == 2 { 0.0 } else { seed[k % 24] }).collect();
        let equations = Equations::new(terms.clone(), coefficients.clone(), 2, 2, 0.1, 1).unwrap();
        let mut slots = vec![f64::NAN; equations.slots()];
        slots[1..5].copy_from_slice(&point);
        let mut dy = [f64::NAN; 2];
        equations.derivative(&mut slots, &mut dy);
        for i in 0..2 {
            let products: Vec<f64> =
                terms.iter().enumerate().map(|(j, t)| coefficients[i * terms.len() + j] * by_hand(t, &point)).collect();
            let scale: f64 = products.iter().map(|p| p.abs()).sum();
            prop_assert!(close(dy[i], products.iter().sum(), scale));
        }
    }

    #[test]
    fn joining_factors_keeps_the_value(
        factors in prop::collection::vec((0..VARIABLES, shapes()), 0..7),
        point in point(),
    ) {
        let factors: Vec<Factor> =
            factors.into_iter().map(|(variable, shape)| Factor { variable, shape }).collect();
        let product: f64 = factors.iter().map(|f| by_hand(&Term::new(vec![*f]), &point)).product();
        let term = Term::new(factors);
        prop_assert!((term.value(&point) - product).abs() <= 1e-9 * product.abs(), "{term:?}");
        prop_assert_eq!(&Term::new(term.factors().to_vec()), &term, "the normal form is its own");
    }

    #[test]
    fn derivatives_are_those_of_finite_differences(term in any_term(), point in point()) {
        let h = 1e-6;
        for v in 0..VARIABLES {
            let at = |x: f64| {
                let mut p = point.clone();
                p[usize::from(v)] += x;
                by_hand(&term, &p)
            };
            let exact: f64 = term.derivative(v).iter().map(|(scale, t)| scale * by_hand(t, &point)).sum();
            let quotient = (at(h) - at(-h)) / (2.0 * h);
            // Truncation by the third derivative and rounding eps f / h, with a margin for steep reciprocals.
            let scale = at(0.0).abs() * 1e3 + exact.abs();
            prop_assert!((exact - quotient).abs() <= 1e-6 * scale + 1e-9, "{term:?}: {exact} for {quotient}");
        }
    }

    #[test]
    fn the_jacobian_is_that_of_the_derivative(
        terms in library(),
        point in point(),
        seed in prop::collection::vec(-2.0..2.0f64, 24),
    ) {
        let coefficients: Vec<f64> = (0..2 * terms.len()).map(|k| seed[k % 24]).collect();
        let equations = Equations::new(terms.clone(), coefficients.clone(), 2, 2, 0.1, 1).unwrap();
        let (a, b) = Jacobian::new(&equations).unwrap().matrices(&point[..2], &point[2..]);
        for i in 0..2 {
            for v in 0..4u16 {
                let mut products = Vec::new();
                for (j, term) in terms.iter().enumerate() {
                    for (scale, derivative) in term.derivative(v) {
                        products.push(coefficients[i * terms.len() + j] * scale * by_hand(&derivative, &point));
                    }
                }
                let column = usize::from(v);
                let got = if column < 2 { a[i * 2 + column] } else { b[i * 2 + column - 2] };
                let scale: f64 = products.iter().map(|p| p.abs()).sum();
                prop_assert!(close(got, products.iter().sum(), scale), "{got}");
            }
        }
    }
}

#[test]
fn a_library_that_needs_too_many_products_is_refused() {
    // 364 variables have 66,430 distinct products of two.
    let terms: Vec<Term> = (0..364u16).flat_map(|a| (a..364).map(move |b| Term::monomial(&[a, b]))).collect();
    assert_eq!(Program::new(&terms, 364).unwrap_err(), ProgramError::TooLarge);
}

const A: f64 = 0.7;
const B: f64 = 1.3;

/// `y' = -a y + b c`.
fn decay(dt: f64, substeps: usize) -> Equations {
    let terms = vec![Term::monomial(&[0]), Term::monomial(&[1])];
    Equations::new(terms, vec![-A, B], 1, 1, dt, substeps).unwrap()
}

/// Its solution under a held command.
fn decayed(y: f64, c: f64, t: f64) -> f64 {
    let rest = B / A * c;
    rest + (y - rest) * (-A * t).exp()
}

fn step(equations: &Equations, y: &[f64], c: &[f64]) -> Vec<f64> {
    let mut y = y.to_vec();
    equations.step(&mut y, c, &mut vec![f64::NAN; equations.scratch()]);
    y
}

#[test]
fn linear_decay_is_its_exponential_to_the_truncation_of_the_method() {
    // The growth factor of RK4 is the exponential series up to the fourth power.
    let (y, c, dt) = (2.0, -0.4, 0.1);
    let got = step(&decay(dt, 1), &[y], &[c])[0];
    let z: f64 = -A * dt;
    let rest = B / A * c;
    let series = 1.0 + z + z.powi(2) / 2.0 + z.powi(3) / 6.0 + z.powi(4) / 24.0;
    assert!((got - (rest + (y - rest) * series)).abs() < 1e-15);
    let truth = decayed(y, c, dt);
    let truncation = ((y - rest) * z.powi(5) / 120.0).abs();
    assert!((got - truth).abs() < 1.05 * truncation && (got - truth).abs() > 0.8 * truncation);
}

#[test]
fn halving_the_step_divides_the_error_by_sixteen() {
    // Over one second, once by the sample time and once by the substeps.
    let (y, c) = (2.0, -0.4);
    let error_of = |steps: usize, substeps: usize| {
        let equations = decay(1.0 / steps as f64, substeps);
        let last = (0..steps).fold(vec![y], |y, _| step(&equations, &y, &[c]));
        (last[0] - decayed(y, c, 1.0)).abs()
    };
    for (coarse, fine) in [(error_of(2, 1), error_of(4, 1)), (error_of(1, 2), error_of(1, 4))] {
        let order = (coarse / fine).log2();
        assert!((3.8..4.3).contains(&order), "order {order}");
    }
    assert!((error_of(4, 1) - error_of(1, 4)).abs() < 1e-15, "steps within a sample are steps");
}

#[test]
fn a_harmonic_oscillator_equals_its_closed_form() {
    let omega = 1.7;
    let terms = vec![Term::monomial(&[0]), Term::monomial(&[1])];
    // x' = w v, v' = -w x.
    let equations = Equations::new(terms, vec![0.0, omega, -omega, 0.0], 2, 0, 0.1, 4).unwrap();
    let mut y = vec![1.0, 0.0];
    for k in 1..=100u32 {
        y = step(&equations, &y, &[]);
        let angle = omega * 0.1 * f64::from(k);
        assert!((y[0] - angle.cos()).abs() < 1e-6 && (y[1] + angle.sin()).abs() < 1e-6, "at {k}: {y:?}");
    }
}

#[test]
fn the_command_is_held_and_the_quadratic_drag_opposes_both_ways() {
    // y' = -y |y|, from 1: 1/(1 + t); odd in y.
    let drag = Equations::new(vec![Term::signed_square(0, 0)], vec![-1.0], 1, 0, 1.0, 100).unwrap();
    assert!((step(&drag, &[1.0], &[])[0] - 0.5).abs() < 1e-9);
    assert!((step(&drag, &[-1.0], &[])[0] + 0.5).abs() < 1e-9);
    // y' = c: after one sample of dt, y + dt c, whatever the number of steps.
    let integrator = Equations::new(vec![Term::monomial(&[1])], vec![1.0], 1, 1, 0.3, 7).unwrap();
    assert!((step(&integrator, &[1.0], &[2.0])[0] - 1.6).abs() < 1e-15);
}

#[test]
fn invalid_equations_are_refused() {
    let terms = || vec![Term::monomial(&[0]), Term::monomial(&[1])];
    let new =
        |coefficients: Vec<f64>, dt, substeps| Equations::new(terms(), coefficients, 1, 1, dt, substeps);
    assert!(new(vec![1.0, 2.0], 0.1, 1).is_ok());
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(
            new(vec![1.0, bad], 0.1, 1).unwrap_err(),
            EquationsError::NotFinite { output: 0, term: 1 }
        );
        assert_eq!(new(vec![1.0, 2.0], bad, 1).unwrap_err(), EquationsError::Step);
    }
    for dt in [0.0, -0.1] {
        assert_eq!(new(vec![1.0, 2.0], dt, 1).unwrap_err(), EquationsError::Step);
    }
    for substeps in [0, 10_001, usize::MAX] {
        assert_eq!(new(vec![1.0, 2.0], 0.1, substeps).unwrap_err(), EquationsError::Step);
    }
    for given in [0, 1, 3] {
        assert_eq!(new(vec![1.0; given], 0.1, 1).unwrap_err(), EquationsError::Shape { expected: 2, given });
    }
    // Also where no equation uses the term.
    let unused = Equations::new(vec![Term::monomial(&[9])], vec![0.0], 1, 1, 0.1, 1);
    assert!(matches!(
        unused,
        Err(EquationsError::Program(ProgramError::UnknownVariable { variable: 9, .. }))
    ));
    let second = Equations::new(terms(), vec![0.0, 0.0, 0.0, f64::NAN], 2, 0, 0.1, 1);
    assert_eq!(second.unwrap_err(), EquationsError::NotFinite { output: 1, term: 1 });
}

/// Two coupled outputs and one input, nonlinear.
fn session() -> EquationsSession {
    let terms = vec![
        Term::monomial(&[0]),
        Term::monomial(&[1]),
        Term::monomial(&[2]),
        Term::monomial(&[0, 1]),
        Term::signed_square(1, 1),
    ];
    let coefficients = vec![-0.5, 0.2, 1.0, 0.0, 0.0, 0.1, -0.3, 0.0, 0.4, -0.2];
    EquationsSession::new(Arc::new(Equations::new(terms, coefficients, 2, 1, 0.1, 2).unwrap()))
}

fn output(session: &dyn Predictor) -> Vec<u64> {
    let mut y = vec![0.0; session.outputs()];
    session.output(&mut y);
    y.into_iter().map(f64::to_bits).collect()
}

fn commands(steps: u32) -> Vec<f64> {
    (0..steps).map(|k| (0.3 * f64::from(k)).sin()).collect()
}

#[test]
fn a_missing_measurement_leaves_the_prediction() {
    let mut session = session();
    session.observe(&[1.0, -0.5]);
    session.advance(&[0.3]);
    let predicted = output(&session);
    session.observe(&[f64::NAN, 0.25]);
    assert_eq!(output(&session), [predicted[0], 0.25f64.to_bits()]);
    session.observe(&[f64::NAN; 2]);
    assert_eq!(output(&session), [predicted[0], 0.25f64.to_bits()]);
}

/// Two sensors that never report in the same sample: an unknown output must not erase the known one.
#[test]
fn alternating_sensors_give_an_estimate() {
    let mut session = session();
    session.observe(&[1.0, f64::NAN]);
    session.advance(&[0.3]);
    session.observe(&[f64::NAN, -0.5]);
    assert_eq!(output(&session), [1.0f64, -0.5].map(f64::to_bits));
    session.advance(&[0.3]);
    let mut y = [0.0; 2];
    session.output(&mut y);
    assert!(y.iter().all(|y| y.is_finite()) && y != [1.0, -0.5], "from here on it predicts: {y:?}");
}

#[test]
fn a_rollout_equals_repeated_advances_and_keeps_the_session() {
    let mut session = session();
    session.observe(&[1.0, -0.5]);
    let commands = commands(50);
    let before = output(&session);
    let mut y = vec![0.0; 100];
    let mut work = Workspace::new();
    session.rollout(&commands, &mut work, &mut y);
    assert_eq!(output(&session), before, "a rollout does not move the session");
    let mut again = vec![0.0; 100];
    session.rollout(&commands, &mut work, &mut again);
    assert_eq!(y, again, "what the workspace held does not matter");
    for (row, c) in y.chunks_exact(2).zip(&commands) {
        session.advance(&[*c]);
        assert_eq!(output(&session), [row[0].to_bits(), row[1].to_bits()]);
    }
    session.rollout(&[], &mut work, &mut []);
}

#[test]
fn snapshots_and_forks_predict_as_the_session_did() {
    let mut original = session();
    original.observe(&[1.0, -0.5]);
    original.advance(&[0.3]);
    let mut kept = vec![0.0; original.snapshot_len()];
    original.snapshot(&mut kept);
    let mut fork = original.fork();
    let roll = |s: &dyn Predictor| {
        let mut y = vec![0.0; 40];
        s.rollout(&commands(20), &mut Workspace::new(), &mut y);
        y
    };
    let expected = roll(&original);
    // The original advances; the fork does not.
    original.observe(&[2.0, 2.0]);
    original.advance(&[1.0]);
    assert_ne!(roll(&original), expected);
    assert_eq!(roll(fork.as_ref()), expected);
    fork.reset();
    assert!(roll(fork.as_ref()).iter().all(|y| y.is_nan()), "nothing is known at the start of a run");
    fork.restore(&kept);
    assert_eq!(roll(fork.as_ref()), expected);
    original.restore(&kept);
    assert_eq!(roll(&original), expected);
}

#[test]
fn a_diverged_rollout_is_not_finite_and_does_not_panic() {
    // y' = y^2 from 100 has no solution beyond 10 ms.
    let square = Equations::new(vec![Term::monomial(&[0, 0])], vec![1.0], 1, 0, 0.1, 1).unwrap();
    let mut session = EquationsSession::new(Arc::new(square));
    session.observe(&[100.0]);
    let mut y = vec![0.0; 100];
    session.rollout(&[], &mut Workspace::new(), &mut y);
    assert!(!y[99].is_finite());
}

#[test]
#[should_panic(expected = "one row of commands")]
fn commands_and_predictions_must_have_the_same_rows() {
    session().rollout(&[0.0; 3], &mut Workspace::new(), &mut [0.0; 8]);
}

#[test]
fn persistence_keeps_the_last_value_measured() {
    let mut session = Persistence::new(2, 1);
    session.observe(&[1.0, 2.0]);
    session.advance(&[9.0]);
    session.observe(&[f64::NAN, 3.0]);
    let mut y = [0.0; 6];
    session.rollout(&[5.0; 3], &mut Workspace::new(), &mut y);
    assert_eq!(y, [1.0, 3.0, 1.0, 3.0, 1.0, 3.0]);
    let fork = session.fork();
    session.reset();
    assert!(output(&session).iter().all(|y| f64::from_bits(*y).is_nan()));
    assert_eq!(output(fork.as_ref()), [1.0f64.to_bits(), 3.0f64.to_bits()]);
}

fn power(variable: u16, n: u8) -> Factor {
    Factor { variable, shape: Shape::Power(n) }
}

fn factor(shape: Shape) -> Factor {
    Factor { variable: 0, shape }
}

#[test]
fn powers_of_a_variable_are_joined() {
    let abs = |variable| Factor { variable, shape: Shape::Abs };
    assert_eq!(Term::new(vec![power(1, 1), power(0, 2), power(1, 1)]).factors(), [power(0, 2), power(1, 2)]);
    assert_eq!(Term::monomial(&[1, 0, 1, 0]), Term::new(vec![power(0, 2), power(1, 2)]));
    assert_eq!(Term::new(vec![abs(0), power(0, 1), power(0, 1)]).factors(), [power(0, 2), abs(0)]);
    assert_eq!(Term::new(vec![abs(0), abs(0), abs(0)]).factors(), [power(0, 2), abs(0)]);
    let large = Term::new(vec![power(0, 200), power(0, 100)]);
    assert_eq!(large.degree(), 300);
    assert!((large.value(&[1.01]) / 1.01f64.powi(300) - 1.0).abs() < 1e-12);
}

#[test]
fn signs_and_reciprocals_cancel() {
    assert_eq!(Term::new(vec![power(0, 1), factor(Shape::Sign)]), Term::of(0, Shape::Abs));
    assert_eq!(Term::new(vec![factor(Shape::Abs), factor(Shape::Sign)]), Term::monomial(&[0]));
    assert_eq!(Term::new(vec![power(0, 2), factor(Shape::Reciprocal)]), Term::monomial(&[0]));
    assert_eq!(Term::new(vec![power(0, 1), factor(Shape::Reciprocal)]), Term::constant());
}

#[test]
fn the_derivative_of_quadratic_drag_is_one_term() {
    let drag = Term::signed_square(0, 0);
    assert_eq!(drag.derivative(0), [(2.0, Term::of(0, Shape::Abs))]);
    assert!(drag.derivative(1).is_empty());
}
