//! The streaming QR factor, compared with normal equations, textbook matrices and closed forms.

use hydroid::sindy::{BLOCK_ROWS, QrFactor, stepwise, stlsq};
use proptest::prelude::*;

/// The factor of a matrix given row by row, folded in by blocks of `BLOCK_ROWS`.
fn fold(rows: &[Vec<f64>]) -> QrFactor {
    let width = rows[0].len();
    let mut factor = QrFactor::new(width);
    for chunk in rows.chunks(BLOCK_ROWS) {
        let mut block = vec![0.0; width * BLOCK_ROWS];
        for (i, row) in chunk.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                block[j * BLOCK_ROWS + i] = *value;
            }
        }
        factor.append_rows(&mut block, chunk.len());
    }
    factor
}

/// `A'A` by definition.
fn gram(rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = rows[0].len();
    (0..n).map(|i| (0..n).map(|j| rows.iter().map(|r| r[i] * r[j]).sum()).collect()).collect()
}

/// `R'R`.
fn square(factor: &QrFactor) -> Vec<Vec<f64>> {
    let n = factor.width();
    let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| factor.get(i, j)).collect()).collect();
    gram(&rows)
}

/// Largest difference of two Gram matrices, relative to the norms of the columns.
fn distance(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let n = a.len();
    let mut worst = 0.0f64;
    for i in 0..n {
        for j in 0..n {
            let scale = (b[i][i] * b[j][j]).sqrt().max(f64::MIN_POSITIVE);
            worst = worst.max((a[i][j] - b[i][j]).abs() / scale);
        }
    }
    worst
}

fn solve_square(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs())).unwrap();
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            for j in k..n {
                let known = a[k][j];
                a[i][j] -= factor * known;
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        b[k] = (b[k] - (k + 1..n).map(|j| a[k][j] * b[j]).sum::<f64>()) / a[k][k];
    }
    b
}

fn matrix(rows: &[&[f64]]) -> Vec<Vec<f64>> {
    rows.iter().map(|r| r.to_vec()).collect()
}

/// Pseudo-random numbers.
fn wild(k: usize) -> f64 {
    (1.0 + 12.9898 * k as f64).sin() * 43_758.545 % 1.0
}

fn wild_matrix(rows: usize, columns: usize) -> Vec<Vec<f64>> {
    (0..rows).map(|i| (0..columns).map(|j| wild(i * columns + j)).collect()).collect()
}

fn tall() -> impl Strategy<Value = Vec<Vec<f64>>> {
    (1usize..9, 1usize..200).prop_flat_map(|(columns, rows)| {
        let scale = prop::collection::vec(-3i32..4, columns);
        let values = prop::collection::vec(prop::collection::vec(-1.0..1.0f64, columns), rows);
        (values, scale).prop_map(|(values, scale)| {
            let row = |r: Vec<f64>| r.iter().zip(&scale).map(|(x, s)| x * 10f64.powi(*s)).collect();
            values.into_iter().map(row).collect()
        })
    })
}

#[test]
fn the_textbook_factor() {
    // The standard example: R = [14 21 -14; 0 175 -70; 0 0 35], up to signs of rows.
    let factor = fold(&matrix(&[&[12.0, -51.0, 4.0], &[6.0, 167.0, -68.0], &[-4.0, 24.0, -41.0]]));
    let expected = [[14.0, 21.0, -14.0], [0.0, 175.0, -70.0], [0.0, 0.0, 35.0]];
    for i in 0..3 {
        let sign = factor.get(i, i).signum();
        for j in 0..3 {
            assert!((sign * factor.get(i, j) - expected[i][j]).abs() < 1e-12, "({i}, {j})");
        }
    }
    assert_eq!((factor.rows(), factor.width()), (3, 3));
    assert!((factor.column_norm(2) - (16.0f64 + 68.0 * 68.0 + 41.0 * 41.0).sqrt()).abs() < 1e-12);
}

