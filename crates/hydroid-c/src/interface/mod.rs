//! The C interface. The pointers of a call are read and written here and nowhere else.
//!
//! The rules of the header hold for every function: arrays come with their length, and do not overlap; a handle is used after
//! it was made and before it is freed.
#![expect(unsafe_code, reason = "functions that C calls, with pointers")]
#![expect(clippy::missing_safety_doc, reason = "the rules of the header hold for every function")]

// In two groups, so that the header has their order.
pub mod model;
pub mod session;

pub mod learning;
pub mod simulation;

use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::error::{self, Error, Outcome, Status};
use crate::model::Model;
use crate::session::Session;
use crate::simulation::Simulation;

/// Half of the width of a band that contains a measurement with a probability of 80 %, in standard deviations.
pub const HYDROID_BAND_80: f64 = 1.281_55;

/// Half of the width of a band that contains a measurement with a probability of 95 %, in standard deviations.
pub const HYDROID_BAND_95: f64 = 1.959_96;

/// The message of the last error in this thread: cause, place and remedy. An empty text before the first error.
/// Valid until the next error in this thread.
#[unsafe(no_mangle)]
pub extern "C" fn hydroid_last_error() -> *const c_char {
    error::last()
}

/// The version of the library, such as "0.2.0". It belongs to the library.
#[unsafe(no_mangle)]
pub extern "C" fn hydroid_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}

fn keep(error: &Error) -> Status {
    error::keep(&error.message);
    error.status
}

fn caught<T>(act: impl FnOnce() -> Outcome<T>) -> Outcome<T> {
    catch_unwind(AssertUnwindSafe(act)).unwrap_or_else(|_| {
        let message = "an internal error of hydroid ended the call: free the handle; please report it";
        Err(Error::new(Status::Internal, message))
    })
}

/// Acts; an error or a panic gives a message and a status.
fn call(act: impl FnOnce() -> Outcome) -> Status {
    caught(act).map_or_else(|error| keep(&error), |()| Status::Ok)
}

/// Acts; an error or a panic gives a message and another value.
fn value_or<T>(otherwise: T, act: impl FnOnce() -> Outcome<T>) -> T {
    caught(act).unwrap_or_else(|error| {
        keep(&error);
        otherwise
    })
}

/// Checks the address of values.
fn check_address<T>(pointer: *const T, name: &str) -> Outcome {
    if pointer.is_null() {
        return Err(Error::new(Status::Pointer, format!("{name} is null")));
    }
    if !pointer.is_aligned() {
        return Err(Error::new(
            Status::Pointer,
            format!("the address of {name} is not aligned for its type"),
        ));
    }
    Ok(())
}

/// What is behind a handle may be used by any thread.
const fn is_shared<T: Send + Sync>() {}

const _: () = {
    is_shared::<Model>();
    is_shared::<Session>();
    is_shared::<Simulation>();
};

/// What is behind a handle.
///
/// # Safety
/// A pointer that is not null is that of a value that is not freed during `'a`.
unsafe fn handle<'a, T>(pointer: *const T, name: &str) -> Outcome<&'a T> {
    check_address(pointer, name)?;
    // SAFETY: not null, and the caller guarantees the rest. What changes behind a handle has a lock.
    Ok(unsafe { &*pointer })
}

/// Writes a handle to a new value.
///
/// # Safety
/// A pointer that is not null points to a place for a handle.
unsafe fn give<T>(place: *mut *mut T, name: &str, make: impl FnOnce() -> Outcome<T>) -> Outcome {
    check_address(place, name)?;
    // SAFETY: not null, and the caller guarantees the place.
    unsafe { place.write(std::ptr::null_mut()) };
    let value = Box::into_raw(Box::new(make()?));
    // SAFETY: as above.
    unsafe { place.write(value) };
    Ok(())
}

/// Frees what is behind a handle.
///
/// # Safety
/// A pointer that is not null comes from [`give`], and is not used any more.
unsafe fn free<T>(pointer: *mut T) {
    if pointer.is_null() {
        return;
    }
    // SAFETY: not null, and the caller guarantees that it comes from a box and was not freed.
    let value = unsafe { Box::from_raw(pointer) };
    value_or((), || {
        drop(value);
        Ok(())
    });
}

/// The numbers of an array; none if it is empty.
///
/// # Safety
/// A pointer that is not null points to `length` values, which nobody writes during `'a`.
unsafe fn slice<'a, T>(pointer: *const T, length: usize, name: &str) -> Outcome<&'a [T]> {
    if length == 0 {
        return Ok(&[]);
    }
    check_address(pointer, name)?;
    check_size::<T>(length, name)?;
    // SAFETY: not null, aligned, of a possible size, and the caller guarantees the rest.
    Ok(unsafe { std::slice::from_raw_parts(pointer, length) })
}

/// As [`slice`], for an array that is written.
///
/// # Safety
/// A pointer that is not null points to `length` values, which nobody else uses during `'a`.
unsafe fn slice_mut<'a, T>(pointer: *mut T, length: usize, name: &str) -> Outcome<&'a mut [T]> {
    if length == 0 {
        return Ok(&mut []);
    }
    check_address(pointer, name)?;
    check_size::<T>(length, name)?;
    // SAFETY: not null, aligned, of a possible size, and the caller guarantees the rest.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer, length) })
}

fn check_size<T>(length: usize, name: &str) -> Outcome {
    if length <= isize::MAX.cast_unsigned() / size_of::<T>() {
        return Ok(());
    }
    Err(Error::new(Status::Length, format!("{name} has {length} numbers: no memory is so large")))
}

/// Writes a value.
///
/// # Safety
/// A pointer that is not null points to a place for a value.
unsafe fn put<T>(place: *mut T, name: &str, value: T) -> Outcome {
    check_address(place, name)?;
    // SAFETY: not null, aligned, and the caller guarantees the place.
    unsafe { place.write(value) };
    Ok(())
}

/// A text.
///
/// # Safety
/// A pointer that is not null points to a text that ends with a zero, and nobody writes during `'a`.
unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Outcome<&'a str> {
    check_address(pointer, name)?;
    // SAFETY: not null, and the caller guarantees the zero.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map_err(|_| Error::new(Status::Text, format!("{name} is not UTF-8")))
}

/// A text that may be missing.
///
/// # Safety
/// As [`text`].
unsafe fn optional_text<'a>(pointer: *const c_char, name: &str) -> Outcome<Option<&'a str>> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller guarantees a text.
    unsafe { text(pointer, name) }.map(Some)
}
