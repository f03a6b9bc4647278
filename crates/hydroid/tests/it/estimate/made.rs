//! Synthetic runs, and an independent dense solver.

use hydroid::log::{Channel, Table, Trajectory};
use hydroid::sindy::{Constraints, FitOptions, Optimizer};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

pub(crate) fn table(prefix: &str, rows: &[Vec<f64>]) -> Table {
    let width = rows.first().map_or(0, Vec::len);
    let channels: Vec<Channel> = (0..width).map(|j| Channel::new(format!("{prefix}{j}"), "")).collect();
    Table::new(channels, rows.concat())
}

pub(crate) fn run(dt: f64, outputs: &[Vec<f64>], inputs: &[Vec<f64>]) -> Trajectory {
    let (outputs, inputs) = (table("y", outputs), table("c", inputs));
    Trajectory {
        name: String::from("made"),
        t0: 0.0,
        dt,
        outputs,
        inputs,
        truth: None,
        heading: None,
        position: None,
    }
}

pub(crate) struct Normal(ChaCha8Rng);

impl Normal {
    pub(crate) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub(crate) fn next(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
}

pub(crate) const DT: f64 = 0.1;

/// `y' = -y + c` by the midpoint rule, with noise of deviation `process` on the derivative; the command is held for ten
/// samples.
pub(crate) fn driven(samples: usize, process: f64, seed: u64) -> Trajectory {
    let mut normal = Normal::new(seed);
    let (mut y, mut c) = (0.0, 0.0);
    let (mut rows, mut commands) = (Vec::new(), Vec::new());
    for k in 0..samples {
        if k % 10 == 0 {
            c = normal.next();
        }
        rows.push(vec![y]);
        commands.push(vec![c]);
        // (y+ - y)/dt = -(y + y+)/2 + c + w
        y = ((1.0 - DT / 2.0) * y + DT * (c + process * normal.next())) / (1.0 + DT / 2.0);
    }
    run(DT, &rows, &commands)
}

pub(crate) fn options(optimizer: Optimizer) -> FitOptions {
    FitOptions { optimizer, ridge: 0.0, substeps: 1, constraints: Constraints::default() }
}

/// Gaussian elimination with partial pivoting; none for a singular matrix.
pub(crate) fn solve(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Option<Vec<f64>> {
    let n = b.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))?;
        if a[pivot][k].abs() < 1e-12 {
            return None;
        }
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
    Some(b)
}
