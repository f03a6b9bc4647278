//! Curves for plots: few points that show all of a long series.

use serde::Serialize;

/// The lowest and the highest value of each part of a series, in the order of their times.
#[derive(Debug, Serialize)]
pub(crate) struct Series {
    pub(crate) name: String,
    pub(crate) unit: String,
    pub(crate) t: Vec<f64>,
    pub(crate) y: Vec<Option<f64>>,
}

impl Series {
    /// A series with at most two points for each of `parts` parts. A missing value breaks the curve.
    pub(crate) fn of(
        name: &str,
        unit: &str,
        len: usize,
        parts: usize,
        point: impl Fn(usize) -> (f64, f64),
    ) -> Self {
        let mut own = Self { name: name.to_owned(), unit: unit.to_owned(), t: Vec::new(), y: Vec::new() };
        let parts = parts.clamp(1, len.max(1));
        for part in 0..parts {
            let (from, to) = (part * len / parts, (part + 1) * len / parts);
            let points = || (from..to).map(&point).filter(|(t, _)| t.is_finite());
            let known = || points().filter(|(_, y)| y.is_finite());
            let low = known().min_by(|a, b| a.1.total_cmp(&b.1));
            let high = known().max_by(|a, b| a.1.total_cmp(&b.1));
            match (low, high) {
                (Some(low), Some(high)) => {
                    let (first, second) = if low.0 <= high.0 { (low, high) } else { (high, low) };
                    own.push(first);
                    if second.0 > first.0 {
                        own.push(second);
                    }
                }
                _ => {
                    if let Some((t, _)) = points().next() {
                        own.t.push(t);
                        own.y.push(None);
                    }
                }
            }
        }
        own
    }

    fn push(&mut self, (t, y): (f64, f64)) {
        self.t.push(t);
        self.y.push(Some(y));
    }
}
