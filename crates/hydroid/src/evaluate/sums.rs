//! Error measures: MAE, RMSE, NRMSE and the largest error.

#[derive(Clone, Debug)]
pub(super) struct Sums {
    cells: Vec<Cell>,
}

/// Sums of one horizon and channel.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    count: f64,
    absolute: f64,
    square: f64,
    largest: f64,
    kept_absolute: f64,
    kept_square: f64,
    /// Of the target minus an offset near its mean, which avoids cancellation in the variance.
    value: f64,
    value_square: f64,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Figures {
    pub(super) mae: f64,
    pub(super) max: f64,
    pub(super) rmse: f64,
    pub(super) nrmse: f64,
    pub(super) kept_mae: f64,
    pub(super) kept_rmse: f64,
    pub(super) kept_nrmse: f64,
}

impl Sums {
    pub(super) fn new(cells: usize) -> Self {
        Self { cells: vec![Cell::default(); cells] }
    }

    pub(super) fn len(&self) -> usize {
        self.cells.len()
    }

    /// Adds one comparison; a missing target is skipped.
    pub(super) fn add(&mut self, cell: usize, predicted: f64, kept: f64, target: f64, shift: f64) {
        if target.is_nan() {
            return;
        }
        let (error, kept_error) = ((predicted - target).abs(), (kept - target).abs());
        let value = target - shift;
        let c = &mut self.cells[cell];
        c.count += 1.0;
        c.absolute += error;
        c.square += error * error;
        c.largest = c.largest.max(error);
        c.kept_absolute += kept_error;
        c.kept_square += kept_error * kept_error;
        c.value += value;
        c.value_square += value * value;
    }

    pub(super) fn merge(&mut self, other: &Self) {
        for (a, b) in self.cells.iter_mut().zip(&other.cells) {
            a.count += b.count;
            a.absolute += b.absolute;
            a.square += b.square;
            a.largest = a.largest.max(b.largest);
            a.kept_absolute += b.kept_absolute;
            a.kept_square += b.kept_square;
            a.value += b.value;
            a.value_square += b.value_square;
        }
    }

    /// Mean over all comparisons of the square error over the variance of the channel.
    pub(super) fn loss(&self, variance: &[f64]) -> f64 {
        let mut sum = 0.0;
        let mut count = 0.0;
        for (cell, variance) in self.cells.iter().zip(variance.iter().cycle()) {
            sum += cell.square / variance;
            count += cell.count;
        }
        if count > 0.0 { sum / count } else { 0.0 }
    }

    pub(super) fn figures(&self, cell: usize) -> Figures {
        let c = self.cells[cell];
        let mean = |sum: f64| if c.count > 0.0 { sum / c.count } else { f64::NAN };
        let variance = mean(c.value_square) - mean(c.value).powi(2);
        // The NRMSE of a constant channel is undefined.
        let noise = 1e-12 * mean(c.value_square);
        let deviation = if variance > noise { variance.sqrt() } else { f64::NAN };
        let (rmse, kept_rmse) = (mean(c.square).sqrt(), mean(c.kept_square).sqrt());
        Figures {
            mae: mean(c.absolute),
            max: if c.count > 0.0 { c.largest } else { f64::NAN },
            rmse,
            nrmse: rmse / deviation,
            kept_mae: mean(c.kept_absolute),
            kept_rmse,
            kept_nrmse: kept_rmse / deviation,
        }
    }
}
