//! Control laws: from an estimate of the state and a reference to a command with a status.
//!
//! - [`Controller`]: the interface of every law; [`Estimate`] is its input, [`Status`] qualifies its command.
//! - [`Affine`]: invertible models `d nu/dt = f + sum g_i phi_i`: vessels with known parameters ([`AffinePlant`]),
//!   identified equations ([`AffineEquations`]) and control-affine networks ([`AffineNetwork`]).
//! - [`FeedbackLinearization`] and [`Backstepping`] of a lookahead point; [`Autopilot`] without a model.
//! - [`AdaptiveAugmentation`]: feedback linearization with a network that learns the model error online.
//! - [`cem`]: model predictive control on any predictor.
//! - [`Liveness`]: how long a command stays in force without measurements.
//! - [`DeadReckoning`]: whether a pose moves as the velocities say.
//! - [`Actuators`]: limits of the commands, and inversion of actuator lags ([`actuator`](crate::actuator)).
//! - [`allocate`]: control allocation, damped near singular configurations; [`allocate_within`]: within bounds.

mod actuators;
mod adaptive_augmentation;
mod affine;
mod affine_form;
mod allocate;
mod autopilot;
mod backstepping;
pub mod cem;
mod dead_reckoning;
mod equations;
mod error;
mod feedback_linearization;
mod liveness;
mod lookahead_point;
mod network;
mod noise;
mod status;
mod supervisor;

pub use actuators::{Actuators, Applied};
pub use adaptive_augmentation::{AdaptiveAugmentation, AdaptiveAugmentationOptions};
pub use affine::{Affine, AffinePlant, Motion};
pub use allocate::{allocate, allocate_within};
pub use autopilot::{Autopilot, AutopilotOptions, HeadingGains, SpeedGains};
pub use backstepping::{Backstepping, BacksteppingOptions};
pub use dead_reckoning::DeadReckoning;
pub use equations::{AffineEquations, NotAffine};
pub use error::ControlError;
pub use feedback_linearization::{FeedbackLinearization, FeedbackLinearizationOptions};
pub use liveness::{Liveness, longest_age_s};
pub use network::AffineNetwork;
pub use status::Status;
pub use supervisor::{Mode, Place, Stop, Supervisor, SupervisorLimits};

use crate::current::in_body;
use crate::guidance::Reference;
use crate::memory::Memory;

/// Estimate of the state of a vessel at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate<'a> {
    /// Pose `[x, y, psi]`: north, east \[m\], clockwise from north \[rad\], wrapped or not.
    pub eta: [f64; 3],
    /// Body velocities over ground `[u, v, r]` \[m/s, m/s, rad/s\].
    pub nu: [f64; 3],
    /// Velocity of the water, north and east \[m/s\]: zero for a model of the motion over ground.
    pub current: [f64; 2],
    /// Measured positions of the actuators in the units of their commands, one for each input: propeller force, rudder
    /// angle. NaN if a position is not measured, empty if none is: the controller then uses its own commands.
    pub actuators: &'a [f64],
}

impl Estimate<'_> {
    /// Whether pose and velocities are finite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.eta.iter().chain(&self.nu).chain(&self.current).all(|x| x.is_finite())
    }

    /// Body velocities through the water.
    pub fn through_water(&self) -> [f64; 3] {
        let [u, v, r] = self.nu;
        let [surge, sway] = in_body(self.current, self.eta[2]);
        [u - surge, v - sway, r]
    }
}

/// A control law for one vessel: from estimate and reference to the command until the next sample.
///
/// No method allocates. Commands are within their limits for any estimate. Without a finite estimate, the last command
/// is held for a while and the status is [`Status::Blind`].
pub trait Controller {
    /// Number of commands.
    fn inputs(&self) -> usize;

    /// Resets integrals and assumes the actuators at rest.
    fn reset(&mut self);

    /// Visits all numbers on which later commands depend besides model and options. A controller that loads those of
    /// another one continues identically to the last bit.
    fn visit_state(&mut self, memory: &mut Memory<'_>);

    /// The command from this sample to the next.
    ///
    /// # Panics
    /// If `command` has not [`inputs`](Self::inputs) numbers.
    fn command(&mut self, estimate: &Estimate<'_>, reference: &Reference, command: &mut [f64]) -> Status;
}

impl<C: Controller + ?Sized> Controller for &mut C {
    fn inputs(&self) -> usize {
        (**self).inputs()
    }

    fn reset(&mut self) {
        (**self).reset();
    }

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        (**self).visit_state(memory);
    }

    fn command(&mut self, estimate: &Estimate<'_>, reference: &Reference, command: &mut [f64]) -> Status {
        (**self).command(estimate, reference, command)
    }
}
