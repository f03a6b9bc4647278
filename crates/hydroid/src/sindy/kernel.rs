//! How a log becomes rows of a regression.
//!
//! Every regression of `dy/dt = Xi theta(y, c)` used here is linear in the outputs on the left and in the
//! library on the right: a row is
//!
//! ```text
//! sum_j g_j y_{i+j}  =  Xi sum_j w_j theta_{i+j}
//! ```
//!
//! with weights `g` (1/s) and `w`, where `theta_k` is the library at sample `k` or between samples `k` and
//! `k + 1`. A new regression is a new pair of weights.

/// Where the library is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Nodes {
    /// At the samples: `theta(y_k, c_k)`.
    Samples,
    /// In the middle of the intervals: `theta((y_k + y_{k+1})/2, c_k)`, the command being the one that was
    /// held over the interval.
    Midpoints,
}

/// Weights of one kind of row.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    /// Weights `g` of the outputs \[1/s\].
    pub outputs: Vec<f64>,
    /// Weights `w` of the library.
    pub library: Vec<f64>,
}

/// The regression that the coefficients come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Regression {
    /// Increments over `intervals` samples against the library averaged over the same intervals, each
    /// evaluated at its mid-state and its own held command. With one interval this is the zero-order-hold
    /// midpoint rule `(y_{k+1} - y_k)/dt = Xi theta((y_k + y_{k+1})/2, c_k)`, of second order in `dt` and,
    /// unlike central differences, right about which command moved what. More intervals average the
    /// measurement noise.
    Midpoint {
        /// Number of intervals in an increment, at least 1.
        intervals: usize,
    },
    /// Central differences `(y_{k+1} - y_{k-1})/(2 dt) = Xi theta(y_k, c_k)`, one-sided of second order at
    /// the ends of a run: what PySINDy does by default. It spans two held commands and sees one; here for
    /// comparison.
    Central,
}

impl Default for Regression {
    fn default() -> Self {
        Self::Midpoint { intervals: 1 }
    }
}

/// One kind of row and the positions where it is used.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// The weights.
    pub kernel: Kernel,
    /// Index of the first sample of the first row.
    pub first: usize,
    /// Number of rows.
    pub count: usize,
    /// Samples between the starts of two rows.
    pub stride: usize,
}

impl Regression {
    /// Where the library is evaluated.
    pub fn nodes(self) -> Nodes {
        match self {
            Self::Midpoint { .. } => Nodes::Midpoints,
            Self::Central => Nodes::Samples,
        }
    }

    /// All rows that a run of `len` samples with sample time `dt` gives; empty where it is too short.
    pub fn rows(self, len: usize, dt: f64) -> Vec<Rows> {
        match self {
            Self::Midpoint { intervals } => {
                let m = intervals.max(1);
                if len <= m {
                    return Vec::new();
                }
                let mut outputs = vec![0.0; m + 1];
                outputs[0] = -1.0 / (m as f64 * dt);
                outputs[m] = -outputs[0];
                let kernel = Kernel { outputs, library: vec![1.0 / m as f64; m] };
                // Increments that overlap by three quarters use nearly all that the samples say.
                let stride = (m / 4).max(1);
                vec![Rows { kernel, first: 0, count: (len - m - 1) / stride + 1, stride }]
            }
            Self::Central => {
                if len < 3 {
                    return Vec::new();
                }
                let h = 0.5 / dt;
                let kernel = |outputs: [f64; 3], library: &[f64]| Kernel {
                    outputs: outputs.to_vec(),
                    library: library.to_vec(),
                };
                let row = |kernel, first, count| Rows { kernel, first, count, stride: 1 };
                vec![
                    row(kernel([-3.0 * h, 4.0 * h, -h], &[1.0]), 0, 1),
                    row(kernel([-h, 0.0, h], &[0.0, 1.0]), 0, len - 2),
                    row(kernel([h, -4.0 * h, 3.0 * h], &[0.0, 0.0, 1.0]), len - 3, 1),
                ]
            }
        }
    }
}
