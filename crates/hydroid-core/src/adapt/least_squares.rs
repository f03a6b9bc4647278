//! Recursive least squares with forgetting that cannot blow up.

use alloc::vec;
use alloc::vec::Vec;

use super::memory::{Reader, Writer};
use super::ud_factor::UdFactor;

/// Recursive least squares for several targets on one regressor.
///
/// At every row `phi` (n numbers), `z_i = phi' theta_i + noise` for each target `i`. The estimate minimises
///
/// ```text
/// sum_k lambda^(t-k) w_k (z_k - phi_k' theta)^2  +  r0 |theta - theta_0|^2
/// ```
///
/// with weights `w_k`, forgetting factor `lambda` per row, and a prior: the coefficients `theta_0` known
/// from shore, worth `r0` rows of unit regressors in each direction. The data are forgotten, **the prior is
/// not**. That is what bounds the covariance: exponential forgetting alone (Ljung, *System Identification*,
/// 2nd ed., section 11.2) lets `P` grow as `lambda^-t` in directions that are not excited, until noise decides
/// ("windup"; Fortescue, Kershenbaum, Ydstie 1981). Keeping the prior in the information matrix exactly,
/// `R <- lambda R + (1 - lambda) r0 I + w phi phi'`, is regularization in the sense of Gunnarsson (*On
/// covariance modification and regularization in recursive least squares identification*, IFAC SYSID 1994,
/// who so reads the `beta I` of Salgado, Goodwin, Middleton 1988), and costs `n^3`. Here, one coefficient
/// at a time, in turn, is given back what `n` rows have made the prior forget:
///
/// ```text
/// R <- lambda R + n (1 - lambda) r0 e_j e_j' + w phi phi'        j = t mod n
/// ```
///
/// a pseudo-measurement of `theta_j`, at the cost of half an ordinary row. By induction over the visits,
/// `R >= r0 lambda^(n-1) I` always, so that **no eigenvalue of `P` ever exceeds `lambda^(1-n) / r0`**,
/// whatever the data. The pseudo-measurement can say `theta_0` (a leak towards the shore-trained
/// coefficients, which makes the estimate that of the sum above) or the present `theta` (only the bound).
///
/// Measured against the alternatives on six tuning records (geometric mean of adapted over frozen error, 1 is no
/// gain; forgetting in 20 s and in 60 s; defaults of `hydroid adapt` otherwise):
///
/// | | 20 s | 60 s | rollouts diverged | vessel that does not change |
/// | --- | --- | --- | --- | --- |
/// | exponential forgetting, no bound | 0.811 | 0.764 | 30 and 1 | 2.14, 1.38 |
/// | no forgetting beyond the first trace of `P` | 0.764 | 0.765 | 0 | 1.01, 1.01 |
/// | this bound, no leak | 0.667 | 0.711 | 0 | 1.04, 1.01 |
/// | this bound, leak | 0.730 | 0.716 | 0 | 0.995, 0.995 |
///
/// With `lambda = 1` nothing is forgotten and the estimate is batch least squares with the ridge `r0`.
///
/// `P` is kept as `U D U'` ([`UdFactor`]): symmetric and positive whatever the rounding (Ljung, section 11.7).
#[derive(Clone, Debug)]
pub struct RecursiveLeastSquares {
    factor: UdFactor,
    /// The numbers that it began with.
    initial: Vec<f64>,
    /// Targets x coefficients.
    theta: Vec<f64>,
    prior: Vec<f64>,
    information: f64,
    /// Upper triangle `T` of a prior information `r0 T'T`, row by row; none for `r0 I`.
    r_factor: Option<Vec<f64>>,
    leak: bool,
    /// The coefficient (the row of the triangle) whose prior is restored next.
    turn: usize,
    innovations: Vec<f64>,
}

impl RecursiveLeastSquares {
    /// From coefficients (`targets x n`, row by row) that are worth `information > 0` rows of unit
    /// regressors. `leak`: whether forgotten coefficients return to these, or stay where they are.
    ///
    /// # Panics
    /// If the coefficients do not fill whole rows of `n`, or `information` is not a positive number.
    pub fn new(n: usize, coefficients: &[f64], information: f64, leak: bool) -> Self {
        assert!(n > 0 && coefficients.len().is_multiple_of(n), "coefficients do not fill whole rows");
        assert!(information > 0.0 && information.is_finite(), "the prior must be worth something");
        let factor = UdFactor::new(n, 1.0 / information);
        Self {
            initial: numbers(&factor),
            factor,
            theta: coefficients.to_vec(),
            prior: coefficients.to_vec(),
            information,
            r_factor: None,
            leak,
            turn: 0,
            innovations: vec![0.0; coefficients.len() / n],
        }
    }

    /// The same with a prior that knows some directions better than others: `information` rows whose second
    /// moments are `T'T`. `r_factor` is `T`, upper triangular, row by row, with no zero on its diagonal: the factor of
    /// the rows that the coefficients come from, say. What is forgotten of this prior is given back row by row
    /// of `T`, so that `R >= r0 lambda^(n-1) T'T` always.
    ///
    /// # Panics
    /// As [`new`](Self::new); if `r_factor` has not `n x n` numbers.
    pub fn with_r_factor(coefficients: &[f64], information: f64, r_factor: &[f64], leak: bool) -> Self {
        let n = r_factor.len().isqrt();
        let own = Self::new(n, coefficients, information, leak);
        let factor = UdFactor::inverse(r_factor, 1.0 / information);
        Self { initial: numbers(&factor), factor, r_factor: Some(r_factor.to_vec()), ..own }
    }

