//! Simulations, which run freely.

use super::{call, free, give, handle, slice, slice_mut, value_or};
use crate::error::Status;
use crate::model::Model;
use crate::simulation::Simulation;

/// A simulation of a model with the outputs u and r, and v if it has one: the motion from the model with constant weights,
/// without measurements, and the pose by kinematics. hydroid_simulation_start() begins it. Allocates.
///
/// current_north, current_east: constant velocity of the water [m/s].
/// simulation: receives the simulation; NULL after an error. Freed by hydroid_simulation_free().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_simulation_new(
    model: *const Model,
    current_north: f64,
    current_east: f64,
    simulation: *mut *mut Simulation,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe {
        give(simulation, "simulation", || {
            Simulation::new(&handle(model, "model")?.content, [current_north, current_east])
        })
    })
}

/// Frees a simulation. NULL is ignored.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_simulation_free(simulation: *mut Simulation) {
    // SAFETY: the rules of the header.
    unsafe { free(simulation) }
}

/// Number of outputs; 0 after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_simulation_outputs_len(simulation: *const Simulation) -> usize {
    // SAFETY: the rules of the header.
    value_or(0, || Ok(unsafe { handle(simulation, "simulation")? }.outputs))
}

/// Number of inputs; 0 after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_simulation_inputs_len(simulation: *const Simulation) -> usize {
    // SAFETY: the rules of the header.
    value_or(0, || Ok(unsafe { handle(simulation, "simulation")? }.inputs))
}

/// Starts at a pose in a steady motion: outputs and command have been constant for a long time. Allocates.
///
/// eta, eta_len: 3 numbers: position north and east [m], heading [rad] clockwise from north.
/// y, y_len: outputs, with the motion through the water.
/// c, c_len: the command before the start.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_simulation_start(
    simulation: *mut Simulation,
    eta: *const f64,
    eta_len: usize,
    y: *const f64,
    y_len: usize,
    c: *const f64,
    c_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe {
        let eta = slice(eta, eta_len, "eta")?;
        handle(simulation, "simulation")?.start(eta, slice(y, y_len, "y")?, slice(c, c_len, "c")?)
    })
}

/// Steps to the next sample, with the command c held up to it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_simulation_advance(
    simulation: *mut Simulation,
    c: *const f64,
    c_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(simulation, "simulation")?.advance(slice(c, c_len, "c")?) })
}

/// The outputs of the model, with the motion through the water; NaN before the start.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_simulation_outputs(
    simulation: *const Simulation,
    y: *mut f64,
    y_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(simulation, "simulation")?.outputs(slice_mut(y, y_len, "y")?) })
}

/// The pose: position north and east [m], heading [rad], clockwise from north and not wrapped.
///
/// eta, eta_len: receives 3 numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_simulation_eta(
    simulation: *const Simulation,
    eta: *mut f64,
    eta_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(simulation, "simulation")?.eta(slice_mut(eta, eta_len, "eta")?) })
}

/// Surge and sway [m/s] and yaw rate [rad/s] over ground.
///
/// nu, nu_len: receives 3 numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_simulation_nu_over_ground(
    simulation: *const Simulation,
    nu: *mut f64,
    nu_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(simulation, "simulation")?.nu_over_ground(slice_mut(nu, nu_len, "nu")?) })
}

/// HYDROID_STATUS_DIVERGED if the motion is not finite.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_simulation_check(simulation: *const Simulation) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(simulation, "simulation") }?.check())
}
