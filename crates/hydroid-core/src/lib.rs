//! The on-board part of hydroid: models, adaptation, guidance and control without I/O, clock, threads, or allocation
//! per sample. It builds without the standard library (`default-features = false`) where there is an allocator.
//!
//! Order of the modules, each of which imports only those before it: `math` (vector kernels), `actuator` (lags, command
//! maps, limits), `vessel` (states, kinematics, numbers), `craft` (vessels with any actuators), `predict` (the prediction session), `memory` (numbers of a state), `model` (equations, networks,
//! plants over samples), `adapt` (online adaptation and its guard), `current`
//! (predictions over ground in a current), `rate_limit` (steering gears in front of a model), `navigation` (pose and velocities from raw sensors), `guidance` (paths and references), `control`
//! (control laws and planning).
//!
//! Conventions: body velocities `nu = (u, v, r)`, surge and sway in m/s (forward, starboard), yaw rate in rad/s
//! (positive to starboard, seen from above, z down); pose `eta = (x, y, psi)`, x north, y east, `psi` clockwise from
//! north and not wrapped. SI units and radians. Sample `k` is measured at `t_k`; command `c_k` is held over
//! `[t_k, t_{k+1})`.
#![no_std]

extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

pub mod actuator;
pub mod adapt;
pub mod control;
pub mod craft;
pub mod current;
pub mod guidance;
pub mod math;
pub mod memory;
pub mod model;
pub mod navigation;
pub mod predict;
pub mod rate_limit;
pub mod vessel;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
