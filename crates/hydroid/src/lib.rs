//! hydroid on shore: makes and reads logs, learns models from them and judges them.
//!
//! The modules in the order of dependence: [`log`] knows nothing of the others; [`excitation`] makes
//! commands and [`simulate`] turns them into logs; [`evaluate`] judges any model; [`sindy`] finds equations;
//! [`model`] is what was found, and its file; [`identify`] does it all, and [`report`] tells it as a page.

pub mod atomic;
pub mod evaluate;
pub mod excitation;
pub mod identify;
pub mod log;
pub mod model;
pub mod progress;
pub mod report;
pub mod simulate;
pub mod sindy;
