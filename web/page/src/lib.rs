//! hydroid in the browser: the functions that the page calls, from a worker.
//!
//! [`Files`] holds the logs that were dropped on the page, and identifies models from them. [`Identified`] is the result.
//! [`Vessel`] is a model of it, or one from a file: it runs trials, and is described for driving. Texts are JSON, with the names that the
//! command writes with `--json`; options are those of `hydroid.toml`. The page itself drives, by the scripts of `hydroid-web`.

#![allow(clippy::needless_pass_by_value, reason = "arguments are what wasm-bindgen gives")]

mod error;
mod files;
mod identified;
mod readings;
mod series;
mod vessel;

use wasm_bindgen::prelude::*;

pub use files::Files;
pub use identified::Identified;
pub use vessel::Vessel;

/// Writes panics to the console of the browser; without it they are traps without a message.
#[wasm_bindgen(start)]
fn start() {
    console_error_panic_hook::set_once();
}
