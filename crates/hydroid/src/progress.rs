//! Progress callbacks and cancellation.

use std::ops::ControlFlow;

/// Called with the completed fraction, 0 to 1; [`ControlFlow::Break`] cancels.
pub type Progress<'a> = &'a mut dyn FnMut(f64) -> ControlFlow<()>;

/// A callback that does nothing.
pub fn silent() -> impl FnMut(f64) -> ControlFlow<()> {
    |_| ControlFlow::Continue(())
}

/// Cancelled by the callback.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("interrupted before it was done")]
pub struct Cancelled;

/// Calls `progress`.
///
/// # Errors
/// If the callback cancels.
pub fn report(progress: Progress<'_>, fraction: f64) -> Result<(), Cancelled> {
    match progress(fraction) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Cancelled),
    }
}
