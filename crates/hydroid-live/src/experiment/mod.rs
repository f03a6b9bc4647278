//! Experiments.

mod allocation;
mod drift;
mod explored;
mod fence;
mod governor;
mod kind;
mod logged;
mod motion;
mod part;
mod probe;
mod response;
mod run;
mod settings;
mod settling;
mod turning_back;

pub use explored::{BINS, Channel, Explored, SHORTEST_WINDOW_S, WINDOWS};
pub use fence::Fence;
pub use kind::Kind;
pub use logged::Logged;
pub use motion::Seen;
pub use run::{Experiment, Step};
pub use settings::Settings;
