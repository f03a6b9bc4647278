//! Three-degree-of-freedom surface vessels: parameters, equations of motion, kinematics, integration.
//!
//! One parametric plant covers the thesis's simple vessel (eq. 1-6), its hydrofoil (eq. 7-12) and the low-speed model
//! C0 of the hydrofoil: they differ in [`VesselParams`], not in code. [`Plant`] is a parameter set compiled for speed;
//! it gives `dx/dt = f(x, c)`, and [`Plant::advance`] integrates it over a step with the command held.
//!
//! ```
//! use hydroid_core::vessel::{Command, Plant, State, VesselParams};
//!
//! let plant = Plant::new(&VesselParams::hydrofoil())?;
//! let mut state = State::REST;
//! for _ in 0..6_000 {
//!     state = plant.advance(&state, &Command { pp: 350.0, rd: 0.0 }, 0.01);
//! }
//! // Flying: the surge drag of one half of (20 + 18.65 u) u balances 350 N.
//! assert!((state.u - 5.6127).abs() < 1e-3);
//! # Ok::<(), hydroid_core::vessel::InvalidParams>(())
//! ```

mod dual;
mod invalid;
pub mod kinematics;
mod lanes;
mod number;
mod parameter;
mod params;
mod plant;
mod reference;
pub mod rk4;
mod state;
mod validate;

pub use dual::Dual;
pub use invalid::{InvalidParams, Mode};
pub(crate) use lanes::Lanes;
pub use number::{Number, Real};
pub use parameter::{Form, Numbers, PARAMETER, PARAMETERS, Parameter, is_solvable};
pub use params::{
    AddedMass, CommandChannel, Commands, Coriolis, Drag, Flying, Noise, Propeller, RigidBody, Rudder,
    RudderLaw, VesselParams,
};
pub use plant::{Actuation, Plant};
pub use state::{Command, State};
