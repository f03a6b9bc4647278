//! Online learning by an extended Kalman filter over the state and the weights of a model.
//!
//! The weights `theta` of a step model are estimated together with its state `h`, sample by sample (Bemporad,
//! "Recurrent neural network training with convex loss and regularization functions by extended Kalman filtering",
//! arXiv:2111.02673; Haykin, *Kalman Filtering and Neural Networks*, 2001, chapter 2):
//!
//! ```text
//! h+ = f(h, x, theta) + noise (Q_h)        theta+ = theta_0 + (1 - leak) (theta - theta_0) + noise (Q_theta)
//! y  = g(h, theta) + noise (R)
//! ```
//!
//! With `A = df/dh` (`n x n`), `B = df/dtheta` (`n x m`), `a = 1 - leak` and the forgetting factor `lambda`, the time
//! update is
//!
//! ```text
//! P_hh <- A P_hh A' + A P_ht B' + (A P_ht B')' + B P_tt B' + Q_h
//! P_ht <- a (A P_ht + B P_tt) / sqrt(lambda)
//! P_tt <- a^2 P_tt / lambda + Q_theta
//! ```
//!
//! and the measurement update, with `H = [dg/dh dg/dtheta]`, `S = H P H' + R = L L'`, `W = P H' L'^-1`,
//!
//! ```text
//! [h; theta] <- [h; theta] + W L^-1 (z - g(h, theta))        P <- P - W W'
//! ```
//!
//! This form keeps `P` symmetric to the last bit. With an explicit inverse of `S`, which is not exactly symmetric, the
//! filter diverges after some hundred samples.
//!
//! Most time and memory belong to `P_tt`. The step acts on the weights of each block separately ([`Learnable`]); half
//! of `P_tt` is stored, and it is read and written once a sample. The memory of [`CovarianceForm::Blocks`] does not
//! grow with the square of the number of weights.
//!
//! [`KalmanSession`] is the session of all models that learn by the filter: a recurrent network ([`KalmanNetwork`]),
//! sparse equations ([`KalmanEquations`]) and a vessel ([`KalmanPlant`]). Without weight variance it filters the state
//! alone.

mod cholesky;
mod covariance;
mod filter;
mod learnable;
mod measurement;
mod options;
mod rehearsal;
mod rollout_gradient;
mod session;

pub use filter::{Correction, Filter};
pub use learnable::{Learnable, LearnableEquations, LearnableNetwork, LearnablePlant, SharedWeightStates};
pub use options::{CovarianceForm, FilterOptions, FilterOptionsError};
pub use rehearsal::RehearsalOptions;
pub use session::{
    EquationsKind, KalmanEquations, KalmanError, KalmanNetwork, KalmanPlant, KalmanSession, NetworkKind,
    PlantKind,
};