proptest! {
    #[test]
    fn the_factor_times_its_transpose_is_the_normal_matrix(rows in tall()) {
        let factor = fold(&rows);
        prop_assert!(distance(&square(&factor), &gram(&rows)) < 1e-13);
        prop_assert_eq!(factor.rows(), rows.len() as u64);
        for i in 0..factor.width() {
            for j in 0..i {
                prop_assert_eq!(factor.get(i, j), 0.0);
            }
        }
    }

    #[test]
    fn parts_merge_in_any_order_and_grouping(rows in tall(), cuts in (0.0..1.0f64, 0.0..1.0f64)) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let at = |f: f64| (f * rows.len() as f64) as usize;
        let (low, high) = (at(cuts.0.min(cuts.1)), at(cuts.0.max(cuts.1)));
        let width = rows[0].len();
        let part = |r: &[Vec<f64>]| if r.is_empty() { QrFactor::new(width) } else { fold(r) };
        let parts = [part(&rows[..low]), part(&rows[low..high]), part(&rows[high..])];
        let truth = gram(&rows);
        for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            let mut all = QrFactor::new(width);
            for i in order {
                all.merge(&parts[i]);
            }
            prop_assert!(distance(&square(&all), &truth) < 1e-13);
            prop_assert_eq!(all.rows(), rows.len() as u64);
        }
        // (1 + (2 + 3)).
        let (mut left, mut right) = (parts[0].clone(), parts[1].clone());
        right.merge(&parts[2]);
        left.merge(&right);
        prop_assert!(distance(&square(&left), &truth) < 1e-13);
    }

    #[test]
    fn columns_can_be_scaled_and_picked_afterwards(rows in tall(), picks in prop::collection::vec(0usize..9, 1..9)) {
        let factor = fold(&rows);
        let width = factor.width();
        let picks: Vec<usize> = picks.into_iter().map(|p| p % width).collect();
        let picked: Vec<Vec<f64>> = rows.iter().map(|r| picks.iter().map(|&j| r[j]).collect()).collect();
        prop_assert!(distance(&square(&factor.select(&picks)), &gram(&picked)) < 1e-13);
        let scale: Vec<f64> = (0..width).map(|j| 0.5 + j as f64).collect();
        let scaled: Vec<Vec<f64>> = rows.iter().map(|r| r.iter().zip(&scale).map(|(x, s)| x * s).collect()).collect();
        prop_assert!(distance(&square(&factor.scaled(&scale)), &gram(&scaled)) < 1e-13);
    }
}

#[test]
fn a_factor_wider_than_a_block_merges_and_selects() {
    let rows = wild_matrix(300, BLOCK_ROWS + 21);
    let mut all = fold(&rows[..150]);
    all.merge(&fold(&rows[150..]));
    assert!(distance(&square(&all), &gram(&rows)) < 1e-13);
    let picks: Vec<usize> = (0..all.width()).rev().collect();
    let reversed: Vec<Vec<f64>> = rows.iter().map(|r| r.iter().rev().copied().collect()).collect();
    assert!(distance(&square(&all.select(&picks)), &gram(&reversed)) < 1e-13);
}

#[test]
fn exact_data_gives_back_their_coefficients() {
    let truth = [0.3, -2.0, 0.0, 5.0, 1e-3];
    let mut rows = wild_matrix(200, 5);
    for row in &mut rows {
        row.push(row.iter().zip(truth).map(|(a, x)| a * x).sum());
    }
    let factor = fold(&rows);
    let solution = factor.solve(&[0, 1, 2, 3, 4], 5);
    for (got, expected) in solution.coefficients.iter().zip(truth) {
        assert!((got - expected).abs() < 1e-13, "{got} for {expected}");
    }
    assert!(solution.residual < 1e-12 && solution.dependent.is_empty());
    // Without a column that is not needed; without a needed one, the rest is residual.
    let fewer = factor.solve(&[0, 1, 3, 4], 5);
    assert!(fewer.residual < 1e-12 && (fewer.coefficients[2] - 5.0).abs() < 1e-13);
    assert!(factor.solve(&[0, 1], 5).residual > 1.0);
    let none = factor.solve(&[], 5);
    assert!((none.residual - factor.column_norm(5)).abs() < 1e-12);
}

#[test]
fn any_subset_of_columns_is_solved_as_its_own_normal_equations() {
    let rows = wild_matrix(150, 7);
    let factor = fold(&rows);
    for subset in [vec![0], vec![5], vec![1, 4], vec![0, 2, 3], vec![0, 1, 2, 3, 4, 5]] {
        let all: Vec<Vec<f64>> =
            rows.iter().map(|r| subset.iter().chain([&6]).map(|&j| r[j]).collect()).collect();
        let n = subset.len();
        let normal = gram(&all);
        let left: Vec<Vec<f64>> = normal[..n].iter().map(|r| r[..n].to_vec()).collect();
        let expected = solve_square(left, normal[..n].iter().map(|r| r[n]).collect());
        let solution = factor.solve(&subset, 6);
        for (got, expected) in solution.coefficients.iter().zip(&expected) {
            assert!((got - expected).abs() < 1e-12, "{subset:?}");
        }
        let residual: f64 = all
            .iter()
            .map(|r| (r[n] - r[..n].iter().zip(&expected).map(|(a, x)| a * x).sum::<f64>()).powi(2))
            .sum();
        assert!((solution.residual - residual.sqrt()).abs() < 1e-12);
    }
}

