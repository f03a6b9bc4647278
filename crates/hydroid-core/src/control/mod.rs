//! Control: from an estimate of the state and a reference to a command, with a status that says how far it is to be
//! trusted.
//!
//! - [`Controller`]: what every law offers; [`Estimate`] and [`Status`] are what it takes and says.
//! - [`Affine`]: motion that a law can invert, `d nu/dt = f + sum g_i phi_i`: vessels with known parameters
//!   ([`AffinePlant`]), identified equations ([`AffineEquations`]) and control-affine networks ([`AffineNetwork`]).
//! - [`FeedbackLinearization`] and [`Backstepping`] of a point ahead of the vessel; [`Autopilot`], which has no model, to
//!   compare with.
//! - [`AdaptiveAugmentation`]: feedback linearization and a network that learns under way what its model misses.
//! - [`cem`]: plans over a horizon, on any predictor.
//! - [`Actuators`]: limits and rate limits of the commands, and the lag of what follows them, inverted (see
//!   [`actuator`](crate::actuator)).
//! - [`allocate`]: the actuators' efforts that give a wanted acceleration, also where the vessel can hardly give it.

mod actuators;
mod adaptive_augmentation;
mod affine;
mod affine_form;
mod allocate;
mod autopilot;
mod backstepping;
pub mod cem;
mod equations;
mod error;
mod feedback_linearization;
mod lookahead_point;
mod network;
mod noise;
mod status;

pub use actuators::{Actuators, Applied};
pub use adaptive_augmentation::{AdaptiveAugmentation, AdaptiveAugmentationOptions};
pub use affine::{Affine, AffinePlant, Motion};
pub use allocate::allocate;
pub use autopilot::{Autopilot, AutopilotOptions, HeadingGains, SpeedGains};
pub use backstepping::{Backstepping, BacksteppingOptions};
pub use equations::{AffineEquations, NotAffine};
pub use error::ControlError;
pub use feedback_linearization::{FeedbackLinearization, FeedbackLinearizationOptions};
pub use network::AffineNetwork;
pub use status::Status;

use crate::guidance::Reference;

/// What is known of a vessel at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate<'a> {
    /// Pose `[x, y, psi]`: north, east \[m\], clockwise from north \[rad\], wrapped or not.
    pub eta: [f64; 3],
    /// Body velocities `[u, v, r]` \[m/s, m/s, rad/s\].
    pub nu: [f64; 3],
    /// What the actuators do at this moment, in the units of their commands, one number for each input: a measured force
    /// of the propeller, an angle of the rudder. NaN where it is not measured, nothing at all where none is: the
    /// controller then knows it from its own commands.
    pub actuators: &'a [f64],
}

impl Estimate<'_> {
    /// Whether pose and velocities are numbers.
    pub fn is_finite(&self) -> bool {
        self.eta.iter().chain(&self.nu).all(|x| x.is_finite())
    }
}

/// A control law on one vessel: sample by sample, from estimate and reference to the command that is held until the next
/// sample.
///
/// Nothing is allocated per sample. Commands are within their limits and rate limits whatever the estimate says; where it
/// is no number, the last command is held for a while, and the status is [`Status::Blind`].
pub trait Controller {
    /// Number of commands.
    fn inputs(&self) -> usize;

    /// Forgets integrals, and takes the actuators to be at rest.
    fn reset(&mut self);

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

    fn command(&mut self, estimate: &Estimate<'_>, reference: &Reference, command: &mut [f64]) -> Status {
        (**self).command(estimate, reference, command)
    }
}
