//! Regressions for the estimate of delays: one with a common delay, one for each input separately.
//!
//! In the regression of one input only its own two columns depend on the delay. The products of all other columns
//! are therefore computed once, and the products of the columns of all delays in one pass per input. The cost is
//! quadratic in the number of inputs; long logs are thinned.

use super::super::trajectory::{Table, Trajectory};

/// Searched delays \[samples\].
pub(super) const EARLIEST: i64 = -10;
pub(super) const LATEST: i64 = 40;
const DELAYS: usize = 51;
/// Largest number of rows of a regression; more rows are thinned evenly.
const MOST_ROWS: usize = 8_000;
/// Largest number of products of one regression; it limits the rows if there are many inputs.
const MOST_PRODUCTS: usize = 40_000_000;
/// Largest number of inputs for which delays are estimated; more inputs cannot be separated.
const MOST_INPUTS: usize = 100;
/// Smallest number of rows per term of a regression.
const ROWS_PER_TERM: usize = 5;

/// Data of the regressions, common to all delays: one set of samples for each row.
pub(super) struct Problem {
    /// Number of outputs and of inputs.
    states: usize,
    inputs: usize,
    /// Each output at the row and after it, row-major.
    present: Vec<[f64; 2]>,
    /// Each input at all delays, from the smallest one, row-major.
    delayed: Vec<[f64; DELAYS]>,
}

impl Problem {
    pub(super) fn new(runs: &[Trajectory], window: usize) -> Option<Self> {
        let (states, inputs) = (runs[0].outputs.width(), runs[0].inputs.width());
        let (before, after) = (usize::try_from(LATEST).ok()?, usize::try_from(-EARLIEST).ok()?);
        let terms = 1 + 2 * states + 2 * inputs;
        if inputs > MOST_INPUTS {
            return None;
        }
        let rows = || {
            let rows = |(i, run)| usable_rows(run, window, before, after).map(move |k| (i, k));
            runs.iter().enumerate().flat_map(rows)
        };
        let fewest = 200.max(ROWS_PER_TERM * terms);
        let most = (MOST_PRODUCTS / (terms + states).pow(2)).max(2 * fewest).min(MOST_ROWS);
        let stride = rows().count().div_ceil(most).max(1);
        let rows: Vec<_> = rows().step_by(stride).collect();
        if rows.len() < fewest {
            return None;
        }
        let scaled = |t: &Table| (0..t.width()).map(|c| unit_size(|| t.column(c))).collect::<Vec<f64>>();
        let scales: Vec<[Vec<f64>; 2]> =
            runs.iter().map(|run| [scaled(&run.outputs), scaled(&run.inputs)]).collect();
        // Moving averages over `window` samples, of channels of unit size.
        let average = |table: &Table, c: usize, scale: f64, k: usize| {
            (k..k + window).map(|k| table.row(k)[c] / scale).sum::<f64>() / window as f64
        };
        let mut problem = Self { states, inputs, present: Vec::new(), delayed: Vec::new() };
        for (i, k) in rows {
            let (run, [of_outputs, of_inputs]) = (&runs[i], &scales[i]);
            for (c, scale) in of_outputs.iter().enumerate() {
                problem.present.push([k, k + 1].map(|k| average(&run.outputs, c, *scale, k)));
            }
            for (c, scale) in of_inputs.iter().enumerate() {
                let at = |d: usize| average(&run.inputs, c, *scale, k + after - d);
                problem.delayed.push(std::array::from_fn(at));
            }
        }
        Some(problem)
    }

    fn rows(&self) -> usize {
        self.present.len() / self.states
    }

    /// Number of rows minus number of terms.
    pub(super) fn free(&self) -> f64 {
        let terms = 1 + 2 * self.states + 2 * self.inputs;
        self.rows().saturating_sub(terms).max(1) as f64
    }

    /// Residual variance over the variance of the increments, mean over outputs; a delay of `None` omits the input.
    pub(super) fn residual(&self, delays: &[Option<i64>]) -> f64 {
        let (design, terms, width) = self.design(delays);
        residual_share(&mut gram(&design, width), width, terms)
    }

