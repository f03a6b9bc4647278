//! Integration tests of the library.

mod actuator_check;
mod adapt;
#[cfg(unix)]
mod atomic;
mod boat;
mod boat_found;
mod boat_values;
mod closed_loop;
mod committee;
mod control_of_models;
mod craft;
mod direct_equations;
mod equations;
mod estimate;
mod evaluate;
mod evaluate_sessions;
mod excitation;
mod expression;
mod extrapolation;
mod faults;
mod identified_control;
mod identify_networks;
mod invariance;
mod judged;
mod kept_logs;
mod library;
mod live_motion;
mod log;
mod lorenz;
mod manoeuvre;
mod methods;
mod model_file;
mod navigate;
mod network_file;
mod peer_pysindy;
mod peer_torch;
mod proposals;
mod qr;
mod rate_limits;
mod real_ships;
mod recording;
mod refine;
#[allow(dead_code)] // the program of the baseline uses all of it
mod ridge_baseline;
mod search_parts;
mod simulate_input;
mod simulate_records;
mod sindy;
mod sindy_golden;
mod steering;
mod texts;
mod through_water;
mod train;
mod train_direct;
mod train_evaluate;
mod train_parts;
mod train_refit;
mod uncertainty;
mod vessel;
mod waypoints;

#[path = "../../../hydroid-core/tests/it/module_order.rs"]
mod module_order;
#[path = "../../../hydroid-core/tests/it/networks.rs"]
#[allow(dead_code)] // the tests of this crate use a part of it
mod networks;
