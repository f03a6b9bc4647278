//! Forms of the regression: weak form (weak `SINDy`), increments, finite differences. Rows are weighted sums of samples.
//!
//! All regressions of `dy/dt = Xi theta(y, c)` are linear in the outputs and in the library. A row is
//!
//! ```text
//! sum_j g_j y_{i+j}  =  Xi sum_j w_j theta_{i+j}
//! ```
//!
//! with weights `g` (1/s) and `w`, and the library `theta_k` at sample `k` or between samples `k` and `k + 1`.

/// Where the library is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Nodes {
    /// At the samples: `theta(y_k, c_k)`.
    Samples,
    /// At the midpoints of the intervals: `theta((y_k + y_{k+1})/2, c_k)` with the command held over the interval.
    Midpoints,
}

/// Weights of a row.
#[derive(Clone, Debug, PartialEq)]
pub struct RowWeights {
    /// Weights `g` of the outputs \[1/s\].
    pub outputs: Vec<f64>,
    /// Weights `w` of the library.
    pub library: Vec<f64>,
}

/// Form of the regression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RegressionForm {
    /// Increments over `intervals` samples against the library averaged over the same intervals, each evaluated at its
    /// midpoint with its held command. One interval gives the midpoint rule with zero-order hold,
    /// `(y_{k+1} - y_k)/dt = Xi theta((y_k + y_{k+1})/2, c_k)`, of second order in `dt`; more intervals average the
    /// measurement noise.
    Midpoint {
        /// Number of intervals in an increment, at least 1.
        intervals: usize,
    },
    /// Central differences `(y_{k+1} - y_{k-1})/(2 dt) = Xi theta(y_k, c_k)`, one-sided of second order at the ends of
    /// a run, the default of PySINDy. A row spans two held commands and uses one. Provided for comparison.
    Central,
    /// The weak form: both sides are averaged over a window of `intervals` under the test function
    /// `phi(s) = (1 - s^2)^4`, which vanishes smoothly at both ends of the window (Messenger and Bortz, J. Comput.
    /// Phys. 443 (2021) 110525):
    ///
    /// ```text
    /// sum_k phi_k (y_{k+1} - y_k)/dt  =  Xi sum_k phi_k theta((y_k + y_{k+1})/2, c_k),   sum_k phi_k = 1
    /// ```
    ///
    /// with `phi_k` at the midpoint of interval `k`. Summation by parts weights the samples on the left with
    /// differences of `phi`. White noise of standard deviation `sigma` causes an error of about
    /// `5.9 sigma / (T sqrt(intervals))` in a row, where `T = intervals dt`. Data that satisfy the midpoint rule
    /// satisfy every row exactly, and each interval has its held command.
    Weak {
        /// Number of intervals in a window, at least 1.
        intervals: usize,
    },
    /// Derivative of the parabola fitted to `2 half + 1` samples, against the library at the middle sample (Savitzky
    /// and Golay, Anal. Chem. 36 (1964) 1627). Provided for comparison: only the left side is averaged, so that the
    /// noise of the middle sample biases the coefficients towards zero.
    Smoothed {
        /// Samples on either side of the middle one, at least 1.
        half: usize,
    },
}

impl Default for RegressionForm {
    fn default() -> Self {
        Self::Midpoint { intervals: 1 }
    }
}

/// Weights of a row and the positions of its use.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// The weights.
    pub kernel: RowWeights,
    /// Index of the first sample of the first row.
    pub first: usize,
    /// Number of rows.
    pub count: usize,
    /// Samples between the starts of consecutive rows.
    pub stride: usize,
}

impl RegressionForm {
    /// Where the library is evaluated.
    pub fn nodes(self) -> Nodes {
        match self {
            Self::Midpoint { .. } | Self::Weak { .. } => Nodes::Midpoints,
            Self::Central | Self::Smoothed { .. } => Nodes::Samples,
        }
    }

    /// Number of intervals of a row.
    pub fn window(self) -> usize {
        match self {
            Self::Midpoint { intervals } | Self::Weak { intervals } => intervals.max(1),
            Self::Central => 2,
            Self::Smoothed { half } => 2 * half.max(1),
        }
    }

    /// Samples between the starts of rows, which overlap by 3/4 (increments) or 7/8 (weak form) to use all information.
    pub fn stride(self) -> usize {
        match self {
            Self::Midpoint { intervals } => (intervals / 4).max(1),
            Self::Weak { intervals } => (intervals / 8).max(1),
            Self::Central | Self::Smoothed { .. } => 1,
        }
    }

    /// Effective number of independent rows among `rows` overlapping ones: the number of disjoint windows.
    pub fn effective_rows(self, rows: u64) -> f64 {
        (rows as f64 * self.stride() as f64 / self.window() as f64).max(1.0)
    }

    /// The weights of a row inside a run.
    pub fn kernel(self, dt: f64) -> RowWeights {
        match self {
            Self::Midpoint { .. } => {
                let m = self.window();
                let mut outputs = vec![0.0; m + 1];
                outputs[0] = -1.0 / (m as f64 * dt);
                outputs[m] = -outputs[0];
                RowWeights { outputs, library: vec![1.0 / m as f64; m] }
            }
            Self::Weak { .. } => {
                let m = self.window();
                let middle = |k: usize| (2 * k + 1) as f64 / m as f64 - 1.0;
                let bump: Vec<f64> = (0..m).map(|k| (1.0 - middle(k).powi(2)).powi(4)).collect();
                let sum: f64 = bump.iter().sum();
                let library: Vec<f64> = bump.iter().map(|phi| phi / sum).collect();
                let before = |j: usize| j.checked_sub(1).map_or(0.0, |k| library[k]);
                let after = |j: usize| library.get(j).copied().unwrap_or(0.0);
                let outputs = (0..=m).map(|j| (before(j) - after(j)) / dt).collect();
                RowWeights { outputs, library }
            }
            Self::Central => RowWeights { outputs: vec![-0.5 / dt, 0.0, 0.5 / dt], library: vec![0.0, 1.0] },
            Self::Smoothed { .. } => {
                let half = self.window() / 2;
                let offset = |j: usize| j as f64 - half as f64;
                let squares: f64 = (0..=2 * half).map(|j| offset(j).powi(2)).sum();
                let mut library = vec![0.0; half + 1];
                library[half] = 1.0;
                RowWeights { outputs: (0..=2 * half).map(|j| offset(j) / (squares * dt)).collect(), library }
            }
        }
    }

    /// All rows of a run of `len` samples with sample time `dt`; empty if the run is too short.
    pub fn rows(self, len: usize, dt: f64) -> Vec<Rows> {
        let (window, stride) = (self.window(), self.stride());
        if len <= window {
            return Vec::new();
        }
        let inner =
            Rows { kernel: self.kernel(dt), first: 0, count: (len - window - 1) / stride + 1, stride };
        if self != Self::Central {
            return vec![inner];
        }
        let h = 0.5 / dt;
        let end = |outputs: [f64; 3], library: &[f64], first| Rows {
            kernel: RowWeights { outputs: outputs.to_vec(), library: library.to_vec() },
            first,
            count: 1,
            stride,
        };
        vec![
            end([-3.0 * h, 4.0 * h, -h], &[1.0], 0),
            inner,
            end([h, -4.0 * h, 3.0 * h], &[0.0, 0.0, 1.0], len - 3),
        ]
    }
}