    /// Regression matrix (terms, then increments), row-major, with its number of terms and of columns.
    pub(super) fn design(&self, delays: &[Option<i64>]) -> (Vec<f64>, usize, usize) {
        let used: Vec<(usize, usize)> = delays
            .iter()
            .enumerate()
            .filter_map(|(i, d)| Some((i, usize::try_from((*d)? - EARLIEST).ok()?)))
            .collect();
        let terms = 1 + 2 * self.states + 2 * used.len();
        let width = terms + self.states;
        let mut design = Vec::with_capacity(width * self.rows());
        for row in 0..self.rows() {
            let present = &self.present[row * self.states..(row + 1) * self.states];
            design.push(1.0);
            for [y, _] in present {
                design.extend([*y, y * y.abs()]);
            }
            for &(i, d) in &used {
                let x = self.delayed[row * self.inputs + i][d];
                design.extend([x, x * x.abs()]);
            }
            design.extend(present.iter().map(|[y, next]| next - y));
        }
        (design, terms, width)
    }
}

/// Regression with all inputs at the common delay except one.
pub(super) struct Fixed {
    design: Vec<f64>,
    gram: Vec<f64>,
    terms: usize,
    width: usize,
}

impl Fixed {
    pub(super) fn new(problem: &Problem, delay: i64) -> Self {
        let (design, terms, width) = problem.design(&vec![Some(delay); problem.inputs]);
        let gram = gram(&design, width);
        Self { design, gram, terms, width }
    }

    /// Residuals with one input at each delay, and without this input.
    pub(super) fn scan(&self, problem: &Problem, input: usize) -> (Vec<f64>, f64) {
        let (terms, width) = (self.terms, self.width);
        let states = width - terms;
        let own = terms - 2 * problem.inputs + 2 * input;
        let (cross, moving) = self.cross(problem, input);
        // Columns: constant terms, two per delay, increments. Products between different delays are not needed.
        let kept: Vec<usize> = (0..terms).filter(|a| *a != own && *a != own + 1).collect();
        let columns = kept.len() + 2 * DELAYS + states;
        let (delays_at, targets_at) = (kept.len(), kept.len() + 2 * DELAYS);
        let mut stays = vec![0.0; kept.len() * columns];
        for (row, &a) in kept.iter().enumerate() {
            let line = &mut stays[row * columns..(row + 1) * columns];
            for (to, &b) in kept.iter().enumerate().skip(row) {
                line[to] = self.gram[a * width + b];
            }
            for n in 0..2 * DELAYS {
                line[delays_at + n] = cross[n * width + a];
            }
            line[targets_at..].copy_from_slice(&self.gram[a * width + terms..(a + 1) * width]);
        }
        // One Gram matrix per delay: two columns of the input, then the increments.
        let small = 2 + states;
        let target = |i: usize| self.gram[(terms + i) * (width + 1)];
        let mut parts = vec![0.0; DELAYS * small * small];
        for (d, part) in parts.chunks_exact_mut(small * small).enumerate() {
            (part[0], part[1], part[small + 1]) = moving[d];
            for i in 0..states {
                for n in 0..2 {
                    part[n * small + 2 + i] = cross[(2 * d + n) * width + terms + i];
                }
                part[(2 + i) * (small + 1)] = target(i);
            }
        }
        let sizes: Vec<f64> = parts
            .chunks_exact(small * small)
            .flat_map(|part| (0..small).map(|a| part[a * (small + 1)]))
            .collect();
        let before: Vec<f64> = (0..kept.len()).map(|row| stays[row * columns + row]).collect();
        let mut pivot_row = vec![0.0; columns];
        for p in 0..kept.len() {
            pivot_row.copy_from_slice(&stays[p * columns..(p + 1) * columns]);
            let pivot = pivot_row[p];
            if pivot <= NOTHING_NEW * before[p] {
                continue;
            }
            for a in p + 1..kept.len() {
                let factor = pivot_row[a] / pivot;
                let line = &mut stays[a * columns + a..(a + 1) * columns];
                for (x, y) in line.iter_mut().zip(&pivot_row[a..]) {
                    *x -= factor * y;
                }
            }
            for (d, part) in parts.chunks_exact_mut(small * small).enumerate() {
                let of = |a: usize| pivot_row[if a < 2 { delays_at + 2 * d + a } else { targets_at + a - 2 }];
                for a in 0..small {
                    let factor = of(a) / pivot;
                    for b in a..small {
                        part[a * small + b] -= factor * of(b);
                    }
                }
            }
        }
        let without: Vec<f64> = (2..small).map(|a| parts[a * (small + 1)]).collect();
        let without = mean_share(without.into_iter().zip((0..states).map(target)));
        let scores = parts
            .chunks_exact_mut(small * small)
            .zip(sizes.chunks_exact(small))
            .map(|(part, before)| {
                eliminate(part, small, 2, before);
                mean_share((2..small).map(|a| (part[a * (small + 1)], before[a])))
            })
            .collect();
        (scores, without)
    }

