//! Minimisation without derivatives: the simplex of Nelder and Mead, Computer Journal 7 (1965) 308.

/// Stopping criteria of the Nelder-Mead simplex method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NelderMeadOptions {
    /// Stop if the values at the corners differ by less.
    pub spread: f64,
    /// Maximum number of evaluations.
    pub evaluations: usize,
}

/// Minimiser near `start` and its value, from an initial simplex with the edge `edge[i]` along variable `i`.
/// A value that is not finite counts as infinite.
pub fn nelder_mead(
    mut f: impl FnMut(&[f64]) -> f64,
    start: &[f64],
    edge: &[f64],
    stop: NelderMeadOptions,
) -> (Vec<f64>, f64) {
    let n = start.len();
    let mut count = 0;
    let mut value = |x: &[f64]| {
        count += 1;
        let y = f(x);
        (if y.is_finite() { y } else { f64::INFINITY }, count)
    };
    let mut corners: Vec<(f64, Vec<f64>)> = vec![(value(start).0, start.to_vec())];
    if n == 0 {
        return (Vec::new(), corners[0].0);
    }
    for (i, edge) in edge.iter().enumerate() {
        let mut x = start.to_vec();
        x[i] += edge;
        corners.push((value(&x).0, x));
    }
    let mut evaluations = n + 1;
    while evaluations < stop.evaluations {
        corners.sort_by(|a, b| a.0.total_cmp(&b.0));
        if corners[n].0 - corners[0].0 < stop.spread {
            break;
        }
        let centre: Vec<f64> =
            (0..n).map(|j| corners[..n].iter().map(|(_, x)| x[j]).sum::<f64>() / n as f64).collect();
        let worst = corners[n].clone();
        let along = |share: f64| -> Vec<f64> {
            centre.iter().zip(&worst.1).map(|(c, w)| c + share * (w - c)).collect()
        };
        let mut try_at = |share: f64| {
            let x = along(share);
            let (y, so_far) = value(&x);
            evaluations = so_far;
            (y, x)
        };
        let reflected = try_at(-1.0);
        let better = if reflected.0 < corners[0].0 {
            let expanded = try_at(-2.0);
            Some(if expanded.0 < reflected.0 { expanded } else { reflected })
        } else if reflected.0 < corners[n - 1].0 {
            Some(reflected)
        } else {
            let contracted = try_at(if reflected.0 < worst.0 { -0.5 } else { 0.5 });
            (contracted.0 < worst.0.min(reflected.0)).then_some(contracted)
        };
        if let Some(better) = better {
            corners[n] = better;
            continue;
        }
        // No point on the line is better: all corners move half way to the best.
        let best = corners[0].1.clone();
        for corner in &mut corners[1..] {
            for (x, b) in corner.1.iter_mut().zip(&best) {
                *x = 0.5 * (*x + b);
            }
            let (y, so_far) = value(&corner.1);
            corner.0 = y;
            evaluations = so_far;
        }
    }
    corners.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (y, x) = corners.swap_remove(0);
    (x, y)
}
