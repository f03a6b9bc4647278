use hydroid::log::Trajectory;
use hydroid::sindy::{
    Coefficient, ConstraintError, Constraints, Criterion, Equality, Fit, FitError, FitOptions, Library,
    LinearRegression, Optimizer, RegressionForm, Scaling, Sign, Variables,
};
use proptest::prelude::*;

use crate::estimate::made::{Normal, driven, options, run, solve};

/// White noise in two outputs and two inputs: two equations in the terms `y0, y1, c0, c1`.
fn noise(seed: u64) -> Trajectory {
    let mut normal = Normal::new(seed);
    let mut rows = |scale: [f64; 2]| -> Vec<Vec<f64>> {
        (0..40).map(|_| scale.iter().map(|s| s * normal.next()).collect()).collect()
    };
    let (outputs, inputs) = (rows([1.0, 10.0]), rows([0.1, 1.0]));
    run(0.1, &outputs, &inputs)
}

const TERMS: usize = 4;

fn fit(data: &Trajectory, constraints: Constraints, optimizer: Optimizer) -> Result<Fit, FitError> {
    let library = Library::polynomial(1).without_constant();
    let prepared = LinearRegression::new(
        &[data],
        library.terms(&Variables::plain(4, 0)),
        RegressionForm::default(),
        &Scaling::Contribution,
    )
    .unwrap();
    prepared.fit(&FitOptions { constraints, ..options(optimizer) })
}

/// Normal equations of both outputs by the definition of the midpoint rule.
fn normal_equations(data: &Trajectory) -> (Vec<Vec<f64>>, Vec<Vec<f64>>, Vec<f64>) {
    let mut matrix = vec![vec![0.0; TERMS]; TERMS];
    let mut right = vec![vec![0.0; TERMS]; 2];
    let mut total = vec![0.0; 2];
    for k in 0..data.len() - 1 {
        let (a, b) = (data.outputs.row(k), data.outputs.row(k + 1));
        let theta: Vec<f64> =
            a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).chain(data.inputs.row(k).iter().copied()).collect();
        for i in 0..TERMS {
            for j in 0..TERMS {
                matrix[i][j] += theta[i] * theta[j];
            }
            for output in 0..2 {
                right[output][i] += theta[i] * (b[output] - a[output]) / data.dt;
            }
        }
        for output in 0..2 {
            total[output] += ((b[output] - a[output]) / data.dt).powi(2);
        }
    }
    (matrix, right, total)
}

/// The coupled problem, each equation weighted by the inverse of its residual: matrix, right-hand side.
fn stacked(data: &Trajectory) -> (Vec<Vec<f64>>, Vec<f64>) {
    let (matrix, right, total) = normal_equations(data);
    let mut all = vec![vec![0.0; 2 * TERMS]; 2 * TERMS];
    let mut rhs = vec![0.0; 2 * TERMS];
    for output in 0..2 {
        let x = solve(matrix.clone(), right[output].clone()).unwrap();
        let residual = total[output] - x.iter().zip(&right[output]).map(|(x, r)| x * r).sum::<f64>();
        for i in 0..TERMS {
            for j in 0..TERMS {
                all[output * TERMS + i][output * TERMS + j] = matrix[i][j] / residual;
            }
            rhs[output * TERMS + i] = right[output][i] / residual;
        }
    }
    (all, rhs)
}

/// The cost up to a constant.
fn cost(matrix: &[Vec<f64>], right: &[f64], x: &[f64]) -> f64 {
    let n = x.len();
    (0..n).map(|i| x[i] * ((0..n).map(|j| matrix[i][j] * x[j]).sum::<f64>() - 2.0 * right[i])).sum()
}