#[test]
fn a_dependent_column_is_reported_and_left_out() {
    let mut rows = wild_matrix(100, 3);
    for row in &mut rows {
        // A sum of two columns, a column of zeros, and the right-hand side.
        row.extend([row[0] - 3.0 * row[1], 0.0, 2.0 * row[0] + row[2]]);
    }
    let solution = fold(&rows).solve(&[0, 1, 2, 3, 4], 5);
    assert_eq!(solution.dependent, [3, 4]);
    for (got, expected) in solution.coefficients.iter().zip([2.0, 0.0, 1.0, 0.0, 0.0]) {
        assert!((got - expected).abs() < 1e-12);
    }
    assert!(solution.residual < 1e-11);
}

/// A dependent column has no coefficient.
#[test]
fn both_optimizers_leave_dependent_terms_out() {
    let mut rows = wild_matrix(100, 3);
    for row in &mut rows {
        row.extend([row[0] - 3.0 * row[1], 2.0 * row[0] + row[2]]);
    }
    let factor = fold(&rows);
    for solution in [stlsq(&factor, &factor, 4, 4, 0.1), stepwise(&factor, 4, 4, 1e-3)] {
        for (got, expected) in solution.coefficients.iter().zip([2.0, 0.0, 1.0, 0.0]) {
            assert!((got - expected).abs() < 1e-12);
        }
    }
}

/// A term is removed exactly if the residual sum of squares rises by less than the tolerance. Orthogonal columns make
/// the rise the square of the coefficient.
#[test]
fn backward_elimination_weighs_the_rise_of_the_residual() {
    // Columns e1, e2, e3 and a right-hand side (10, 0.3, 0.2, 1): the residual sum of squares is 1.
    let rows = matrix(&[
        &[1.0, 0.0, 0.0, 10.0],
        &[0.0, 1.0, 0.0, 0.3],
        &[0.0, 0.0, 1.0, 0.2],
        &[0.0, 0.0, 0.0, 1.0],
    ]);
    let factor = fold(&rows);
    // A total of 101.13 makes every rise below 0.00101 negligible; the rises are 0.04, 0.09 and 100.
    let support = |tolerance: f64| -> Vec<bool> {
        stepwise(&factor, 3, 3, tolerance).coefficients.iter().map(|c| *c != 0.0).collect()
    };
    assert_eq!(support(0.03), [true, true, true]);
    assert_eq!(support(0.05), [true, true, false]);
    // Without the third column the residual is 1.04: 0.09 is 0.0865 of it.
    assert_eq!(support(0.085), [true, true, false]);
    assert_eq!(support(0.088), [true, false, false]);
    assert_eq!(support(200.0), [false, false, false]);
}

#[test]
fn ridge_is_its_closed_form() {
    // One column: x = a'b / (a'a + w^2).
    let one = fold(&matrix(&[&[3.0, 1.0], &[4.0, 2.0]])).with_ridge(&[5.0, 0.0]);
    assert!((one.solve(&[0], 1).coefficients[0] - 11.0 / 50.0).abs() < 1e-14);
    assert_eq!(one.rows(), 2, "the penalty is not an observation");
    // Several: (A'A + W^2) x = A'b.
    let rows = wild_matrix(120, 5);
    let weights = [0.5, 2.0, 0.0, 10.0];
    let mut normal = gram(&rows);
    for (j, w) in weights.iter().enumerate() {
        normal[j][j] += w * w;
    }
    let left: Vec<Vec<f64>> = normal[..4].iter().map(|r| r[..4].to_vec()).collect();
    let expected = solve_square(left, normal[..4].iter().map(|r| r[4]).collect());
    let ridged = fold(&rows).with_ridge(&[0.5, 2.0, 0.0, 10.0, 0.0]);
    for (got, expected) in ridged.solve(&[0, 1, 2, 3], 4).coefficients.iter().zip(&expected) {
        assert!((got - expected).abs() < 1e-13);
    }
    // A subset of the columns has its own ridge.
    let own = solve_square(
        vec![vec![normal[1][1], normal[1][3]], vec![normal[3][1], normal[3][3]]],
        vec![normal[1][4], normal[3][4]],
    );
    for (got, expected) in ridged.solve(&[1, 3], 4).coefficients.iter().zip(&own) {
        assert!((got - expected).abs() < 1e-13);
    }
}

