//! Weights that known waters determine return to those from shore faster.

use super::filter::Filter;
use super::learnable::Learnable;
use crate::math::Scalar;

impl<T: Scalar, M: Learnable<T>> Filter<T, M> {
    /// Weighs the leak of each weight by what has been learned of it so far: with `F_i = 1 / P_ii - 1 / P0_ii`, the
    /// information that its variance has gained, and `w` the [`anchor`](super::Tuning::anchor),
    ///
    /// ```text
    /// leak_i = min(1, leak ((1 - w) + w F_i / mean F))
    /// ```
    ///
    /// (Kirkpatrick et al., 2017, "Overcoming catastrophic forgetting in neural networks", with the diagonal of the
    /// covariance in the place of that of the Fisher information.) The covariance goes on leaking as before.
    pub fn anchor(&mut self) {
        let w = self.tuning.anchor;
        if w == 0.0 {
            return;
        }
        let initial = &self.tuning.initial_weights;
        let gained = |(p, &initial): (T, &f64)| {
            if initial > 0.0 { (1.0 / p.wide() - 1.0 / initial).max(0.0) } else { 0.0 }
        };
        let variances = self.variances().1.into_iter();
        let sum: f64 = variances.clone().zip(initial).map(gained).sum();
        let mean = sum / initial.iter().filter(|&&p| p > 0.0).count().max(1) as f64;
        if !(mean > 0.0 && mean.is_finite()) {
            return;
        }
        for (leak, of) in self.leaks.iter_mut().zip(variances.zip(initial)) {
            *leak = T::of((self.tuning.leak * ((1.0 - w) + w * gained(of) / mean)).min(1.0));
        }
    }
}
