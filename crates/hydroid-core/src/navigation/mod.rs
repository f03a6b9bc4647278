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
//! v  : -x_P r, and a Matern process of smoothness 3/2 with mean zero (Hartikainen and Sarkka, MLSP 2010);
//!      the pivot point x_P is that of steady turns
//! r  : such a process
//! ```
//!
//! The zero mean of `v` over a run separates it from a current, if the heading changes, and from a misalignment of the
//! compass, if the speed or the course changes. Where it does not, the covariance of the estimate says so.
//!
//! Specific force along the horizontal body axes at the inertial unit `(X, Y)`, with the static heel in a turn, which is
//! proportional to `u r` (the centripetal acceleration), and waves, whose spectrum is that of
//! `s / (s^2 + 2 z w s + w^2)` behind white noise (Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control,
//! 2nd ed., section 8.2.6):
//!
//! ```text
//! f_x = u' - r v - r' Y - r^2 X + b_x + w_x
//! f_y = v' + r u + r' X - r^2 Y + k u r + b_y + w_y
//! ```
//!
//! The error of a GNSS position is the sum of a Gauss-Markov process and white noise, that of a compass the sum of its
//! misalignment, a Gauss-Markov process and white noise. A fix is older than its stamp by
//! the delay `d`: position and velocity at `t - d` follow from a Taylor series of the motion.
//!
//! Limits: the standard deviation of the delay is too small where the yaw acceleration jumps, because the model takes the
//! motion as smooth; a current that is estimated together with the heel is too small where the heel follows the speed
//! over ground.
//!
//! Units: SI and radians. Frames: north-east-down, body forward-starboard-down.

mod filter;
mod motion;
mod sensor;
mod state;

pub use filter::{Filter, Innovation, Update};
pub use motion::{Noise, Transition};
pub use sensor::{Measurement, Mounting};
pub use state::{Estimate, Prior, STATES, State};
