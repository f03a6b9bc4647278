//! Adapters, which learn. For a session that does not learn, these functions return an error.

use std::ffi::c_char;

use super::{call, give, handle, optional_text, put, slice, slice_mut, value_or};
use crate::error::Status;
use crate::learning::{Expert, Health, SampleOutcome};
use crate::model::Model;
use crate::session::Session;

/// Effect of the last observed sample on the weights.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_outcome(
    session: *const Session,
    outcome: *mut SampleOutcome,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { put(outcome, "outcome", handle(session, "session")?.outcome()?) })
}

/// Innovation (measurement minus prediction) of each output at the last sample before the update, and its standard
/// deviation, in the unit of the output. NaN if the outcome is HYDROID_OUTCOME_WAITING.
///
/// values, values_len: receives a number for each output.
/// deviations, deviations_len: receives a number for each output.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_innovations(
    session: *const Session,
    values: *mut f64,
    values_len: usize,
    deviations: *mut f64,
    deviations_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe {
        let values = slice_mut(values, values_len, "values")?;
        let deviations = slice_mut(deviations, deviations_len, "deviations")?;
        handle(session, "session")?.innovations(values, deviations)
    })
}

/// Number of learned weights, constant over the life of a session; 0 for one that does not learn.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_weights_len(session: *const Session) -> usize {
    // SAFETY: the rules of the header.
    value_or(0, || Ok(unsafe { handle(session, "session")? }.sizes.weights))
}

/// The learned weights, in the units and order of the model.
///
/// weights, weights_len: receives hydroid_session_weights_len() numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_weights(
    session: *const Session,
    weights: *mut f64,
    weights_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(session, "session")?.weights(slice_mut(weights, weights_len, "weights")?) })
}

/// Stops or resumes learning. A frozen adapter predicts with its present weights.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_freeze(session: *mut Session, frozen: bool) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(session, "session") }?.freeze(frozen))
}

/// Multiplies the noise variance of the next measurement by a positive factor.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_scale_noise(session: *mut Session, factor: f64) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(session, "session") }?.scale_noise(factor))
}

/// Resets the covariance of the weights to its initial value. The weights stay.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_restart(session: *mut Session) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(session, "session") }?.restart())
}

/// Indicators of the covariance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_health(session: *const Session, health: *mut Health) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { put(health, "health", handle(session, "session")?.health()?) })
}

/// The model from which a guarded adapter predicts. HYDROID_EXPERT_ADAPTED without a guard.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_active(session: *const Session, expert: *mut Expert) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { put(expert, "expert", handle(session, "session")?.active()?) })
}

/// Standard deviations of the measurements around the predictions of hydroid_session_rollout(), from the uncertainty of
/// weights and state and from the measurement noise. A band of HYDROID_BAND_80 standard deviations contains the
/// measurement with a probability of 80 %. Allocates while its memory grows, with the size and with the first updates.
///
/// commands, commands_len: samples x inputs numbers, as many samples as the last horizon.
/// horizons, horizons_len: samples ahead, ascending, from 1 on.
/// deviations, deviations_len: receives horizons x outputs numbers, in the units of the outputs; NaN where the adapter has
///     no estimate.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_deviations(
    session: *mut Session,
    commands: *const f64,
    commands_len: usize,
    horizons: *const usize,
    horizons_len: usize,
    deviations: *mut f64,
    deviations_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe {
        let commands = slice(commands, commands_len, "commands")?;
        let horizons = slice(horizons, horizons_len, "horizons")?;
        let deviations = slice_mut(deviations, deviations_len, "deviations")?;
        handle(session, "session")?.deviations(commands, horizons, deviations)
    })
}

/// Stores a window of training data for an adapter with the option rehearsal, while there is room. Allocates.
///
/// outputs, outputs_len: samples x outputs finite numbers. The last samples are stored, as many as a window has and one more;
///     the samples before them settle the state.
/// commands, commands_len: samples x inputs finite numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_store_window(
    session: *mut Session,
    outputs: *const f64,
    outputs_len: usize,
    commands: *const f64,
    commands_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe {
        let outputs = slice(outputs, outputs_len, "outputs")?;
        handle(session, "session")?.store_window(outputs, slice(commands, commands_len, "commands")?)
    })
}

/// Length of the memory of an adapter, constant over its life; 0 for a session that does not learn.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_memory_len(session: *const Session) -> usize {
    // SAFETY: the rules of the header.
    value_or(0, || Ok(unsafe { handle(session, "session")? }.sizes.memory))
}

/// Copies the numbers on which predictions and further learning depend, as for a restart of the program. They begin with a
/// fingerprint of model, options and version.
///
/// numbers, numbers_len: receives hydroid_session_memory_len() numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_save(
    session: *const Session,
    numbers: *mut f64,
    numbers_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(session, "session")?.save(slice_mut(numbers, numbers_len, "numbers")?) })
}

/// Loads what hydroid_session_save() of an adapter of the same model, options and version copied: both continue
/// identically to the last bit. HYDROID_STATUS_MEMORY if it is another one or damaged; the adapter is then as before.
/// Windows of hydroid_session_store_window() are stored again before. Allocates.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_load(
    session: *mut Session,
    numbers: *const f64,
    numbers_len: usize,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(session, "session")?.load(slice(numbers, numbers_len, "numbers")?) })
}

/// Whether the memory can be that of an adapter: weights and states are finite, variances finite and not negative.
/// hydroid_session_load() of a sound memory repairs it. False after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_is_sound(session: *const Session) -> bool {
    // SAFETY: the rules of the header.
    value_or(false, || unsafe { handle(session, "session") }?.is_sound())
}

/// The model with the learned weights, which hydroid_model_write() writes. Allocates.
///
/// run: name of the run, for the provenance of the model; or NULL.
/// model: receives the model; NULL after an error. Freed by hydroid_model_free().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_session_learned(
    session: *const Session,
    run: *const c_char,
    model: *mut *mut Model,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe {
        give(model, "model", || {
            let run = optional_text(run, "run")?;
            handle(session, "session")?.learned(run).map(Model::of)
        })
    })
}
