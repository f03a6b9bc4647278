//! What the programs of a session on board share: `hydroid` and `hydroid-ros`.
//!
//! [`SessionArgs`] are their arguments, [`file`] merges those with a configuration file, and [`Session`] runs over the link
//! of the program. Needs the feature `program`.

// Help texts come from the comments of the arguments; backticks would be printed, and brackets are units and sections.
#![allow(clippy::doc_markdown, rustdoc::broken_intra_doc_links)]

mod arguments;
pub mod control;
pub mod file;
mod identification;
pub mod interrupt;
mod session;
pub mod text;

pub use arguments::{CommandArgs, PageArgs, SessionArgs};
pub use session::{Session, check_positive, config_file};
