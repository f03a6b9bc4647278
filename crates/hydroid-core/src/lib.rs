//! The on-board part of hydroid.
//!
//! Numbers in, numbers out: no I/O, no clock, no threads, and no allocation per sample. Builds
//! without the standard library (`default-features = false`) wherever there is an allocator.
//!
//! Conventions of the whole crate: body velocities `nu = (u, v, r)`, surge and sway in m/s (forward,
//! starboard), yaw rate in rad/s (positive to starboard, seen from above, z down); pose
//! `eta = (x, y, psi)`, x north, y east, `psi` clockwise from north and not wrapped. SI units and
//! radians. Sample `k` is measured at `t_k`; command `c_k` is held over `[t_k, t_{k+1})`.
#![no_std]

extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

pub mod actuator;
pub mod adapt;
pub mod control;
pub mod guidance;
pub mod math;
pub mod model;
pub mod predict;
pub mod vessel;
