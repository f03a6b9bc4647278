use hydroid::sindy::{BLOCK_ROWS, Criterion, QrFactor, stepwise_bidirectional};
use proptest::prelude::*;

use crate::estimate::made::{Normal, solve};

fn residual(rows: &[Vec<f64>], support: &[usize]) -> f64 {
    let target = rows[0].len() - 1;
    let dot = |i: usize, j: usize| rows.iter().map(|r| r[i] * r[j]).sum::<f64>();
    let normal = support.iter().map(|&i| support.iter().map(|&j| dot(i, j)).collect()).collect();
    let x = solve(normal, support.iter().map(|&i| dot(i, target)).collect()).unwrap();
    let fitted = |r: &Vec<f64>| support.iter().zip(&x).map(|(&j, x)| r[j] * x).sum::<f64>();
    rows.iter().map(|r| (r[target] - fitted(r)).powi(2)).sum()
}

#[test]
fn tolerances_are_those_of_the_criteria() {
    // For many rows the corrections vanish: n ln(RSS without / RSS with) = p at the limit.
    let n = 1e7;
    assert!((Criterion::Aic.tolerance(n, 3) * n - 2.0).abs() < 1e-5);
    assert!((Criterion::Bic.tolerance(n, 3) * n - n.ln()).abs() < 1e-3);
    // Few rows, by hand: n = 10, k = 2 against 1: 2 (2/7 - 1/8), and ln 10 (2/6 - 1/7).
    assert!((Criterion::Aic.tolerance(10.0, 2) - f64::exp_m1(2.0 * (2.0 / 7.0 - 1.0 / 8.0))).abs() < 1e-14);
    let bic = 10f64.ln() * (2.0 / 6.0 - 1.0 / 7.0);
    assert!((Criterion::Bic.tolerance(10.0, 2) - bic.exp_m1()).abs() < 1e-14);
    assert_eq!(Criterion::Bic.tolerance(10.0, 8), f64::INFINITY);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// No single addition or removal lowers the criterion, computed by its definition.
    #[test]
    fn no_single_term_improves_the_criterion(seed in 0u64..1_000_000, columns in 2usize..8, aic: bool) {
        let criterion = if aic { Criterion::Aic } else { Criterion::Bic };
        let mut normal = Normal::new(seed);
        let rows: Vec<Vec<f64>> = (0..60)
            .map(|_| {
                let mut row: Vec<f64> = (0..columns).map(|_| normal.next()).collect();
                // Correlated columns; two are true.
                row[1] = 0.8 * row[0] + 0.6 * row[1];
                row.push(row[0] - 0.5 * row[columns - 1] + normal.next());
                row
            })
            .collect();
        let mut triangle = QrFactor::new(columns + 1);
        let mut block = vec![0.0; (columns + 1) * BLOCK_ROWS];
        for (i, row) in rows.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                block[j * BLOCK_ROWS + i] = *value;
            }
        }
        triangle.append_rows(&mut block, rows.len());
        let n = rows.len() as f64;
        let solution = stepwise_bidirectional(&triangle, columns, columns, criterion, n);
        let support: Vec<usize> = (0..columns).filter(|&j| solution.coefficients[j] != 0.0).collect();
        let (penalty, slack) = if aic { (2.0, 1.0) } else { (n.ln(), 2.0) };
        let score = |support: &[usize]| {
            let k = support.len() as f64;
            n * residual(&rows, support).ln() + n * penalty * k / (n - k - slack)
        };
        let total: f64 = rows.iter().map(|row| row[columns].powi(2)).sum();
        let own = score(&support);
        let negligible = n * 1.1e-5 * total / residual(&rows, &support);
        for j in 0..columns {
            let other: Vec<usize> = if support.contains(&j) {
                support.iter().copied().filter(|k| *k != j).collect()
            } else {
                let mut more = support.clone();
                more.push(j);
                more
            };
            prop_assert!(score(&other) >= own - negligible, "{support:?} against {other:?}");
        }
    }
}