    /// Products of the two columns of an input at every delay with all columns, row-major, and among the two:
    /// square, mixed, square.
    pub(super) fn cross(&self, problem: &Problem, input: usize) -> (Vec<f64>, Vec<(f64, f64, f64)>) {
        let width = self.width;
        let mut cross = vec![0.0; 2 * DELAYS * width];
        let mut moving = vec![(0.0, 0.0, 0.0); DELAYS];
        let mut block = vec![[0.0; TOGETHER]; 2 * DELAYS];
        let delayed = problem.delayed.chunks(TOGETHER * problem.inputs);
        for (rows, delayed) in self.design.chunks(TOGETHER * width).zip(delayed) {
            for (r, delayed) in delayed.chunks_exact(problem.inputs).enumerate() {
                for (d, x) in delayed[input].iter().enumerate() {
                    let square = x * x.abs();
                    (block[2 * d][r], block[2 * d + 1][r]) = (*x, square);
                    moving[d].0 += x * x;
                    moving[d].1 += x * square;
                    moving[d].2 += square * square;
                }
            }
            for (x, sums) in block.iter().zip(cross.chunks_exact_mut(width)) {
                add_products(sums, x, rows, width, 0);
            }
        }
        (cross, moving)
    }
}

const TOGETHER: usize = 4;

/// Adds to `sums` the products of one column with the columns `from..` over a block of rows.
fn add_products(sums: &mut [f64], column: &[f64; TOGETHER], rows: &[f64], width: usize, from: usize) {
    if rows.len() == TOGETHER * width {
        let [p, q, r, s] = [0, 1, 2, 3].map(|i| &rows[i * width + from..(i + 1) * width]);
        for ((((sum, p), q), r), s) in sums.iter_mut().zip(p).zip(q).zip(r).zip(s) {
            *sum += (column[0] * p + column[1] * q) + (column[2] * r + column[3] * s);
        }
    } else {
        for (row, x) in rows.chunks_exact(width).zip(column) {
            for (sum, y) in sums.iter_mut().zip(&row[from..]) {
                *sum += x * y;
            }
        }
    }
}

fn gram(design: &[f64], width: usize) -> Vec<f64> {
    let mut gram = vec![0.0; width * width];
    for rows in design.chunks(TOGETHER * width) {
        for a in 0..width {
            let mut column = [0.0; TOGETHER];
            for (x, row) in column.iter_mut().zip(rows.chunks_exact(width)) {
                *x = row[a];
            }
            add_products(&mut gram[a * width + a..(a + 1) * width], &column, rows, width, a);
        }
    }
    gram
}

/// A term with this share of its diagonal left is linearly dependent on the terms before (a constant input).
const NOTHING_NEW: f64 = 1e-9;

/// Eliminates the first `terms` variables from an upper Gram matrix; `before` is its original diagonal.
fn eliminate(gram: &mut [f64], width: usize, terms: usize, before: &[f64]) {
    for p in 0..terms {
        let pivot = gram[p * width + p];
        if pivot <= NOTHING_NEW * before[p] {
            continue;
        }
        for a in p + 1..width {
            let factor = gram[p * width + a] / pivot;
            for b in a..width {
                gram[a * width + b] -= factor * gram[p * width + b];
            }
        }
    }
}

/// Mean share of the diagonal of an upper Gram matrix left after elimination of the first `terms` variables.
fn residual_share(gram: &mut [f64], width: usize, terms: usize) -> f64 {
    let before: Vec<f64> = (0..width).map(|i| gram[i * width + i]).collect();
    eliminate(gram, width, terms, &before);
    mean_share((terms..width).map(|i| (gram[i * width + i], before[i])))
}

/// Mean ratio of the diagonal after and before elimination, over positive entries.
fn mean_share(left_and_before: impl Iterator<Item = (f64, f64)>) -> f64 {
    let shares = left_and_before.filter(|(_, before)| *before > 0.0).map(|(left, b)| left.max(0.0) / b);
    let (sum, n) = shares.fold((0.0, 0_usize), |(sum, n), x| (sum + x, n + 1));
    sum / n.max(1) as f64
}