/// The minimum over all choices of which signed coefficients are zero, each solved from its Lagrange system.
fn brute_force(
    (matrix, right): &(Vec<Vec<f64>>, Vec<f64>),
    signs: &[f64],
    equalities: &[(Vec<f64>, f64)],
) -> Option<Vec<f64>> {
    let n = right.len();
    let signed: Vec<usize> = (0..n).filter(|&j| signs[j] != 0.0).collect();
    let mut best: Option<(f64, Vec<f64>)> = None;
    for choice in 0..1u32 << signed.len() {
        let zero = |j: &usize| signed.iter().position(|s| s == j).is_some_and(|bit| choice >> bit & 1 == 1);
        let free: Vec<usize> = (0..n).filter(|j| !zero(j)).collect();
        let size = free.len() + equalities.len();
        let mut system = vec![vec![0.0; size]; size];
        let mut rhs = vec![0.0; size];
        for (a, &i) in free.iter().enumerate() {
            for (b, &j) in free.iter().enumerate() {
                system[a][b] = matrix[i][j];
            }
            for (e, (weights, value)) in equalities.iter().enumerate() {
                system[a][free.len() + e] = weights[i];
                system[free.len() + e][a] = weights[i];
                rhs[free.len() + e] = *value;
            }
            rhs[a] = right[i];
        }
        let Some(solution) = solve(system, rhs) else { continue };
        let mut x = vec![0.0; n];
        free.iter().zip(&solution).for_each(|(&j, value)| x[j] = *value);
        if (0..n).any(|j| signs[j] * x[j] < 0.0) {
            continue;
        }
        let cost = cost(matrix, right, &x);
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, x));
        }
    }
    best.map(|(_, x)| x)
}

fn at(index: usize) -> Coefficient {
    Coefficient { equation: index / TERMS, term: index % TERMS }
}

fn constraints(signs: &[f64], equalities: &[(Vec<f64>, f64)]) -> Constraints {
    let sign = |s: f64| if s > 0.0 { Sign::NotNegative } else { Sign::NotPositive };
    Constraints {
        signs: (0..signs.len()).filter(|&k| signs[k] != 0.0).map(|k| (at(k), sign(signs[k]))).collect(),
        equalities: equalities
            .iter()
            .map(|(weights, value)| Equality {
                weights: weights
                    .iter()
                    .enumerate()
                    .filter(|(_, a)| **a != 0.0)
                    .map(|(k, a)| (at(k), *a))
                    .collect(),
                value: *value,
            })
            .collect(),
    }
}

fn any_signs() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(prop_oneof![Just(0.0), Just(1.0), Just(-1.0)], 2 * TERMS)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn signs_and_equalities_give_the_minimum_of_all_choices(
        seed in 0u64..1_000_000,
        signs in any_signs(),
        equalities in prop::collection::vec((prop::collection::vec(-2i32..3, 2 * TERMS), -3i32..4), 0..3),
    ) {
        let data = noise(seed);
        let mut equalities: Vec<(Vec<f64>, f64)> = equalities
            .into_iter()
            .map(|(weights, value)| (weights.into_iter().map(f64::from).collect(), f64::from(value)))
            .filter(|(weights, _): &(Vec<f64>, f64)| weights.iter().any(|a| *a != 0.0))
            .collect();
        // One equality couples the equations, so that their weights are those of the stacked problem.
        let mut tie = vec![0.0; 2 * TERMS];
        (tie[1], tie[TERMS]) = (1.0, -1.0);
        equalities.push((tie, 0.0));
        let problem = stacked(&data);
        let expected = brute_force(&problem, &signs, &equalities);
        let found = fit(&data, constraints(&signs, &equalities), Optimizer::Stlsq(0.0));
        match (found, expected) {
            (Ok(found), Some(expected)) => {
                let scale = expected.iter().map(|x| x.abs()).fold(1.0, f64::max);
                // A choice with a singular Lagrange system is skipped above and may be the best: the fit is then better
                // than all others and within its bounds.
                let of = |x: &[f64]| cost(&problem.0, &problem.1, x);
                let (own, theirs) = (of(found.equations.coefficients()), of(&expected));
                let beats = own < theirs - 1e-6 * theirs.abs().max(1.0);
                for (k, (x, e)) in found.equations.coefficients().iter().zip(&expected).enumerate() {
                    prop_assert!(beats || (x - e).abs() < 1e-6 * scale, "{k}: {x} for {e}, cost {own} for {theirs}");
                    prop_assert!(signs[k] * x >= 0.0);
                }
                for (weights, value) in &equalities {
                    let terms: Vec<f64> =
                        weights.iter().zip(found.equations.coefficients()).map(|(a, x)| a * x).collect();
                    let size = value.abs() + terms.iter().map(|t| t.abs()).sum::<f64>();
                    prop_assert!((terms.iter().sum::<f64>() - value).abs() <= 1e-11 * size + 1e-12 * scale);
                }
            }
            (Err(FitError::Constraints(ConstraintError::Contradiction { .. })), None) => {}
            // Dependent equalities make the Lagrange system singular: there is no reference.
            (found, None) => prop_assume!(found.is_err()),
            (Err(error), Some(_)) => prop_assert!(false, "{error}"),
        }
    }

    /// Karush-Kuhn-Tucker conditions of one equation.
    #[test]
    fn the_gradient_pushes_against_the_bounds(seed in 0u64..1_000_000, signs in any_signs()) {
        let data = noise(seed);
        let found = fit(&data, constraints(&signs, &[]), Optimizer::Stlsq(0.0)).unwrap();
        let (matrix, right, total) = normal_equations(&data);
        for k in 0..2 * TERMS {
            let (i, j) = (k / TERMS, k % TERMS);
            let x = &found.equations.coefficients()[i * TERMS..(i + 1) * TERMS];
            let gradient = (0..TERMS).map(|l| matrix[j][l] * x[l]).sum::<f64>() - right[i][j];
            let size = (matrix[j][j] * total[i]).sqrt();
            if x[j] == 0.0 {
                prop_assert!(signs[k] * gradient >= -1e-9 * size, "{k}: {gradient}");
            } else {
                prop_assert!(gradient.abs() < 1e-9 * size && signs[k] * x[j] >= 0.0, "{k}: {gradient}");
            }
        }
    }
}

