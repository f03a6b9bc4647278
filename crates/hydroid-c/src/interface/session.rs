//! Sessions, which predict.

use super::{call, free, give, handle, put, slice, slice_mut, value_or};
use crate::error::Status;
use crate::session::Session;

/// Frees a session or an adapter. NULL is ignored.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_free(session: *mut Session) {
    // SAFETY: the rules of the header.
    unsafe { free(session) }
}

/// Number of outputs; 0 after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_outputs(session: *const Session) -> usize {
    // SAFETY: the rules of the header.
    value_or(0, || Ok(unsafe { handle(session, "session")? }.sizes.outputs))
}

/// Number of inputs; 0 after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_inputs(session: *const Session) -> usize {
    // SAFETY: the rules of the header.
    value_or(0, || Ok(unsafe { handle(session, "session")? }.sizes.inputs))
}

/// Number of samples that a session must observe before its predictions are valid; 0 after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_warm_up(session: *const Session) -> usize {
    // SAFETY: the rules of the header.
    value_or(0, || Ok(unsafe { handle(session, "session")? }.sizes.warm_up))
}

/// Whether the session learns, so that the functions of adapters can be called. False after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_is_adapter(session: *const Session) -> bool {
    // SAFETY: the rules of the header.
    value_or(false, || Ok(unsafe { handle(session, "session")? }.is_adapter()))
}

/// Returns to the start of a run: outputs, hidden states and lags are cleared. Learned weights stay.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_reset(session: *mut Session) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(session, "session") }?.reset())
}

/// Takes the heading [rad] of the sample that is observed next, clockwise from north; NaN if it is missing. Models of
/// the motion over ground ignore it. See hydroid_model_needs_heading().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_observe_heading(session: *mut Session, heading: f64) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(session, "session") }?.observe_heading(heading))
}

/// Takes the measurement of the present sample. An adapter learns from it. Allocates in the first test of a guard, and in
/// the first window of an estimate of the current.
///
/// y, y_len: the outputs in their units. NaN is a missing value, for which the session keeps its own prediction. An
///     adapter rejects infinite values; a session that does not learn believes them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_observe(
    session: *mut Session,
    y: *const f64,
    y_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(session, "session")?.observe(slice(y, y_len, "y")?) })
}

/// Steps to the next sample.
///
/// c, c_len: the command that is held from the present sample to the next, one finite number for each input, in its unit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_advance(
    session: *mut Session,
    c: *const f64,
    c_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(session, "session")?.advance(slice(c, c_len, "c")?) })
}

/// hydroid_session_advance() and hydroid_session_observe() in one. A model may omit the prediction where a complete
/// measurement replaces it. Allocates as hydroid_session_observe().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_advance_observe(
    session: *mut Session,
    c: *const f64,
    c_len: usize,
    y: *const f64,
    y_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe {
        handle(session, "session")?.advance_observe(slice(c, c_len, "c")?, slice(y, y_len, "y")?)
    })
}

/// The estimate of the present outputs; NaN where there is none yet.
///
/// y, y_len: receives a number for each output, in its unit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_output(
    session: *const Session,
    y: *mut f64,
    y_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(session, "session")?.output(slice_mut(y, y_len, "y")?) })
}

/// As hydroid_session_output(), with the motion through the water.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_output_through_water(
    session: *const Session,
    y: *mut f64,
    y_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(session, "session")?.output_through_water(slice_mut(y, y_len, "y")?) })
}

/// An estimate of the current.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Current {
    /// Component north [m/s].
    pub north: f64,
    /// Component east [m/s].
    pub east: f64,
    /// Variance of the component north [m^2/s^2].
    pub variance_north: f64,
    /// Covariance of both components [m^2/s^2].
    pub covariance: f64,
    /// Variance of the component east [m^2/s^2].
    pub variance_east: f64,
}

/// The estimate of the current. HYDROID_STATUS_UNSUPPORTED for a model of the motion over ground.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_current(session: *const Session, current: *mut Current) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe {
        let of = handle(session, "session")?.current()?;
        let ([north, east], [variance_north, covariance, variance_east]) = (of.velocity, of.covariance);
        put(current, "current", Current { north, east, variance_north, covariance, variance_east })
    })
}

/// Predicts the next samples under given commands, and does not change the session. Allocates while its memory grows:
/// in the first call of a size, and in the first calls of a guarded adapter.
///
/// commands, commands_len: samples x inputs numbers, sample by sample; the first command acts from the present sample on.
/// y, y_len: receives samples x outputs numbers, sample by sample; the first row is the next sample. y_len determines the
///     number of samples. A prediction that diverges is not finite, and no error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_rollout(
    session: *const Session,
    commands: *const f64,
    commands_len: usize,
    y: *mut f64,
    y_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe {
        let commands = slice(commands, commands_len, "commands")?;
        handle(session, "session")?.rollout(commands, slice_mut(y, y_len, "y")?)
    })
}

/// Predicts under count sequences of commands from the present sample, side by side where the model can: for planners.
/// Results differ from those of hydroid_session_rollout() in the last digits. Allocates as
/// that function.
///
/// commands, commands_len: count x samples x inputs numbers, sequence by sequence.
/// y, y_len: receives count x samples x outputs numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_rollout_batch(
    session: *const Session,
    count: usize,
    commands: *const f64,
    commands_len: usize,
    y: *mut f64,
    y_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe {
        let commands = slice(commands, commands_len, "commands")?;
        handle(session, "session")?.rollout_batch(count, commands, slice_mut(y, y_len, "y")?)
    })
}

/// Length of a snapshot, constant over the life of a session; 0 after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_snapshot_len(session: *const Session) -> usize {
    // SAFETY: the rules of the header.
    value_or(0, || Ok(unsafe { handle(session, "session")? }.sizes.snapshot))
}

/// Copies the numbers on which predictions depend: outputs, lags, hidden states, and learned weights.
///
/// numbers, numbers_len: receives hydroid_session_snapshot_len() numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_snapshot(
    session: *const Session,
    numbers: *mut f64,
    numbers_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(session, "session")?.snapshot(slice_mut(numbers, numbers_len, "numbers")?) })
}

/// Restores a snapshot of a session of the same model. The memory that serves learning alone stays.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_restore(
    session: *mut Session,
    numbers: *const f64,
    numbers_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(session, "session")?.restore(slice(numbers, numbers_len, "numbers")?) })
}

/// A new session with the same predictions. That of an adapter does not learn. Allocates.
///
/// fork: receives the session; NULL after an error. Freed by hydroid_session_free().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_fork(session: *const Session, fork: *mut *mut Session) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { give(fork, "fork", || handle(session, "session")?.fork()) })
}
