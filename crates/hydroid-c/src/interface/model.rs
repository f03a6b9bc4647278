//! Models: files, descriptions, and what is made of them.

use std::ffi::{CString, c_char};

use super::{call, free, give, handle, optional_text, slice, text, value_or};
use crate::error::{Error, Status};
use crate::model::{Channel, Model};
use crate::options;
use crate::session::Session;

/// Reads a model file (.safetensors), a vessel file (.toml), or a built-in vessel by its name. Allocates.
///
/// path: text in UTF-8.
/// model: receives the model; NULL after an error. Freed by hydroid_model_free().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_read(path: *const c_char, model: *mut *mut Model) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { give(model, "model", || Model::read(text(path, "path")?)) })
}

/// Reads a model from the content of its file. Allocates.
///
/// bytes, bytes_len: the content of a model file or a vessel file.
/// name: a name for messages, or NULL.
/// model: receives the model; NULL after an error. Freed by hydroid_model_free().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_decode(
    bytes: *const u8,
    bytes_len: usize,
    name: *const c_char,
    model: *mut *mut Model,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe {
        give(model, "model", || {
            let name = optional_text(name, "name")?.unwrap_or("the model in memory");
            Model::decode(slice(bytes, bytes_len, "bytes")?, name)
        })
    })
}

/// Writes a model file; a vessel as its vessel file. The file is written completely or not at all. Allocates.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_write(model: *const Model, path: *const c_char) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { handle(model, "model")?.write(text(path, "path")?) })
}

/// Frees a model. Sessions and simulations of it stay valid. NULL is ignored.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_free(model: *mut Model) {
    // SAFETY: the rules of the header.
    unsafe { free(model) }
}

/// A vessel at another sample time dt [s]. The sample time of an identified model is fixed. Allocates.
///
/// changed: receives the model; NULL after an error. Freed by hydroid_model_free().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_at_step(
    model: *const Model,
    dt: f64,
    changed: *mut *mut Model,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { give(changed, "changed", || handle(model, "model")?.at_step(dt)) })
}

/// The model with constant weights: sessions of a committee, and of a model that was identified with online learning,
/// adapt coefficients inside; those of the frozen model do not. Allocates.
///
/// frozen: receives the model; NULL after an error. Freed by hydroid_model_free().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_frozen(model: *const Model, frozen: *mut *mut Model) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { give(frozen, "frozen", || Ok(handle(model, "model")?.frozen())) })
}

/// Number of outputs; 0 after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_outputs(model: *const Model) -> usize {
    // SAFETY: the rules of the header.
    value_or(0, || Ok(unsafe { handle(model, "model")? }.outputs.len()))
}

/// Number of inputs; 0 after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_inputs(model: *const Model) -> usize {
    // SAFETY: the rules of the header.
    value_or(0, || Ok(unsafe { handle(model, "model")? }.inputs.len()))
}

/// Sample time [s]; NaN after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_dt(model: *const Model) -> f64 {
    // SAFETY: the rules of the header.
    value_or(f64::NAN, || Ok(unsafe { handle(model, "model")? }.content.description.dt))
}

/// Whether the model predicts the motion through the water and estimates the current: its sessions need the heading of
/// each sample, by hydroid_session_observe_heading(). False after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_needs_heading(model: *const Model) -> bool {
    // SAFETY: the rules of the header.
    value_or(false, || Ok(unsafe { handle(model, "model")? }.content.description.current.is_some()))
}

/// Name of the model, such as "gru". It belongs to the model; NULL after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_name(model: *const Model) -> *const c_char {
    // SAFETY: the rules of the header.
    value_or(std::ptr::null(), || Ok(unsafe { handle(model, "model")? }.name.as_ptr()))
}

/// Kind of the model, as in its file. It belongs to the model; NULL after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_kind(model: *const Model) -> *const c_char {
    // SAFETY: the rules of the header.
    value_or(std::ptr::null(), || Ok(unsafe { handle(model, "model")? }.kind.as_ptr()))
}

/// A text of a channel.
unsafe fn channel(
    model: *const Model,
    index: usize,
    of: impl FnOnce(&Model) -> &[Channel],
    text: impl FnOnce(&Channel) -> &CString,
) -> *const c_char {
    value_or(std::ptr::null(), || {
        // SAFETY: the rules of the header.
        let channels = of(unsafe { handle(model, "model")? });
        let Some(channel) = channels.get(index) else {
            let message = format!("there is no channel {index}: the model has {}, from 0 on", channels.len());
            return Err(Error::new(Status::Value, message));
        };
        Ok(text(channel).as_ptr())
    })
}

/// Name of an output, from 0 on. It belongs to the model; NULL after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_output_name(model: *const Model, index: usize) -> *const c_char {
    // SAFETY: the rules of the header.
    unsafe { channel(model, index, |model| &model.outputs, |channel| &channel.name) }
}

/// Unit of an output, such as "m/s"; empty if unknown. It belongs to the model; NULL after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_output_unit(model: *const Model, index: usize) -> *const c_char {
    // SAFETY: the rules of the header.
    unsafe { channel(model, index, |model| &model.outputs, |channel| &channel.unit) }
}

/// Name of an input, from 0 on. It belongs to the model; NULL after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_input_name(model: *const Model, index: usize) -> *const c_char {
    // SAFETY: the rules of the header.
    unsafe { channel(model, index, |model| &model.inputs, |channel| &channel.name) }
}

/// Unit of an input; empty if unknown. It belongs to the model; NULL after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_input_unit(model: *const Model, index: usize) -> *const c_char {
    // SAFETY: the rules of the header.
    unsafe { channel(model, index, |model| &model.inputs, |channel| &channel.unit) }
}

/// A session of the model at the start of a run. Allocates.
///
/// session: receives the session; NULL after an error. Freed by hydroid_session_free().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_session(model: *const Model, session: *mut *mut Session) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe { give(session, "session", || Ok(handle(model, "model")?.session())) })
}

/// A session that learns from the measurements, at the start of a run. Allocates.
///
/// guarded: with a guard, which detects faults of sensors and bounds the error of the adapted model by that of the
///     model as it was read.
/// options: lines of the section [adapt] of a configuration file (TOML), such as "leak = 600\nhuber = inf", or NULL for the
///     defaults. With the option estimate_current, the session needs the heading of each sample.
/// noise, noise_len: standard deviation of the measurement noise of each output, in its unit; or NULL and 0 for those of
///     the model file. Kalman filters need one of the two.
/// adapter: receives the session; NULL after an error. Freed by hydroid_session_free().
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroid_model_adapter(
    model: *const Model,
    guarded: bool,
    options: *const c_char,
    noise: *const f64,
    noise_len: usize,
    adapter: *mut *mut Session,
) -> Status {
    // SAFETY: the rules of the header.
    call(|| unsafe {
        give(adapter, "adapter", || {
            let model = handle(model, "model")?;
            let noise = slice(noise, noise_len, "noise")?;
            let noise = Some(noise).filter(|noise| !noise.is_empty());
            let section = optional_text(options, "options")?;
            model.adapter(&options::read(&model.content, guarded, section, noise)?)
        })
    })
}
