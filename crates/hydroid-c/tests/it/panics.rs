//! No panic crosses the border: it becomes an error, after which a handle can only be freed.

use std::ffi::CStr;

use hydroid_c::interface::session::{
    hydroid_session_advance, hydroid_session_fork, hydroid_session_free, hydroid_session_observe,
    hydroid_session_outputs, hydroid_session_reset,
};
use hydroid_c::interface::{HYDROID_BAND_80, HYDROID_BAND_95, hydroid_last_error};
use hydroid_c::{Session, Status};
use hydroid_core::predict::{Predictor, Workspace, plain};

/// A session that panics in the middle of a step.
struct Broken;

impl Predictor for Broken {
    plain!(warm_up over_ground advance_observe rollout_batch rollout_snapshots);

    fn outputs(&self) -> usize {
        1
    }

    fn inputs(&self) -> usize {
        1
    }

    fn reset(&mut self) {}

    fn observe(&mut self, _: &[f64]) {}

    fn advance(&mut self, c: &[f64]) {
        assert!(c[0] < 1.0, "broken");
    }

    fn output(&self, _: &mut [f64]) {}

    fn rollout(&self, _: &[f64], _: &mut Workspace, _: &mut [f64]) {}

    fn snapshot_len(&self) -> usize {
        0
    }

    fn snapshot(&self, _: &mut [f64]) {}

    fn restore(&mut self, _: &[f64]) {}

    fn fork(&self) -> Box<dyn Predictor> {
        panic!("no fork");
    }
}

impl Drop for Broken {
    fn drop(&mut self) {
        assert!(std::thread::panicking(), "broken until the end");
    }
}

fn message() -> String {
    // SAFETY: a text that ends with a zero, and no error comes between.
    unsafe { CStr::from_ptr(hydroid_last_error()) }.to_str().unwrap().to_owned()
}

#[test]
fn a_panic_is_an_error_and_the_end_of_the_handle() {
    let session = Box::into_raw(Box::new(Session::of(Box::new(Broken))));
    let advance = |c: f64| {
        // SAFETY: a session, and an array of one number.
        unsafe { hydroid_session_advance(session, &raw const c, 1) }
    };
    assert_eq!(advance(0.0), Status::Ok);
    assert_eq!(advance(2.0), Status::Internal);
    assert!(message().contains("free the handle"), "{}", message());
    assert_eq!(advance(0.0), Status::Failed);
    assert!(message().contains("make a new one"), "{}", message());
    let y = 0.0;
    let mut fork = std::ptr::null_mut();
    // SAFETY: a session, an array of one number, and a place for a handle; the session is not used after it was freed.
    unsafe {
        assert_eq!(hydroid_session_observe(session, &raw const y, 1), Status::Failed);
        assert_eq!(hydroid_session_reset(session), Status::Failed);
        assert_eq!(hydroid_session_fork(session, &raw mut fork), Status::Failed);
        // What no call changes can still be asked.
        assert_eq!(hydroid_session_outputs(session), 1);
        hydroid_session_free(session);
    }
    assert!(fork.is_null());
    assert!(message().contains("internal error"), "{}", message());
}

#[test]
fn a_panic_that_makes_a_handle_leaves_null() {
    let session = Box::into_raw(Box::new(Session::of(Box::new(Broken))));
    let mut fork = std::ptr::dangling_mut();
    // SAFETY: a session, and a place for a handle.
    unsafe {
        assert_eq!(hydroid_session_fork(session, &raw mut fork), Status::Internal);
        hydroid_session_free(session);
    }
    assert!(fork.is_null());
}

#[test]
fn the_bands_are_those_of_hydroid() {
    assert_eq!((HYDROID_BAND_80, HYDROID_BAND_95), (hydroid::adapt::BAND_80, hydroid::adapt::BAND_95));
}