/// Samples with a value of all outputs from `k` to `k + window`, `before` samples after the beginning of a run and
/// `after` before the end of its moving averages.
fn usable_rows(
    run: &Trajectory,
    window: usize,
    before: usize,
    after: usize,
) -> impl Iterator<Item = usize> + '_ {
    let end = (run.len() + 1).saturating_sub(window + after.max(1));
    let missing = move |m: usize| run.outputs.row(m).iter().any(|y| y.is_nan());
    // The first sample without a missing value from it on.
    let mut known = (before..(before + window).min(run.len())).rfind(|&m| missing(m)).map_or(0, |m| m + 1);
    (before..end).filter(move |&k| {
        if missing(k + window) {
            known = k + window + 1;
        }
        known <= k
    })
}

/// Root mean square of a channel, so that quadratic terms have comparable size; 1 for a channel without one.
fn unit_size<I: Iterator<Item = f64>>(values: impl Fn() -> I) -> f64 {
    let known = || values().filter(|x| !x.is_nan());
    let n = known().count().max(1) as f64;
    let size = (known().map(|x| x * x).sum::<f64>() / n).sqrt();
    if size > 0.0 && size.is_finite() { size } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::super::super::trajectory::Channel;
    use super::super::delay::estimate;
    use super::*;

    /// Two outputs driven by three inputs with different delays; the third input equals the second.
    fn run(rows: usize) -> Trajectory {
        let mut state = 88_172_645_463_325_252_u64;
        let mut draw = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let mut levels = [0.0; 2];
        let commands: Vec<[f64; 2]> = (0..rows)
            .map(|k| {
                if k % 7 == 0 {
                    levels = [draw(), draw()];
                }
                levels
            })
            .collect();
        let mut state = [0.0, 0.0];
        let mut outputs = Vec::new();
        for k in 0..rows {
            outputs.extend(state);
            let (a, b) = (commands[k.saturating_sub(3)][0], commands[k.saturating_sub(9)][1]);
            state = [0.9 * state[0] + a + 0.3 * b, 0.8 * state[1] - 0.2 * a * a.abs() + b + 0.01 * draw()];
        }
        let inputs = commands.iter().flat_map(|c| [c[0], c[1], c[1]]).collect();
        let channels = |names: &[&str]| names.iter().map(|n| Channel::new(*n, "")).collect::<Vec<_>>();
        Trajectory {
            name: String::from("run"),
            t0: 0.0,
            dt: 0.1,
            outputs: Table::new(channels(&["u", "v"]), outputs),
            inputs: Table::new(channels(&["a", "b", "c"]), inputs),
            truth: None,
            heading: None,
            position: None,
        }
    }

    #[test]
    fn trying_one_input_at_a_time_is_the_regression_with_only_that_input_moved() {
        let problem = Problem::new(&[run(1_003)], 1).unwrap();
        assert!(!problem.rows().is_multiple_of(TOGETHER));
        let fixed = Fixed::new(&problem, 3);
        for input in 0..3 {
            let (scores, without) = fixed.scan(&problem, input);
            assert_eq!(scores.len(), DELAYS);
            let moved = |to: Option<i64>| {
                let delays: Vec<_> = (0..3).map(|j| if j == input { to } else { Some(3) }).collect();
                problem.residual(&delays)
            };
            assert!((without - moved(None)).abs() < 1e-9, "{without}");
            for (delay, score) in (EARLIEST..=LATEST).zip(scores) {
                let expected = moved(Some(delay));
                assert!((score - expected).abs() < 1e-9, "{input} at {delay}: {score} {expected}");
            }
        }
    }

    #[test]
    fn each_input_has_its_own_delay() {
        let found = estimate(&[run(3_000)], false);
        assert_eq!(found.per_input[0].as_ref().unwrap().samples, 3);
    }

    #[test]
    fn more_inputs_than_a_log_can_tell_apart_have_no_delay() {
        let mut run = run(400);
        let channels: Vec<Channel> = (0..60).map(|i| Channel::new(format!("n{i}"), "")).collect();
        let values = (0..400 * 60).map(|i| f64::from(i % 97)).collect();
        run.inputs = Table::new(channels, values);
        let found = estimate(&[run], false);
        assert!(found.common.is_none() && found.per_input.len() == 60);
    }
}
