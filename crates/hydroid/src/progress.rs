//! How long work tells how far it is, and hears that it should stop.

use std::ops::ControlFlow;

/// Called now and then with the fraction done, 0 to 1; [`ControlFlow::Break`] asks the work to stop.
pub type Progress<'a> = &'a mut dyn FnMut(f64) -> ControlFlow<()>;

/// For callers that neither watch nor stop.
pub fn silent() -> impl FnMut(f64) -> ControlFlow<()> {
    |_| ControlFlow::Continue(())
}

/// The work was asked to stop before it was done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("interrupted before it was done")]
pub struct Cancelled;

/// Tells how far the work is.
///
/// # Errors
/// If the work is to stop.
pub fn report(progress: Progress<'_>, fraction: f64) -> Result<(), Cancelled> {
    match progress(fraction) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Cancelled),
    }
}
