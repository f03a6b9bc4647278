//! The C interfaces. The pointers of a call are read and written here and nowhere else.
#![expect(unsafe_code, reason = "functions that C calls, with pointers")]

pub mod fmi2;
pub mod fmi3;
mod logger;
mod table;

use std::ffi::{CStr, c_char, c_int, c_void};

use hydroid_export::fmu::MARK;

use crate::instance::Outcome;
use logger::Logger;
pub use logger::{Log2, Log3};
use table::{Entry, call};

/// An instance or a state: a number in a table.
pub type Handle = *mut c_void;

pub const OK: c_int = 0;
pub const ERROR: c_int = 3;

/// By this text the exporter knows the library.
#[used]
static VERSION_MARK: &str = MARK;

/// Functions that are equal in both versions, but for their names and the type of a Boolean.
macro_rules! shared {
    (
        $boolean:ty;
        $free:ident $exit_initialization:ident $terminate:ident $reset:ident
        $get_state:ident $set_state:ident $free_state:ident
        $serialized_size:ident $serialize:ident $deserialize:ident
        $enter_event_mode:ident $enter_continuous_time_mode:ident $completed_step:ident $set_time:ident
        $set_continuous_states:ident $get_continuous_states:ident $derivatives:ident
        $nominals:ident $event_indicators:ident
    ) => {
        #[unsafe(no_mangle)]
        pub extern "C" fn $free(c: Handle) {
            super::table::remove(c);
        }

        #[unsafe(no_mangle)]
        pub extern "C" fn $exit_initialization(c: Handle) -> c_int {
            super::call(c, |entry| entry.instance.exit_initialization())
        }

        #[unsafe(no_mangle)]
        pub extern "C" fn $terminate(c: Handle) -> c_int {
            super::call(c, |entry| entry.instance.terminate())
        }

        #[unsafe(no_mangle)]
        pub extern "C" fn $reset(c: Handle) -> c_int {
            super::table::recover(c, |entry| {
                entry.instance.reset();
                Ok(())
            })
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $get_state(c: Handle, state: *mut Handle) -> c_int {
            super::call(c, |entry| unsafe { super::get_state(entry, state) })
        }

        #[unsafe(no_mangle)]
        pub extern "C" fn $set_state(c: Handle, state: Handle) -> c_int {
            super::table::recover(c, |entry| super::set_state(entry, state))
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $free_state(c: Handle, state: *mut Handle) -> c_int {
            super::table::recover(c, |entry| unsafe { super::free_state(entry, state) })
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $serialized_size(c: Handle, state: Handle, size: *mut usize) -> c_int {
            super::call(c, |entry| unsafe { super::serialized_size(entry, state, size) })
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $serialize(c: Handle, state: Handle, bytes: *mut u8, size: usize) -> c_int {
            super::call(c, |entry| unsafe { super::serialize(entry, state, bytes, size) })
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $deserialize(
            c: Handle,
            bytes: *const u8,
            size: usize,
            state: *mut Handle,
        ) -> c_int {
            super::call(c, |entry| unsafe { super::deserialize(entry, bytes, size, state) })
        }

        #[unsafe(no_mangle)]
        pub extern "C" fn $enter_event_mode(c: Handle) -> c_int {
            super::call(c, |entry| entry.instance.enter($crate::instance::Phase::Event))
        }

        #[unsafe(no_mangle)]
        pub extern "C" fn $enter_continuous_time_mode(c: Handle) -> c_int {
            super::call(c, |entry| entry.instance.enter($crate::instance::Phase::Continuous))
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $completed_step(
            c: Handle,
            _no_set: $boolean,
            enter_event_mode: *mut $boolean,
            terminate: *mut $boolean,
        ) -> c_int {
            super::call(c, |entry| {
                entry.instance.check_mode("the end of a step", &[$crate::instance::Phase::Continuous])?;
                unsafe {
                    super::put(enter_event_mode, 0);
                    super::put(terminate, 0);
                }
                Ok(())
            })
        }

        #[unsafe(no_mangle)]
        pub extern "C" fn $set_time(c: Handle, time: f64) -> c_int {
            super::call(c, |entry| entry.instance.set_time(time))
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $set_continuous_states(c: Handle, x: *const f64, nx: usize) -> c_int {
            super::call(c, |entry| entry.instance.set_continuous_states(unsafe { super::slice(x, nx)? }))
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $get_continuous_states(c: Handle, x: *mut f64, nx: usize) -> c_int {
            super::call(c, |entry| unsafe {
                super::write_row(entry, entry.instance.continuous_states()?, x, nx)
            })
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $derivatives(c: Handle, rates: *mut f64, nx: usize) -> c_int {
            super::call(c, |entry| unsafe {
                super::write_row(entry, &entry.instance.derivatives()?, rates, nx)
            })
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $nominals(c: Handle, x: *mut f64, nx: usize) -> c_int {
            super::call(c, |entry| unsafe { super::write_row(entry, &entry.instance.nominals()?, x, nx) })
        }

        #[unsafe(no_mangle)]
        pub extern "C" fn $event_indicators(c: Handle, _: *mut f64, count: usize) -> c_int {
            super::call(c, |_| super::no_variables(count, "event indicator"))
        }
    };
}
use shared;

/// The numbers of an array; none if it is empty.
///
/// # Safety
/// A pointer that is not null points to `count` values, which nobody writes during `'a`.
unsafe fn slice<'a, T>(pointer: *const T, count: usize) -> Outcome<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    if pointer.is_null() || count > isize::MAX.cast_unsigned() / size_of::<T>().max(1) {
        return Err(format!("an array of {count} values is missing"));
    }
    // The pointer is not null, the size is possible, and the caller guarantees the rest.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// As [`slice`], for an array that is written.
///
/// # Safety
/// A pointer that is not null points to `count` values, which nobody else uses during `'a`.
unsafe fn slice_mut<'a, T>(pointer: *mut T, count: usize) -> Outcome<&'a mut [T]> {
    if count == 0 {
        return Ok(&mut []);
    }
    if pointer.is_null() || count > isize::MAX.cast_unsigned() / size_of::<T>().max(1) {
        return Err(format!("an array for {count} values is missing"));
    }
    // The pointer is not null, the size is possible, and the caller guarantees the rest.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer, count) })
}

/// Writes a value, if there is a place for it.
///
/// # Safety
/// A pointer that is not null points to a place for a value.
unsafe fn put<T>(place: *mut T, value: T) {
    if !place.is_null() {
        // Not null, and the caller guarantees the place.
        unsafe { place.write(value) };
    }
}

/// A text; empty without one.
///
/// # Safety
/// A pointer that is not null points to a text that ends with a zero.
unsafe fn text(pointer: *const c_char) -> String {
    if pointer.is_null() {
        return String::new();
    }
    // Not null, and the caller guarantees the zero.
    unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
}

/// Writes the values of variables.
unsafe fn get(entry: &Entry, references: *const u32, count: usize, values: *mut f64) -> Outcome {
    // Arrays of a length that the caller states.
    let (references, values) = unsafe { (slice(references, count)?, slice_mut(values, count)?) };
    for (reference, value) in references.iter().zip(values) {
        *value = entry.instance.get(*reference)?;
    }
    Ok(())
}

/// Sets variables.
unsafe fn set(entry: &mut Entry, references: *const u32, count: usize, values: *const f64) -> Outcome {
    // Arrays of a length that the caller states.
    let (references, values) = unsafe { (slice(references, count)?, slice(values, count)?) };
    for (reference, value) in references.iter().zip(values) {
        entry.instance.set(*reference, *value)?;
    }
    Ok(())
}

/// Writes a row of numbers of a fixed length.
unsafe fn write_row(entry: &Entry, row: &[f64], into: *mut f64, count: usize) -> Outcome {
    entry.instance.check_states(count)?;
    // An array of a length that the caller states.
    unsafe { slice_mut(into, count)? }.copy_from_slice(row);
    Ok(())
}

/// An error if a variable of a type that no variable has is meant.
fn no_variables(count: usize, type_name: &str) -> Outcome {
    if count == 0 { Ok(()) } else { Err(format!("no variable is of the type {type_name}")) }
}

/// States as handles: keeps the present one.
unsafe fn get_state(entry: &mut Entry, place: *mut Handle) -> Outcome {
    if place.is_null() {
        return Err(String::from("the place for the state is missing"));
    }
    let state = entry.instance.state();
    // Not null, and the caller guarantees a handle in it.
    let handle = unsafe { place.read() };
    let handle = entry.keep(handle, state);
    unsafe { put(place, handle) };
    Ok(())
}

fn set_state(entry: &mut Entry, state: Handle) -> Outcome {
    let Entry { instance, states, .. } = entry;
    let state = states.get(&(state as usize)).ok_or_else(table::unknown_state)?;
    instance.set_state(state)
}

unsafe fn free_state(entry: &mut Entry, place: *mut Handle) -> Outcome {
    if place.is_null() {
        return Ok(());
    }
    // Not null, and the caller guarantees a handle in it.
    let handle = unsafe { place.read() };
    if !handle.is_null() && entry.states.remove(&(handle as usize)).is_none() {
        return Err(table::unknown_state());
    }
    unsafe { put(place, std::ptr::null_mut()) };
    Ok(())
}

unsafe fn serialized_size(entry: &Entry, state: Handle, size: *mut usize) -> Outcome {
    let state = entry.states.get(&(state as usize)).ok_or_else(table::unknown_state)?;
    unsafe { put(size, state.size()) };
    Ok(())
}

unsafe fn serialize(entry: &Entry, state: Handle, into: *mut u8, size: usize) -> Outcome {
    let state = entry.states.get(&(state as usize)).ok_or_else(table::unknown_state)?;
    if size != state.size() {
        return Err(format!("the state has {} bytes, and the array {size}", state.size()));
    }
    // An array of a length that the caller states.
    unsafe { slice_mut(into, size)? }.copy_from_slice(&state.bytes());
    Ok(())
}

unsafe fn deserialize(entry: &mut Entry, bytes: *const u8, size: usize, place: *mut Handle) -> Outcome {
    if place.is_null() {
        return Err(String::from("the place for the state is missing"));
    }
    // An array of a length that the caller states.
    let state = crate::state::State::read(unsafe { slice(bytes, size)? })?;
    entry.instance.check_state(&state)?;
    // Not null, and the caller guarantees a handle in it.
    let handle = unsafe { place.read() };
    let handle = entry.keep(handle, state);
    unsafe { put(place, handle) };
    Ok(())
}

/// Derivatives in a direction.
unsafe fn directional(
    entry: &Entry,
    (unknowns, unknown_count): (*const u32, usize),
    (knowns, known_count): (*const u32, usize),
    (seed, seed_count): (*const f64, usize),
    (sensitivity, sensitivity_count): (*mut f64, usize),
) -> Outcome {
    if seed_count != known_count || sensitivity_count != unknown_count {
        return Err(String::from("a seed for each known, and a sensitivity for each unknown, are needed"));
    }
    // Arrays of lengths that the caller states.
    let (unknowns, knowns, seed) =
        unsafe { (slice(unknowns, unknown_count)?, slice(knowns, known_count)?, slice(seed, seed_count)?) };
    let values = entry.instance.directional(unknowns, knowns, seed)?;
    unsafe { slice_mut(sensitivity, sensitivity_count)? }.copy_from_slice(&values);
    Ok(())
}