    /// How many numbers [`save`](Self::save) writes.
    pub(super) fn memory_len(&self) -> usize {
        self.factor.memory_len() + self.theta.len() + 1
    }

    /// Covariance, coefficients, and whose turn it is; a row that was met is not part of it.
    pub(super) fn save(&self, into: &mut Writer<'_>) {
        self.factor.save(into);
        into.numbers(&self.theta);
        into.count(self.turn);
    }

    pub(super) fn load(&mut self, from: &mut Reader<'_>) {
        self.factor.load(from);
        from.numbers(&mut self.theta);
        self.turn = from.count(self.len() - 1);
        self.innovations.fill(0.0);
    }

    /// The covariance is as at the start; the coefficients stay.
    pub fn restart(&mut self) {
        self.factor.load(&mut Reader::new(&self.initial));
        self.turn = 0;
    }

    /// Whether prior and covariance are of a size to compute with: [`UdFactor::is_sound`].
    pub fn is_sound(&self) -> bool {
        self.factor.is_sound() && self.theta.iter().all(|theta| theta.is_finite())
    }

    /// Number of coefficients of each target.
    pub fn len(&self) -> usize {
        self.factor.len()
    }

    /// Whether there are no targets.
    pub fn is_empty(&self) -> bool {
        self.theta.is_empty()
    }

    /// The coefficients, `targets x n`, row by row.
    pub fn coefficients(&self) -> &[f64] {
        &self.theta
    }

    /// The same, to go on from others.
    pub fn coefficients_mut(&mut self) -> &mut [f64] {
        &mut self.theta
    }

    /// `P_ij`, in units of the noise variance.
    pub fn covariance(&self, i: usize, j: usize) -> f64 {
        self.factor.covariance(i, j)
    }

    /// `phi' P phi` of a row whose numbers are given by position, in units of the noise variance.
    pub(super) fn variance(&self, phi: impl Fn(usize) -> f64 + Copy) -> f64 {
        self.factor.variance(phi)
    }

    /// Forgets: the data's weight by `lambda`, the prior's not. Once for each row, before
    /// [`predict`](Self::predict) or after [`correct`](Self::correct).
    pub fn forget(&mut self, lambda: f64) {
        if lambda >= 1.0 {
            return;
        }
        let n = self.len();
        self.factor.scale(1.0 / lambda);
        let (j, weight) = (self.turn, n as f64 * (1.0 - lambda) * self.information);
        self.turn = (j + 1) % n;
        let row = self.r_factor.as_ref().map(|r_factor| &r_factor[j * n..(j + 1) * n]);
        match row {
            Some(row) => _ = self.factor.project(row),
            None => self.factor.project_unit(j),
        }
        let gain = self.factor.absorb(1.0 / weight);
        if self.leak {
            for (theta, prior) in self.theta.chunks_exact_mut(n).zip(self.prior.chunks_exact(n)) {
                let lost = match row {
                    Some(row) => (j..n).map(|k| row[k] * (prior[k] - theta[k])).sum(),
                    None => prior[j] - theta[j],
                };
                add(theta, lost, gain);
            }
        }
    }

    /// Meets a row without its targets: gives `phi' P phi`. The innovations are to be put in
    /// [`innovations_mut`](Self::innovations_mut) before [`correct`](Self::correct).
    ///
    /// # Panics
    /// If `phi` has not `n` numbers.
    pub fn project(&mut self, phi: &[f64]) -> f64 {
        assert_eq!(phi.len(), self.len(), "a row of this regression");
        self.factor.project(phi)
    }

    /// Meets a row: gives `phi' P phi` and keeps the innovations `z_i - phi' theta_i`. The variance of an
    /// innovation is `noise variance x (1/w + phi' P phi)`.
    ///
    /// # Panics
    /// If `phi` has not `n` numbers or `z` not one for each target.
    pub fn predict(&mut self, phi: &[f64], z: &[f64]) -> f64 {
        let n = self.len();
        assert_eq!((phi.len(), z.len()), (n, self.innovations.len()), "a row of this regression");
        for ((e, z), theta) in self.innovations.iter_mut().zip(z).zip(self.theta.chunks_exact(n)) {
            *e = z - super::ud_factor::dot(phi, theta);
        }
        self.factor.project(phi)
    }

    /// The innovations of the last [`predict`](Self::predict).
    pub fn innovations(&self) -> &[f64] {
        &self.innovations
    }

    /// The same, to put others in their place; 0 of a target from which there is nothing to learn.
    pub fn innovations_mut(&mut self) -> &mut [f64] {
        &mut self.innovations
    }

    /// Learns from the row that [`predict`](Self::predict) has met, with weight `w > 0`: `theta_i += K e_i`,
    /// `K = P phi / (1/w + phi' P phi)`, `P -= K phi' P`. Without a new `predict` there is nothing to learn, nor
    /// from a row without weight.
    pub fn correct(&mut self, weight: f64) {
        if !(1.0 / weight).is_finite() {
            return;
        }
        let n = self.len();
        let gain = self.factor.absorb(1.0 / weight);
        for (theta, e) in self.theta.chunks_exact_mut(n).zip(&mut self.innovations) {
            add(theta, *e, gain);
            *e = 0.0;
        }
    }
}

/// All of a factor.
fn numbers(factor: &UdFactor) -> Vec<f64> {
    let mut numbers = vec![0.0; factor.memory_len()];
    factor.save(&mut Writer::new(&mut numbers));
    numbers
}

/// `theta += e gain`.
fn add(theta: &mut [f64], e: f64, gain: &[f64]) {
    for (theta, gain) in theta.iter_mut().zip(gain) {
        *theta += e * gain;
    }
}