/// With the forbidden sign of the damping in `y' = -y + c` the term is removed, and the others are selected anew.
#[test]
fn a_term_at_its_bound_leaves() {
    let data = driven(3_000, 0.1, 2);
    let library = Library::polynomial(2);
    let prepared = LinearRegression::new(
        &[&data],
        library.terms(&Variables::plain(2, 0)),
        RegressionForm::default(),
        &Scaling::Contribution,
    )
    .unwrap();
    for optimizer in [Optimizer::Stepwise(0.01), Optimizer::Criterion(Criterion::Bic), Optimizer::Stlsq(0.05)]
    {
        let with = |sign| {
            let signs = vec![(Coefficient { equation: 0, term: 1 }, sign)];
            let constraints = Constraints { signs, equalities: Vec::new() };
            prepared.fit(&FitOptions { constraints, ..options(optimizer) }).unwrap()
        };
        assert_eq!(with(Sign::NotNegative).equations.coefficient(0, 1), 0.0);
        let free = prepared.fit(&options(optimizer)).unwrap();
        for (a, b) in with(Sign::NotPositive).scaled.iter().zip(&free.scaled) {
            assert!((a - b).abs() < 1e-12, "a sign that holds anyway changes nothing");
        }
    }
}

#[test]
fn constraints_that_make_no_sense_are_refused() {
    let data = noise(1);
    let refused = |constraints| match fit(&data, constraints, Optimizer::Stlsq(0.0)).unwrap_err() {
        FitError::Constraints(error) => error,
        other => panic!("{other}"),
    };
    let one = |index: usize, value: f64| Equality { weights: vec![(at(index), 1.0)], value };
    let of = |equalities: Vec<Equality>| Constraints { signs: Vec::new(), equalities };
    assert!(matches!(refused(of(vec![one(0, 1.0), one(0, 2.0)])), ConstraintError::Contradiction { .. }));
    assert!(matches!(refused(of(vec![one(8, 1.0)])), ConstraintError::OutOfRange { .. }));
    assert!(matches!(refused(of(vec![one(0, f64::NAN)])), ConstraintError::Empty(0)));
    assert!(matches!(
        refused(of(vec![Equality { weights: Vec::new(), value: 0.0 }])),
        ConstraintError::Empty(0)
    ));
    let against = Constraints { signs: vec![(at(5), Sign::NotPositive)], equalities: vec![one(5, 2.0)] };
    assert_eq!(refused(against), ConstraintError::Contradiction { equation: 1 });
    // A repeated constraint is consistent; both signs at once give zero.
    let twice = of(vec![one(0, 1.0), one(0, 1.0)]);
    let fitted = fit(&data, twice, Optimizer::Stlsq(0.0)).unwrap();
    assert!((fitted.equations.coefficient(0, 0) - 1.0).abs() < 1e-14);
    let both = Constraints {
        signs: vec![(at(2), Sign::NotPositive), (at(2), Sign::NotNegative)],
        equalities: Vec::new(),
    };
    assert_eq!(fit(&data, both, Optimizer::Stlsq(0.0)).unwrap().equations.coefficient(0, 2), 0.0);
}
