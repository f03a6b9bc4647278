//! The library of the FMUs that hydroid exports: the C interfaces of FMI 2.0 and FMI 3.0.
//!
//! The library is the same for every model. An instance reads the model in the resources of its FMU, so that an FMU is made
//! without a compiler (`hydroid_export::fmu`). Co-simulation exists for models of every kind, model exchange for models in
//! continuous time.
//!
//! Wrong calls (null pointers, unknown variables, functions out of order, damaged resources or states) give an error and a
//! message to the logger of the importer. Instances and states are numbers in a table, and not addresses, so that a handle
//! that was freed is an error, too. A panic becomes an error, after which an instance can only be reset or freed.
//!
//! Order of the modules, bottom to top: `resource`, `state`, `co_simulation`, `instance`, `exchange`, `interface`.

#![allow(missing_docs, clippy::missing_errors_doc, reason = "its users are the programs of hydroid")]

mod co_simulation;
mod exchange;
mod instance;
#[doc(hidden)]
pub mod interface;
mod resource;
mod state;
