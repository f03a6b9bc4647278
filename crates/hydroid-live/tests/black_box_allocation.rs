//! A recorded session allocates nothing after its start: a counting allocator around a recorded adapter. The counter is
//! global, so there is only one test.
#![allow(unsafe_code)] // an allocator can be written in no other way

#[path = "it/boat.rs"]
#[allow(dead_code)] // this binary uses a part of it
mod boat;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use hydroid::adapt::{Options, adapter};
use hydroid_core::predict::Predictor;
use hydroid_live::black_box::{Recorder, RecordingAdapter, Source};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is forwarded to the system allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the contract of the caller is forwarded.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the contract of the caller is forwarded.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_recorded_session_allocates_nothing() {
    let folder = tempfile::TempDir::new().unwrap();
    let model = boat::model();
    let options = Options::default().guarded(&model);
    let (mut adapter, _) = adapter(&model, &options, &[]).unwrap();
    let settings = boat::settings(&folder.path().join("boat.box"));
    let source = Source::Stream("test");
    let recorder = Recorder::new(&settings, &model, adapter.as_mut(), &options, &(), source).unwrap();
    let mut recorded = RecordingAdapter::new(adapter, Some(recorder));
    recorded.reset();
    let mut before = 0;
    // Starts after the first shadow test; covers several segments and writes.
    for k in 0..900 {
        if k == 50 {
            before = ALLOCATIONS.load(Ordering::Relaxed);
        }
        let (c, y) = boat::sample(k);
        recorded.observe(&y);
        recorded.advance(&c);
    }
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), before);
    recorded.finish().unwrap();
}
