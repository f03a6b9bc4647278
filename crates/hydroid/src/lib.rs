//! Identification, evaluation, adaptation and closed-loop simulation of vessel models from logs.
//!
//! Order of the modules, bottom to top; each imports only modules before it: `progress`, `key` (names of options in messages), `written` (their values), `log` (runs and their files),
//! `excitation` (command sequences), `toml_file`, `atomic`, `fingerprint`, `boat` (roles of inputs), `evaluate` (multi-step errors of any model),
//! `navigate` (pose and velocities from raw sensors), `recording` (files of topics), `faults` (sensor faults), `simulate` (commands to logs), `craft` (vessel files with any actuators), `model` (identified models and their files),
//! `plant` (models that run freely), `manoeuvre` (manoeuvring trials), `sindy`
//! (sparse regression), `grey_box` (numbers of a vessel file from logs), `committee` (difference equations combined by cross-validation), `adapt` (online adaptation along a log), `train` (networks), `closed_loop` (controllers on a
//! simulated vessel), `identify` (from runs to an evaluated model), `config` (settings as data).
//!
//! Items that are hidden in this documentation serve the other crates of the workspace and its tests. They are not part
//! of the API.

pub mod adapt;
#[doc(hidden)]
pub mod atomic;
pub mod boat;
pub mod closed_loop;
pub mod committee;
pub mod config;
pub mod craft;
pub mod evaluate;
pub mod excitation;
pub mod faults;
#[doc(hidden)]
pub mod fingerprint;
pub mod grey_box;
pub mod identify;
pub mod key;
pub mod log;
pub mod manoeuvre;
pub mod model;
pub mod navigate;
pub mod plant;
pub mod progress;
pub mod recording;
pub mod simulate;
pub mod sindy;
#[doc(hidden)]
pub mod toml_file;
pub mod train;
mod written;

/// The examples of the page on the Rust API, to which the package has a link.
#[cfg(doctest)]
#[doc = include_str!("../rust-api.md")]
struct RustApiPage;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
