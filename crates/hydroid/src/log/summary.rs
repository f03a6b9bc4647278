//! Statistics of columns that are collected while a log is read.
//!
//! Values are collected in blocks of fixed size, whose moments are joined by the formulas of Chan, Golub and `LeVeque`
//! ("Algorithms for computing the sample variance", The American Statistician 37 (1983) 242). The result does not depend
//! on the parts in which the values arrive.

/// Values of one block.
const BLOCK: usize = 1024;

/// Statistics of one column; NaN is a missing value.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Summary {
    rows: usize,
    moments: Moments<1>,
    block: Vec<[f64; 1]>,
    pub(super) min: f64,
    pub(super) max: f64,
    /// First row with a value.
    pub(super) first: Option<usize>,
    missing_now: usize,
    pub(super) longest_missing: usize,
    /// Pairs of successive rows with values, and those with equal values.
    pub(super) pairs: usize,
    pub(super) repeats: usize,
    last: f64,
}

impl Default for Summary {
    fn default() -> Self {
        Self {
            rows: 0,
            moments: Moments::default(),
            block: Vec::new(),
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
            first: None,
            missing_now: 0,
            longest_missing: 0,
            pairs: 0,
            repeats: 0,
            last: f64::NAN,
        }
    }
}

impl Summary {
    pub(super) fn of(values: &[f64]) -> Self {
        let mut summary = Self::default();
        summary.extend(values);
        summary.finish();
        summary
    }

    pub(super) fn extend(&mut self, values: &[f64]) {
        for &x in values {
            if x.is_nan() {
                self.missing_now += 1;
                self.longest_missing = self.longest_missing.max(self.missing_now);
            } else {
                self.missing_now = 0;
                self.first.get_or_insert(self.rows);
                (self.min, self.max) = (self.min.min(x), self.max.max(x));
                if !self.last.is_nan() {
                    self.pairs += 1;
                    self.repeats += usize::from(x == self.last);
                }
                self.block.push([x]);
                if self.block.len() == BLOCK {
                    self.moments.join(&mut self.block);
                }
            }
            self.last = x;
            self.rows += 1;
        }
    }

    pub(super) fn finish(&mut self) {
        self.moments.join(&mut self.block);
    }

    /// Rows, and those with a value.
    pub(super) fn counts(&self) -> (usize, usize) {
        (self.rows, self.moments.count)
    }

    /// Mean and variance (division by the number of values).
    pub(super) fn mean_and_variance(&self) -> (f64, f64) {
        (self.moments.mean()[0], self.moments.products[0][0] / self.moments.count as f64)
    }

    /// Whether all values are equal.
    pub(super) fn is_constant(&self) -> bool {
        self.min == self.max
    }
}

/// Statistics of the rows in which both of two columns have values.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct PairSummary {
    moments: Moments<2>,
    block: Vec<[f64; 2]>,
}

impl PairSummary {
    pub(super) fn of(a: &[f64], b: &[f64]) -> Self {
        let mut summary = Self::default();
        summary.extend(a, b);
        summary.finish();
        summary
    }

    pub(super) fn extend(&mut self, a: &[f64], b: &[f64]) {
        for (&a, &b) in a.iter().zip(b).filter(|(a, b)| !a.is_nan() && !b.is_nan()) {
            self.block.push([a, b]);
            if self.block.len() == BLOCK {
                self.moments.join(&mut self.block);
            }
        }
    }

    pub(super) fn finish(&mut self) {
        self.moments.join(&mut self.block);
    }

    pub(super) fn count(&self) -> usize {
        self.moments.count
    }

    /// Pearson correlation; not finite for a constant column.
    pub(super) fn correlation(&self) -> f64 {
        let [[aa, ab], [_, bb]] = self.moments.products;
        ab / (aa * bb).sqrt()
    }
}

/// Number, sums, and sums of products of the deviations from the means.
#[derive(Clone, Debug, PartialEq)]
struct Moments<const N: usize> {
    count: usize,
    sum: [f64; N],
    products: [[f64; N]; N],
}

impl<const N: usize> Default for Moments<N> {
    fn default() -> Self {
        Self { count: 0, sum: [0.0; N], products: [[0.0; N]; N] }
    }
}

impl<const N: usize> Moments<N> {
    fn of(block: &[[f64; N]]) -> Self {
        let mut moments = Self { count: block.len(), ..Self::default() };
        for row in block {
            (0..N).for_each(|i| moments.sum[i] += row[i]);
        }
        let mean = moments.mean();
        for row in block {
            for i in 0..N {
                for j in 0..N {
                    moments.products[i][j] += (row[i] - mean[i]) * (row[j] - mean[j]);
                }
            }
        }
        moments
    }

    fn mean(&self) -> [f64; N] {
        self.sum.map(|sum| sum / self.count as f64)
    }

    /// Joins the moments of a block, and empties it.
    fn join(&mut self, block: &mut Vec<[f64; N]>) {
        if block.is_empty() {
            return;
        }
        let other = Self::of(block);
        block.clear();
        if self.count == 0 {
            *self = other;
            return;
        }
        let (n, m) = (self.count as f64, other.count as f64);
        let (own_mean, mean) = (self.mean(), other.mean());
        let difference: [f64; N] = std::array::from_fn(|i| mean[i] - own_mean[i]);
        for i in 0..N {
            for j in 0..N {
                let between = difference[i] * difference[j] * n * m / (n + m);
                self.products[i][j] += other.products[i][j] + between;
            }
            self.sum[i] += other.sum[i];
        }
        self.count += other.count;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_the_definition_and_do_not_depend_on_the_parts() {
        let value = |k: usize| 1e6 + f64::from(u32::try_from(k * 7_919 % 1_000).unwrap());
        let mut a: Vec<f64> = (0..5_000).map(value).collect();
        let b: Vec<f64> = a.iter().map(|x| 0.5 - x).collect();
        a[7] = f64::NAN;
        let whole = Summary::of(&a);
        let mut parts = Summary::default();
        a.chunks(37).for_each(|part| parts.extend(part));
        parts.finish();
        assert_eq!(format!("{whole:?}"), format!("{parts:?}"));
        let known: Vec<f64> = a.iter().copied().filter(|x| !x.is_nan()).collect();
        let mean = known.iter().sum::<f64>() / known.len() as f64;
        let variance = known.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / known.len() as f64;
        let (found_mean, found_variance) = whole.mean_and_variance();
        assert!((found_mean / mean - 1.0).abs() < 1e-14 && (found_variance / variance - 1.0).abs() < 1e-12);
        assert_eq!((whole.counts(), whole.longest_missing, whole.first), ((5_000, 4_999), 1, Some(0)));
        let pair = PairSummary::of(&a, &b);
        assert_eq!(pair.count(), 4_999);
        assert!((pair.correlation() + 1.0).abs() < 1e-12);
    }
}
