//! Long calls. The work is done in a thread without the interpreter's lock, while the calling thread reports progress
//! and looks for signals, so that ctrl-C ends a call at once.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;

use pyo3::prelude::*;

use crate::error::internal;

/// Time between two looks at signals.
const TICK: Duration = Duration::from_millis(50);

/// State that the work shares with the calling thread.
#[derive(Clone, Default)]
pub(crate) struct Control {
    stopped: Arc<AtomicBool>,
    /// Bits of the completed fraction.
    fraction: Arc<AtomicU64>,
}

impl Control {
    /// Progress of the work; breaks after an interrupt.
    pub(crate) fn report(&self, fraction: f64) -> ControlFlow<()> {
        self.fraction.store(fraction.to_bits(), Ordering::Relaxed);
        if self.stopped.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Runs `work` on its own thread, and on `threads` cores if they are given. `progress` is called with the completed
/// fraction. After an exception, an interrupt among them, the work ends at its next report.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Control) -> T + Send + 'static,
) -> PyResult<T> {
    let control = Control::default();
    let shared = control.clone();
    let (done, mut result) = sync_channel(1);
    let pool = match threads {
        Some(0) => return Err(crate::error::unfit("threads", "at least 1", 0)),
        Some(threads) => {
            Some(rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(internal)?)
        }
        None => None,
    };
    let thread = std::thread::Builder::new().name("hydroid".to_owned()).spawn(move || {
        let value = match pool {
            Some(pool) => pool.install(|| work(&shared)),
            None => work(&shared),
        };
        // After an exception nobody receives it.
        let _ = done.send(value);
    });
    let thread = thread.map_err(internal)?;
    let mut told = f64::NAN;
    loop {
        let received;
        (received, result) = py.detach(move || (result.recv_timeout(TICK), result));
        match received {
            Ok(value) => return Ok(value),
            Err(RecvTimeoutError::Disconnected) => {
                let _ = thread.join();
                return Err(internal("the calculation ended with a panic"));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        let fraction = f64::from_bits(control.fraction.load(Ordering::Relaxed));
        let told_of = match progress {
            Some(progress) if fraction != told => progress.call1((fraction,)).map(|_| ()),
            _ => Ok(()),
        };
        told = fraction;
        if let Err(error) = told_of.and_then(|()| py.check_signals()) {
            control.stopped.store(true, Ordering::Relaxed);
            return Err(error);
        }
    }
}
