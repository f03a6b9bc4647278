//! Memory and entry points on the board.

use alloc::boxed::Box;
use core::alloc::{GlobalAlloc, Layout};
use core::cell::UnsafeCell;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicUsize, Ordering};

use crate::Learner;

/// Memory of everything that is allocated.
const HEAP: usize = 512 * 1024;

#[repr(align(16))]
struct Heap(UnsafeCell<[u8; HEAP]>);

// SAFETY: `Allocator` gives out each part once.
unsafe impl Sync for Heap {}

static MEMORY: Heap = Heap(UnsafeCell::new([0; HEAP]));
static USED: AtomicUsize = AtomicUsize::new(0);

/// Gives memory out and takes none back: all of it is needed as long as the boat runs.
struct Allocator;

// SAFETY: the parts do not overlap, and are aligned.
unsafe impl GlobalAlloc for Allocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let start = USED.load(Ordering::Relaxed).next_multiple_of(layout.align());
        let end = start + layout.size();
        if end > HEAP {
            return core::ptr::null_mut();
        }
        USED.store(end, Ordering::Relaxed);
        // SAFETY: `start` is inside of the memory.
        unsafe { MEMORY.0.get().cast::<u8>().add(start) }
    }

    unsafe fn dealloc(&self, _: *mut u8, _: Layout) {}
}

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

unsafe extern "C" {
    fn board_exit(status: i32) -> !;
}

/// Without memory, or on an error: the program ends with status 3.
#[panic_handler]
fn halt(_: &PanicInfo<'_>) -> ! {
    // SAFETY: it ends the program.
    unsafe { board_exit(3) }
}

/// A learner; null if its options are refused.
#[unsafe(no_mangle)]
pub extern "C" fn learner_new(cells: u32, group: u32) -> *mut Learner {
    Learner::new(cells as usize, group as usize)
        .map_or(core::ptr::null_mut(), |learner| Box::into_raw(Box::new(learner)))
}

/// The next sample.
///
/// # Safety
/// `learner` is from [`learner_new`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn learner_step(learner: *mut Learner) {
    // SAFETY: by the condition of this function.
    unsafe { (*learner).step() }
}

/// Number of weights.
///
/// # Safety
/// `learner` is from [`learner_new`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn learner_weights(learner: *const Learner) -> u32 {
    // SAFETY: by the condition of this function.
    unsafe { (*learner).weights() as u32 }
}

/// Mean of the squares of the weights.
///
/// # Safety
/// `learner` is from [`learner_new`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn learner_check(learner: *const Learner) -> f64 {
    // SAFETY: by the condition of this function.
    unsafe { (*learner).check() }
}

/// Allocated memory \[byte\].
#[unsafe(no_mangle)]
pub extern "C" fn learner_memory() -> u32 {
    USED.load(Ordering::Relaxed) as u32
}
