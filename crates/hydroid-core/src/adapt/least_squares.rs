//! Recursive least squares (RLS) with a forgetting factor, and a bounded covariance against covariance windup.

use alloc::vec;
use alloc::vec::Vec;

use super::ud_factor::UdFactor;
use crate::memory::Memory;

/// Recursive least squares for several targets with one regressor.
///
/// A row has the regressor `phi` (`n` numbers) and the targets `z_i = phi' theta_i + noise`. The estimate minimizes
///
/// ```text
/// sum_k lambda^(t-k) w_k (z_k - phi_k' theta)^2  +  r0 |theta - theta_0|^2
/// ```
///
/// with the row weights `w_k`, the forgetting factor `lambda`, and a prior: the reference coefficients `theta_0` with
/// the weight of `r0` rows of unit regressors in each direction. Data are forgotten, the prior is not. With
/// exponential forgetting alone `P` grows as `lambda^-t` in directions without excitation ("windup"; Ljung, *System
/// Identification*, 2nd ed., section 11.2; Fortescue, Kershenbaum, Ydstie 1981). The exact recursion `R <- lambda R +
/// (1 - lambda) r0 I + w phi phi'` of the information matrix `R = P^-1` (Gunnarsson, *On covariance modification and
/// regularization in recursive least squares identification*, IFAC SYSID 1994; Salgado, Goodwin, Middleton 1988) costs
/// `n^3`. Here each row restores the prior of one coefficient, in turn:
///
/// ```text
/// R <- lambda R + n (1 - lambda) r0 e_j e_j' + w phi phi'        j = t mod n
/// ```
///
/// The restoration is a pseudo-measurement of `theta_j` and costs half an ordinary row. By induction `R >= r0
/// lambda^(n-1) I`, so that **no eigenvalue of `P` exceeds `lambda^(1-n) / r0`** for any data. The value of the
/// pseudo-measurement is `theta_0` (leak towards the reference) or the present `theta` (bound without leak).
///
/// The measurement update with the weight `w` is
///
/// ```text
/// K = P phi / (1/w + phi' P phi),    theta_i += K (z_i - phi' theta_i),    P -= K phi' P
/// ```
///
/// With `lambda = 1` the estimate is batch least squares with the ridge `r0`. `P` is stored as `U D U'`
/// ([`UdFactor`]).
#[derive(Clone, Debug)]
pub struct RecursiveLeastSquares {
    factor: UdFactor,
    initial: Vec<f64>,
    theta: Vec<f64>,
    prior: Vec<f64>,
    information: f64,
    /// Upper triangle `T` of a prior information `r0 T'T`, row by row; `None` for `r0 I`.
    r_factor: Option<Vec<f64>>,
    leak: bool,
    /// Coefficient (row of `T`) of the next restoration.
    turn: usize,
    innovations: Vec<f64>,
}

impl RecursiveLeastSquares {
    /// Starts from reference coefficients (`targets x n`, row by row) with the weight of `information > 0` rows of
    /// unit regressors; `leak`: whether forgotten coefficients return to the reference.
    ///
    /// # Panics
    /// If the coefficients do not fill whole rows of `n`, or `information` is not a positive number.
    pub fn new(n: usize, coefficients: &[f64], information: f64, leak: bool) -> Self {
        assert!(n > 0 && coefficients.len().is_multiple_of(n), "coefficients do not fill whole rows");
        assert!(information > 0.0 && information.is_finite(), "the prior information must be positive");
        let mut factor = UdFactor::new(n, 1.0 / information);
        Self {
            initial: Memory::saved(|memory| factor.visit_state(memory)),
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

    /// As [`new`](Self::new), with the prior information `r0 T'T`: `r0` is `information`, and `T` is `r_factor`, a
    /// regular upper triangle (`n x n`, row by row) such as the QR factor of the training rows. Forgotten prior
    /// information is restored row by row of `T`, so that `R >= r0 lambda^(n-1) T'T`.
    ///
    /// # Panics
    /// As [`new`](Self::new); if `r_factor` has not `n x n` numbers.
    pub fn with_r_factor(coefficients: &[f64], information: f64, r_factor: &[f64], leak: bool) -> Self {
        let n = r_factor.len().isqrt();
        let own = Self::new(n, coefficients, information, leak);
        let mut factor = UdFactor::inverse(r_factor, 1.0 / information);
        Self {
            initial: Memory::saved(|memory| factor.visit_state(memory)),
            factor,
            r_factor: Some(r_factor.to_vec()),
            ..own
        }
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.factor.visit_state(memory);
        memory.numbers(&mut self.theta);
        let most = self.len() - 1;
        memory.count(&mut self.turn, most);
        if memory.is_loading() {
            self.innovations.fill(0.0);
        }
    }

    /// The covariance at the start.
    pub(super) fn initial_factor(&self) -> UdFactor {
        let mut factor = self.factor.clone();
        factor.visit_state(&mut Memory::Loading(&self.initial));
        factor
    }

    /// The weight `r0` of the prior \[rows\].
    pub(super) fn information(&self) -> f64 {
        self.information
    }

    /// Whether forgotten coefficients return to the reference.
    pub(super) fn leaks(&self) -> bool {
        self.leak
    }

    /// Resets the covariance to its initial value. The coefficients stay.
    pub fn restart(&mut self) {
        self.factor.visit_state(&mut Memory::Loading(&self.initial));
        self.turn = 0;
    }

    /// Whether all numbers are finite and in the range of [`UdFactor::is_sound`].
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

    /// Coefficients, `targets x n`, row by row.
    pub fn coefficients(&self) -> &[f64] {
        &self.theta
    }

    /// Mutable coefficients.
    pub fn coefficients_mut(&mut self) -> &mut [f64] {
        &mut self.theta
    }

    /// `P_ij`, in units of the noise variance.
    pub fn covariance(&self, i: usize, j: usize) -> f64 {
        self.factor.covariance(i, j)
    }

    /// `phi' P phi` of a regressor that is given by position, in units of the noise variance.
    pub(super) fn variance(&self, phi: impl Fn(usize) -> f64 + Copy) -> f64 {
        self.factor.variance(phi)
    }

    /// Discounts the data by `lambda` and restores the prior. Call it once for each row, before
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

    /// Projects a regressor without targets and returns `phi' P phi`. The caller sets
    /// [`innovations_mut`](Self::innovations_mut) before [`correct`](Self::correct).
    ///
    /// # Panics
    /// If `phi` has not `n` numbers.
    pub fn project(&mut self, phi: &[f64]) -> f64 {
        assert_eq!(phi.len(), self.len(), "a row of this regression");
        self.factor.project(phi)
    }

    /// Projects a regressor, stores the innovations `z_i - phi' theta_i` and returns `phi' P phi`. The variance of an
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

    /// Innovations of the last [`predict`](Self::predict).
    pub fn innovations(&self) -> &[f64] {
        &self.innovations
    }

    /// Mutable innovations; 0 excludes a target from the update.
    pub fn innovations_mut(&mut self) -> &mut [f64] {
        &mut self.innovations
    }

    /// Measurement update with the projected regressor. A zero weight has no effect.
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

fn add(theta: &mut [f64], e: f64, gain: &[f64]) {
    for (theta, gain) in theta.iter_mut().zip(gain) {
        *theta += e * gain;
    }
}
