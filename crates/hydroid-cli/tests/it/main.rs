//! Integration tests of the command.

mod adapt;
mod adapt_direct;
mod adapt_networks;
mod adapt_stream;
mod adapt_vessels;
mod bad_input;
mod black_box;
mod boat_found;
mod commands;
mod committee;
mod common;
mod control;
mod control_client;
mod control_service;
mod documents;
mod equations_input;
mod export;
mod file_options;
mod hostile;
#[cfg(unix)]
mod interruptions;
mod keys;
#[cfg(unix)]
mod kills;
mod low_speed;
mod manoeuvre;
mod networks;
mod packages;
mod recordings;
mod report;
mod thesis;
mod too_little_data;
mod vessel_files;
