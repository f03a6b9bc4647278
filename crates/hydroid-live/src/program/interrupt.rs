//! Signals that end a program.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use hydroid::atomic;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Action at an interruption, for threads that wait for input.
static AT_INTERRUPT: Mutex<Option<Box<dyn FnOnce() + Send>>> = Mutex::new(None);

/// Time after which an interrupted program ends wherever it is \[ms\].
static GRACE_MS: AtomicU64 = AtomicU64::new(800);

/// Longest time to wait for a file that is being written.
const WRITING: Duration = Duration::from_secs(5);

/// Installs the signal handler: the first ctrl-C, SIGTERM or SIGHUP requests a stop, and ends a program that is blocked after
/// a grace time; the second ends it at once.
pub fn catch_interrupt() {
    // Without a handler, ctrl-C ends the program at once; files are written atomically in either case.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
        // In threads, so that the handler receives a second ctrl-C.
        if let Some(act) = AT_INTERRUPT.lock().ok().and_then(|mut act| act.take()) {
            std::thread::spawn(act);
        }
        std::thread::spawn(|| {
            let grace = Duration::from_millis(GRACE_MS.load(Ordering::Relaxed));
            let _settled = atomic::settle(grace, WRITING);
            std::process::exit(130);
        });
    });
}

/// Gives an interrupted program more time to end.
pub fn grant(time: Duration) {
    GRACE_MS.store(u64::try_from(time.as_millis()).unwrap_or(u64::MAX), Ordering::Relaxed);
}

/// Sets the action at an interruption. It runs in a thread and must end the program.
pub fn at_interrupt(act: impl FnOnce() + Send + 'static) {
    if let Ok(mut place) = AT_INTERRUPT.lock() {
        *place = Some(Box::new(act));
    }
}

/// Whether the program was interrupted.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}
