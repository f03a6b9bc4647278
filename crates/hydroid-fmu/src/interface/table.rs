//! The table of the instances.

use std::collections::BTreeMap;
use std::ffi::c_int;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::{ERROR, Handle, Logger, OK};
use crate::instance::{Instance, Outcome};
use crate::state::State;

/// An instance with its states.
pub(super) struct Entry {
    pub(super) instance: Instance,
    pub(super) states: BTreeMap<usize, State>,
    /// Whether a call panicked.
    failed: bool,
}

#[derive(Clone)]
struct Row {
    entry: Arc<Mutex<Entry>>,
    logger: Logger,
}

struct Table {
    rows: BTreeMap<usize, Row>,
    /// The last handle of an instance or a state.
    last: usize,
}

static TABLE: Mutex<Table> = Mutex::new(Table { rows: BTreeMap::new(), last: 0 });

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What a panic left behind is marked in the entry.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Handles are multiples of 16, as addresses are.
fn next_handle() -> usize {
    let mut table = lock(&TABLE);
    table.last += 16;
    table.last
}

pub(super) fn unknown_state() -> String {
    String::from("the state is not one of this instance, or it was freed")
}

impl Entry {
    /// Keeps a state behind a known handle, else behind a new one.
    pub(super) fn keep(&mut self, handle: Handle, state: State) -> Handle {
        let known = handle as usize;
        let key = if self.states.contains_key(&known) { known } else { next_handle() };
        self.states.insert(key, state);
        key as Handle
    }
}

/// Adds an instance; null and a message if there is none.
pub(super) fn add(logger: Logger, make: impl FnOnce() -> Outcome<Instance>) -> Handle {
    let made = catch_unwind(AssertUnwindSafe(make))
        .unwrap_or_else(|_| Err(String::from("an internal error prevented the instance")));
    match made {
        Ok(instance) => {
            let entry = Entry { instance, states: BTreeMap::new(), failed: false };
            let row = Row { entry: Arc::new(Mutex::new(entry)), logger };
            let handle = next_handle();
            lock(&TABLE).rows.insert(handle, row);
            handle as Handle
        }
        Err(message) => {
            logger.error(&message);
            std::ptr::null_mut()
        }
    }
}

/// Removes an instance with its states.
pub(super) fn remove(handle: Handle) {
    let row = lock(&TABLE).rows.remove(&(handle as usize));
    // Nothing is left to tell of a panic.
    let _ = catch_unwind(AssertUnwindSafe(|| drop(row)));
}

/// Acts on an instance. An error or a panic gives a message to the logger and an error.
pub(super) fn call(handle: Handle, act: impl FnOnce(&mut Entry) -> Outcome) -> c_int {
    act_on(handle, false, act)
}

/// As [`call`], for an instance that failed, too.
pub(super) fn recover(handle: Handle, act: impl FnOnce(&mut Entry) -> Outcome) -> c_int {
    act_on(handle, true, act)
}

fn act_on(handle: Handle, recovers: bool, act: impl FnOnce(&mut Entry) -> Outcome) -> c_int {
    let Some(row) = lock(&TABLE).rows.get(&(handle as usize)).cloned() else { return ERROR };
    let outcome = {
        let mut entry = lock(&row.entry);
        if entry.failed && !recovers {
            Err(String::from("an earlier call failed: reset or free the instance"))
        } else {
            let entry = &mut *entry;
            let outcome = catch_unwind(AssertUnwindSafe(|| act(entry)));
            entry.failed = outcome.is_err();
            outcome.unwrap_or_else(|_| {
                Err(String::from("an internal error ended the call: reset or free the instance"))
            })
        }
    };
    match outcome {
        Ok(()) => OK,
        Err(message) => {
            // The entry is free again: a logger may call the instance.
            row.logger.error(&message);
            ERROR
        }
    }
}
