//! Errors: a status for the caller, and a message that the thread keeps.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};

/// Result of a call. The message of hydroid_last_error() names the cause and a remedy.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The call succeeded.
    Ok = 0,
    /// A pointer is null, or not aligned for its type.
    Pointer = 1,
    /// An array has another length than the one that is needed.
    Length = 2,
    /// A text is not UTF-8.
    Text = 3,
    /// A number is outside its range.
    Value = 4,
    /// A file cannot be read or written, or its content is not a model.
    File = 5,
    /// The options of an adapter are invalid.
    Options = 6,
    /// The kind of model has no such function.
    Unsupported = 7,
    /// The session does not learn: it is not an adapter.
    NotAdapter = 8,
    /// The memory is not one of an adapter of the same model, options and version, or it is damaged.
    Memory = 9,
    /// A simulation has numbers that are not finite.
    Diverged = 10,
    /// An internal error ended an earlier call of this handle, which can only be freed.
    Failed = 11,
    /// An internal error ended the call. The handle can only be freed.
    Internal = 12,
}

/// A status and its message.
#[derive(Debug)]
pub(crate) struct Error {
    pub(crate) status: Status,
    pub(crate) message: String,
}

pub(crate) type Outcome<T = ()> = Result<T, Error>;

impl Error {
    pub(crate) fn new(status: Status, message: impl Into<String>) -> Self {
        Self { status, message: message.into() }
    }

    pub(crate) fn length(name: &str, needed: impl std::fmt::Display, given: usize) -> Self {
        Self::new(Status::Length, format!("{name} has {given} numbers: {needed} are needed"))
    }
}

/// Checks the length of an array.
pub(crate) fn check_length(name: &str, needed: usize, given: usize) -> Outcome {
    if needed == given { Ok(()) } else { Err(Error::length(name, needed, given)) }
}

/// Checks that rows of numbers are finite.
pub(crate) fn check_finite(name: &str, numbers: &[f64]) -> Outcome {
    match numbers.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(at) => {
            let message = format!("number {at} of {name} is {}: give a finite number", numbers[at]);
            Err(Error::new(Status::Value, message))
        }
    }
}

/// A text for C, without zeros.
pub(crate) fn c_text(text: &str) -> CString {
    let bytes: Vec<u8> = text.bytes().filter(|byte| *byte != 0).collect();
    CString::new(bytes).unwrap_or_default()
}

const NOTHING: &CStr = c"";

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Keeps the message of an error for the thread.
pub(crate) fn keep(message: &str) {
    // At the end of a thread there is nobody to read it.
    let _ = LAST.try_with(|last| last.replace(c_text(message)));
}

/// The message of the last error of the thread.
pub(crate) fn last() -> *const c_char {
    LAST.try_with(|last| last.borrow().as_ptr()).unwrap_or(NOTHING.as_ptr())
}