#[test]
fn condition_numbers_of_known_matrices() {
    let all = |n: usize| (0..n).collect::<Vec<_>>();
    // Orthogonal columns have condition number 1 after scaling to unit norm.
    let diagonal = fold(&matrix(&[&[1e-3, 0.0, 0.0], &[0.0, 7.0, 0.0], &[0.0, 0.0, 1e4]]));
    assert!((diagonal.condition(&all(3)) - 1.0).abs() < 1e-12);
    // Two unit columns at an angle with cosine c: sqrt((1 + c)/(1 - c)).
    for cosine in [0.0f64, 0.5, -0.9, 0.999_999] {
        let sine = (1.0 - cosine * cosine).sqrt();
        let pair = fold(&matrix(&[&[2.0, 30.0 * cosine], &[0.0, 30.0 * sine]]));
        let expected = ((1.0 + cosine.abs()) / (1.0 - cosine.abs())).sqrt();
        let got = pair.condition(&all(2));
        assert!((got / expected - 1.0).abs() < 1e-6, "{got} for {expected}");
    }
    // The Hilbert matrix of order 5 has 4.766e5; with columns of unit norm 292,433.243 (mpmath, 40 digits).
    let hilbert: Vec<Vec<f64>> =
        (0..5).map(|i| (0..5).map(|j| 1.0 / f64::from(i + j + 1)).collect()).collect();
    let got = fold(&hilbert).condition(&all(5));
    assert!((got / 292_433.243_054 - 1.0).abs() < 1e-6, "{got}");
    assert_eq!(fold(&hilbert).condition(&[]), 1.0);
    assert!((fold(&hilbert).condition(&[3]) - 1.0).abs() < 1e-12);
    // Dependent columns, and one that is zero.
    assert!(fold(&matrix(&[&[1.0, 2.0], &[1.0, 2.0], &[0.5, 1.0]])).condition(&all(2)) > 1e15);
    assert_eq!(fold(&matrix(&[&[1.0, 0.0], &[1.0, 0.0]])).condition(&all(2)), f64::INFINITY);
}

/// Regression test: the inverse of the normal matrix cancels if columns are nearly equal, and true terms were removed.
#[test]
fn backward_elimination_survives_columns_that_are_nearly_the_same() {
    for near in [1e-3, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9] {
        for seed in 0..20 {
            let mut rows = wild_matrix(400, 6);
            for (i, row) in rows.iter_mut().enumerate() {
                // Near copies of the first and of the third column.
                let (a, b) = (row[0] + near * row[4], row[2] + near * row[5]);
                let noise = 0.01 * wild(90_000 + 1000 * seed + i);
                let target = 2.0 * row[0] - row[2] + 0.05 * row[3] + noise;
                *row = vec![row[0], row[1], row[2], row[3], a, b, target];
            }
            let solution = stepwise(&fold(&rows), 6, 6, 0.05);
            let kept: Vec<usize> = (0..6).filter(|&j| solution.coefficients[j] != 0.0).collect();
            let sums = [0, 2].map(|j| solution.coefficients[j] + solution.coefficients[4 + j / 2]);
            let what = format!("{near:e}, {seed}: {:?}", solution.coefficients);
            assert!(kept.len() == 3 && kept.contains(&3), "{what}");
            assert!((sums[0] - 2.0).abs() < 0.01 && (sums[1] + 1.0).abs() < 0.01, "{what}");
        }
    }
}

/// Regression test: the reflector of a column of 1e-160 was infinite, and every coefficient became zero.
#[test]
fn a_column_with_tiny_initial_values_is_harmless() {
    for tiny in [1e-80, 1e-145, 1e-160, 1e-200, 1e-310] {
        let mut factor = QrFactor::new(3);
        let mut block = vec![0.0; 3 * BLOCK_ROWS];
        for i in 0..BLOCK_ROWS {
            (block[i], block[BLOCK_ROWS + i]) = (tiny * (i as f64 + 1.0).sin(), 1.0 + i as f64);
            block[2 * BLOCK_ROWS + i] = 3.0 * block[BLOCK_ROWS + i];
        }
        factor.append_rows(&mut block, BLOCK_ROWS);
        assert!(factor.is_finite(), "{tiny:e}");
        for i in 0..BLOCK_ROWS {
            (block[i], block[BLOCK_ROWS + i]) = ((i as f64).cos(), (0.3 * i as f64).sin());
            block[2 * BLOCK_ROWS + i] = 2.0 * block[i] + 3.0 * block[BLOCK_ROWS + i];
        }
        factor.append_rows(&mut block, BLOCK_ROWS);
        let x = factor.solve(&[0, 1], 2).coefficients;
        assert!((x[0] - 2.0).abs() < 1e-9 && (x[1] - 3.0).abs() < 1e-9, "{tiny:e}: {x:?}");
    }
}
