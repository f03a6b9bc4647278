//! The extended Kalman filter over the state and the weights of a model: learning while sailing.
//!
//! The weights `theta` of a step model are estimated together with its state `h`, sample by sample (Bemporad, "Recurrent
//! neural network training with convex loss and regularization functions by extended Kalman filtering",
//! arXiv:2111.02673):
//!
//! ```text
//! h+ = f(h, x, theta) + noise (Q_h)        theta+ = theta_0 + (1 - leak) (theta - theta_0) + noise (Q_theta)
//! y  = g(h, theta) + noise (R)
//! ```
//!
//! With `A = df/dh`, `B = df/dtheta`, `a = 1 - leak`, `lambda` the forgetting factor, the time update is
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
//! which keeps `P` symmetric to the last bit: with an inverse of `S` that is not, such filters run away after some
//! hundred samples.
//!
//! `P_tt` is what takes time and memory. It is touched by what a step does to the weights of each block by itself alone
//! ([`Learnable`]), half of it is kept, and it is read and written once a sample. [`Memory`] chooses less of it, which does
//! not grow with the square of the number of weights.

mod ahead;
mod courses;
mod equations;
mod equations_session;
mod filter;
pub(crate) mod full;
mod gain;
mod joint;
mod learnable;
mod lines;
mod narrow;
mod network;
mod plant;
mod plant_session;
mod plant_weights;
pub(crate) mod reduced;
mod rehearsal;
mod root;
mod saved;
mod session;
pub(crate) mod triangle;
mod tuning;

pub use courses::Courses;
pub use equations::LearnableEquations;
pub use equations_session::KalmanEquations;
pub use filter::{Correction, Filter};
pub use learnable::Learnable;
pub use network::LearnableNetwork;
pub use plant::LearnablePlant;
pub use plant_session::KalmanPlant;
pub use rehearsal::Rehearsal;
pub use session::{KalmanError, KalmanNetwork};
pub use tuning::{Memory, Tuning, TuningError};
