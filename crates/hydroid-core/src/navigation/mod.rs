//! Navigation: pose, body velocities and current from what a boat measures.
//!
//! An extended Kalman filter over the states of [`State`]. Its sensors are a GNSS receiver (position and velocity of an
//! antenna off the origin, late by an unknown delay), a compass with a misalignment, a yaw-rate gyro with a bias,
//! accelerometers that see gravity when the vessel heels and rolls, and direct measurements of body velocities. Each has
//! its own times.
//!
//! Motion, with `nu = (u, v, r)` through the water and a current `V_c = (V_n, V_e)` over ground:
//!
//! ```text
//! p' = R(psi) (u, v) + V_c        psi' = r
//! u  : integral of an Ornstein-Uhlenbeck process (Singer, IEEE Trans. AES 6 (1970) 473)
//! r  : Matern process of smoothness 3/2 with mean zero (Hartikainen and Sarkka, MLSP 2010)
//! v  : -x_P r - (x_S + x_U u) q, and such a process of its own;   q' = (r - q) / T
//! ```
//!
//! The sway velocity that a turn causes has the transfer function of linear manoeuvring theory, with one zero and one pole
//! (Nomoto, Taguchi, Honda and Hirano, Int. Shipbuilding Progress 4 (1957) 354): the pivot point is `x_P` forward of the
//! origin at the beginning of a turn, and `x_P + x_S + x_U u` in a steady turn.
//!
//! The rest of `v` is small and has a mean of zero. This separates it from a current, if the heading changes, and from a
//! misalignment of the compass, if the speed or the course changes. Where it does not, the covariance of the estimate
//! says so.
//!
//! Specific force along the horizontal body axes at the inertial unit `(X, Y)`, with the heel, which is proportional to
//! the lateral acceleration `a_y = v' + u r` of the origin, and waves, whose spectrum is that of
//! `s / (s^2 + 2 z w s + w^2)` behind white noise (Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control,
//! 2nd ed., section 8.2.6):
//!
//! ```text
//! f_x = u' - r v - r' Y - r^2 X + b_x + w_x
//! f_y = v' + r u + r' X - r^2 Y + k a_y + b_y + w_y
//! ```
//!
//! The error of a GNSS position is the sum of a Gauss-Markov process and white noise, that of a compass the sum of its
//! misalignment, a Gauss-Markov process and white noise. A fix is older than its stamp by the delay `d`:
//! position and velocity at `t - d` follow from a Taylor series of the motion.
//!
//! Limits: the standard deviation of the delay is too small where the yaw acceleration jumps, because the model takes the
//! motion as smooth.
//!
//! Units: SI and radians. Frames: north-east-down, body forward-starboard-down.

mod filter;
mod gradient;
mod motion;
mod sensor;
mod state;

pub use filter::{Filter, Innovation, Update};
pub use gradient::Gradient;
pub use motion::{Noise, Transition};
pub use sensor::{Measurement, Mounting};
pub use state::{Estimate, Prior, STATES, State};
